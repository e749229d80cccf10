//! What can go wrong in an export.

use needlebench_engine::EngineError;
use needlebench_kinematics::NotUrGeometry;

/// Why a format cannot hold a scenario.
#[derive(Debug, Clone, thiserror::Error)]
pub enum ExportError {
    /// The engine has no model of the cell.
    #[error("the cell cannot be made in the engine: {0}")]
    Engine(#[from] EngineError),
    /// Nobody says how often the arm's controller takes set-points.
    #[error(
        "the data of the arm {arm} do not say how often its controller takes set-points: `period_ms` under \
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
        /// Rules that it breaks, in words.
        reason: String,
    },
    /// The arm has no closed form, so goals have no postures.
    #[error("{0}")]
    NotUr(#[from] NotUrGeometry),
}
