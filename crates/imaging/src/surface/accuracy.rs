//! How far a surface is from another one that is finer.

use nalgebra::Point3;
use needlebench_geometry::mesh::SurfaceIndex;
use needlebench_volume::VoxelGrid;
use serde::Serialize;

use super::field::Field;

/// Points at which a surface is compared.
const SAMPLES: usize = 20_000;

/// Distances of a surface from that of the voxels: from evenly chosen places at which the trilinear surface crosses the
/// lines between voxels, of all three directions, to the nearest point of the surface, m. What the surface leaves out
/// counts.
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

/// Measures a surface against the field that it was made of. None if the field has no surface.
pub(crate) fn surface_error(
    field: &Field<'_>,
    grid: &VoxelGrid,
    surface: &SurfaceIndex,
) -> Option<SurfaceError> {
    let mut count = 0_usize;
    field.for_each_crossed_line(|_, _| count += 1);
    let every = count.div_ceil(SAMPLES).max(1);
    let mut distances_m = Vec::with_capacity(count / every + 1);
    let mut number = 0;
    field.for_each_crossed_line(|at, axis| {
        if number % every == 0 {
            let place = grid.ct_from_index(&Point3::from(field.crossing(at, axis)));
            distances_m.push(surface.distance_m(&place));
        }
        number += 1;
    });
    of_distances(distances_m)
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
