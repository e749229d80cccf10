//! What is measured of prescribed contacts, of stops, and of the retreat.

mod envelope;
mod press;
mod retract;
mod stop;

use std::collections::BTreeMap;

use needlebench_cell::BrakeFigures;
use serde::Serialize;

pub use envelope::{StopEnvelope, stopping_envelope};
pub use press::{
    PressEngineReport, PressReport, RIGID_FORCE_MEANS, measure_press, press_difference,
};
pub use retract::{RetractionEngineReport, measure_retraction};
pub use stop::{StopEngineReport, measure_stop};

use crate::report::{ClearanceReport, Judged};

/// Events of one configuration.
#[derive(Debug, Clone, PartialEq, Serialize, Default)]
pub struct EventsReport {
    /// Contacts, in the order of the scenario.
    pub press: Vec<PressReport>,
    /// The stop; none if the scenario asks for none.
    pub stop: Option<StopReport>,
    /// The retreat, by engine; empty if the scenario does not prescribe it.
    pub retract: BTreeMap<String, RetractionEngineReport>,
    /// What was evaluated and what was to be; in the report's own lists of criteria.
    #[serde(skip)]
    pub checks: Judged,
}

impl EventsReport {
    /// Clearances of the motions of stop and retreat, in all engines.
    pub(crate) fn clearances(&self) -> impl Iterator<Item = &ClearanceReport> {
        let stops = self.stop.iter().flat_map(|stop| stop.engines.values());
        let retreats = self.retract.values();
        let stops = stops.map(|engine| &engine.clearance);
        stops.chain(retreats.map(|engine| &engine.clearance))
    }
}

/// A stop on the way in.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StopReport {
    /// Category of IEC 60204-1.
    pub category: u8,
    /// When it was triggered, s.
    pub at_s: f64,
    /// In which phase.
    pub phase: &'static str,
    /// What the engines measured.
    pub engines: BTreeMap<String, StopEngineReport>,
    /// Distance of the engines' tips in the end, m; none unless both ran.
    pub tip_difference_m: Option<f64>,
    /// How far a stop at any moment of the way in would go, by our own dynamics.
    pub envelope: StopEnvelope,
    /// The brakes and what they are derived from; none in category 2, where the servo goes on.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub brakes: Option<StopBrakes>,
}

/// How far brakes that are derived from published stops are tested, in the words of reports.
pub const BRAKES_FIT: &str = "two torques of each joint are fitted to its two published figures; no published stop remains \
     to verify them";

/// Brakes of the joints, derived from an arm's published stops.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StopBrakes {
    /// The published stops, whose they are and where they are from.
    #[serde(flatten)]
    pub figures: BrakeFigures,
    /// How far they are tested: [`BRAKES_FIT`].
    pub fit: &'static str,
    /// Torque of each slipping brake at no speed, N m.
    pub coulomb_nm: [f64; 6],
    /// Torque of each by speed, N m s/rad.
    pub viscous_nms_per_rad: [f64; 6],
}
