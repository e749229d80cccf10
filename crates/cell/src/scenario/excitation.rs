//! A run that excites every joint, for what is then identified from its log: `[excitation]`.

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Serialize};

use needlebench_kinematics::JOINT_LABELS;

use super::Scenario;
use crate::Finding;
use crate::toml_text::TomlText;

/// A run that excites every joint instead of goals: postures at which the arm stands, for a calibration; single
/// joints that sweep both ways at several speeds, for friction; once with each payload. `needlebench
/// record-plan` writes it.
///
/// The arm starts at the scenario's start posture and comes back to it. All motions are straight in joint space,
/// from rest to rest; accelerations are those of `[motion]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ExcitationSection {
    /// Postures in the order in which they are visited, shoulder pan to wrist 3, deg.
    #[schemars(length(min = 1, max = 500), extend("x-hint" = "a calibration has 30 unknowns and a posture gives 6 equations: 24 postures are sound, fewer than 10 are not"), inner(inner(range(min = -720.0, max = 720.0))))]
    pub postures_deg: Vec<[f64; 6]>,
    /// Time for which the arm stands at each posture, s. Default assumed: 25 rows of a log of 25 Hz, the
    /// slowest that is known.
    #[schemars(range(min = 0.05, max = 60.0))]
    pub dwell_s: f64,
    /// Speeds of the leading joint between postures, deg/s: one after the other, and again. Default: URScript
    /// `movej`'s 1.05 rad/s, and half of it, so that friction is seen at several speeds.
    #[schemars(length(min = 1, max = 20), inner(range(min = 0.5, max = 360.0)))]
    pub speeds_deg_s: Vec<f64>,
    /// Motions of one joint alone.
    pub sweeps: Vec<SweepSection>,
    /// Speeds of each sweep, deg/s: forth and back at each. Default: slow, where sliding friction is nearly all
    /// but well above the speeds at which a joint sticks; and fast enough for viscous friction.
    #[schemars(length(min = 1, max = 20), inner(range(min = 0.5, max = 360.0)))]
    pub sweep_speeds_deg_s: Vec<f64>,
    /// What is mounted at the flange besides the tool: the whole run once with each. Default: nothing.
    #[schemars(length(min = 1, max = 20))]
    pub payloads: Vec<PayloadSection>,
    /// Time between two rows of the log, ms; that of the arm's controller if left out.
    #[schemars(range(min = 0.01, max = 1000.0))]
    pub period_ms: Option<f64>,
    /// Least proven clearance of arm, tool and payload from everything else, mm. Default assumed: a hand's
    /// thickness beside an arm whose surroundings are known to a centimetre.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub clearance_mm: f64,
    /// Least proven clearance of arm, tool and payload from the arm itself, mm. Default assumed: above what
    /// calibration and tracking move anything by; by its build an arm's own links are about 10 mm apart.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub self_clearance_mm: f64,
}

impl Default for ExcitationSection {
    fn default() -> Self {
        Self {
            postures_deg: Vec::new(),
            dwell_s: 1.0,
            speeds_deg_s: vec![60.0, 30.0],
            sweeps: Vec::new(),
            sweep_speeds_deg_s: vec![6.0, 40.0],
            payloads: vec![PayloadSection::default()],
            period_ms: None,
            clearance_mm: 30.0,
            self_clearance_mm: 5.0,
        }
    }
}

/// A motion of one joint away from a posture and back, at every speed of the sweeps.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SweepSection {
    /// The joint: `shoulder_pan`, `shoulder_lift`, `elbow`, `wrist_1`, `wrist_2` or `wrist_3`.
    #[schemars(schema_with = "joints")]
    pub joint: String,
    /// The posture at which it is made, counted from 1 as `postures_deg` are; 0 for the start posture.
    #[schemars(range(min = 0, max = 500))]
    pub posture: usize,
    /// By how much the joint moves, deg.
    #[schemars(range(min = -360.0, max = 360.0))]
    pub by_deg: f64,
}

/// What is mounted at the flange besides the tool.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PayloadSection {
    /// Its mass, kg.
    #[schemars(range(min = 0.0, max = 50.0))]
    pub mass_kg: f64,
    /// Its centre in the flange frame, mm. Left out: on the flange's axis, half of its depth before the flange.
    #[schemars(inner(range(min = -500.0, max = 500.0)))]
    pub centre_mm: Option<[f64; 3]>,
    /// Edges of the box around it along the axes of the flange, mm: what clearances are of. Left out: a cube of
    /// steel of that mass.
    #[schemars(inner(range(min = 1.0, max = 1000.0)))]
    pub size_mm: Option<[f64; 3]>,
}

fn joints(_: &mut SchemaGenerator) -> Schema {
    json_schema!({ "type": "string", "enum": JOINT_LABELS })
}

/// What contradicts the section, in itself and elsewhere.
pub(super) fn check(toml: &TomlText<'_>, scenario: &Scenario) -> Vec<Finding> {
    let Some(section) = &scenario.excitation else {
        return Vec::new();
    };
    let mut findings = Vec::new();
    let count = section.postures_deg.len();
    if toml.span_of("excitation.postures_deg").is_none() {
        findings.push(
            toml.finding("excitation", "`postures_deg` is missing")
                .hint("`needlebench record-plan` finds postures and writes them"),
        );
    }
    for (index, sweep) in section.sweeps.iter().enumerate() {
        let key = |name: &str| format!("excitation.sweeps[{index}].{name}");
        if sweep.posture > count {
            let message = format!("there is no posture {}", sweep.posture);
            let hint = format!("0 for the start posture, 1 to {count} for those of `postures_deg`");
            findings.push(toml.finding(&key("posture"), message).hint(hint));
        }
        if sweep.by_deg == 0.0 {
            let message = "a sweep by 0 deg is none";
            let hint = "45 deg or more let the joint reach its speed; negative for the other way";
            findings.push(toml.finding(&key("by_deg"), message).hint(hint));
        }
    }
    for (index, payload) in section.payloads.iter().enumerate() {
        let is_repeated = section.payloads[..index].contains(payload);
        if is_repeated {
            let key = format!("excitation.payloads[{index}]");
            let message = "the payload is listed twice";
            let hint = "the whole run is made once with each payload: leave one of them out";
            findings.push(toml.finding(&key, message).hint(hint));
        }
        if payload.mass_kg == 0.0 && (payload.centre_mm.is_some() || payload.size_mm.is_some()) {
            let key = format!("excitation.payloads[{index}].mass_kg");
            let message = "a payload without mass has no centre and no size";
            let hint = "give `mass_kg`, or leave the others out for a run without payload";
            findings.push(toml.finding(&key, message).hint(hint));
        }
    }
    for (name, is_there) in [
        ("goals", !scenario.goals.is_empty()),
        ("[iso9283]", scenario.iso9283.is_some()),
        ("[events]", scenario.events.is_some()),
    ] {
        if is_there {
            let message = format!("a scenario with [excitation] has no {name}");
            findings.push(
                toml.finding("excitation", message)
                    .hint("put the run into a scenario of its own"),
            );
        }
    }
    findings
}
