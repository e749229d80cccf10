//! Measurements, criteria and reports, from outside the crate.

mod adjudication;
mod compare;
mod iso9283;
mod measurements;
mod ranking;
mod room;
mod verdicts;
