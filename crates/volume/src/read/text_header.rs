//! Headers that are lines of text, and the files of voxels that they name.

use std::path::{Path, PathBuf};

use super::DAMAGED;
use super::bytes::ByteStream;
use crate::VolumeError;

/// Longest line of a header: the tags of a segment have a few hundred bytes.
const MOST_LINE_BYTES: usize = 1 << 16;
/// Longest header: a segmentation of a hundred structures has a tenth of it.
const MOST_BYTES: usize = 1 << 20;

/// A line of a header: a key and its value.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Entry {
    /// From 1.
    pub(super) line: usize,
    pub(super) key: String,
    pub(super) value: String,
}

impl Entry {
    /// Where it stands, for people.
    pub(super) fn place(&self) -> String {
        format!("line {}, {}", self.line, self.key)
    }

    /// An error about it.
    pub(super) fn refused(&self, message: impl Into<String>) -> VolumeError {
        VolumeError::refused(message).at(self.place())
    }

    /// Its value as just so many numbers, with nothing but blanks between them.
    pub(super) fn numbers(&self, count: usize) -> Result<Vec<f64>, VolumeError> {
        let numbers: Vec<f64> = self
            .value
            .split_whitespace()
            .map(|word| number(word, self))
            .collect::<Result<_, _>>()?;
        if numbers.len() == count {
            Ok(numbers)
        } else {
            Err(self
                .refused(format!("it has {} numbers, not {count}", numbers.len()))
                .hint(DAMAGED))
        }
    }

    /// Its value as lengths of axes: whole numbers from 1 on, `count` of them where that is known.
    pub(super) fn lengths(&self, count: Option<usize>) -> Result<Vec<usize>, VolumeError> {
        let lengths: Vec<usize> = self
            .value
            .split_whitespace()
            .map(|word| {
                word.parse()
                    .ok()
                    .filter(|length| *length > 0)
                    .ok_or_else(|| {
                        self.refused(format!("`{}` is not a number of voxels", shown(word)))
                            .hint(DAMAGED)
                    })
            })
            .collect::<Result<_, _>>()?;
        match count {
            Some(count) if count != lengths.len() => Err(self
                .refused(format!(
                    "it has {} lengths, but there are {count} axes",
                    lengths.len()
                ))
                .hint(DAMAGED)),
            _ => Ok(lengths),
        }
    }

    /// Its value as a whole number.
    pub(super) fn whole<T: std::str::FromStr>(&self) -> Result<T, VolumeError> {
        self.value.trim().parse().map_err(|_| {
            self.refused(format!(
                "`{}` is not a whole number that it may be",
                shown(&self.value)
            ))
            .hint(DAMAGED)
        })
    }
}

/// A finite number of an entry.
pub(super) fn number(word: &str, entry: &Entry) -> Result<f64, VolumeError> {
    word.parse::<f64>()
        .ok()
        .filter(|number| number.is_finite())
        .ok_or_else(|| {
            entry
                .refused(format!("`{}` is not a finite number", shown(word)))
                .hint(DAMAGED)
        })
}

/// The beginning of a value, for a message.
pub(super) fn shown(value: &str) -> String {
    value
        .trim()
        .chars()
        .filter(|letter| !letter.is_control())
        .take(32)
        .collect()
}

/// The lines of a header one after another.
#[derive(Debug)]
pub(super) struct Lines<'a> {
    stream: &'a mut ByteStream,
    number: usize,
    bytes: usize,
}

impl<'a> Lines<'a> {
    /// From where the stream is.
    pub(super) fn of(stream: &'a mut ByteStream) -> Self {
        Self {
            stream,
            number: 0,
            bytes: 0,
        }
    }

    /// The next one with its number; none at the end of the file.
    pub(super) fn next_line(&mut self) -> Result<Option<(usize, String)>, VolumeError> {
        let Some(line) = self.stream.line(MOST_LINE_BYTES)? else {
            return Ok(None);
        };
        self.number += 1;
        self.bytes += line.len();
        if self.bytes > MOST_BYTES {
            return Err(VolumeError::refused(format!(
                "the header has more than {} MiB",
                MOST_BYTES >> 20
            ))
            .hint(DAMAGED));
        }
        Ok(Some((
            self.number,
            String::from_utf8_lossy(&line).into_owned(),
        )))
    }
}

/// The entries of a header, each key once.
#[derive(Debug, Default)]
pub(super) struct Entries(Vec<Entry>);

impl Entries {
    /// Adds one.
    pub(super) fn add(&mut self, entry: Entry) -> Result<(), VolumeError> {
        if let Some(other) = self.get(&entry.key) {
            return Err(entry
                .refused(format!("line {} states it, too", other.line))
                .hint(DAMAGED));
        }
        self.0.push(entry);
        Ok(())
    }

    /// The one of a key.
    pub(super) fn get(&self, key: &str) -> Option<&Entry> {
        self.0.iter().find(|entry| entry.key == key)
    }

    /// The first that there is of several keys for the same.
    pub(super) fn any(&self, keys: &[&str]) -> Option<&Entry> {
        keys.iter().find_map(|key| self.get(key))
    }

    /// The one of a key without which nothing can be read.
    pub(super) fn wanted(&self, key: &str) -> Result<&Entry, VolumeError> {
        self.get(key).ok_or_else(|| {
            VolumeError::refused(format!("the header does not state `{key}`"))
                .at(key)
                .hint(DAMAGED)
        })
    }
}

/// The file of voxels that a header names, which must be beside it: a header from elsewhere reads no other files.
pub(super) fn beside(header: &Path, entry: &Entry) -> Result<PathBuf, VolumeError> {
    let name = entry.value.trim();
    let name = name.strip_prefix("./").unwrap_or(name);
    let is_plain = !name.is_empty()
        && !name.contains(['/', '\\', '\0'])
        && !matches!(name, "." | "..")
        && Path::new(name).file_name().is_some_and(|file| file == name);
    if !is_plain {
        return Err(entry
            .refused("the voxels are in another folder than the header, from where none are read")
            .hint(
                "put both files into one folder, and write the file's name alone into the header",
            ));
    }
    let path = header.with_file_name(name);
    if !path.is_file() {
        return Err(entry
            .refused(format!("there is no `{}` beside the header", shown(name)))
            .hint("the voxels must be next to the header, in the file that it names"));
    }
    Ok(path)
}
