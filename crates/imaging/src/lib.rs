//! CT volumes: segmented, turned into surfaces, and registered to the robot by markers.
//!
//! Metres and Hounsfield units throughout, in the frame `ct` and with the indices of `needlebench-volume`, which has
//! the volumes and label maps.
#![cfg_attr(any(doc, doctest), doc = include_str!("../README.md"))]

mod components;
mod distance;
mod field_of_view;
mod label_map;
mod mapped_lesions;
pub mod markers;
mod mask;
mod morphology;
mod outside;
mod reconstruct;
pub mod registration;
mod segment;
mod serial;
mod spacing;
mod surface;

pub use components::{Component, Components, Connectivity};
pub use distance::{DistanceField, DistanceOptions};
pub use field_of_view::{Cut, FieldOfView};
pub use mask::{IndexBox, Mask};
pub use morphology::{closed, dilated, eroded, opened};
pub use outside::{AssumedBody, AssumedPiece, Outside};
pub use reconstruct::{
    LesionSize, MeasuredLesion, NotGrown, Progress, ReconstructOptions, Reconstruction, Surface,
    SurfaceSizes, reconstruct,
};
pub use segment::{
    Beside, Body, Bone, FIRST_LESION, Label, LabelFacts, Lesion, LesionSeed, Levels, Lung, Lungs,
    Segmentation, Side, label_map, segment,
};
pub use surface::{Field, Level, SurfaceError, Values, stl_bytes};
