//! A file in memory that is written anew for each input.

use std::path::PathBuf;
use std::sync::OnceLock;
use std::sync::atomic::AtomicBool;

use needlebench_imaging::read::{ReadOptions, read_labels, read_volume};

/// Voxels may take this much: what a header asks for beyond it is refused before memory is taken.
const MEMORY: u64 = 1 << 22;

static FOLDER: OnceLock<PathBuf> = OnceLock::new();

/// Reads bytes as the file `name`: as a volume, and as its own label map.
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
    if let Ok(read) = read_volume(&path, &options, 1, &never) {
        assert_eq!(read.volume.hu.len(), read.volume.grid.len());
        let _ = read_labels(&path, &read.volume.grid, &options, &never);
    }
}
