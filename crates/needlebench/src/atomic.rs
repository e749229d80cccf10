//! Files that are either whole or not there.

use std::ffi::OsString;
use std::io;
use std::path::Path;

/// Writes a file under a temporary name and renames it into place.
pub(crate) fn write_atomically(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let mut name: OsString = path.file_name().unwrap_or_default().to_owned();
    name.push(format!(".{}.tmp", std::process::id()));
    let temporary = path.with_file_name(name);
    std::fs::write(&temporary, bytes)
        .and_then(|()| std::fs::rename(&temporary, path))
        .inspect_err(|_| {
            // Nothing more can be done about a leftover than to report the first error.
            let _ = std::fs::remove_file(&temporary);
        })
}
