//! Output formats: terminal, JSON, JUnit, Markdown, CSV, pictures.

mod budget;
pub(crate) mod comparison;
mod events;
pub(crate) mod findings;
mod format;
mod junit;
mod markdown;
pub(crate) mod pictures;
mod ranking;
mod recording;
mod referee;
pub(crate) mod room_pictures;
mod saturation;
pub(crate) mod study_comparison;
mod table;

pub(crate) use budget::budget_picture;
pub(crate) use events::{press_csv, press_picture};
pub(crate) use format::small_length;
pub(crate) use junit::{junit, study_junit};
pub(crate) use markdown::markdown;
pub(crate) use ranking::ranking_picture;
pub(crate) use recording::recording_csv;
pub(crate) use table::{plain_table, report_text};
