//! The arm of `ik` and `fk`.

use std::path::Path;

use needlebench_cell::Robot;
use needlebench_input::Finding;
use needlebench_kinematics::{Chain, JointLimits, Joints, LimitPolicy, UrModel};
use needlebench_robot::{AppliedCalibration, Calibration, MOVING_LINK_LABELS, RobotDescription};
use needlebench_scenario::load_robot;

use super::super::urdf_overrides;
use crate::arguments::ArmArguments;

/// The kinematic data of an arm.
#[derive(Debug, Clone)]
pub struct KinematicArm {
    /// The manufacturer's name if it is a known arm.
    pub name: String,
    /// Its source, for error messages.
    pub file: String,
    /// Its links.
    pub chain: Chain,
    /// Limits of its joints.
    pub limits: JointLimits,
    /// Short names of the moving links.
    pub links: [String; 6],
    /// Its calibration.
    pub calibration: Option<AppliedCalibration>,
}

impl KinematicArm {
    pub(super) fn new(arguments: &ArmArguments) -> Result<Self, Finding> {
        if let Some(model) = arguments.arm {
            return Self::of_model(model, arguments.robot.calibration.as_deref());
        }
        let loaded = load_robot(&urdf_overrides(&arguments.robot)?)?;
        Ok(Self::of_robot(&loaded.robot, &loaded.description))
    }

    /// The data of a robot.
    pub fn of_robot(robot: &Robot, description: &RobotDescription) -> Self {
        Self {
            name: description.arm_name.clone(),
            file: description.source.file.clone(),
            chain: robot.chain,
            limits: robot.limits,
            links: robot.links.each_ref().map(|link| link.name.clone()),
            calibration: description.calibration.clone(),
        }
    }

    /// The nominal arm of a model, or a calibrated one.
    ///
    /// # Errors
    /// A [`Finding`] about the calibration.
    pub fn of_model(model: UrModel, calibration: Option<&Path>) -> Result<Self, Finding> {
        let geometry = model.geometry();
        let mut arm = Self {
            name: model.name().to_owned(),
            file: "--arm".to_owned(),
            chain: geometry.chain(),
            limits: LimitPolicy::of_ros(model).limits_of(model),
            links: MOVING_LINK_LABELS.map(str::to_owned),
            calibration: None,
        };
        if let Some(path) = calibration {
            let calibration = Calibration::load(path)?;
            arm.chain = calibration.chain_of(model.name(), &geometry)?;
            arm.calibration = Some(AppliedCalibration {
                hash: calibration.hash,
                source: calibration.source,
            });
        }
        Ok(arm)
    }

    /// Whether a posture is inside the limits.
    pub(super) fn allows(&self, q: &Joints) -> bool {
        self.limits.first_violation(q).is_none()
    }
}
