//! Cases of a study: rows of numbers from one layout with one goal.

mod dynamic;
mod engines;
mod planned;
mod rows;

pub use dynamic::{CaseCost, DynamicCase, dynamic_case, dynamic_rows};
pub use engines::EngineSet;
pub use planned::planned_rows;
