//! The arm whose data a robot has.

use std::sync::Arc;

use needlebench_kinematics::JointLimits;
use serde::Serialize;

use needlebench_cell::{BrakeFigures, Robot};

use crate::arm::{Arm, Recognition, SAME_ARM_M};

/// The arm whose data a robot has.
#[derive(Debug, Clone, PartialEq)]
pub struct ArmInUse {
    /// The arm.
    pub arm: Arc<Arm>,
    /// Why.
    pub recognition: Recognition,
    /// Largest difference of any length of the robot's URDF from the arm's, m.
    pub deviation_m: f64,
    /// The arm by its own URDF, where the robot is from elsewhere.
    pub nominal: Option<Arc<Robot>>,
    /// Limits of the arm's own URDF.
    pub limits: JointLimits,
}

/// The arm whose data a result was made with, in a report.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ArmReport {
    /// The name that it is called by: `ur5e`.
    pub arm: String,
    /// The manufacturer's name: `UR5e`.
    pub name: String,
    /// The file with its data.
    pub file: String,
    /// SHA-256 of that file.
    pub sha256: String,
    /// Why the data are the robot's.
    pub recognition: Recognition,
    /// Largest difference of any length of the robot's URDF from the arm's.
    pub largest_length_difference_m: f64,
}

impl ArmInUse {
    /// What is published of the arm's brakes.
    pub fn brakes(&self) -> Option<BrakeFigures> {
        self.arm.brakes(&self.limits)
    }

    /// Whether the robot has the arm's lengths.
    pub(crate) fn has_its_lengths(&self) -> bool {
        self.deviation_m <= SAME_ARM_M
    }

    /// As reports have it.
    pub fn report(&self) -> ArmReport {
        ArmReport {
            arm: self.arm.key.clone(),
            name: self.arm.data.name.clone(),
            file: self.arm.source.file.clone(),
            sha256: self.arm.source.sha256.clone(),
            recognition: self.recognition,
            largest_length_difference_m: self.deviation_m,
        }
    }

    /// Which arm's data are used and why, for people.
    pub(crate) fn note(&self) -> String {
        let how = match self.recognition {
            Recognition::Own => String::new(),
            Recognition::Lengths => ", recognised by its lengths".to_owned(),
            Recognition::Named if self.has_its_lengths() => ", as named".to_owned(),
            Recognition::Named => format!(
                ", as named; the URDF's lengths differ from the arm's by up to {:.1} mm",
                self.deviation_m * 1e3
            ),
        };
        format!("arm data: {} ({}){how}", self.arm.key, self.arm.path())
    }
}
