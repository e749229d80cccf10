//! What a search leaves besides its generations.

use std::path::Path;

use needlebench_bench::search::PreparedSearch;
use needlebench_study::search::SearchLog;
use serde::Serialize;

use super::error::FilesError;
use super::folder::Folder;
use crate::page::search_page;
use crate::table::search::search_text;

/// Version of the keys of `search.json`.
const SCHEMA_VERSION: u32 = 1;
/// Name of the log in a study's folder.
pub(crate) const SEARCH_FILE: &str = "search.json";
/// Name of the page in a study's folder.
const PAGE_FILE: &str = "search.html";

/// The log of a search with what it is of.
#[derive(Debug, Serialize)]
pub struct SearchDocument<'a> {
    schema_version: u32,
    /// Name of the study.
    name: &'a str,
    /// The question that it answers.
    description: &'a str,
    /// Hash of everything that decides the results.
    study_id: &'a str,
    /// Cases are final postures: whether a motion gets there is not known.
    postures_only: bool,
    /// Classes of clearance that count in margins.
    classes: Vec<&'static str>,
    /// Cases of an exhaustive grid of candidates and layouts; none with ranges.
    grid_cases: Option<u64>,
    /// Number of the recommended candidate; none before the end, and where the best one is feasible in no layout.
    recommended: Option<usize>,
    #[serde(flatten)]
    log: &'a SearchLog,
}

impl<'a> SearchDocument<'a> {
    /// Of a search, as far as it is.
    pub fn new(search: &'a PreparedSearch, log: &'a SearchLog) -> Self {
        let all = needlebench_cell::ClearanceClass::ALL.into_iter();
        Self {
            schema_version: SCHEMA_VERSION,
            name: &search.study.file.name,
            description: &search.study.file.description,
            study_id: &search.identity.id,
            postures_only: true,
            classes: all
                .filter(|&class| search.section.counts(class))
                .map(needlebench_cell::ClearanceClass::name)
                .collect(),
            grid_cases: search.grid_cases(),
            recommended: log
                .answer
                .as_ref()
                .filter(|answer| answer.is_recommended())
                .map(|answer| answer.winner),
            log,
        }
    }
}

/// Writes the log of a search, as far as it is.
pub fn write_search_log(
    search: &PreparedSearch,
    log: &SearchLog,
    folder: &Path,
) -> Result<(), FilesError> {
    Folder(folder).write_json(SEARCH_FILE, &SearchDocument::new(search, log))
}

/// Writes the page of a finished search, and gives its text for a terminal.
pub fn write_search(
    search: &PreparedSearch,
    log: &SearchLog,
    folder: &Path,
    page: bool,
) -> Result<String, FilesError> {
    let folder = Folder(folder);
    if page {
        let document = serde_json::to_value(SearchDocument::new(search, log))?;
        folder.write(PAGE_FILE, search_page(search, log, &document)?)?;
    } else {
        folder.remove(PAGE_FILE)?;
    }
    Ok(search_text(search, log))
}
