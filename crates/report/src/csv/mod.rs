//! Recordings as comma-separated values.

pub(crate) mod press;
mod recording;
pub mod servo;

pub use press::press_csv;
pub use recording::{recording_csv, recording_name};
