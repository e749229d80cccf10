//! Folders of shards: found below others, and read.

use std::cmp::Ordering;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use super::error::StudyError;
use super::manifest::{MANIFEST_FILE, Manifest, Shard, Status};
use super::ordered::in_order;

/// How far below a folder shards are looked for: `DIR/K/NAME`, as `--out DIR/K` makes them, in `NAME/shards`.
const DEPTH: usize = 3;

/// A folder of a shard.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct ShardFolder {
    pub(crate) path: PathBuf,
    /// Which part of the study it is of: all of it without one.
    pub(crate) shard: Option<Shard>,
    /// What its manifest says.
    pub(crate) status: Status,
}

/// Folders of one study.
#[derive(Debug)]
pub(crate) struct ShardFolders {
    /// That of the whole study.
    pub(crate) manifest: Manifest,
    pub(crate) folders: Vec<ShardFolder>,
    /// Those below the given ones that are of studies of other names.
    pub(crate) others: Vec<PathBuf>,
}

/// A folder with a manifest.
struct Found {
    path: PathBuf,
    /// Named by the user, not found below what he has named.
    given: bool,
}

/// What becomes of a given folder in which no study is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum EmptyFolder {
    Refused,
    LeftOut,
}

/// The folders of shards that are meant by some: those themselves that have a manifest, and those below the
/// others that do. `out`, where results go, is none of them.
///
/// `study` is what they have to be shards of: that of the first one if it is left out.
///
/// # Errors
/// [`StudyError::OtherStudy`] if one is of another study; `empty` says what becomes of those in which nothing
/// is. `None` if there is no folder and no `study`.
pub(crate) fn shard_folders(
    given: &[PathBuf],
    out: Option<&Path>,
    study: Option<&Manifest>,
    empty: EmptyFolder,
    threads: usize,
) -> Result<Option<ShardFolders>, StudyError> {
    let found = find(given, out, empty)?;
    let first;
    let study = match (study, found.first()) {
        (Some(study), _) => study,
        (None, None) => return Ok(None),
        (None, Some(found)) => {
            first = read(&found.path)?;
            &first
        }
    };
    let mut folders = Vec::new();
    let mut others = Vec::new();
    in_order(
        found.len() as u64,
        threads,
        |index| {
            let found = &found[usize::try_from(index).expect("an index of a list")];
            let manifest = read(&found.path)?;
            if !found.given && manifest.name != study.name {
                return Ok((found, None));
            }
            match study.other_study(&found.path, &manifest) {
                Some(error) => Err(error),
                None => Ok((found, Some((manifest.shard, manifest.status)))),
            }
        },
        |(found, manifest)| {
            let path = found.path.clone();
            match manifest {
                None => others.push(path),
                Some((shard, status)) => folders.push(ShardFolder {
                    path,
                    shard,
                    status,
                }),
            }
            Ok(())
        },
    )?;
    Ok(Some(ShardFolders {
        manifest: Manifest {
            shard: None,
            status: Status::Running,
            ..study.clone()
        },
        folders,
        others,
    }))
}

fn read(folder: &Path) -> Result<Manifest, StudyError> {
    Manifest::read(folder)?.ok_or_else(|| {
        StudyError::file(
            folder,
            "holds no study\nhint: give the folders of its shards, or their parent folder",
        )
    })
}

fn find(
    given: &[PathBuf],
    out: Option<&Path>,
    empty: EmptyFolder,
) -> Result<Vec<Found>, StudyError> {
    let out = out.and_then(|out| out.canonicalize().ok());
    let mut seen = BTreeSet::new();
    let mut found = Vec::new();
    for folder in given {
        let is_out = |path: &Path| out.is_some() && path.canonicalize().ok() == out;
        let mut paths = Vec::new();
        if folder.join(MANIFEST_FILE).exists() && !is_out(folder) {
            paths.push(folder.clone());
        } else {
            below(folder, DEPTH, &is_out, &mut paths)?;
        }
        // Refused when it is read.
        if paths.is_empty() && !is_out(folder) && empty == EmptyFolder::Refused {
            paths.push(folder.clone());
        }
        paths.sort_by(|a, b| natural(&a.to_string_lossy(), &b.to_string_lossy()));
        for path in paths {
            let real = path.canonicalize().unwrap_or_else(|_| path.clone());
            if seen.insert(real) {
                let given = path == *folder;
                found.push(Found { path, given });
            }
        }
    }
    Ok(found)
}

