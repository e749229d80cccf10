//! Exit status of the program.

use std::process::ExitCode;

use needlebench_evaluation::report::Verdict;

/// What a run's exit status says.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum ExitStatus {
    /// All criteria were met.
    Success,
    /// A criterion was not met, or could not be judged.
    CriterionFailed,
    /// The input is wrong.
    BadInput,
    /// The environment or an engine failed.
    EnvironmentFailed,
    /// Interrupted from the keyboard or by a signal.
    Interrupted,
}

impl ExitStatus {
    /// Of what was judged: only what is complete and met succeeds.
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
