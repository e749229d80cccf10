//! DICOMDIR: the index of a disc, and the files that it names.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::dataset::DataSet;
use super::file::OpenedFile;
use super::tag;
use crate::{Remark, VolumeError};

/// Media Storage Directory Storage.
const SOP_CLASS: &str = "1.2.840.10008.1.3.10";

/// What an index names.
#[derive(Debug)]
pub(super) struct Directory {
    /// That are there.
    pub(super) files: Vec<PathBuf>,
    /// As the index calls them, with `/` between folders.
    missing: Vec<String>,
}

impl Directory {
    /// Of the index at `path`; none of any other file.
    pub(super) fn of(opened: &OpenedFile, path: &Path) -> Option<Self> {
        let sop_class = opened
            .sop_class
            .clone()
            .or_else(|| opened.data.text(tag::SOP_CLASS));
        if sop_class.as_deref() != Some(SOP_CLASS) {
            return None;
        }
        let mut folders = Folders {
            root: path.parent().unwrap_or(Path::new("")).to_owned(),
            listed: BTreeMap::new(),
        };
        let (mut files, mut missing) = (Vec::new(), Vec::new());
        for record in opened.data.items(tag::DIRECTORY_RECORDS) {
            let Some(parts) = parts(record) else { continue };
            match folders.find(&parts) {
                Some(file) => files.push(file),
                None => missing.push(parts.join("/")),
            }
        }
        files.sort();
        files.dedup();
        missing.sort();
        missing.dedup();
        Some(Self { files, missing })
    }

    /// Refuses an index by which nothing can be read.
    pub(super) fn check(&self) -> Result<(), VolumeError> {
        if !self.files.is_empty() {
            return Ok(());
        }
        Err(match self.missing.first() {
            None => VolumeError::refused("it is a DICOMDIR, but names no files")
                .hint("name the folder with the DICOM files of a scan"),
            Some(first) => VolumeError::refused(format!(
                "it is a DICOMDIR, but none of the {} files that it names is there, such as {first}",
                self.missing.len()
            ))
            .hint("copy the whole disc, with the folders beside the DICOMDIR"),
        })
    }

    /// That files are missing.
    pub(super) fn remark(&self, name: &str) -> Option<Remark> {
        let first = self.missing.first()?;
        let count = self.missing.len();
        let all = count + self.files.len();
        Some(
            Remark::new(format!(
                "{count} of the {all} files that the DICOMDIR names are missing, such as {first}"
            ))
            .at(name),
        )
    }
}

/// Folders and name of the file of a record; none of a record without one.
fn parts(record: &DataSet) -> Option<Vec<String>> {
    let text = record.text(tag::REFERENCED_FILE)?;
    Some(
        text.split('\\')
            .map(|part| part.trim().to_owned())
            .collect(),
    )
}

/// Folders of a disc, some of which were copied with other letters, or with the version numbers of ISO 9660.
struct Folders {
    root: PathBuf,
    listed: BTreeMap<PathBuf, BTreeMap<String, PathBuf>>,
}

impl Folders {
    fn find(&mut self, parts: &[String]) -> Option<PathBuf> {
        let mut path = self.root.clone();
        for part in parts {
            let is_name =
                !matches!(part.as_str(), "" | "." | "..") && !part.contains(['/', '\\', ':']);
            if !is_name {
                return None;
            }
            let exact = path.join(part);
            path = if exact.exists() {
                exact
            } else {
                let names = self
                    .listed
                    .entry(path)
                    .or_insert_with_key(|folder| listed(folder));
                names.get(&plain(part))?.clone()
            };
        }
        path.is_file().then_some(path)
    }
}

fn listed(folder: &Path) -> BTreeMap<String, PathBuf> {
    let entries = folder.read_dir().into_iter().flatten().flatten();
    entries
        .map(|entry| (plain(&entry.file_name().to_string_lossy()), entry.path()))
        .collect()
}

/// A name without what copies change: `im0001.;1` is `IM0001`.
fn plain(name: &str) -> String {
    let name = name.split_once(';').map_or(name, |(name, _)| name);
    name.trim_end_matches('.').to_ascii_uppercase()
}
