//! Volumes and label maps into files that other programs read.
//!
//! Files are either whole or not there.

mod dicom;
mod file;
mod nifti;
mod seg_nrrd;

pub use dicom::{DicomSeries, write_dicom};
pub use file::{TEMPORARY_PREFIX, stream, write_bytes};
pub use nifti::{write_label_nifti, write_nifti};
pub use seg_nrrd::write_seg_nrrd;
