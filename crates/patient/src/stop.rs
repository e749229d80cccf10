//! What ends a piece of work before its answer.

use std::path::Path;

use needlebench_input::Finding;
use needlebench_volume::VolumeError;

/// Why there is no answer.
#[derive(Debug, Clone, PartialEq)]
pub enum Stop {
    /// What is wrong, and what to do.
    Refused(Vec<Finding>),
    /// It was told to stop.
    Interrupted,
}

impl Stop {
    /// Of a scan, with the file that it is about.
    pub fn of_scan(file: &Path, error: VolumeError) -> Self {
        match error {
            VolumeError::Interrupted => Self::Interrupted,
            VolumeError::Refused {
                place,
                message,
                hint,
            } => {
                let mut finding = Finding::new(file.display().to_string(), message);
                finding.key = place;
                finding.hint = hint;
                finding.into()
            }
        }
    }
}

impl From<Vec<Finding>> for Stop {
    fn from(findings: Vec<Finding>) -> Self {
        Self::Refused(findings)
    }
}

impl From<Finding> for Stop {
    fn from(finding: Finding) -> Self {
        Self::Refused(vec![finding])
    }
}
