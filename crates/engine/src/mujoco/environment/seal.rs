//! Whether an environment still is what was installed.
//!
//! Once everything is in place it is sealed: size, times and SHA-256 of each file are written down, under a hash of
//! all that. Later starts only look at sizes and times. A file that anybody writes to, cuts off or replaces has other
//! ones, and is hashed again. A file that was not installed was never checked: Python runs what it finds,
//! a `.pth` at every start. Bytecode is sealed with the rest, once what is used has been imported, and Python is started
//! such that it writes none; other bytecode is removed.
//!
//! A seal is only as good as its folder: a user who may write there may seal anything. Folders that
//! others may write to are therefore not what was installed.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::fs::{self, Metadata};
use std::io;
use std::path::{Path, PathBuf};
use std::time::UNIX_EPOCH;

use crate::mujoco::sha256_hex;
use needlebench_geometry::mesh::other_writers;

use super::install::venv_python;

/// A line for each file, `STATE SHA-256 PATH`, below the hash of these and of what the environment is made of.
const SEAL: &str = "complete";

/// What there is of an environment.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Found {
    /// Nothing that was ever complete.
    Nothing,
    /// All of it, as it was installed.
    Complete,
    /// It was complete; why it is not any more.
    Damaged(String),
}

/// Seals what is in `folder`, made of what `key` stands for.
pub(super) fn seal(folder: &Path, key: &str) -> io::Result<()> {
    for_its_owner_to_write(folder)?;
    let mut lines = String::new();
    for (path, metadata) in files(folder)? {
        let name = path.strip_prefix(folder).unwrap_or(&path).display();
        let sha256 = sha256_hex(&fs::read(&path)?);
        // Writing to a String cannot fail.
        let _ = writeln!(lines, "{} {sha256} {name}", state(&metadata));
    }
    write(folder, key, &lines)
}

/// What there is in `folder` of the environment that `key` stands for.
pub(super) fn look(folder: &Path, key: &str) -> Found {
    let seal = fs::read_to_string(folder.join(SEAL)).unwrap_or_default();
    match seal.split_once('\n') {
        Some((hash, lines)) if hash == sha256_hex(format!("{key}\n{lines}").as_bytes()) => {
            match check(folder, key, lines) {
                Ok(()) => Found::Complete,
                Err(reason) => Found::Damaged(reason),
            }
        }
        // Cut off or garbled, it is evidence of nothing.
        _ => Found::Nothing,
    }
}

fn check(folder: &Path, key: &str, lines: &str) -> Result<(), String> {
    let missing = |path: &Path, error: io::Error| format!("{}: {error}", path.display());
    if let Some(others) = other_writers(folder).map_err(|error| missing(folder, error))? {
        return Err(format!("{} {others}", folder.display()));
    }
    let python = venv_python(folder);
    // A link to an interpreter that has gone is none.
    let interpreter = fs::metadata(&python).map_err(|error| missing(&python, error))?;
    if !interpreter.is_file() {
        return Err(format!("{} is not a file", python.display()));
    }
    let mut renewed = String::new();
    for line in lines.lines() {
        let mut words = line.splitn(3, ' ');
        let [known, sha256, name] = std::array::from_fn(|_| words.next().unwrap_or_default());
        let path = folder.join(name);
        let metadata = fs::symlink_metadata(&path).map_err(|error| missing(&path, error))?;
        let now = state(&metadata);
        if now != known {
            let bytes = fs::read(&path).map_err(|error| missing(&path, error))?;
            if sha256_hex(&bytes) != sha256 {
                return Err(format!("{} is not what was installed", path.display()));
            }
        }
        let _ = writeln!(renewed, "{now} {sha256} {name}");
    }
    let known: BTreeSet<&str> = lines
        .lines()
        .filter_map(|line| line.splitn(3, ' ').nth(2))
        .collect();
    if let Some(added) = added(folder, &known).map_err(|error| missing(folder, error))? {
        return Err(format!("{} was not installed", added.display()));
    }
    if renewed != lines {
        // Copied, for instance; where it cannot be written, the next start hashes again.
        let _ = write(folder, key, &renewed);
    }
    Ok(())
}

