//! `study.json`: what a folder's results are results of.

use std::collections::BTreeMap;
use std::fmt;
use std::path::Path;
use std::str::FromStr;

use needlebench_input::{InputError, read_data_text};
use serde::{Deserialize, Serialize};

use super::atomic::write_atomically;
use super::case_design::CaseDesign;
use super::error::StudyError;
use crate::{Factor, MetricColumn};

/// Name of the manifest in a study's folder.
pub const MANIFEST_FILE: &str = "study.json";

/// Version of a folder's manifest and journal.
pub const SCHEMA_VERSION: u32 = 2;

/// What a folder's results are results of. It names no time, no machine and no number of threads:
/// two folders of one study have the same.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    /// [`SCHEMA_VERSION`].
    pub schema_version: u32,
    /// Hash of everything that decides the results.
    pub study_id: String,
    /// For people.
    pub name: String,
    /// Number of cases of the whole study.
    pub cases: u64,
    /// Consecutive cases that are computed and written together. Part of the study, because shards
    /// are made of blocks.
    pub block_cases: u32,
    /// Which part of the study the folder holds; all of it without one.
    pub shard: Option<Shard>,
    /// How far it is.
    pub status: Status,
    /// The factors, in the order of their columns.
    pub factors: Vec<Factor>,
    /// What rows have values of, in the order of their columns.
    pub columns: Vec<MetricColumn>,
    /// Hashes of what goes into `study_id`, by name, to say what differs where it does.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub inputs: BTreeMap<String, String>,
    /// Where the results come from. It is copied into the tables, so it must be the same in all
    /// shards and after every break.
    pub provenance: serde_json::Value,
}

/// How far a folder is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Status {
    /// Some of its blocks are missing, or the table is.
    Running,
    /// Everything is there.
    Complete,
}

/// Part `part` of `parts`, counted from one: the blocks whose index is `part - 1` modulo `parts`, so
/// that every part gets some of each region of the design.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Shard {
    part: u32,
    parts: u32,
}

impl Shard {
    /// Part `part` of `parts`, counted from one. `None` if there is no such part.
    pub fn new(part: u32, parts: u32) -> Option<Self> {
        (1..=parts).contains(&part).then_some(Self { part, parts })
    }

    /// Which part, from 1.
    pub fn part(self) -> u32 {
        self.part
    }

    /// Of how many.
    pub fn parts(self) -> u32 {
        self.parts
    }

    pub(crate) fn owns(self, block: u64) -> bool {
        block % u64::from(self.parts) == u64::from(self.part - 1)
    }
}

/// Whether a block belongs to a part of a study.
pub(crate) fn owns(shard: Option<Shard>, block: u64) -> bool {
    shard.is_none_or(|shard| shard.owns(block))
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.part, self.parts)
    }
}

impl From<Shard> for String {
    fn from(shard: Shard) -> Self {
        shard.to_string()
    }
}

impl TryFrom<String> for Shard {
    type Error = String;

    fn try_from(text: String) -> Result<Self, Self::Error> {
        text.parse()
    }
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        text.split_once('/')
            .and_then(|(part, parts)| Self::new(part.parse().ok()?, parts.parse().ok()?))
            .ok_or_else(|| {
                format!("\"{text}\" is not a shard: expected k/n with k from 1 to n, such as 2/7")
            })
    }
}

/// What every version of a manifest has.
#[derive(Deserialize)]
struct Version {
    schema_version: u32,
}

impl Manifest {
    /// The manifest of a whole study that has a design, with nothing computed yet.
    pub fn new(
        study_id: impl Into<String>,
        name: impl Into<String>,
        design: &dyn CaseDesign,
        columns: Vec<MetricColumn>,
        block_cases: u32,
        provenance: serde_json::Value,
    ) -> Self {
        Self {
            schema_version: SCHEMA_VERSION,
            study_id: study_id.into(),
            name: name.into(),
            cases: design.cases(),
            block_cases,
            shard: None,
            status: Status::Running,
            factors: design.factors().to_vec(),
            columns,
            inputs: BTreeMap::new(),
            provenance,
        }
    }

    /// Number of blocks of the whole study.
    pub fn blocks(&self) -> u64 {
        self.cases.div_ceil(u64::from(self.block_cases))
    }

    /// Cases of a block.
    pub(crate) fn block(&self, block: u64) -> std::ops::Range<u64> {
        let first = block * u64::from(self.block_cases);
        first..(first + u64::from(self.block_cases)).min(self.cases)
    }

    /// Number of cases of a block.
    pub(crate) fn block_len(&self, block: u64) -> usize {
        let cases = self.block(block);
        usize::try_from(cases.end - cases.start).expect("a block's length is a u32")
    }

    /// Whether a block belongs to this folder.
    pub(crate) fn owns(&self, block: u64) -> bool {
        owns(self.shard, block)
    }

    /// Number of cases of the folder.
    pub fn own_cases(&self) -> u64 {
        self.cases_of(self.shard)
    }

    /// Number of blocks of a part of the study.
    pub(crate) fn blocks_of(&self, shard: Option<Shard>) -> u64 {
        shard.map_or(self.blocks(), |shard| {
            let behind = self.blocks().saturating_sub(u64::from(shard.part - 1));
            behind.div_ceil(u64::from(shard.parts))
        })
    }

