//! Slices on several threads.

use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::{ImagingError, VoxelGrid};

/// Memory for a value per voxel.
pub(super) fn room_for<T: Clone + Default>(grid: &VoxelGrid) -> Result<Vec<T>, ImagingError> {
    let mut values = Vec::new();
    values.try_reserve_exact(grid.len()).map_err(|_| {
        let [columns, rows, slices] = grid.size();
        let bytes = grid.len().saturating_mul(size_of::<T>());
        ImagingError::refused(format!(
            "{columns} x {rows} x {slices} voxels need {} MB of memory, which is not to be had",
            bytes / 1_000_000
        ))
        .hint("fewer or larger voxels")
    })?;
    values.resize(grid.len(), T::default());
    Ok(values)
}

/// Gives each slice to `work`, whose first argument each thread makes for itself by `make`; on at most `threads` threads, in no order.
pub(super) fn in_slices<T: Send, S>(
    values: &mut [T],
    per_slice: usize,
    threads: usize,
    cancel: &AtomicBool,
    make: impl Fn() -> S + Sync,
    work: impl Fn(&mut S, usize, &mut [T]) + Sync,
) -> Result<(), ImagingError> {
    let slices = Mutex::new(values.chunks_mut(per_slice).enumerate());
    let count = slices.lock().map_or(1, |slices| slices.len());
    std::thread::scope(|scope| {
        for _ in 0..threads.clamp(1, count.max(1)) {
            scope.spawn(|| {
                let mut own = make();
                loop {
                    let next = slices.lock().ok().and_then(|mut slices| slices.next());
                    let Some((index, slice)) = next else { break };
                    if cancel.load(Ordering::Relaxed) {
                        break;
                    }
                    work(&mut own, index, slice);
                }
            });
        }
    });
    if cancel.load(Ordering::Relaxed) {
        return Err(ImagingError::Interrupted);
    }
    Ok(())
}
