//! The arm that `ik` and `fk` are asked about.

use std::path::Path;

use needlebench_cell::{
    AppliedCalibration, Calibration, Finding, MOVING_LINK_LABELS, Robot, load_robot,
};
use needlebench_kinematics::{Chain, JointLimits, Joints, LimitPolicy, UrModel};

use super::super::urdf_overrides;
use crate::arguments::ArmArguments;

/// What kinematics need of an arm.
#[derive(Debug, Clone)]
pub struct KinematicArm {
    /// The maker's name where it is a known arm.
    pub name: String,
    /// Where it comes from, for complaints.
    pub file: String,
    /// Its links.
    pub chain: Chain,
    /// Limits of its joints.
    pub limits: JointLimits,
    /// Short names of the moving links.
    pub links: [String; 6],
    /// The calibration that it has.
    pub calibration: Option<AppliedCalibration>,
}

impl KinematicArm {
    pub(super) fn new(arguments: &ArmArguments) -> Result<Self, Finding> {
        match arguments.arm {
            Some(model) => Self::of_model(model, arguments.robot.calibration.as_deref()),
            None => Ok(Self::of_robot(&load_robot(&urdf_overrides(
                &arguments.robot,
            )?)?)),
        }
    }

    /// That of a robot.
    pub fn of_robot(robot: &Robot) -> Self {
        Self {
            name: robot.arm_name(),
            file: robot.source.file.clone(),
            chain: robot.chain,
            limits: robot.limits,
            links: robot.links.each_ref().map(|link| link.name.clone()),
            calibration: robot.calibration.clone(),
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
