//! Recordings of breath: a marker on the skin or a trace of a tracker, read, checked, and told in numbers.
//!
//! [`read_recording`] makes a [`Recording`] of a file: displacement along the one axis that a marker moves on, at
//! 10 Hz, positive towards inspiration. [`statistics`] finds the breaths and gives amplitude, period, level, drift and
//! windows, each with its 95 % interval. [`over_recordings`] says what holds for several recordings, and how far that
//! covers the one that is left out.
#![cfg_attr(any(doc, doctest), doc = include_str!("../README.md"))]

mod breaths;
mod clock;
mod drift;
mod interval;
mod level;
#[cfg(not(target_arch = "wasm32"))]
mod log;
mod options;
mod over_recordings;
mod read;
mod recording;
mod samples;
mod segment;
mod source;
mod statistics;
mod table;
mod window;

pub use interval::Estimate;
pub use level::{LevelChange, LevelLaw};
pub use options::{LengthUnit, ReadOptions};
pub use over_recordings::{LevelOverRecordings, OverRecordings, Quantiles, over_recordings};
pub use read::read_recording;
pub use recording::{Axis, Gap, Lost, Recording};
pub use samples::Samples;
pub use segment::{SAMPLE_S, Segment};
pub use statistics::{SIN4_NEAR_EXPIRATION, Statistics, statistics};
pub use window::Window;
