//! What a scenario says, in the formats of other tools: the whole cell as a model of a simulator, a
//! robot description or a picture in space; its motions as recordings, trajectories and programs; its
//! needles as markups over the scan.
//!
//! One public function for each format, which gives [`ExportedFile`]s. Nothing here prints or writes.
//! Joints and links have the names that ROS gives them. The same scenario gives the same bytes.
#![cfg_attr(any(doc, doctest), doc = include_str!("../README.md"))]

mod error;
mod file;
mod gltf;
mod head;
mod marks;
mod markups;
mod mcap;
mod mjcf;
mod motion;
mod postures;
mod stl;
mod surfaces;
mod trajectory;
mod urdf;
mod urscript;

pub use error::ExportError;
pub use file::ExportedFile;
pub use gltf::{Packing, Shown, gltf};
pub use markups::markups;
pub use mcap::mcap;
pub use mjcf::mjcf;
pub use motion::Motion;
pub use surfaces::{MergedSurface, MovesWith, Surfaces, surfaces_of_cell};
pub use trajectory::{TrajectoryNotation, trajectory};
pub use urdf::urdf;
pub use urscript::{excitation_script, motion_script};
