//! Recordings as comma-separated values.

pub(crate) mod press;
mod recording;
mod rtde;
pub mod servo;

pub use press::press_csv;
pub use recording::{recording_csv, recording_name};
pub use rtde::rtde_csv;
