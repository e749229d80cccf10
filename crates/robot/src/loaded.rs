//! A robot together with the files that it was made of.

use std::ops::{Deref, DerefMut};

use needlebench_cell::{Robot, Tool};
use needlebench_input::ModelSource;
use needlebench_kinematics::{UrGeometry, UrModel};

use crate::ArmInUse;
use crate::arm::SAME_ARM_M;

/// Beginning of the note on parts that have no shape by the scenario's setting.
pub const WITHOUT_SHAPE: &str = "without a collision shape, as set in the scenario: ";

/// End of the note on a link that has no shapes of its own, or too small ones.
pub const STANDS_FOR_IT: &str = " are added to it";

/// Beginning of the note on an arm whose shapes were compared with no surface of it.
pub const ASSUMED_SHAPES: &str = "assumed: the collision shapes of the ";

/// A link of the URDF that a body of the arm was made of.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LinkMember {
    /// Name in the URDF, e.g. `forearm_link`.
    pub name: String,
    /// The body: 0 for the base, 1 to 6 for the moving links.
    pub owner: usize,
    /// Whether it has collision geometry.
    pub has_geometry: bool,
    /// Whether it has surfaces for pictures.
    pub is_drawn: bool,
    /// Whether it is the base or a moving link itself, and not bolted to one.
    pub is_links_own: bool,
}

/// A calibration that a robot's chain was made from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct AppliedCalibration {
    /// Its hash, if the file has one.
    pub hash: Option<String>,
    /// The file.
    pub source: ModelSource,
}

/// The files that a robot was made of, and what they say beside its geometry.
#[derive(Debug, Clone, PartialEq)]
pub struct RobotDescription {
    /// Links of the URDF and what they became part of, in the file's order.
    pub members: Vec<LinkMember>,
    /// The arm whose data the robot has, if its lengths are known or it is named.
    pub arm: Option<ArmInUse>,
    /// What the arm is called: the manufacturer's name where its lengths are those of a known arm, else the URDF's.
    pub arm_name: String,
    /// The URDF.
    pub source: ModelSource,
    /// The factory calibration whose joint origins replaced the URDF's, if one was given.
    pub calibration: Option<AppliedCalibration>,
    /// The URDF's collision meshes, each once.
    pub meshes: Vec<ModelSource>,
    /// What was assumed or replaced while the URDF was read; belongs in every report.
    pub notes: Vec<String>,
}

/// A robot as its files describe it; it is the robot wherever one is asked for.
#[derive(Debug, Clone, PartialEq)]
pub struct LoadedRobot {
    /// The robot.
    pub robot: Robot,
    /// Where it is from.
    pub description: RobotDescription,
}

impl Deref for LoadedRobot {
    type Target = Robot;

    fn deref(&self) -> &Robot {
        &self.robot
    }
}

impl DerefMut for LoadedRobot {
    fn deref_mut(&mut self) -> &mut Robot {
        &mut self.robot
    }
}

/// A tool and the URDF that it was made of.
#[derive(Debug, Clone, PartialEq)]
pub struct LoadedTool {
    /// The tool.
    pub tool: Tool,
    /// The URDF.
    pub source: ModelSource,
}

/// What an arm is called that has these lengths and this data.
pub(crate) fn arm_name(robot: &Robot, arm: Option<&ArmInUse>) -> String {
    if let Some(used) = arm.filter(|used| used.has_its_lengths()) {
        return used.arm.data.name.clone();
    }
    let known = UrGeometry::of_chain(&robot.chain)
        .map(|geometry| UrModel::nearest(&geometry))
        .ok()
        .filter(|(_, deviation_m)| *deviation_m <= SAME_ARM_M);
    known.map_or_else(|| robot.name.clone(), |(model, _)| model.name().to_owned())
}
