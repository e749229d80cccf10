//! What is asked of a run, and what it leaves.

use needlebench_cell::Cell;
use needlebench_engine::{ENGINES, Engine, UnknownEngine, choose_engines};
use needlebench_evaluation::report::Report;
use needlebench_iso9283::{Arrival, Attained, Commanded};
use needlebench_kinematics::{Chain, Pose};
use needlebench_planning::GoalPlan;
use needlebench_scenario::ResolvedScenario;
use needlebench_scenario::scenario::EngineName;

use crate::events::EventRun;
use crate::rtde::{RtdeLog, RtdeSource};
use crate::setup::SetupError;
use crate::simulate::EngineRun;

/// How to run a scenario.
#[derive(Debug, Clone)]
pub struct RunOptions {
    /// Engines that there are.
    pub known_engines: &'static [&'static dyn Engine],
    /// Names of the engines that run; the scenario's own choice if `None`.
    pub engines: Option<Vec<EngineName>>,
    /// Threads; more than there are engines and goals is no use.
    pub jobs: usize,
    /// Whether to hold every simulated motion against the reference integrator.
    pub referee: bool,
}

impl Default for RunOptions {
    /// The scenario's engines on one thread.
    fn default() -> Self {
        Self {
            known_engines: ENGINES,
            engines: None,
            jobs: 1,
            referee: false,
        }
    }
}

impl RunOptions {
    /// Engines that run, in the order of those that there are.
    ///
    /// # Errors
    /// A name that no engine has.
    pub fn chosen_engines(
        &self,
        resolved: &ResolvedScenario,
    ) -> Result<Vec<&'static dyn Engine>, UnknownEngine> {
        let own = resolved.scenario.engines.run.as_deref();
        choose_engines(self.known_engines, self.engines.as_deref().or(own))
    }
}

/// Why a scenario cannot be run at all.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// It cannot be planned.
    #[error(transparent)]
    Setup(#[from] SetupError),
    /// It is to run in an engine that there is not.
    #[error(transparent)]
    Engine(#[from] UnknownEngine),
}

/// Everything that a run of a scenario leaves.
#[derive(Debug)]
pub struct ScenarioRun {
    /// The report.
    pub report: Report,
    /// Plans, by goal.
    pub plans: Vec<GoalPlan>,
    /// Recordings, by goal, configuration and engine.
    pub runs: Vec<Vec<Vec<EngineRun>>>,
    /// Events of the feasible configurations.
    pub events: Vec<EventRun>,
    /// Motions that an engine could not carry on, until then.
    pub stopped: Vec<StoppedRun>,
    /// What a test by ISO 9283 left besides its report.
    pub iso9283: Option<ProtocolRun>,
    /// What an excitation run left besides its report.
    pub excitation: Option<ExcitationRun>,
    /// What makes logs of the recordings; none where there are none.
    pub rtde: Option<RtdeSource>,
    /// It was interrupted; what was finished until then is here.
    pub interrupted: bool,
    /// The arm that was simulated.
    pub real_arm: RealArm,
}

/// A motion that an engine could not carry on, with its recording until then.
#[derive(Debug, Clone)]
pub struct StoppedRun {
    /// Index of the goal.
    pub goal: usize,
    /// Index of the configuration.
    pub configuration: usize,
    /// What there is of it.
    pub run: EngineRun,
}

/// What a simulated test by ISO 9283 leaves besides its report.
#[derive(Debug)]
pub struct ProtocolRun {
    /// Commanded poses.
    pub commanded: Vec<Commanded>,
    /// Measurements and arrivals of each engine that finished, by its name.
    pub engines: Vec<(&'static str, Vec<Attained>, Vec<Arrival>)>,
    /// Half-width of the band of the stabilisation time, m.
    pub limit_band_m: f64,
}

/// What a simulated excitation run leaves besides its report.
#[derive(Debug)]
pub struct ExcitationRun {
    /// Engine, number of the payload from 0, and the log.
    pub logs: Vec<(&'static str, usize, RtdeLog)>,
}

/// The arm that was simulated: the nominal one, or one draw of the imperfections.
#[derive(Debug, Clone, Copy)]
pub struct RealArm {
    /// Its place.
    pub world_from_base_link: Pose,
    /// Its links.
    pub chain: Chain,
    /// Where the needle enters the guide of its tool, and where it leaves it, in the flange frame.
    pub flange_from_guide: [Pose; 2],
}

impl RealArm {
    pub(crate) fn of(cell: &Cell) -> Self {
        Self {
            world_from_base_link: cell.robot.world_from_base_link,
            chain: cell.robot.chain,
            flange_from_guide: [
                cell.tool.flange_from_guide_entry,
                cell.tool.flange_from_guide_exit,
            ],
        }
    }
}
