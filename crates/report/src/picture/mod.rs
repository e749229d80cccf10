//! What is drawn of a result: the arm in each configuration, and the room that it leaves to people, slices of
//! a scan.

pub mod configuration;
pub mod room;
mod slices;
mod voxels;

pub use slices::{SlicePicture, slice_pictures};
pub use voxels::voxel_surface;
