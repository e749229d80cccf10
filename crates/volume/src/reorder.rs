//! Voxels in the order of the patient's axes.

use std::sync::atomic::AtomicBool;

use nalgebra::{Matrix3, Point3};

use crate::in_slices::{in_slices, room_for};
use crate::{NotAGrid, Orientation, Volume, VolumeError, VoxelGrid};

/// Puts voxels in an order in which columns run most to the left, rows to the back and slices to the head, without
/// loss: each voxel keeps its value and its place.
///
/// Stacks of sagittal or coronal slices become axial ones, so that whatever follows needs to know one order alone. A
/// volume in this order stays as it is. The result is the same whatever the number of `threads`.
///
/// # Errors
/// Too little memory; interrupted.
pub fn in_order(
    volume: Volume,
    threads: usize,
    cancel: &AtomicBool,
) -> Result<Volume, VolumeError> {
    let axes = Orientation::of(&volume.grid).axes();
    if axes == [0, 1, 2].map(|axis| (axis, 1.0)) {
        return Ok(volume);
    }
    let grid = ordered_grid(&volume.grid, axes)
        .map_err(|problem| VolumeError::refused(problem.to_string()))?;
    // Of ours, along each axis of the other.
    let strides = [
        1,
        volume.grid.size()[0],
        volume.grid.size()[0] * volume.grid.size()[1],
    ];
    let mut ways = [(0, false, 0); 3];
    for (axis, (row, direction)) in axes.into_iter().enumerate() {
        ways[row] = (strides[axis], direction < 0.0, volume.grid.size()[axis] - 1);
    }
    let offset = |along: usize, index: usize| {
        let (stride, is_reversed, last) = ways[along];
        stride * if is_reversed { last - index } else { index }
    };
    let [columns, rows, _] = grid.size();
    let mut hu = room_for(&grid)?;
    let fill = |(): &mut (), k: usize, slice: &mut [i16]| {
        for (j, row) in slice.chunks_mut(columns).enumerate() {
            let start = offset(2, k) + offset(1, j);
            for (i, out) in row.iter_mut().enumerate() {
                *out = volume.hu[start + offset(0, i)];
            }
        }
    };
    in_slices(&mut hu, columns * rows, threads, cancel, || (), fill)?;
    Ok(Volume {
        grid,
        hu,
        // Of slices along another axis of the patient nothing that asks for it would be right.
        slice_thickness_m: volume.slice_thickness_m.filter(|_| axes[2].0 == 2),
    })
}

/// The same voxels' grid, by the axis of the patient and the direction of each of its axes.
fn ordered_grid(grid: &VoxelGrid, axes: [(usize, f64); 3]) -> Result<VoxelGrid, NotAGrid> {
    let mut size = [0; 3];
    let mut steps_m = Matrix3::zeros();
    let mut first = Point3::origin();
    for (axis, (row, direction)) in axes.into_iter().enumerate() {
        size[row] = grid.size()[axis];
        steps_m.set_column(row, &(grid.steps_m().column(axis) * direction));
        if direction < 0.0 {
            first[axis] = (grid.size()[axis] - 1) as f64;
        }
    }
    VoxelGrid::new(size, steps_m, grid.ct_from_index(&first))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::orientation::PERMUTATIONS;

    /// Every order of the axes, each way.
    fn orders() -> impl Iterator<Item = [(usize, f64); 3]> {
        PERMUTATIONS.into_iter().flat_map(|rows| {
            (0..8_usize).map(move |flips| {
                [0, 1, 2].map(|axis| (rows[axis], if flips >> axis & 1 == 1 { -1.0 } else { 1.0 }))
            })
        })
    }

    /// A leaning grid, so that no two of its axes are alike.
    fn patient() -> VoxelGrid {
        let steps = Matrix3::new(6e-4, 0.0, 0.0, 0.0, 7e-4, 3e-4, 0.0, -1e-4, 2e-3);
        VoxelGrid::new([5, 4, 3], steps, Point3::new(0.1, -0.2, 0.3)).unwrap()
    }

    /// The value says the place.
    fn value(index: &Point3<f64>) -> i16 {
        #[expect(clippy::cast_possible_truncation, reason = "less than a thousand")]
        let value = (index.x + 10.0 * index.y + 100.0 * index.z).round() as i16;
        value
    }

    #[test]
    fn every_order_of_the_axes_becomes_the_same_volume() {
        let wanted = patient();
        let mut count = 0;
        for order in orders() {
            let size = order.map(|(row, _)| wanted.size()[row]);
            let steps: [_; 3] = order.map(|(row, sign)| wanted.steps_m().column(row) * sign);
            let first = std::array::from_fn(|row| {
                let is_flipped = order.contains(&(row, -1.0));
                if is_flipped {
                    (wanted.size()[row] - 1) as f64
                } else {
                    0.0
                }
            });
            let first = wanted.ct_from_index(&Point3::from(first));
            let grid = VoxelGrid::new(size, Matrix3::from_columns(&steps), first).unwrap();
            let [nx, ny, nz] = size;
            let all =
                (0..nz).flat_map(|k| (0..ny).flat_map(move |j| (0..nx).map(move |i| [i, j, k])));
            let hu = all.map(|index| {
                let place = grid.ct_from_index(&Point3::from(index.map(|each| each as f64)));
                value(&wanted.index_from_ct(&place))
            });
            let volume = Volume {
                hu: hu.collect(),
                grid,
                slice_thickness_m: Some(2e-3),
            };
            let made = in_order(volume, 2, &AtomicBool::new(false)).unwrap();
            assert_eq!(made.grid.size(), wanted.size(), "{order:?}");
            assert!(made.grid.farthest_corners_m(&wanted) < 1e-15, "{order:?}");
            for (offset, hu) in made.hu.iter().enumerate() {
                let [i, j, k] = [offset % 5, offset / 5 % 4, offset / 20];
                let index = Point3::new(i as f64, j as f64, k as f64);
                assert_eq!(*hu, value(&index), "{order:?} {index}");
            }
            count += 1;
        }
        assert_eq!(count, 48);
    }

    #[test]
    fn it_can_be_interrupted() {
        let steps = Matrix3::from_diagonal_element(-1e-3);
        let volume = Volume {
            grid: VoxelGrid::new([2; 3], steps, Point3::origin()).unwrap(),
            hu: vec![0; 8],
            slice_thickness_m: None,
        };
        let stopped = in_order(volume, 1, &AtomicBool::new(true));
        assert_eq!(stopped, Err(VolumeError::Interrupted));
    }
}
