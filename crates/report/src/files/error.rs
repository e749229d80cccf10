//! Why results are not written.

use std::io;
use std::path::PathBuf;

use needlebench_bench::study::CaseFailure;
use needlebench_export::ExportError;
use needlebench_study::ResultsError;

use needlebench_render::PictureError;

/// What can go wrong with files of results.
#[derive(Debug, thiserror::Error)]
pub enum FilesError {
    /// A file or folder cannot be written.
    #[error("cannot write {}: {source}", path.display())]
    Write {
        /// Which.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// A file of an earlier run cannot be removed.
    #[error("cannot remove {} from an earlier run: {source}", path.display())]
    Remove {
        /// Which.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// A picture cannot be encoded.
    #[error(transparent)]
    Picture(#[from] PictureError),
    /// A report is no JSON.
    #[error("cannot write a report as JSON: {0}")]
    Json(#[from] serde_json::Error),
    /// Criteria are no JUnit XML.
    #[error("cannot write criteria as JUnit XML: {0}")]
    Junit(#[from] quick_junit::SerializeError),
    /// A study's table cannot be read.
    #[error(transparent)]
    Results(#[from] ResultsError),
    /// The robustness of a study's base scenario cannot be computed.
    #[error("robustness: {0}")]
    Robustness(String),
    /// A static case of a study cannot be planned.
    #[error("planning a sample of cases: {0}")]
    Replan(CaseFailure),
    /// A recording cannot be exported.
    #[error(transparent)]
    Export(#[from] ExportError),
    /// The user ended it.
    #[error("interrupted")]
    Interrupted,
}
