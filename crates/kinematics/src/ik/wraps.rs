//! Whole turns of a posture within joint limits.
