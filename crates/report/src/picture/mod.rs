//! What is drawn of a result: the arm in each configuration, and the room that it leaves to people, slices of
//! a scan.

pub mod configuration;
mod overview;
pub mod room;
mod slices;
mod voxels;

use needlebench_patient::ct::ScanBuild;
use needlebench_render::PictureError;

pub use overview::OVERVIEW;
pub use slices::SlicePicture;

pub use voxels::voxel_surface;

/// What was found in one image, and slices through it.
///
/// # Errors
/// A picture that cannot be encoded.
pub fn scan_pictures(build: &ScanBuild) -> Result<Vec<SlicePicture>, PictureError> {
    let mut pictures = vec![overview::overview_picture(build)?];
    pictures.extend(slices::slice_pictures(build)?);
    Ok(pictures)
}
