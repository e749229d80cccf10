//! Why a case of a study has no rows.

use needlebench_engine::{EngineError, UnknownEngine};
use needlebench_input::Finding;

use crate::setup::SetupError;

/// Why a case cannot be computed, although its layout is valid.
#[derive(Debug, thiserror::Error)]
pub enum CaseFailure {
    /// The scenario has no goal, several, or no goals but something else.
    #[error("a case has one goal, `{file}` has {goals}")]
    Goals {
        /// The scenario.
        file: String,
        /// How many goals it has.
        goals: usize,
    },
    /// Its arm or its cell cannot be prepared.
    #[error(transparent)]
    Setup(#[from] SetupError),
    /// An engine that is not in this program.
    #[error(transparent)]
    UnknownEngine(#[from] UnknownEngine),
    /// An engine cannot be started, or ended.
    #[error(transparent)]
    Engine(#[from] EngineError),
    /// A case of a sample that is planned again.
    #[error("case {case}: {source}")]
    Replanned {
        /// Number of the case.
        case: u64,
        /// What happened.
        source: Box<CaseFailure>,
    },
    /// The scenario of the case is refused.
    #[error("{}", joined(.0))]
    Refused(Vec<Finding>),
}

fn joined(findings: &[Finding]) -> String {
    let texts: Vec<String> = findings.iter().map(ToString::to_string).collect();
    texts.join("; ")
}
