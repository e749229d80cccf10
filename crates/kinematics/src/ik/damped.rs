//! Damped, restarted numerical inverse kinematics.
