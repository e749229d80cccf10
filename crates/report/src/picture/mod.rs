//! What is drawn of a result: the arm in each configuration, and the room that it leaves to people.

pub mod configuration;
pub mod room;
mod voxels;

pub use voxels::voxel_surface;
