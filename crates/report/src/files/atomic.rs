//! Files that are either whole or not there.

use std::io::{self, Write};
use std::path::Path;

use needlebench_volume::write::stream;

/// Writes a file beside its place first and then renames it, so that a partial file is never visible.
/// Who may read it is decided by the user's mask, as of any file.
///
/// It is not made to outlive a power failure: a run is made again. What a study has computed in days
/// is, by the store's own `AtomicFile`, which waits for the disk.
pub fn write_atomically(path: &Path, bytes: &[u8]) -> io::Result<()> {
    stream_atomically(path, &mut |file| file.write_all(bytes))
}

/// The same of what is written bit by bit: it is never in memory as a whole.
pub(super) fn stream_atomically(
    path: &Path,
    write: &mut dyn FnMut(&mut dyn Write) -> io::Result<()>,
) -> io::Result<()> {
    stream(path, |file| write(file))?;
    tracing::debug!(
        file = %path.display(),
        bytes = path.metadata().map_or(0, |file| file.len()),
        "written"
    );
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_there_is_replaced_and_nothing_else_is_left() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("report.json");
        for text in ["first", "second"] {
            write_atomically(&path, text.as_bytes()).unwrap();
            assert_eq!(std::fs::read_to_string(&path).unwrap(), text);
        }
        assert_eq!(folder.path().read_dir().unwrap().count(), 1);
        let missing = folder.path().join("missing").join("report.json");
        assert!(write_atomically(&missing, b"").is_err());
        // A folder cannot be replaced; the temporary file goes all the same.
        assert!(write_atomically(folder.path(), b"").is_err());
        assert_eq!(folder.path().read_dir().unwrap().count(), 1);
    }

    #[cfg(unix)]
    #[test]
    fn others_may_read_it_as_any_file() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let [ours, usual] = ["ours", "usual"].map(|name| folder.path().join(name));
        write_atomically(&ours, b"").unwrap();
        std::fs::write(&usual, b"").unwrap();
        let [ours, usual] = [ours, usual].map(|path| path.metadata().unwrap().permissions().mode());
        assert_eq!(ours, usual);
    }
}
