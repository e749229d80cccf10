//! Measurements, criteria and reports, from outside the crate.

mod adjudication;
mod compare;
mod likely;
mod measurements;
mod ranking;
mod room;
mod verdicts;
