//! A study's statistics, and one of its cases, as text.

mod case;
pub(crate) mod document;
pub(crate) mod postures;
pub(crate) mod robustness;
pub(crate) mod text;

pub use case::{CaseReport, case_text};