/// Folders with a manifest below one.
fn below(
    folder: &Path,
    depth: usize,
    is_out: &dyn Fn(&Path) -> bool,
    found: &mut Vec<PathBuf>,
) -> Result<(), StudyError> {
    let entries = match std::fs::read_dir(folder) {
        Ok(entries) => entries,
        // What is no folder has no studies in it.
        Err(error)
            if matches!(
                error.kind(),
                std::io::ErrorKind::NotFound | std::io::ErrorKind::NotADirectory
            ) =>
        {
            return Ok(());
        }
        Err(error) => return Err(StudyError::io("read", folder)(error)),
    };
    for entry in entries {
        let path = entry.map_err(StudyError::io("read", folder))?.path();
        if !path.is_dir() {
            continue;
        }
        if path.join(MANIFEST_FILE).exists() && !is_out(&path) {
            found.push(path);
        } else if depth > 1 {
            below(&path, depth - 1, is_out, found)?;
        }
    }
    Ok(())
}

/// Order of names in which 10 comes after 9.
fn natural(a: &str, b: &str) -> Ordering {
    let (mut a, mut b) = (a, b);
    loop {
        let (Some(first_of_a), Some(first_of_b)) = (a.chars().next(), b.chars().next()) else {
            return a.len().cmp(&b.len());
        };
        if first_of_a.is_ascii_digit() && first_of_b.is_ascii_digit() {
            let digits = |text: &str| {
                text.find(|letter: char| !letter.is_ascii_digit())
                    .unwrap_or(text.len())
            };
            let (of_a, of_b) = (a.split_at(digits(a)), b.split_at(digits(b)));
            let [value_of_a, value_of_b] =
                [of_a.0, of_b.0].map(|text| text.trim_start_matches('0'));
            let order = value_of_a
                .len()
                .cmp(&value_of_b.len())
                .then_with(|| value_of_a.cmp(value_of_b))
                .then_with(|| of_a.0.len().cmp(&of_b.0.len()));
            if order != Ordering::Equal {
                return order;
            }
            (a, b) = (of_a.1, of_b.1);
        } else {
            let order = first_of_a.cmp(&first_of_b);
            if order != Ordering::Equal {
                return order;
            }
            a = &a[first_of_a.len_utf8()..];
            b = &b[first_of_b.len_utf8()..];
        }
    }
}

/// Numbers as arrays of job schedulers have them: `3,17,20-24`. They have to be in order.
pub fn ranges(numbers: impl IntoIterator<Item = u32>) -> String {
    let mut runs: Vec<(u32, u32)> = Vec::new();
    for number in numbers {
        match runs.last_mut() {
            Some((_, last)) if last.checked_add(1) == Some(number) => *last = number,
            _ => runs.push((number, number)),
        }
    }
    let runs = runs.into_iter().map(|(first, last)| match last - first {
        0 => first.to_string(),
        1 => format!("{first},{last}"),
        _ => format!("{first}-{last}"),
    });
    runs.collect::<Vec<_>>().join(",")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_are_written_short() {
        for (numbers, text) in [
            (&[][..], ""),
            (&[7], "7"),
            (&[3, 17, 201], "3,17,201"),
            (&[3, 4, 5, 6, 7, 8, 9, 17], "3-9,17"),
            (&[1, 2, 4, 5, 6, u32::MAX], "1,2,4-6,4294967295"),
        ] {
            assert_eq!(ranges(numbers.iter().copied()), text);
        }
    }

    #[test]
    fn ten_comes_after_nine() {
        let mut names = ["s10", "s9", "s9a", "t", "s09", "s", "10", "9/x", "9"];
        names.sort_by(|a, b| natural(a, b));
        assert_eq!(
            names,
            ["9", "9/x", "10", "s", "s9", "s9a", "s09", "s10", "t"]
        );
    }
}
