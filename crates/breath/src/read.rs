//! Files with recordings.

use std::path::Path;

use needlebench_input::Finding;

use crate::options::ReadOptions;
use crate::recording::Recording;
use crate::source::Source;
use crate::table;

/// Reads and checks a recording: a table of text (CSV) with a time and one or three coordinates, or an MCAP file with
/// `PointStamped` or `PoseStamped` messages, whose positions are in m.
///
/// # Errors
/// What is wrong with it: its line, column and value, and a hint to make it readable.
pub fn read_recording(path: &Path, options: &ReadOptions) -> Result<Recording, Vec<Finding>> {
    let source = source(path, options)?;
    Recording::from_source(source).map_err(|finding| vec![finding])
}

#[cfg(not(target_arch = "wasm32"))]
fn source(path: &Path, options: &ReadOptions) -> Result<Source, Vec<Finding>> {
    if needlebench_input::open_input(path).is_ok_and(needlebench_ros::is_mcap) {
        crate::log::read(path, options)
    } else {
        table::read(path, options)
    }
}

#[cfg(target_arch = "wasm32")]
fn source(path: &Path, options: &ReadOptions) -> Result<Source, Vec<Finding>> {
    table::read(path, options)
}
