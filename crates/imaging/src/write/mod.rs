//! Volumes and label maps into files that other programs read.
//!
//! Files are either whole or not there.

mod file;
mod nifti;

pub use nifti::{write_label_nifti, write_nifti};
