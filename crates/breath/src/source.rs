//! What was read of a file.

use needlebench_input::Finding;

use crate::clock::TimeUnit;
use crate::samples::Samples;

/// What was read, before it is checked.
#[derive(Debug)]
pub(crate) struct Source {
    pub file: String,
    pub sha256: String,
    pub format: &'static str,
    /// In the file.
    pub rows: usize,
    /// Its clock, where a name says it.
    pub time_unit: Option<TimeUnit>,
    /// Times in the unit of the file.
    pub samples: Samples,
    pub notes: Vec<Finding>,
}
