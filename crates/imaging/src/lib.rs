//! CT volumes: read, synthesised, segmented, turned into surfaces, and registered to the robot by markers.
//!
//! Metres and Hounsfield units throughout. Frame `ct` is the patient's LPS: +x to the patient's left, +y posterior,
//! +z towards the head; its axes are those of the frame `phantom`. An index (i, j, k) means a voxel's centre: column,
//! row, slice. A volume of n columns spans -0.5 to n - 0.5.
//!
//! Names and birth dates of patients are never read into any value of this crate.

mod error;
mod grid;
pub mod synth;
mod volume;
pub mod write;

pub use error::{ImagingError, Remark};
pub use grid::{NotAGrid, VoxelGrid};
pub use volume::{AIR_HU, LabelMap, Volume};
