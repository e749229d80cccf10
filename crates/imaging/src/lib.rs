//! CT volumes: read, written, segmented, turned into surfaces, and registered to the robot by markers.
//!
//! Metres and Hounsfield units throughout. Frame `ct` is the patient's LPS: +x to the patient's left, +y posterior,
//! +z towards the head; its axes are those of the frame `phantom`. An index (i, j, k) means a voxel's centre: column,
//! row, slice. A volume of n columns spans -0.5 to n - 0.5.
//!
//! Names and birth dates of patients are never read into any value of this crate.
#![cfg_attr(any(doc, doctest), doc = include_str!("../README.md"))]

mod components;
mod distance;
mod error;
mod field_of_view;
mod grid;
mod histogram;
mod image_circle;
mod in_slices;
mod label_map;
mod mapped_lesions;
pub mod markers;
mod mask;
mod morphology;
mod orientation;
mod outside;
mod patient_position;
pub mod read;
mod reconstruct;
pub mod registration;
mod reorder;
mod resample;
mod segment;
mod serial;
mod spacing;
mod structures;
mod surface;
mod volume;
pub mod write;

pub use components::{Component, Components, Connectivity};
pub use distance::{DistanceField, DistanceOptions};
pub use error::{ImagingError, Remark};
pub use field_of_view::{Cut, FieldOfView};
pub use grid::{NotAGrid, VoxelGrid};
pub use histogram::HuHistogram;
pub use image_circle::ImageCircle;
pub use in_slices::{in_slices, room_for};
pub use mask::{IndexBox, Mask};
pub use morphology::{closed, dilated, eroded, opened};
pub use orientation::{NoOrientation, Orientation};
pub use outside::{AssumedBody, AssumedPiece, Outside};
pub use patient_position::{Lying, PatientPosition};
pub use reconstruct::{
    LesionSize, MeasuredLesion, NotGrown, Progress, ReconstructOptions, Reconstruction, Surface,
    SurfaceSizes, reconstruct,
};
pub use reorder::in_order;
pub use resample::{Resampled, resample, resample_labels};
pub use segment::{
    Beside, Body, Bone, FIRST_LESION, Label, LabelFacts, Lesion, LesionSeed, Levels, Lung, Lungs,
    Segmentation, Side, label_map, segment,
};
pub use structures::{BesideKind, Structure, SurfaceTissue, structure_of};
pub use surface::{Field, Level, SurfaceError, Values, stl_bytes};
pub use volume::{AIR_HU, LabelMap, Volume};