    /// Number of cases of a part of the study.
    pub(crate) fn cases_of(&self, shard: Option<Shard>) -> u64 {
        let whole = self.blocks_of(shard) * u64::from(self.block_cases);
        // The last block may be shorter.
        let last = self
            .blocks()
            .checked_sub(1)
            .filter(|last| owns(shard, *last));
        let lacking = last.map_or(0, |last| {
            u64::from(self.block_cases) - self.block_len(last) as u64
        });
        whole - lacking
    }

    /// `"name" (id), shard 1/2`.
    pub(crate) fn describe(&self) -> String {
        let shard = self
            .shard
            .map_or(String::new(), |shard| format!(", shard {shard}"));
        format!("\"{}\" ({}){shard}", self.name, self.study_id)
    }

    /// Why a folder with the manifest `found` holds no results of this study.
    pub fn other_study(&self, folder: &Path, found: &Self) -> Option<StudyError> {
        (!found.same_study(self)).then(|| StudyError::OtherStudy {
            folder: folder.to_owned(),
            found: found.describe(),
            expected: self.describe(),
            differences: found.differences(self),
        })
    }

    /// Reads the manifest of a folder, if there is one.
    ///
    /// # Errors
    /// [`StudyError::File`] if it is none or of another version.
    pub fn read(folder: &Path) -> Result<Option<Self>, StudyError> {
        let path = folder.join(MANIFEST_FILE);
        let text = match read_data_text(&path) {
            Ok(text) => text,
            Err(error) if error.is_not_found() => return Ok(None),
            Err(InputError::Io(error)) => return Err(StudyError::io("read", &path)(error)),
            Err(error) => {
                return Err(unreadable(&path, &error));
            }
        };
        let version: Version =
            serde_json::from_str(&text).map_err(|error| unreadable(&path, &error))?;
        if version.schema_version != SCHEMA_VERSION {
            let message = format!(
                "has schema version {}; this program reads version {SCHEMA_VERSION}",
                version.schema_version
            );
            return Err(StudyError::file(&path, message));
        }
        let manifest: Self =
            serde_json::from_str(&text).map_err(|error| unreadable(&path, &error))?;
        if manifest.block_cases == 0 {
            return Err(StudyError::file(&path, "block_cases is 0"));
        }
        Ok(Some(manifest))
    }

    /// Writes the manifest into a folder, atomically.
    pub(crate) fn write(&self, folder: &Path) -> Result<(), StudyError> {
        let path = folder.join(MANIFEST_FILE);
        let mut json = serde_json::to_vec_pretty(self).expect("a manifest has string keys only");
        json.push(b'\n');
        write_atomically(&path, &json).map_err(StudyError::io("write", &path))
    }

    /// What differs between two manifests of which results would be mixed up; the shard is no such
    /// difference.
    pub(crate) fn differences(&self, other: &Self) -> Vec<String> {
        let mut differences = Vec::new();
        let names = self.inputs.keys().chain(other.inputs.keys());
        let names: std::collections::BTreeSet<_> = names.collect();
        for name in names {
            if self.inputs.get(name) != other.inputs.get(name) {
                differences.push(name.clone());
            }
        }
        if self.block_cases != other.block_cases {
            differences.push(format!(
                "block_cases: {} there, {} here",
                self.block_cases, other.block_cases
            ));
        }
        if self.cases != other.cases {
            differences.push(format!("cases: {} there, {} here", self.cases, other.cases));
        }
        if self.factors != other.factors {
            differences.push("factors".to_owned());
        }
        if self.columns != other.columns {
            differences.push("columns".to_owned());
        }
        provenance_differences(
            "provenance",
            &self.provenance,
            &other.provenance,
            &mut differences,
        );
        differences
    }

    /// Whether results of both may stand in one table.
    pub(crate) fn same_study(&self, other: &Self) -> bool {
        self.study_id == other.study_id
            && self.name == other.name
            && self.block_cases == other.block_cases
            && self.cases == other.cases
            && self.factors == other.factors
            && self.columns == other.columns
            && self.provenance == other.provenance
    }
}

fn unreadable(path: &Path, error: &dyn fmt::Display) -> StudyError {
    let message = format!(
        "is not a study manifest: {error}\n\
         hint: restore it from a copy, or compute the study in another folder"
    );
    StudyError::file(path, message)
}

fn provenance_differences(
    path: &str,
    there: &serde_json::Value,
    here: &serde_json::Value,
    differences: &mut Vec<String>,
) {
    if let (Some(there), Some(here)) = (there.as_object(), here.as_object()) {
        let keys: std::collections::BTreeSet<_> = there.keys().chain(here.keys()).collect();
        for key in keys {
            let value = |map: &serde_json::Map<_, _>| map.get(key).cloned().unwrap_or_default();
            provenance_differences(
                &format!("{path}.{key}"),
                &value(there),
                &value(here),
                differences,
            );
        }
    } else if there != here {
        differences.push(format!("{path}: {there} there, {here} here"));
    }
}
