//! JUnit XML, for continuous integration.

mod comparison;
mod failure;
mod limits;
mod replay;
mod run;
mod study;
mod study_comparison;
mod times;

pub use comparison::comparison_junit;
pub use limits::{JudgedLimit, limits_junit};
pub(crate) use replay::replay_junit;
pub use run::junit;
pub(crate) use study::study_junit;
pub use study_comparison::study_comparison_junit;
