//! JUnit XML, for continuous integration.

mod answers;
mod comparison;
mod failure;
mod free;
mod limits;
mod replay;
mod run;
mod study;
mod study_comparison;
mod times;

pub use answers::answers_junit;
pub use comparison::comparison_junit;
pub use free::free_junit;
pub use limits::{JudgedLimit, limits_junit};
pub(crate) use replay::replay_junit;
pub use run::junit;
pub(crate) use study::study_junit;
pub use study_comparison::study_comparison_junit;
