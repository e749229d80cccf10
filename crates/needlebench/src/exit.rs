//! Exit status of the program.

use std::process::ExitCode;

use needlebench_evaluation::report::Verdict;

/// Exit status of a command.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum ExitStatus {
    /// All criteria are met.
    Success,
    /// A criterion failed, or was not evaluated.
    CriterionFailed,
    /// The input is invalid.
    BadInput,
    /// The environment or an engine failed.
    EnvironmentFailed,
    /// Interrupted from the keyboard or by a signal.
    Interrupted,
}

impl ExitStatus {
    /// The exit status of a verdict: only a complete result that meets all criteria succeeds.
    pub fn of(verdict: Verdict) -> Self {
        match verdict {
            Verdict::Pass => Self::Success,
            Verdict::Fail | Verdict::Incomplete => Self::CriterionFailed,
        }
    }

    /// The number.
    pub fn code(self) -> u8 {
        match self {
            Self::Success => 0,
            Self::CriterionFailed => 1,
            Self::BadInput => 2,
            Self::EnvironmentFailed => 3,
            Self::Interrupted => 130, // 128 + SIGINT, as shells have it
        }
    }
}

impl From<ExitStatus> for ExitCode {
    fn from(status: ExitStatus) -> Self {
        Self::from(status.code())
    }
}
