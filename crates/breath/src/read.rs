//! Files with recordings.

use std::path::Path;

use needlebench_input::{Finding, open_input};

use crate::options::ReadOptions;
use crate::recording::Recording;
use crate::{log, table};

/// Reads and checks a recording: a table of text (CSV) with a time and one or three coordinates, or an MCAP file with
/// `PointStamped` or `PoseStamped` messages, whose positions are in m.
///
/// # Errors
/// What is wrong with it: its line, column and value, and a hint to make it readable.
pub fn read_recording(path: &Path, options: &ReadOptions) -> Result<Recording, Vec<Finding>> {
    let source = if open_input(path).is_ok_and(needlebench_ros::is_mcap) {
        log::read(path, options)?
    } else {
        table::read(path, options)?
    };
    Recording::from_source(source).map_err(|finding| vec![finding])
}
