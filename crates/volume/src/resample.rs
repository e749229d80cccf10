//! Volumes on a grid whose axes are those of the patient.

use std::sync::atomic::AtomicBool;

use nalgebra::{Point3, Vector3};

use crate::in_slices::in_slices;
use crate::reorder::in_order;
use crate::{AIR_HU, LabelMap, NotAGrid, Orientation, Remark, Volume, VolumeError, VoxelGrid};

/// Deviation of a step from an axis, as a share of it, up to which axes are only turned round or in another order:
/// over a thousand voxels it comes to a hundredth of one.
const ALONG_AXES: f64 = 1e-5;

/// Weights of an interpolation below which a voxel's neighbour does not count.
const ON_A_VOXEL: f64 = 1e-6;

/// A volume on an aligned grid, and what was made of it if it was not aligned before.
#[derive(Debug, Clone, PartialEq)]
pub struct Resampled {
    /// The volume, of which i, j and k run to left, posterior and head.
    pub volume: Volume,
    /// None where every voxel has the value that it had.
    pub remark: Option<Remark>,
}

/// Brings a volume to a grid whose axes run along those of `ct`.
///
/// One that is aligned stays as it is. Where axes only run the other way or in another order, voxels are put in order,
/// without loss. All others (oblique ones, those of a tilted gantry) are interpolated between the eight voxels around,
/// onto a grid that holds the whole volume; what lies outside it is air. The result is the same whatever the number of
/// `threads`.
pub fn resample(
    volume: Volume,
    max_bytes: u64,
    threads: usize,
    cancel: &AtomicBool,
) -> Result<Resampled, VolumeError> {
    let volume = in_order(volume, threads, cancel)?;
    if volume.grid.is_aligned() {
        return Ok(Resampled {
            volume,
            remark: None,
        });
    }
    let not_a_grid = |problem: NotAGrid| VolumeError::refused(problem.to_string());
    let is_turned = is_along_axes(&volume.grid);
    let grid = aligned_grid(&volume.grid, is_turned).map_err(not_a_grid)?;
    let bytes = grid.len() as u64 * size_of::<i16>() as u64;
    if bytes > max_bytes {
        let [columns, rows, slices] = grid.size();
        return Err(VolumeError::refused(format!(
            "along the patient's axes it has {columns} x {rows} x {slices} voxels, {} MiB; the \
             limit is {} MiB",
            bytes.div_ceil(1 << 20),
            max_bytes >> 20
        ))
        .hint("crop it beforehand, or raise the limit with --max-memory"));
    }
    let hu = interpolated(&volume, &grid, threads, cancel)?;
    let remark = (!is_turned).then(|| {
        let [x, y, z] = grid.spacing_m().map(|each| each * 1e3);
        let [columns, rows, slices] = grid.size();
        let how = if volume.grid.tilt_rad() > 1e-4 {
            format!(
                "slices are tilted by {:.2} deg",
                volume.grid.tilt_rad().to_degrees()
            )
        } else {
            "the volume is oblique".to_owned()
        };
        Remark::new(format!(
            "{how}: interpolated to {columns} x {rows} x {slices} voxels of {x:.4} x {y:.4} x {z:.4} mm along the \
             patient's axes"
        ))
    });
    Ok(Resampled {
        volume: Volume {
            grid,
            hu,
            slice_thickness_m: volume.slice_thickness_m,
        },
        remark,
    })
}

/// A label map on another grid: each voxel has the label of the one that it lies in, none outside them all.
///
/// The result is the same whatever the number of `threads`.
pub fn resample_labels(
    map: &LabelMap,
    grid: &VoxelGrid,
    threads: usize,
    cancel: &AtomicBool,
) -> Result<LabelMap, VolumeError> {
    let mut labels = Vec::new();
    labels
        .try_reserve_exact(grid.len())
        .map_err(|_| VolumeError::refused("not enough memory for the labels"))?;
    labels.resize(grid.len(), 0_u16);
    let [columns, rows, _] = grid.size();
    let fill = |(): &mut (), k: usize, slice: &mut [u16]| {
        for (j, row) in slice.chunks_mut(columns).enumerate() {
            let (first, step) = along_row(&map.grid, grid, [j, k]);
            for (i, label) in row.iter_mut().enumerate() {
                if let Some(at) = map.grid.voxel_at(&(first + step * i as f64)) {
                    *label = map.labels[map.grid.offset(at)];
                }
            }
        }
    };
    in_slices(&mut labels, columns * rows, threads, cancel, || (), fill)?;
    Ok(LabelMap {
        grid: grid.clone(),
        labels,
        names: map.names.clone(),
    })
}

