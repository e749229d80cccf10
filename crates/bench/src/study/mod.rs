//! Cases of a study: rows of numbers from one layout with one goal.

mod assignment;
mod case;
mod dynamic;
mod evaluator;
mod failure;
mod identity;
mod launch;
mod likely;
mod margin;
mod planned;
mod prediction;
mod prepare;
mod replan;
mod robust;
pub mod robustness;
mod rows;
mod static_case;
#[cfg(test)]
mod tests;

pub use assignment::{Assignment, SHARD_VARIABLE, SHARDS_VARIABLE, assignment, shards_of};
pub use case::StudyCase;
pub use dynamic::{CaseCost, DynamicCase, ENGINE_FAILURE, dynamic_case, dynamic_rows};
pub use evaluator::StudyEvaluator;
pub(crate) use evaluator::counted_classes;
pub use failure::CaseFailure;
pub use identity::Identity;
pub use launch::{
    Launch, LaunchFile, LaunchPlan, LaunchRequest, LaunchStep, Launcher, advice, launch_plan,
};
pub use likely::Likely;
pub(crate) use likely::{has_imperfections, has_spread, sets};
pub use margin::{CountedClasses, MARGIN_COLUMN, margin_column};
pub use planned::{planned_case, planned_rows};
pub use prepare::{PreparedStudy, in_words, time_per_case};
pub use replan::{ReplanControl, ReplanDraw, Replanned, replan_draw, replanned};
pub use robust::{RobustnessResult, robustness_of};
pub use rows::{CaseRow, StudyColumns, metric_column};
pub use static_case::{NO_ENTRY, StaticWorker, rows_without_scenario, static_rows};
