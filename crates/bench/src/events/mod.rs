//! The third stage: contacts, a stop and the retreat, where a scenario asks for them. They are staged once, simulated
//! in each engine, and put into the report.

mod checks;
mod report;
mod simulate;
mod stage;

pub(crate) use report::events_report;
pub(crate) use simulate::simulate;
pub(crate) use stage::stage;

use needlebench_cell::BrakeFigures;
use needlebench_engine::{Brakes, Recording};
use needlebench_evaluation::events::StopEnvelope;
use needlebench_kinematics::trajectory::{JointTrajectory, Phase};
use needlebench_planning::{PressError, PressPlan};
use needlebench_scenario::ResolvedScenario;
use needlebench_scenario::scenario::EventsSection;

/// Events of one configuration, with what the engines made of them.
#[derive(Debug)]
pub struct EventRun {
    /// Index of the goal.
    pub goal: usize,
    /// Index of the configuration.
    pub configuration: usize,
    /// The contacts.
    pub press: Vec<Result<PressPlan, PressError>>,
    /// The stop.
    pub stop: Option<StagedStop>,
    /// What each engine recorded, by its name.
    pub engines: Vec<(&'static str, EngineEvents)>,
}

/// A stop that is ready to be simulated.
#[derive(Debug)]
pub struct StagedStop {
    at_s: f64,
    phase: Phase,
    trajectory: JointTrajectory,
    /// From when on, and with which brakes.
    brakes: Option<(f64, Brakes)>,
    /// What the brakes are derived from.
    figures: Option<BrakeFigures>,
    envelope: StopEnvelope,
}

/// Recordings of one engine.
#[derive(Debug, Default)]
pub struct EngineEvents {
    /// By contact; none where it could not be staged.
    pub press: Vec<Option<Recording>>,
    stop: Option<Recording>,
    retract: Option<Recording>,
}

fn section(resolved: &ResolvedScenario) -> &EventsSection {
    let events = resolved.scenario.events.as_ref();
    events.expect("events are staged where the scenario has the section")
}
