//! What can go wrong in an export.

use needlebench_engine::EngineError;
use needlebench_kinematics::NotUrGeometry;

/// Why a format cannot hold a scenario.
#[derive(Debug, Clone, thiserror::Error)]
pub enum ExportError {
    /// The engine has no model of the cell.
    #[error("the cell cannot be built in the engine: {0}")]
    Engine(#[from] EngineError),
    /// The set-point period of the arm's controller is unknown.
    #[error(
        "the data of the arm {arm} lack the set-point period of its controller: `period_ms` under \
         [control] of its arm.toml"
    )]
    NoPeriod {
        /// The arm.
        arm: String,
    },
    /// The container cannot be made.
    #[error("{0}")]
    Mcap(String),
    /// A configuration that has no posture at a goal.
    #[error("{configuration} has no posture at the goal `{goal}`: {reason}")]
    NoPosture {
        /// Name of the goal.
        goal: String,
        /// Label of the configuration.
        configuration: &'static str,
        /// Rules that it violates, in words.
        reason: String,
    },
    /// The arm has no closed form, so goals have no postures.
    #[error("{0}")]
    NotUr(#[from] NotUrGeometry),
}
