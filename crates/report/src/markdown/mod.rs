//! Markdown, for pull requests and pages of continuous integration.

mod comparison;
mod excitation;
mod iso9283;
mod metrics;
mod ranking;
mod run;
mod schema;
pub(crate) mod study;
mod study_comparison;

pub use comparison::comparison_markdown;
pub use metrics::{MetricDescription, metric_descriptions, metrics_markdown};
pub use run::markdown;
pub use schema::schema_markdown;
pub use study_comparison::study_comparison_markdown;
