//! Where the rows of a study are read from.

use crate::{CaseResult, Factor, FactorValue, MetricColumn};

/// A complete table of results. It may be larger than memory: it is read from the first case to the
/// last, as often as needed.
pub trait Results {
    /// The factors, in the order of their columns; `goal` is the first.
    fn factors(&self) -> &[Factor];

    /// What the values of rows are of, in their order.
    fn columns(&self) -> &[MetricColumn];

    /// Number of cases.
    fn cases(&self) -> u64;

    /// Calls `visit` with every case, in the order of their numbers, and the values of its factors.
    ///
    /// # Errors
    /// What cannot be read, with the file and where it breaks off.
    fn visit(&self, visit: &mut dyn FnMut(&[FactorValue], &CaseResult))
    -> Result<(), ResultsError>;
}

/// Why results cannot be read.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{file}: {message}")]
pub struct ResultsError {
    /// File.
    pub file: String,
    /// What is wrong with it, and where.
    pub message: String,
}
