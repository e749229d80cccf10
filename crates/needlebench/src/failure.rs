//! Failures of commands.

use needlebench_bench::judge::JudgeError;
use needlebench_bench::robot::RobotError;
use needlebench_input::{Finding, nothing_serves};
use needlebench_patient::Stop;
use needlebench_study::StudyError;
use serde::Serialize;

use crate::exit::ExitStatus;
use crate::findings::print_findings;
use crate::output::{complain, json_text, print_as_it_is};

/// Why a command ends without an answer: the text on standard error, and the exit status.
#[derive(Debug)]
pub(crate) enum Failure {
    /// The input is invalid.
    BadInput(Vec<Finding>),
    /// The input is valid, but infeasible.
    Missed(Vec<Finding>),
    /// It ended with this status and message.
    Ended {
        /// Exit status of the program.
        status: ExitStatus,
        /// Message on standard error.
        message: String,
    },
    /// The input is refused, and a JSON document on standard output says why.
    Answered {
        /// Exit status of the program.
        status: ExitStatus,
        /// The document, as it is printed.
        document: String,
    },
    /// The environment failed.
    Environment(anyhow::Error),
}

impl Failure {
    /// It was interrupted; the message states which results exist.
    pub(crate) fn interrupted(message: impl Into<String>) -> Self {
        Self::Ended {
            status: ExitStatus::Interrupted,
            message: message.into(),
        }
    }

    /// Work that stopped, with the message of an interruption.
    pub(crate) fn of_stop(stop: Stop, interrupted: &str) -> Self {
        match stop {
            Stop::Interrupted => Self::interrupted(interrupted),
            Stop::Refused(findings) => findings.into(),
        }
    }

    /// A refusal that `--json` has as a document.
    pub(crate) fn answered(status: ExitStatus, document: &impl Serialize) -> Self {
        match json_text(document) {
            Ok(document) => Self::Answered { status, document },
            Err(error) => Self::Environment(error),
        }
    }

    /// Prints it, and returns the exit status.
    pub(crate) fn tell(self) -> ExitStatus {
        match self {
            Self::BadInput(findings) => {
                print_findings(&findings);
                ExitStatus::BadInput
            }
            Self::Missed(findings) => {
                print_findings(&findings);
                ExitStatus::CriterionFailed
            }
            Self::Ended { status, message } => {
                complain(&message);
                status
            }
            Self::Answered { status, document } => match print_as_it_is(&document) {
                Ok(()) => status,
                Err(error) => Self::Environment(error).tell(),
            },
            Self::Environment(error) => {
                // A closed pipe (`needlebench ... | head`) is the reader's choice.
                let closed = error
                    .downcast_ref::<std::io::Error>()
                    .is_some_and(|error| error.kind() == std::io::ErrorKind::BrokenPipe);
                if closed {
                    return ExitStatus::Success;
                }
                complain(&format!("error: {error:#}"));
                ExitStatus::EnvironmentFailed
            }
        }
    }
}

/// Exit status of a command that these findings refuse.
pub(crate) fn status_of(findings: &[Finding]) -> ExitStatus {
    if nothing_serves(findings) {
        ExitStatus::CriterionFailed
    } else {
        ExitStatus::BadInput
    }
}

impl From<Finding> for Failure {
    fn from(finding: Finding) -> Self {
        vec![finding].into()
    }
}

impl From<Vec<Finding>> for Failure {
    fn from(findings: Vec<Finding>) -> Self {
        if nothing_serves(&findings) {
            Self::Missed(findings)
        } else {
            Self::BadInput(findings)
        }
    }
}

impl From<anyhow::Error> for Failure {
    fn from(error: anyhow::Error) -> Self {
        Self::Environment(error)
    }
}

impl From<JudgeError> for Failure {
    fn from(error: JudgeError) -> Self {
        match error {
            JudgeError::Refused(finding) => (*finding).into(),
            JudgeError::Run(error) => anyhow::Error::from(error).into(),
        }
    }
}

impl From<RobotError> for Failure {
    fn from(error: RobotError) -> Self {
        match error {
            RobotError::Judge(error) => error.into(),
            error @ RobotError::Engine { .. } => anyhow::Error::from(error).into(),
        }
    }
}

impl From<StudyError> for Failure {
    fn from(error: StudyError) -> Self {
        let status = if error.is_input() {
            ExitStatus::BadInput
        } else {
            ExitStatus::EnvironmentFailed
        };
        Self::Ended {
            status,
            message: format!("error: {error}"),
        }
    }
}
