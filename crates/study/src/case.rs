//! What computes the rows of a case.

use crate::CaseResult;

/// Why a case has no rows: the environment failed, not the case. An invalid layout is a
/// result ([`Outcome::Invalid`](crate::Outcome::Invalid)).
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("case {case}: {message}")]
pub struct CaseError {
    /// Number of the case.
    pub case: u64,
    /// What happened.
    pub message: String,
}

/// Gives every thread its own worker.
pub trait CaseEvaluator: Sync {
    /// A worker; it may hold scratch memory, caches and processes, but what it answers depends on the
    /// number of the case alone.
    fn worker(&self) -> Box<dyn CaseWorker + '_>;
}

/// Computes cases, one by one.
pub trait CaseWorker {
    /// All rows of a case.
    ///
    /// # Errors
    /// [`CaseError`] where the environment failed.
    fn evaluate(&mut self, case: u64) -> Result<CaseResult, CaseError>;
}
