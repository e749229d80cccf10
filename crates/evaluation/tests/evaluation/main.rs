//! Measurements, criteria and reports, from outside the crate.

mod adjudication;
mod compare;
mod measurements;
mod ranking;
mod room;
mod verdicts;
