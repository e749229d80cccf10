//! Recordings as comma-separated values.

pub(crate) mod press;
mod recording;
mod rtde;
pub mod servo;

pub(crate) use press::press_csv;
pub(crate) use recording::{recording_csv, recording_name};
pub(crate) use rtde::rtde_csv;
