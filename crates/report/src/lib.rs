//! Results for people and other programs: tables, Markdown, JUnit, CSV, charts, pictures and pages,
//! and the folders that they are written into.
#![cfg_attr(any(doc, doctest), doc = include_str!("../README.md"))]

pub mod accuracy;
pub mod chart;
pub mod csv;
pub mod files;
mod junit;
mod markdown;
pub mod page;
pub mod picture;
#[cfg(test)]
#[path = "../../engine/tests/engine/common/replay.rs"]
mod replay;
pub mod table;

pub use files::write_atomically;
pub use junit::{
    JudgedLimit, answers_junit, comparison_junit, free_junit, junit, limits_junit,
    study_comparison_junit,
};
pub use markdown::{
    MetricDescription, comparison_markdown, markdown, metric_descriptions, metrics_markdown,
    schema_markdown, study_comparison_markdown,
};
pub use table::{report_screen, report_text};
