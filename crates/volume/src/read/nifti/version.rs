//! Version and byte order, which the first four bytes tell.

/// Bytes of the header of NIfTI-1.
pub(super) const BYTES_1: usize = 348;
/// Bytes of the header of NIfTI-2.
pub(super) const BYTES_2: usize = 540;

/// Whether bytes begin with the size of a header, in either byte order.
pub(in crate::read) fn begins_as_header(first: &[u8]) -> bool {
    version_of(first).is_some()
}

/// Version and byte order.
pub(super) fn version_of(first: &[u8]) -> Option<(u8, bool)> {
    let size: [u8; 4] = first.get(..4)?.try_into().ok()?;
    [(1, BYTES_1), (2, BYTES_2)]
        .into_iter()
        .find_map(|(version, bytes)| {
            let bytes = u32::try_from(bytes).ok()?;
            if u32::from_le_bytes(size) == bytes {
                Some((version, false))
            } else if u32::from_be_bytes(size) == bytes {
                Some((version, true))
            } else {
                None
            }
        })
}
