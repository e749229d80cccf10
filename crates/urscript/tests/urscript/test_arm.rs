//! A UR3e.

use needlebench_kinematics::ik::Kinematics;
use needlebench_kinematics::{Joints, Pose, UrModel, base_from_base_link};
use needlebench_urscript::ScriptError;

pub struct TestArm {
    kinematics: Kinematics,
}

pub fn start() -> Joints {
    Joints::from([0.1, -1.5, 1.2, -1.3, -1.4, 0.2])
}

impl TestArm {
    pub fn new() -> Self {
        Self {
            kinematics: Kinematics::new(UrModel::Ur3e.geometry().chain()).unwrap(),
        }
    }

    pub fn base_from_flange(&self, joints: &Joints) -> Pose {
        base_from_base_link() * self.kinematics.base_link_from_flange(joints)
    }

    pub fn inverse(&self, base_from_flange: &Pose, near: &Joints) -> Option<Joints> {
        let pose = base_from_base_link() * base_from_flange;
        let all = self.kinematics.branches(&pose, Some(near)).solutions;
        let off = |joints: &Joints| (joints - near).amax();
        let all = all.into_iter().map(|solution| solution.joints);
        all.min_by(|a, b| off(a).total_cmp(&off(b)))
    }
}

/// An error is at a line and column, and says a part.
pub fn check_error(error: &ScriptError, place: (usize, usize), part: &str, text: &str) {
    let found = (error.place.line, error.place.column);
    assert_eq!(found, place, "{text}: {error}");
    assert!(error.message.contains(part), "{text}: {error}");
}
