//! An environment is there whole or not at all, however many processes make one, and whenever they end.

use std::fs::{self, File, TryLockError};
use std::io;
use std::path::{Path, PathBuf};
use std::thread;
use std::time::{Duration, Instant};

/// Between the names of an environment and of the set-up in progress: `harness-0f3a.tmp-117-2`.
const MARK: &str = ".tmp-";

/// Held while an environment is being made; the operating system frees it when its holder dies.
#[derive(Debug)]
pub(super) struct Guard {
    _file: File,
}

impl Guard {
    /// Waits for the guard of a folder of environments; `None` when another process holds it for longer than `limit`.
    ///
    /// Set-ups that died half-way are gone then: who makes one holds the guard.
    pub(super) fn acquire(
        cache: &Path,
        limit: Duration,
        mut on_wait: impl FnMut(),
    ) -> io::Result<Option<Self>> {
        let file = File::create(cache.join("guard"))?;
        let asked = Instant::now();
        let mut on_wait = Some(&mut on_wait);
        let locked = loop {
            match file.try_lock() {
                Err(TryLockError::WouldBlock) if asked.elapsed() > limit => return Ok(None),
                Err(TryLockError::WouldBlock) => {
                    if let Some(tell) = on_wait.take() {
                        tell();
                    }
                    thread::sleep(Duration::from_millis(100));
                }
                // Network file systems without locks. Two set-ups may then do the work twice, but each in its
                // own folder, and the first to be renamed stays.
                Err(TryLockError::Error(_)) => break false,
                Ok(()) => break true,
            }
        };
        for entry in fs::read_dir(cache).into_iter().flatten().flatten() {
            let name = entry.file_name();
            if locked && name.to_string_lossy().contains(MARK) {
                // A leftover only takes space.
                let _ = fs::remove_dir_all(entry.path());
            }
        }
        Ok(Some(Self { _file: file }))
    }
}

/// A folder beside its target; removed again unless it is published.
#[derive(Debug)]
pub(super) struct Staging {
    pub(super) folder: PathBuf,
}

impl Staging {
    pub(super) fn beside(target: &Path) -> io::Result<Self> {
        let process = std::process::id();
        for attempt in 0_u32.. {
            let mut folder = target.as_os_str().to_owned();
            folder.push(format!("{MARK}{process}-{attempt}"));
            let folder = PathBuf::from(folder);
            match fs::create_dir(&folder) {
                Ok(()) => return Ok(Self { folder }),
                // Another thread, or a dead process that had the same id.
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
                Err(error) => return Err(error),
            }
        }
        Err(io::ErrorKind::AlreadyExists.into())
    }

    /// Renames the folder to `target`, unless a complete environment has come to be there.
    pub(super) fn publish(self, target: &Path, is_complete: impl Fn() -> bool) -> io::Result<()> {
        let renamed = || fs::rename(&self.folder, target);
        if renamed().is_ok() || is_complete() {
            return Ok(());
        }
        if target.exists() {
            // Not complete and nobody's: its maker would hold the guard.
            fs::remove_dir_all(target)?;
        }
        match renamed() {
            Err(error) if !is_complete() => Err(error),
            _ => Ok(()),
        }
    }
}

impl Drop for Staging {
    fn drop(&mut self) {
        // Renamed away, or removed by the next set-up.
        let _ = fs::remove_dir_all(&self.folder);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn guard_is_held_by_one_at_a_time_and_only_its_holder_clears_up() {
        let cache = tempfile::tempdir().unwrap();
        let acquire = || Guard::acquire(cache.path(), Duration::ZERO, || {}).unwrap();
        let complete = cache.path().join("harness-1");
        fs::create_dir(&complete).unwrap();
        let guard = acquire();
        assert!(guard.is_some());
        let alive = Staging::beside(&complete).unwrap();
        assert!(acquire().is_none());
        assert!(alive.folder.exists());
        // Its maker dies, and nothing of it is dropped.
        let dead = alive.folder.clone();
        std::mem::forget(alive);
        drop(guard);
        assert!(acquire().is_some());
        assert!(!dead.exists() && complete.exists());
    }

    #[test]
    fn publishing_replaces_what_is_incomplete_and_keeps_what_is_complete() {
        for complete in [false, true] {
            let cache = tempfile::tempdir().unwrap();
            let target = cache.path().join("harness-1");
            fs::create_dir(&target).unwrap();
            fs::write(target.join("first"), "").unwrap();
            let staging = Staging::beside(&target).unwrap();
            let folder = staging.folder.clone();
            fs::write(folder.join("second"), "").unwrap();
            staging.publish(&target, || complete).unwrap();
            assert_eq!(target.join("first").exists(), complete);
            assert_eq!(target.join("second").exists(), !complete);
            assert!(!folder.exists());
        }
    }

    #[test]
    fn abandoned_staging_leaves_nothing() {
        let cache = tempfile::tempdir().unwrap();
        drop(Staging::beside(&cache.path().join("harness-1")).unwrap());
        assert_eq!(fs::read_dir(cache.path()).unwrap().count(), 0);
    }
}
