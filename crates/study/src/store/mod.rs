//! Studies on disk: a folder with `study.json`, `journal.nbj` while it runs, then `results.parquet`.
//!
//! What is in a folder depends on the study alone, neither on threads nor on how often it was
//! interrupted: blocks of cases come into the journal in any order, and the table is made of them in
//! the order of their numbers.

mod atomic;
mod case_design;
mod codec;
mod columns;
mod csv;
mod error;
mod folder;
mod journal;
mod manifest;
mod merge;
mod ordered;
mod parquet_read;
mod parquet_write;
mod progress;
mod run;
mod salvage;
mod schema;
mod seal;
mod shards;
mod space;
mod survey;

pub use case_design::CaseDesign;
pub use csv::write_csv;
pub use error::StudyError;
pub use folder::{CSV_FILE, RESULTS_FILE};
pub use journal::JOURNAL_FILE;
pub use manifest::{MANIFEST_FILE, Manifest, SCHEMA_VERSION, Shard, Status};
pub use merge::merge;
pub use parquet_read::ParquetResults;
pub use progress::Progress;
pub use run::{RunEnd, StudyRun};
pub use shards::ranges;
pub use survey::{ShardState, ShardSurvey, Survey, survey};
