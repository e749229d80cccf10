//! Kinematics and rigid-body dynamics of UR arms.
#![cfg_attr(any(doc, doctest), doc = include_str!("../README.md"))]

mod chain;
mod dynamics;
mod forward_dynamics;
mod geometry;
pub mod ik;
mod integrate;
mod limits;
mod manipulability;
mod models;
// Of tests and benches, hidden from the documentation: no part of what this crate promises.
#[doc(hidden)]
pub mod pose_sets;
pub mod registration;
mod rotation;
pub mod trajectory;

pub use chain::{Chain, ChainJoint};
pub use dynamics::{Body, Dynamics};
pub use forward_dynamics::AboutBase;
pub use geometry::{NotUrGeometry, UrGeometry, base_from_base_link};
pub use integrate::{NotSmooth, integrate};
pub use limits::{JointLimit, JointLimits, LIMIT_ROUNDING_RAD, LimitPolicy, MAX_TURNS};
pub use manipulability::{Manipulability, SingularityDistances, determinant_gradient};
pub use models::{UnknownUrModel, UrModel};
pub use rotation::{
    NotARotation, pose_from_matrix, pose_from_rotation_vector, rotation_angle_between,
    rotation_vector,
};

/// Number of joints of the arm.
pub const JOINT_COUNT: usize = 6;

/// One value per joint: positions in rad, velocities in rad/s, torques in N m.
pub type Joints = nalgebra::Vector6<f64>;

/// A rigid transform `a_from_b`.
pub type Pose = nalgebra::Isometry3<f64>;

/// ROS joint names, in order.
pub const JOINT_NAMES: [&str; JOINT_COUNT] = [
    "shoulder_pan_joint",
    "shoulder_lift_joint",
    "elbow_joint",
    "wrist_1_joint",
    "wrist_2_joint",
    "wrist_3_joint",
];

/// ROS names of the links that the joints move, in order.
pub const LINK_NAMES: [&str; JOINT_COUNT] = [
    "shoulder_link",
    "upper_arm_link",
    "forearm_link",
    "wrist_1_link",
    "wrist_2_link",
    "wrist_3_link",
];

/// Short joint names, in order, as reports print them.
pub const JOINT_LABELS: [&str; JOINT_COUNT] = [
    "shoulder_pan",
    "shoulder_lift",
    "elbow",
    "wrist_1",
    "wrist_2",
    "wrist_3",
];