/// Takes the right to write to it from all but its owner, whatever the user's mask is.
fn for_its_owner_to_write(folder: &Path) -> io::Result<()> {
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        let mut permissions = fs::metadata(folder)?.permissions();
        permissions.set_mode(permissions.mode() & !0o022);
        fs::set_permissions(folder, permissions)?;
    }
    #[cfg(not(unix))]
    let _ = folder;
    Ok(())
}

/// What Python would rather run than the source beside it.
fn is_bytecode(path: &Path) -> bool {
    path.components()
        .any(|part| part.as_os_str() == "__pycache__")
}

/// A file that is not among those that were sealed, or a link among the packages, where none is installed. Bytecode that
/// a Python wrote that was started by hand is removed and not needed.
fn added(folder: &Path, known: &BTreeSet<&str>) -> io::Result<Option<PathBuf>> {
    let is_added = |(path, metadata): &(PathBuf, Metadata)| {
        let name = path.strip_prefix(folder).unwrap_or(path).to_string_lossy();
        // The seal, and one that is being written.
        if name.starts_with(SEAL) || known.contains(&*name) {
            return false;
        }
        if is_bytecode(path) {
            return fs::remove_file(path).is_err();
        }
        if metadata.is_symlink() {
            return name.contains("site-packages");
        }
        true
    };
    let added = entries(folder)?.into_iter().find(is_added);
    Ok(added.map(|(path, _)| path))
}

/// Replaces the seal as a whole: others may be reading it.
fn write(folder: &Path, key: &str, lines: &str) -> io::Result<()> {
    let hash = sha256_hex(format!("{key}\n{lines}").as_bytes());
    let new = folder.join(format!("{SEAL}.{}", std::process::id()));
    fs::write(&new, format!("{hash}\n{lines}"))?;
    fs::rename(&new, folder.join(SEAL))
}

/// All files below a folder, sorted; no links.
pub(super) fn files(folder: &Path) -> io::Result<Vec<(PathBuf, Metadata)>> {
    let mut found = entries(folder)?;
    found.retain(|(_, metadata)| metadata.is_file());
    Ok(found)
}

/// All that is no folder below a folder, sorted; links are not followed.
fn entries(folder: &Path) -> io::Result<Vec<(PathBuf, Metadata)>> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        let metadata = entry.metadata()?;
        if metadata.is_dir() {
            found.extend(entries(&entry.path())?);
        } else {
            found.push((entry.path(), metadata));
        }
    }
    found.sort_by(|(a, _), (b, _)| a.cmp(b));
    Ok(found)
}

/// Size and times of a file: every write changes one of them.
fn state(metadata: &Metadata) -> String {
    let modified = metadata.modified().ok();
    let modified = modified.and_then(|time| time.duration_since(UNIX_EPOCH).ok());
    let modified = modified.map_or(0, |time| time.as_nanos());
    format!("{}:{modified}:{}", metadata.len(), changed(metadata))
}

/// When the file's entry was changed last, which cannot be set back.
#[cfg(unix)]
fn changed(metadata: &Metadata) -> String {
    use std::os::unix::fs::MetadataExt;
    format!("{}.{}", metadata.ctime(), metadata.ctime_nsec())
}

#[cfg(not(unix))]
fn changed(_: &Metadata) -> String {
    String::new()
}

#[cfg(test)]
mod tests {
    use super::*;

    const FILES: [&str; 3] = ["venv/pyvenv.cfg", "venv/lib/tiny/a.py", "requirements.lock"];

    fn sealed() -> tempfile::TempDir {
        let cache = tempfile::tempdir().unwrap();
        let python = venv_python(cache.path());
        for file in FILES
            .map(|name| cache.path().join(name))
            .iter()
            .chain([&python])
        {
            fs::create_dir_all(file.parent().unwrap()).unwrap();
            fs::write(file, "a = 1\n").unwrap();
        }
        seal(cache.path(), "key").unwrap();
        cache
    }

