//! Grids on which distances can be counted in voxels.

use needlebench_volume::{VolumeError, VoxelGrid};

/// Cosine of the angle between two steps below which they count as perpendicular: a millimetre over a metre.
const PERPENDICULAR: f64 = 1e-3;

/// Spacing in m of a grid whose axes are perpendicular.
pub(crate) fn orthogonal(grid: &VoxelGrid) -> Result<[f64; 3], VolumeError> {
    let steps = grid.steps_m();
    for (a, b) in [(0, 1), (1, 2), (2, 0)] {
        let (one, other) = (steps.column(a), steps.column(b));
        let cosine = one.dot(&other).abs() / (one.norm() * other.norm());
        if cosine > PERPENDICULAR {
            return Err(VolumeError::refused(format!(
                "the voxels' axes {a} and {b} are {:.2} degrees from perpendicular",
                libm::atan2(cosine.min(1.0), (1.0 - cosine * cosine).max(0.0).sqrt()).to_degrees()
            ))
            .hint("resample the volume to a perpendicular grid first"));
        }
    }
    Ok(grid.spacing_m())
}

/// Whole steps in a length; what is more than there are voxels saturates.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a count, which is never negative"
)]
pub(crate) fn whole(steps: f64) -> usize {
    steps.floor().max(0.0) as usize
}
