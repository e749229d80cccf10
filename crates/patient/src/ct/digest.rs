//! Digests of voxels, by which files belong together.

use std::fmt::Write as _;

use sha2::{Digest, Sha256};

/// Digest of voxels as their file has them.
pub(super) fn voxels_sha256<T: Copy>(values: &[T], bytes: impl Fn(T) -> [u8; 2]) -> String {
    /// Values that are hashed at a time.
    const BLOCK: usize = 1 << 15;
    let mut hash = Sha256::new();
    let mut buffer = Vec::with_capacity(2 * BLOCK);
    for block in values.chunks(BLOCK) {
        buffer.clear();
        buffer.extend(block.iter().flat_map(|value| bytes(*value)));
        hash.update(&buffer);
    }
    let mut text = String::with_capacity(64);
    for byte in hash.finalize() {
        let _ = write!(text, "{byte:02x}");
    }
    text
}
