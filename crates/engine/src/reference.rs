//! What a servo follows.

use needlebench_kinematics::trajectory::{JointState, JointTrajectory};

/// What a servo follows: a planned motion, or one that grows while it is followed.
///
/// A step asks for times up to that at which it begins. What was given for a time once stays so: then a motion that
/// grew is followed again with the same bits.
pub trait Reference {
    /// Joints at a time, s after the motion's begin.
    fn sample(&self, time_s: f64) -> JointState;
}

impl Reference for JointTrajectory {
    fn sample(&self, time_s: f64) -> JointState {
        self.sample(time_s)
    }
}
