//! Kinematics and rigid-body dynamics of the six-joint UR arms.
//!
//! Metres, radians, kilograms and seconds throughout. Joint vectors are ordered
//! `shoulder_pan, shoulder_lift, elbow, wrist_1, wrist_2, wrist_3`.
//!
//! Frames: `base_link` is ROS's; `base` is the UR controller's, `base_link` turned by 180 degrees
//! about z, and the frame of the DH chain; `flange` here always means DH frame 6, which ROS calls
//! `tool0` and the controller shows at a zero TCP.

mod chain;
pub mod chi_square;
mod dynamics;
mod forward_dynamics;
mod geometry;
pub mod ik;
mod integrate;
mod limits;
mod manipulability;
mod models;
pub mod normal;
pub mod pose_sets;
pub mod random;
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

/// Short joint names, in order, as reports print them.
pub const JOINT_LABELS: [&str; JOINT_COUNT] = [
    "shoulder_pan",
    "shoulder_lift",
    "elbow",
    "wrist_1",
    "wrist_2",
    "wrist_3",
];