    #[track_caller]
    fn is_damaged(cache: &Path, file: &Path) {
        let found = look(cache, "key");
        let Found::Damaged(reason) = &found else {
            panic!("{}: {found:?}", file.display());
        };
        assert!(reason.contains(file.to_str().unwrap()), "{reason}");
    }

    #[test]
    fn every_file_that_is_not_what_was_installed_is_named() {
        let ways: [fn(&Path); 3] = [
            |file| fs::remove_file(file).unwrap(),
            // Cut off, and changed in place.
            |file| fs::write(file, "a = 1").unwrap(),
            |file| fs::write(file, "a = 2\n").unwrap(),
        ];
        for damage in ways {
            for name in FILES {
                let cache = sealed();
                assert_eq!(look(cache.path(), "key"), Found::Complete);
                let file = cache.path().join(name);
                damage(&file);
                is_damaged(cache.path(), &file);
            }
        }
        let cache = sealed();
        let python = venv_python(cache.path());
        fs::remove_file(&python).unwrap();
        is_damaged(cache.path(), &python);
    }

    #[test]
    fn a_file_that_was_not_installed_is_named() {
        for name in [
            "venv/lib/tiny/evil.pth",
            "sitecustomize.py",
            "venv/lib/new/b.so",
        ] {
            let cache = sealed();
            let file = cache.path().join(name);
            fs::create_dir_all(file.parent().unwrap()).unwrap();
            fs::write(&file, "import os\n").unwrap();
            is_damaged(cache.path(), &file);
        }
    }

    #[test]
    fn bytecode_is_what_was_sealed_or_is_removed() {
        let cache = sealed();
        let bytecode = cache.path().join("venv/lib/tiny/__pycache__");
        fs::create_dir(&bytecode).unwrap();
        let file = bytecode.join("a.pyc");
        fs::write(&file, "").unwrap();
        assert_eq!(look(cache.path(), "key"), Found::Complete);
        assert!(!file.exists());

        fs::write(&file, "sealed").unwrap();
        fs::remove_file(cache.path().join(SEAL)).unwrap();
        seal(cache.path(), "key").unwrap();
        assert_eq!(look(cache.path(), "key"), Found::Complete);
        assert!(file.exists());
        fs::write(&file, "another").unwrap();
        is_damaged(cache.path(), &file);
    }

    #[cfg(unix)]
    #[test]
    fn a_folder_that_everybody_may_write_to_is_no_place_for_a_seal() {
        use std::os::unix::fs::PermissionsExt;
        let cache = sealed();
        fs::set_permissions(cache.path(), fs::Permissions::from_mode(0o777)).unwrap();
        is_damaged(cache.path(), cache.path());
        fs::set_permissions(cache.path(), fs::Permissions::from_mode(0o755)).unwrap();
        assert_eq!(look(cache.path(), "key"), Found::Complete);
    }

    #[test]
    fn a_seal_that_was_changed_or_is_for_something_else_is_none() {
        let cache = sealed();
        assert_eq!(look(cache.path(), "another key"), Found::Nothing);
        let seal = cache.path().join(SEAL);
        let text = fs::read_to_string(&seal).unwrap();
        let shorter = &text[..=text.trim_end().rfind('\n').unwrap()];
        for changed in [shorter, &text.replace(" venv", " Venv"), ""] {
            fs::write(&seal, changed).unwrap();
            assert_eq!(look(cache.path(), "key"), Found::Nothing);
        }
        fs::remove_file(&seal).unwrap();
        assert_eq!(look(cache.path(), "key"), Found::Nothing);
    }

    #[test]
    fn files_with_other_times_are_hashed_once_more_and_not_again() {
        let cache = sealed();
        let seal = || fs::read_to_string(cache.path().join(SEAL)).unwrap();
        let before = seal();
        let file = fs::File::options()
            .append(true)
            .open(cache.path().join(FILES[1]));
        file.unwrap().set_modified(UNIX_EPOCH).unwrap();
        assert_eq!(look(cache.path(), "key"), Found::Complete);
        let after = seal();
        assert_ne!(before, after);
        assert_eq!(look(cache.path(), "key"), Found::Complete);
        assert_eq!(seal(), after);
    }
}
