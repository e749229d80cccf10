//! The six lengths that define the kinematics of a UR arm.
