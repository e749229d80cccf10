//! Cases of a study: rows of numbers from one layout with one goal.

mod case;
mod case_report;
mod dynamic;
mod engines;
mod evaluator;
mod identity;
mod markdown;
mod output;
mod planned;
mod prediction;
mod prepare;
mod robust;
pub mod robustness;
mod rows;
mod static_case;
mod tables;
#[cfg(test)]
mod tests;
mod text;

pub(crate) use case::StudyCase;
pub(crate) use case_report::{CaseReport, case_text};
pub use dynamic::{CaseCost, DynamicCase, dynamic_case, dynamic_rows};
pub use engines::EngineSet;
pub(crate) use evaluator::StudyEvaluator;
pub(crate) use output::{StudyOutput, write_study};
pub use planned::planned_rows;
pub(crate) use prepare::{PreparedStudy, in_words, time_per_case};
pub use static_case::{StaticWorker, invalid_rows, static_rows};
