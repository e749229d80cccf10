//! Keeps two set-ups at the same time, and the remains of dead ones, apart.

use std::fs::{self, File, TryLockError};
use std::io;
use std::path::{Path, PathBuf};
use std::thread;
use std::time::{Duration, Instant};

/// Between the names of an environment and of the set-up in progress: `harness-0f3a.tmp-117-2`.
const STAGING_MARK: &str = ".tmp-";

/// Held while an environment is being made; the operating system frees it when its holder dies.
#[derive(Debug)]
pub(super) struct Guard {
    _file: File,
}

impl Guard {
    /// Waits for the guard of `target`; `None` when somebody else holds it for longer than `limit`.
    pub(super) fn acquire(
        target: &Path,
        limit: Duration,
        mut on_wait: impl FnMut(),
    ) -> io::Result<Option<Self>> {
        let file = File::create(guard_path(target))?;
        let asked = Instant::now();
        let mut told = false;
        // Other errors than "held" come from network file systems without locks. Two set-ups may
        // then do the work twice, but each in its own folder, and the first to be renamed stays.
        while matches!(file.try_lock(), Err(TryLockError::WouldBlock)) {
            if asked.elapsed() > limit {
                return Ok(None);
            }
            if !told {
                on_wait();
                told = true;
            }
            thread::sleep(Duration::from_millis(100));
        }
        Ok(Some(Self { _file: file }))
    }
}

fn guard_path(target: &Path) -> PathBuf {
    let mut path = target.as_os_str().to_owned();
    path.push(".guard");
    PathBuf::from(path)
}

/// A folder beside `target` in which an environment is made; removed again unless it is published.
#[derive(Debug)]
pub(super) struct Staging {
    pub(super) folder: PathBuf,
}

impl Staging {
    pub(super) fn beside(target: &Path) -> io::Result<Self> {
        let process = std::process::id();
        let mut attempt = 0_u32;
        loop {
            let mut folder = target.as_os_str().to_owned();
            folder.push(format!("{STAGING_MARK}{process}-{attempt}"));
            let folder = PathBuf::from(folder);
            match fs::create_dir(&folder) {
                Ok(()) => return Ok(Self { folder }),
                // Another thread, or a dead process that had the same id.
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists => attempt += 1,
                Err(error) => return Err(error),
            }
        }
    }

    /// Renames the folder to `target`, unless a complete environment has come to be there.
    pub(super) fn publish(self, target: &Path, is_complete: impl Fn() -> bool) -> io::Result<()> {
        match fs::rename(&self.folder, target) {
            Ok(()) => return Ok(()),
            Err(_) if is_complete() => return Ok(()),
            Err(error) if !target.exists() => return Err(error),
            Err(_) => {}
        }
        // What stands there is not complete and nobody's: its maker would hold the guard.
        fs::remove_dir_all(target)?;
        match fs::rename(&self.folder, target) {
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

/// Removes the set-ups that died half-way: those whose guard nobody holds.
///
/// `target` is the environment whose guard the caller itself holds. Folders that cannot be removed
/// stay; they only take space.
pub(super) fn remove_dead_staging(target: &Path) {
    let Some(parent) = target.parent() else {
        return;
    };
    for entry in fs::read_dir(parent).into_iter().flatten().flatten() {
        let name = entry.file_name();
        let Some((owner, _)) = name.to_str().and_then(|n| n.split_once(STAGING_MARK)) else {
            continue;
        };
        if !owner.starts_with("harness-") {
            continue;
        }
        let owner = parent.join(owner);
        // Kept until the folder is gone, so that nobody starts meanwhile.
        let _guard = if owner == target {
            None
        } else {
            match Guard::acquire(&owner, Duration::ZERO, || {}) {
                Ok(Some(guard)) => Some(guard),
                _ => continue,
            }
        };
        let _ = fs::remove_dir_all(entry.path());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wait_not(target: &Path) -> Option<Guard> {
        Guard::acquire(target, Duration::ZERO, || {}).unwrap()
    }

    #[test]
    fn guard_is_held_by_one_at_a_time() {
        let cache = tempfile::tempdir().unwrap();
        let target = cache.path().join("harness-1");
        let guard = wait_not(&target);
        assert!(guard.is_some());
        assert!(wait_not(&target).is_none());
        drop(guard);
        assert!(wait_not(&target).is_some());
    }

    #[test]
    fn only_dead_staging_is_removed() {
        let cache = tempfile::tempdir().unwrap();
        let [ours, dead, alive] = ["harness-1", "harness-2", "harness-3"].map(|name| {
            let target = cache.path().join(name);
            fs::create_dir(cache.path().join(format!("{name}.tmp-1-0"))).unwrap();
            target
        });
        let complete = cache.path().join("harness-4");
        fs::create_dir(&complete).unwrap();
        let _our_guard = wait_not(&ours);
        let _their_guard = wait_not(&alive);
        remove_dead_staging(&ours);
        let staged = |target: &Path| target.with_extension("tmp-1-0").exists();
        assert!(!staged(&ours));
        assert!(!staged(&dead));
        assert!(staged(&alive));
        assert!(complete.exists());
    }

    #[test]
    fn publishing_replaces_an_incomplete_environment() {
        let cache = tempfile::tempdir().unwrap();
        let target = cache.path().join("harness-1");
        fs::create_dir(&target).unwrap();
        fs::write(target.join("half"), "").unwrap();
        let staging = Staging::beside(&target).unwrap();
        fs::write(staging.folder.join("whole"), "").unwrap();
        staging.publish(&target, || false).unwrap();
        assert!(target.join("whole").exists());
        assert!(!target.join("half").exists());
    }

    #[test]
    fn publishing_keeps_a_complete_environment() {
        let cache = tempfile::tempdir().unwrap();
        let target = cache.path().join("harness-1");
        fs::create_dir(&target).unwrap();
        fs::write(target.join("first"), "").unwrap();
        let staging = Staging::beside(&target).unwrap();
        let folder = staging.folder.clone();
        staging.publish(&target, || true).unwrap();
        assert!(target.join("first").exists());
        assert!(!folder.exists());
    }

    #[test]
    fn abandoned_staging_leaves_nothing() {
        let cache = tempfile::tempdir().unwrap();
        let target = cache.path().join("harness-1");
        drop(Staging::beside(&target).unwrap());
        assert_eq!(fs::read_dir(cache.path()).unwrap().count(), 0);
    }
}
