//! Excitation run for calibration and dynamic identification: `[excitation]`.

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Serialize};

use needlebench_input::{Finding, TomlText};
use needlebench_kinematics::JOINT_LABELS;

use super::Scenario;

/// An excitation run instead of goals: postures held for a calibration, and single-joint sweeps in both directions at
/// several speeds for friction, repeated with each payload. `needlebench record-plan` writes it.
///
/// The arm starts and ends at the scenario's start posture. All motions are joint-space lines from rest to rest, with
/// the accelerations of `[motion]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ExcitationSection {
    /// Postures in the order of the run, shoulder pan to wrist 3, deg.
    #[schemars(length(min = 1, max = 500), extend("x-hint" = "a calibration has 30 unknowns and a posture gives 6 equations: 24 postures are recommended, fewer than 10 are too few"), inner(inner(range(min = -720.0, max = 720.0))))]
    pub postures_deg: Vec<[f64; 6]>,
    /// Dwell time at each posture, s. Assumed: 25 rows of a 25 Hz log, the slowest known.
    #[schemars(range(min = 0.05, max = 60.0))]
    pub dwell_s: f64,
    /// Speeds of the leading joint between postures, deg/s, used in turn. Default: URScript `movej`'s 1.05 rad/s and
    /// half of it, to identify friction at several speeds.
    #[schemars(length(min = 1, max = 20), inner(range(min = 0.5, max = 360.0)))]
    pub speeds_deg_s: Vec<f64>,
    /// Single-joint motions.
    pub sweeps: Vec<SweepSection>,
    /// Speeds of each sweep, deg/s, both directions at each. Default: one slow speed, dominated by Coulomb friction but
    /// well above stick-slip, and one fast enough for viscous friction.
    #[schemars(length(min = 1, max = 20), inner(range(min = 0.5, max = 360.0)))]
    pub sweep_speeds_deg_s: Vec<f64>,
    /// Payloads at the flange besides the tool; the whole run is repeated with each. Default: none.
    #[schemars(length(min = 1, max = 20))]
    pub payloads: Vec<PayloadSection>,
    /// Sampling period of the log, ms. Default: that of the arm's controller.
    #[schemars(range(min = 0.01, max = 1000.0))]
    pub period_ms: Option<f64>,
    /// Minimum certified clearance of arm, tool and payload from everything else, mm. Assumed: a hand's thickness, with
    /// the surroundings known to 1 cm.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub clearance_mm: f64,
    /// Minimum certified self-clearance of arm, tool and payload, mm. Assumed: above all calibration and tracking
    /// errors; in most postures forearm and wrist 2 are about 10 mm apart.
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

/// A motion of one joint away from a posture and back, at every sweep speed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SweepSection {
    /// The joint: `shoulder_pan`, `shoulder_lift`, `elbow`, `wrist_1`, `wrist_2` or `wrist_3`.
    #[schemars(schema_with = "joints")]
    pub joint: String,
    /// Number of the posture at which the sweep is made, from 1 in the order of `postures_deg`; 0 for the start
    /// posture.
    #[schemars(range(min = 0, max = 500))]
    pub posture: usize,
    /// Joint displacement, deg.
    #[schemars(range(min = -360.0, max = 360.0))]
    pub by_deg: f64,
}

/// A payload at the flange besides the tool.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PayloadSection {
    /// Mass, kg.
    #[schemars(range(min = 0.0, max = 50.0))]
    pub mass_kg: f64,
    /// Centre of mass in the flange frame, mm. Default: on the flange axis, half the payload's depth in front of the
    /// flange.
    #[schemars(inner(range(min = -500.0, max = 500.0)))]
    pub centre_mm: Option<[f64; 3]>,
    /// Edges of the bounding box along the flange axes, mm, used for clearances. Default: a steel cube of that mass.
    #[schemars(inner(range(min = 1.0, max = 1000.0)))]
    pub size_mm: Option<[f64; 3]>,
}

fn joints(_: &mut SchemaGenerator) -> Schema {
    json_schema!({ "type": "string", "enum": JOINT_LABELS })
}

/// Checks the section, and its combination with other sections.
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
            let message = "a sweep needs a displacement other than 0 deg";
            let hint =
                "45 deg or more let the joint reach its speed; negative for the other direction";
            findings.push(toml.finding(&key("by_deg"), message).hint(hint));
        }
    }
    for (index, payload) in section.payloads.iter().enumerate() {
        let is_repeated = section.payloads[..index].contains(payload);
        if is_repeated {
            let key = format!("excitation.payloads[{index}]");
            let message = "the payload is listed twice";
            let hint = "the whole run is repeated with each payload: remove one of them";
            findings.push(toml.finding(&key, message).hint(hint));
        }
        if payload.mass_kg == 0.0 && (payload.centre_mm.is_some() || payload.size_mm.is_some()) {
            let key = format!("excitation.payloads[{index}].mass_kg");
            let message = "a payload without mass has no centre and no size";
            let hint = "give `mass_kg`, or omit the others for a run without payload";
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