/// Index in one grid of the first voxel of a row of another, and of the step to the next.
fn along_row(of: &VoxelGrid, grid: &VoxelGrid, [j, k]: [usize; 2]) -> (Point3<f64>, Vector3<f64>) {
    let index = |i: usize| {
        let place = grid.ct_from_index(&Point3::new(i as f64, j as f64, k as f64));
        of.index_from_ct(&place)
    };
    let first = index(0);
    (first, index(1) - first)
}

/// Whether each step runs along an axis of `ct`, one way or the other.
fn is_along_axes(grid: &VoxelGrid) -> bool {
    let spacing_m = grid.spacing_m();
    let axes = Orientation::of(grid).axes();
    axes.into_iter().enumerate().all(|(axis, (row, _))| {
        let step = grid.steps_m().column(axis);
        (0..3).all(|other| other == row || step[other].abs() <= ALONG_AXES * spacing_m[axis])
    })
}

/// The grid that holds all voxels' centres, with the spacing of the axes that come nearest. Through the first voxel of
/// the result's own corner where axes are only turned, so that voxels fall on voxels.
fn aligned_grid(grid: &VoxelGrid, is_turned: bool) -> Result<VoxelGrid, NotAGrid> {
    let mut spacing_m = [0.0; 3];
    let axes = Orientation::of(grid).axes();
    for (axis, (row, _)) in axes.into_iter().enumerate() {
        let step: Vector3<f64> = grid.steps_m().column(axis).into_owned();
        // Of leaning slices the distance between them, and not along their lean.
        spacing_m[row] = if axis == 2 {
            let [i, j] = [0, 1].map(|other| grid.steps_m().column(other).into_owned());
            let normal = i.cross(&j);
            (normal.dot(&step) / normal.norm()).abs()
        } else {
            step.norm()
        };
    }
    let corners = grid.corners_m();
    let least = corners
        .iter()
        .fold(corners[0], |least, each| least.inf(each));
    let greatest = corners
        .iter()
        .fold(corners[0], |greatest, each| greatest.sup(each));
    let mut size = [1; 3];
    if is_turned {
        for (axis, (row, _)) in axes.into_iter().enumerate() {
            size[row] = grid.size()[axis];
        }
    } else {
        for axis in 0..3 {
            let steps = (greatest[axis] - least[axis]) / spacing_m[axis];
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "not negative, and saturates, which is too large for a grid"
            )]
            let steps = (steps - ON_A_VOXEL).ceil().max(0.0) as usize;
            size[axis] = steps.saturating_add(1);
        }
    }
    VoxelGrid::aligned(size, spacing_m, least)
}

fn interpolated(
    volume: &Volume,
    grid: &VoxelGrid,
    threads: usize,
    cancel: &AtomicBool,
) -> Result<Vec<i16>, VolumeError> {
    let count = grid.len();
    let mut hu = Vec::new();
    hu.try_reserve_exact(count)
        .map_err(|_| VolumeError::refused("not enough memory for the voxels"))?;
    hu.resize(count, AIR_HU);
    let [columns, rows, _] = grid.size();
    let plane = columns * rows;
    let fill = |(): &mut (), k: usize, slice: &mut [i16]| {
        for (j, row) in slice.chunks_mut(columns).enumerate() {
            fill_row(volume, grid, [j, k], row);
        }
    };
    in_slices(&mut hu, plane, threads, cancel, || (), fill)?;
    Ok(hu)
}

