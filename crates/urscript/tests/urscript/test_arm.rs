//! A UR3e that notes what it is given.

use needlebench_kinematics::ik::Kinematics;
use needlebench_kinematics::{Joints, Pose, UrModel, base_from_base_link};
use needlebench_urscript::{
    Arm, Installation, Motion, MotionKind, Outcome, ScriptError, evaluate, parse,
};

pub struct TestArm {
    kinematics: Kinematics,
    joints: Joints,
    pub motions: Vec<Motion>,
}

pub fn start() -> Joints {
    Joints::from([0.1, -1.5, 1.2, -1.3, -1.4, 0.2])
}

impl TestArm {
    pub fn new() -> Self {
        Self {
            kinematics: Kinematics::new(UrModel::Ur3e.geometry().chain()).unwrap(),
            joints: start(),
            motions: Vec::new(),
        }
    }
}

impl Arm for TestArm {
    fn joints(&self) -> Joints {
        self.joints
    }

    fn base_from_flange(&self, joints: &Joints) -> Pose {
        base_from_base_link() * self.kinematics.base_link_from_flange(joints)
    }

    fn inverse(&mut self, base_from_flange: &Pose, near: &Joints) -> Option<Joints> {
        let pose = base_from_base_link() * base_from_flange;
        let all = self.kinematics.branches(&pose, Some(near)).solutions;
        let off = |joints: &Joints| (joints - near).amax();
        let all = all.into_iter().map(|solution| solution.joints);
        all.min_by(|a, b| off(a).total_cmp(&off(b)))
    }

    fn period_s(&self) -> f64 {
        2e-3
    }

    fn perform(&mut self, motion: &Motion) -> Result<(), ScriptError> {
        match &motion.kind {
            MotionKind::Joints { to, .. } | MotionKind::Servo { to, .. } => self.joints = *to,
            MotionKind::Line { to, .. }
            | MotionKind::Circle { to, .. }
            | MotionKind::Process { to, .. } => {
                let flange = to * motion.flange_from_tcp.unwrap().inverse();
                let found = self.inverse(&flange, &{ self.joints });
                self.joints =
                    found.ok_or_else(|| ScriptError::new(motion.place, "out of reach"))?;
            }
            MotionKind::Stand { .. } | MotionKind::Stop { .. } => {}
        }
        self.motions.push(motion.clone());
        Ok(())
    }
}

/// What a program does, with the installation's TCP unknown.
pub fn done(text: &str) -> Result<(Outcome, Vec<Motion>), ScriptError> {
    let mut arm = TestArm::new();
    let outcome = evaluate(&parse(text)?, &mut arm, &Installation::default())?;
    assert_eq!(outcome.motions, arm.motions.len());
    Ok((outcome, arm.motions))
}

/// An error is at a line and column, and says a part.
pub fn check_error(error: &ScriptError, place: (usize, usize), part: &str, text: &str) {
    let found = (error.place.line, error.place.column);
    assert_eq!(found, place, "{text}: {error}");
    assert!(error.message.contains(part), "{text}: {error}");
}
