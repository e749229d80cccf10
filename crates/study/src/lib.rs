//! Studies: many cases of one scenario, from a design to a table of results.
//!
//! A *case* is one layout with one goal; its number decides everything about it, so that it can be
//! rerun alone. Each case gives one [`Row`] per configuration, with a value for each of the study's
//! [columns](MetricColumn). What computes the rows is a [`CaseWorker`], and what the columns are is
//! said when a study is opened; this crate knows neither arms nor engines.
#![cfg_attr(any(doc, doctest), doc = include_str!("../README.md"))]

mod case;
mod column;
pub mod compare;
mod design;
mod distribution;
mod results;
mod row;
mod sampling;
pub mod search;
pub mod statistics;
mod store;

pub use case::{CaseError, CaseEvaluator, CaseWorker};
pub use column::{Measure, MetricColumn};
pub use design::{Design, DesignError, Factor, FactorKind, FactorValue, Level, Role};
pub use results::{Results, ResultsError};
pub use row::{CaseResult, Outcome, Row};
pub use store::{
    CSV_FILE, CaseDesign, JOURNAL_FILE, MANIFEST_FILE, Manifest, ParquetResults, Progress,
    RESULTS_FILE, RunEnd, SCHEMA_VERSION, Shard, ShardState, ShardSurvey, Status, StudyError,
    StudyRun, Survey, merge, ranges, survey, write_csv,
};
