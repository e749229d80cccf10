//! How far a surface is from another one that is finer.

use nalgebra::Point3;
use needlebench_geometry::TriangleMesh;
use needlebench_geometry::mesh::SurfaceIndex;
use serde::Serialize;

/// Points at which a surface is compared.
const SAMPLES: usize = 20_000;

/// Distances of a simplified surface from the surface of the voxels: from evenly chosen vertices of the fine one to
/// the coarse one, m. The fine one's vertices lie on the trilinear surface of the voxels.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SurfaceError {
    /// Root of the mean square.
    pub rms_m: f64,
    /// 99 % are nearer.
    pub p99_m: f64,
    /// Of the points that were looked at.
    pub max_m: f64,
    /// Points that were looked at.
    pub points: usize,
}

/// Measures a simplified surface against the one that it was made of. None without triangles.
pub fn surface_error(fine: &TriangleMesh, coarse: &SurfaceIndex) -> Option<SurfaceError> {
    let every = fine.vertices_m.len().div_ceil(SAMPLES).max(1);
    let points = fine.vertices_m.iter().step_by(every);
    of_distances(
        points
            .map(|point: &Point3<f64>| coarse.distance_m(point))
            .collect(),
    )
}

/// Of distances from a surface.
fn of_distances(mut distances_m: Vec<f64>) -> Option<SurfaceError> {
    let points = distances_m.len();
    distances_m.sort_by(f64::total_cmp);
    let squares: f64 = distances_m.iter().map(|distance| distance * distance).sum();
    Some(SurfaceError {
        rms_m: (squares / points as f64).sqrt(),
        p99_m: distances_m
            .get((points * 99).div_ceil(100).saturating_sub(1))
            .copied()?,
        max_m: distances_m.last().copied()?,
        points,
    })
}