fn fill_row(volume: &Volume, grid: &VoxelGrid, at: [usize; 2], row: &mut [i16]) {
    let (first, step) = along_row(&volume.grid, grid, at);
    for (i, out) in row.iter_mut().enumerate() {
        if let Some(hu) = trilinear(volume, &(first + step * i as f64)) {
            *out = hu;
        }
    }
}

/// Between the eight voxels around a place; none outside the volume's outermost centres.
fn trilinear(volume: &Volume, index: &Point3<f64>) -> Option<i16> {
    let size = volume.grid.size();
    let mut low = [0; 3];
    let mut weight = [0.0; 3];
    for axis in 0..3 {
        let last = (size[axis] - 1) as f64;
        let at = index[axis];
        if !(-ON_A_VOXEL..=last + ON_A_VOXEL).contains(&at) {
            return None;
        }
        let at = at.clamp(0.0, last);
        let floor = at.floor().min((last - 1.0).max(0.0));
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "within the grid"
        )]
        let whole = floor as usize;
        low[axis] = whole;
        weight[axis] = at - floor;
    }
    let mut sum = 0.0;
    for corner in 0..8_usize {
        let mut share = 1.0;
        let mut voxel = low;
        for axis in 0..3 {
            let is_high = corner >> axis & 1 == 1;
            share *= if is_high {
                weight[axis]
            } else {
                1.0 - weight[axis]
            };
            voxel[axis] += usize::from(is_high);
        }
        if share > ON_A_VOXEL {
            sum += share * f64::from(volume.hu[volume.grid.offset(voxel)]);
        }
    }
    #[expect(
        clippy::cast_possible_truncation,
        reason = "a mean of values of 16 bits"
    )]
    let hu = sum.round_ties_even() as i16;
    Some(hu)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Matrix3;

    const SIZE: [usize; 3] = [6, 5, 4];

    fn volume(steps_m: Matrix3<f64>) -> Volume {
        let grid = VoxelGrid::new(SIZE, steps_m, Point3::new(0.01, -0.02, 0.3)).unwrap();
        let hu = (0..grid.len()).map(|at| i16::try_from(at * 7 % 1000).unwrap());
        Volume {
            hu: hu.collect(),
            grid,
            slice_thickness_m: Some(1e-3),
        }
    }

    fn resampled(volume: &Volume, threads: usize) -> Resampled {
        let never = AtomicBool::new(false);
        resample(volume.clone(), 1 << 20, threads, &never).unwrap()
    }

    #[test]
    fn an_aligned_volume_stays_as_it_is() {
        let volume = volume(Matrix3::from_diagonal(&Vector3::new(5e-4, 7e-4, 2e-3)));
        let resampled = resampled(&volume, 1);
        assert_eq!(resampled.volume, volume);
        assert_eq!(resampled.remark, None);
    }

    #[test]
    fn turned_axes_are_put_in_order_without_loss() {
        // i runs to the feet, j to the left, k to the front.
        let steps = Matrix3::new(0.0, 7e-4, 0.0, 0.0, 0.0, -2e-3, -5e-4, 0.0, 0.0);
        let volume = volume(steps);
        let resampled = resampled(&volume, 2);
        assert_eq!(resampled.remark, None);
        let grid = &resampled.volume.grid;
        assert!(grid.is_aligned());
        assert_eq!(grid.size(), [5, 4, 6]);
        for i in 0..6 {
            for j in 0..5 {
                for k in 0..4 {
                    let place = volume
                        .grid
                        .ct_from_index(&Point3::new(i as f64, j as f64, k as f64));
                    let index = grid.index_from_ct(&place);
                    #[expect(
                        clippy::cast_possible_truncation,
                        clippy::cast_sign_loss,
                        reason = "an index within the volume"
                    )]
                    let at = [0, 1, 2].map(|axis| index[axis].round() as usize);
                    assert_eq!(
                        resampled.volume.hu[grid.offset(at)],
                        volume.hu[volume.grid.offset([i, j, k])]
                    );
                }
            }
        }
    }

    #[test]
    fn labels_of_leaning_slices_stay_where_they_are() {
        let steps = Matrix3::new(5e-4, 0.0, 0.0, 0.0, 5e-4, 3e-4, 0.0, -1e-4, 1e-3);
        let volume = volume(steps);
        let labels = (0..volume.grid.len()).map(|at| u16::try_from(at).unwrap());
        let map = LabelMap {
            labels: labels.collect(),
            grid: volume.grid.clone(),
            names: vec![(3, "three".to_owned())],
        };
        let grid = resampled(&volume, 1).volume.grid;
        let never = AtomicBool::new(false);
        let made = resample_labels(&map, &grid, 2, &never).unwrap();
        assert_eq!(made.names, map.names);
        let [columns, rows, slices] = grid.size();
        let mut inside = 0;
        for k in 0..slices {
            for (j, i) in (0..rows).flat_map(|j| (0..columns).map(move |i| (j, i))) {
                let place = grid.ct_from_index(&Point3::new(i as f64, j as f64, k as f64));
                let label = made.labels[grid.offset([i, j, k])];
                // The nearest voxel along the axes of the map, by looking at them all.
                let index = map.grid.index_from_ct(&place);
                let within = (0..map.grid.len()).find(|at| {
                    let at = [at % 6, at / 6 % 5, at / 30];
                    (0..3).all(|axis| (index[axis] - at[axis] as f64).abs() < 0.5)
                });
                let wanted = within.map_or(0, |at| u16::try_from(at).unwrap());
                inside += usize::from(within.is_some());
                assert_eq!(label, wanted, "{i} {j} {k}");
            }
        }
        assert!(inside > 60, "{inside}");
    }

    /// A field that is linear in place is interpolated without error but rounding.
    #[test]
    fn a_sheared_volume_keeps_its_places() {
        let steps = Matrix3::new(5e-4, 0.0, 0.0, 0.0, 5e-4, 3e-4, 0.0, -1e-4, 1e-3);
        let mut volume = volume(steps);
        let hu = |place: &Point3<f64>| 1e5 * place.x - 5e4 * place.y + 2e5 * (place.z - 0.3);
        for k in 0..4 {
            for j in 0..5 {
                for i in 0..6 {
                    let place = volume
                        .grid
                        .ct_from_index(&Point3::new(i as f64, j as f64, k as f64));
                    let offset = volume.grid.offset([i, j, k]);
                    #[expect(clippy::cast_possible_truncation, reason = "some hundred HU")]
                    let value = hu(&place).round() as i16;
                    volume.hu[offset] = value;
                }
            }
        }
        let resampled = resampled(&volume, 3);
        assert!(resampled.remark.is_some());
        let grid = &resampled.volume.grid;
        let mut inside = 0;
        for k in 0..grid.size()[2] {
            for j in 0..grid.size()[1] {
                for i in 0..grid.size()[0] {
                    let value = resampled.volume.hu[grid.offset([i, j, k])];
                    let place = grid.ct_from_index(&Point3::new(i as f64, j as f64, k as f64));
                    if value != AIR_HU {
                        inside += 1;
                        assert!(
                            (f64::from(value) - hu(&place)).abs() <= 1.01,
                            "{value} at {place}"
                        );
                    }
                }
            }
        }
        assert!(inside > 60, "{inside}");
        assert_eq!(super::tests::resampled(&volume, 1), resampled);
    }

    #[test]
    fn memory_is_limited_and_it_can_be_interrupted() {
        let steps = Matrix3::new(5e-4, 0.0, 0.0, 0.0, 5e-4, 3e-4, 0.0, 0.0, 1e-3);
        let refused = resample(volume(steps), 100, 1, &AtomicBool::new(false)).unwrap_err();
        assert!(refused.to_string().contains("limit"), "{refused}");
        let stopped = resample(volume(steps), 1 << 20, 1, &AtomicBool::new(true));
        assert_eq!(stopped, Err(VolumeError::Interrupted));
    }
}
