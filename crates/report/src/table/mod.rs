//! Tables and lines for a terminal.

pub mod answers;
pub mod atlas;
pub(crate) mod budget;
pub(crate) mod class_words;
pub mod comparison;
pub(crate) mod engine_headings;
pub(crate) mod events;
pub mod excitation;
pub mod free;
pub mod iso9283;
pub(crate) mod judged;
pub(crate) mod needle;
pub mod overview;
pub(crate) mod probability;
pub(crate) mod ranking;
mod referee;
pub mod replay;
pub mod routes;
mod run;
mod saturation;
pub mod search;
pub mod servo;
pub(crate) mod shown;
pub mod study;
pub mod study_comparison;
pub mod suggest;
pub(crate) mod true_target;
pub(crate) mod verdict;

pub(crate) use run::route_wanted_m;
pub use run::{fissures_in_words, rejected_in_words, report_screen, report_text, route_in_words};
