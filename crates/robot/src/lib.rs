//! Robots and tools from the files that describe them: URDFs with their meshes, factory calibrations, and what is known
//! of an arm besides its URDF.
//!
//! A [`LoadedRobot`] is the robot of a cell with the files that it was made of. What is wrong with a file is a
//! [`Finding`](needlebench_input::Finding).
#![cfg_attr(any(doc, doctest), doc = include_str!("../README.md"))]

pub mod arm;
mod arm_in_use;
mod loaded;
mod mesh_file;
mod robot;
mod ros_package;

pub use arm::{Arm, Recognition};
pub use arm_in_use::{ArmInUse, ArmReport};
pub use loaded::{
    ASSUMED_SHAPES, AppliedCalibration, LinkMember, LoadedRobot, LoadedTool, RobotDescription,
    STANDS_FOR_IT, WITHOUT_SHAPE,
};
pub use mesh_file::{MeshFormat, read_mesh};
pub use robot::{
    Calibration, DisabledPair, GuidePlace, LinkEnclosure, MOVING_LINK_LABELS, MissingInertia,
    OriginDeviation, Srdf, StatedShape, ToolOverrides, enclosures, read_robot, read_tool,
};
pub use ros_package::package_of;
