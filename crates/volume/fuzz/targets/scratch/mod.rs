//! A file in memory that is written anew for each input.

use std::path::PathBuf;
use std::sync::OnceLock;
use std::sync::atomic::AtomicBool;

use nalgebra::{Matrix3, Point3, Vector3};
use needlebench_volume::VoxelGrid;
use needlebench_volume::read::{ReadOptions, read_labels, read_volume};

/// Voxels may take this much: what a header asks for beyond it is refused before memory is taken.
const MEMORY: u64 = 1 << 22;

static FOLDER: OnceLock<PathBuf> = OnceLock::new();

/// Reads bytes as the file `name`: as a volume, and as its own label map, or that of the corpus's slices.
pub fn read(name: &str, bytes: &[u8]) {
    let folder = FOLDER.get_or_init(|| {
        let folder = PathBuf::from(format!("/dev/shm/needlebench-fuzz-{}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("a folder in memory");
        folder
    });
    let path = folder.join(name);
    std::fs::write(&path, bytes).expect("a file in memory");
    let options = ReadOptions {
        fill_gaps: true,
        assume_orientation: "LPS".parse().ok(),
        max_bytes: MEMORY,
        ..ReadOptions::default()
    };
    let never = AtomicBool::new(false);
    let grid = match read_volume(&path, &options, 1, &never) {
        Ok(read) => {
            assert_eq!(read.volume.hu.len(), read.volume.grid.len());
            read.volume.grid
        }
        Err(_) => slices(),
    };
    if let Ok(read) = read_labels(&path, &grid, &options, &never) {
        assert_eq!(read.labels.labels.len(), grid.len());
    }
}

/// Of the corpus's slices, which its segmentations are of.
fn slices() -> VoxelGrid {
    let steps_m = Matrix3::from_diagonal(&Vector3::new(0.5e-3, 0.75e-3, 2e-3));
    VoxelGrid::new([5, 4, 3], steps_m, Point3::new(-10e-3, 20e-3, 0.0)).expect("a grid")
}
