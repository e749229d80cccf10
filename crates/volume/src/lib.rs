//! CT volumes and label maps: read, brought to other grids, and written.
//!
//! Metres and Hounsfield units throughout. Frame `ct` is the patient's LPS: +x to the patient's left, +y posterior,
//! +z towards the head; its axes are those of the frame `phantom`. An index (i, j, k) means a voxel's centre: column,
//! row, slice. A volume of n columns spans -0.5 to n - 0.5.
//!
//! What is in a scan is the matter of `needlebench-imaging`. Here is only what names in label maps mean, which decides
//! what is painted over what where structures overlap.
//!
//! Names and birth dates of patients are never read into any value of this crate.
#![cfg_attr(any(doc, doctest), doc = include_str!("../README.md"))]

mod error;
mod grid;
mod histogram;
mod image_circle;
mod in_slices;
mod orientation;
mod patient_position;
pub mod read;
mod reorder;
mod resample;
mod structures;
mod volume;
pub mod write;

pub use error::{Remark, VolumeError};
pub use grid::{NotAGrid, VoxelGrid};
pub use histogram::HuHistogram;
pub use image_circle::ImageCircle;
pub use in_slices::{in_slices, room_for};
pub use orientation::{NoOrientation, Orientation};
pub use patient_position::{Lying, PatientPosition};
pub use reorder::in_order;
pub use resample::{Resampled, resample, resample_labels};
pub use structures::{BesideKind, Structure, SurfaceTissue, structure_of};
pub use volume::{AIR_HU, LabelMap, Volume};
