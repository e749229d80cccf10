//! Slices on several threads.

use std::sync::atomic::{AtomicBool, Ordering};

use needlebench_parallel::in_parts;

use crate::{VolumeError, VoxelGrid};

/// Memory for a value per voxel.
pub fn room_for<T: Clone + Default>(grid: &VoxelGrid) -> Result<Vec<T>, VolumeError> {
    let mut values = Vec::new();
    values.try_reserve_exact(grid.len()).map_err(|_| {
        let [columns, rows, slices] = grid.size();
        let bytes = grid.len().saturating_mul(size_of::<T>());
        VolumeError::refused(format!(
            "{columns} x {rows} x {slices} voxels need {} MB of memory, which is not available",
            bytes / 1_000_000
        ))
        .hint("use fewer or larger voxels")
    })?;
    values.resize(grid.len(), T::default());
    Ok(values)
}

/// Gives each slice to `work` with its number, in no order, on up to `threads` threads, each of which makes its first argument
/// for itself by `make`.
pub fn in_slices<T: Send, S>(
    values: &mut [T],
    per_slice: usize,
    threads: usize,
    cancel: &AtomicBool,
    make: impl Fn() -> S + Sync,
    work: impl Fn(&mut S, usize, &mut [T]) + Sync,
) -> Result<(), VolumeError> {
    let is_cancelled = || cancel.load(Ordering::Relaxed);
    in_parts(threads, values, per_slice, make, |own, index, slice| {
        if !is_cancelled() {
            work(own, index, slice);
        }
    });
    if is_cancelled() {
        return Err(VolumeError::Interrupted);
    }
    Ok(())
}
