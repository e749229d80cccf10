//! Cases of studies: what becomes of a layout's eight configurations.

mod dynamic;
mod engines;
mod planned;
mod prediction;
pub mod robustness;
mod rows;
mod static_case;

pub use dynamic::{CaseCost, DynamicCase, dynamic_case, dynamic_rows};
pub use engines::EngineSet;
pub use planned::planned_rows;
pub use static_case::{StaticWorker, invalid_rows, static_rows};
