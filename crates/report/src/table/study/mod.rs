//! A study's statistics, and one of its cases, as text.

pub(crate) mod answer;
pub(crate) mod block;
mod case;
mod choices;
mod configurations;
pub(crate) mod criteria;
pub(crate) mod document;
pub(crate) mod postures;
pub(crate) mod robustness;

pub use case::{CaseReport, case_text};

/// Lengths below a nanometre are rounding: an exact posture has no error. mm.
const ROUNDING_MM: f64 = 1e-6;
