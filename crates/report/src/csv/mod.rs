//! Recordings as comma-separated values.

pub(crate) mod press;
mod program;
mod recording;
mod rtde;
pub mod servo;

pub(crate) use press::press_csv;
pub(crate) use program::events_csv;
pub(crate) use recording::{recording_csv, recording_name};
pub(crate) use rtde::rtde_csv;

/// A text of a cell (RFC 4180).
pub(crate) fn quoted(text: &str) -> String {
    if text.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.to_owned()
    }
}
