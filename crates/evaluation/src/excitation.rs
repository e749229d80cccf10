//! What is reported of an excitation run, and its criteria.

use std::collections::BTreeMap;

use needlebench_cell::{ClearanceClass, UNSEEN_BODY};
use needlebench_scenario::scenario::CriteriaSection;
use serde::Serialize;

use crate::class_clearance::ClearanceReport;
use crate::iso9283::Effort;
use crate::motion::EngineDifference;
use crate::truth::TruthReport;
use crate::verdict::{CriterionResult, Judged};
use crate::verdict::{UNCOMPARED, unmeasured_by};

/// What criteria of such a run are said to be about, in place of a goal.
pub const SUBJECT: &str = "excitation";

/// A simulated run.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ExcitationReport {
    /// Postures in the order in which they are visited, rad.
    pub postures_rad: Vec<[f64; 6]>,
    /// Stand at each, s.
    pub dwell_s: f64,
    /// Duration with one payload, s.
    pub duration_s: f64,
    /// Required clearance from everything else, m.
    pub clearance_limit_m: f64,
    /// Required self-clearance, m.
    pub self_clearance_limit_m: f64,
    /// Certified clearances of the planned motions, all together.
    pub planned: ClearanceReport,
    /// Motion by motion.
    pub motions: Vec<MotionReport>,
    /// Payloads, in the order of the runs.
    pub loads: Vec<LoadReport>,
    /// What each engine's arm did, by payload.
    pub engines: BTreeMap<String, Vec<LoadMeasurement>>,
    /// Difference of the flanges of two engines, over the runs and at their ends.
    pub engine_difference: Option<EngineDifference>,
    /// Files of the results folder.
    pub files: Vec<String>,
}

/// A motion of the plan.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MotionReport {
    /// In words.
    pub motion: String,
    /// Its certified clearances.
    pub clearance: ClearanceReport,
}

/// What is mounted in a run.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LoadReport {
    /// Mass besides the tool, kg.
    pub added_kg: f64,
    /// Mass at the flange that the controller assumes, tool included, kg.
    pub payload_kg: f64,
    /// Its centre in the flange frame, m.
    pub payload_cog_m: [f64; 3],
    /// How the arm that is simulated differs from what its controller assumes; none if it does not.
    pub truth: Option<TruthReport>,
}

/// What an engine's arm did with a payload.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LoadMeasurement {
    /// Number of the payload, from 1.
    pub load: usize,
    /// Clearances of the recorded motion, proven between its steps.
    pub clearance: ClearanceReport,
    /// Readings of the encoders minus targets, root mean square by joint, rad.
    pub tracking_rms_rad: [f64; 6],
    /// The largest of them, rad.
    pub tracking_peak_rad: [f64; 6],
    /// Effort and contact.
    #[serde(flatten)]
    pub effort: Effort,
}

/// Least certified clearance from everything else, and from itself, m; none where nothing is measured.
pub fn proven_m(clearance: &ClearanceReport) -> [Option<f64>; 2] {
    let least = |is_self: bool| {
        let classes = clearance.classes.iter().filter(|(name, _)| {
            ClearanceClass::named(name).is_some_and(|class| {
                class.is_physical() && (class == ClearanceClass::SelfCollision) == is_self
            })
        });
        classes
            .map(|(_, found)| found.certified_lower_bound_m)
            .reduce(|least, next| Some(least?.min(next?)))
            .flatten()
    };
    [least(false), least(true)]
}

/// Checks a run against the clearances of its section, planned and recorded, and against those criteria of the
/// scenario that make sense without a goal: torque, contact and the difference of the engines.
pub fn judge(report: &ExcitationReport, general: &CriteriaSection, engines: &[&str]) -> Judged {
    let mut judged = Judged::default();
    let limits_m = [report.clearance_limit_m, report.self_clearance_limit_m];
    let mut clearances = |engine: Option<(&str, usize)>, found: Option<&ClearanceReport>| {
        let values = found.map(proven_m);
        for (which, criterion) in ["clearance_mm", "self_clearance_mm"]
            .into_iter()
            .enumerate()
        {
            let value = values.and_then(|values| values[which]);
            if value.is_none() && found.is_some() {
                // There is nothing of that kind to come near to.
                continue;
            }
            let result = CriterionResult {
                value,
                limit: Some(limits_m[which]),
                unit: "m",
                pass: value.is_some_and(|value| value >= limits_m[which]),
                ..about(engine, criterion)
            };
            let is_unknown = which == 0 && found.is_some_and(|it| it.unknown().next().is_some());
            if is_unknown && result.pass {
                let unjudged = CriterionResult {
                    value: None,
                    ..result
                };
                judged.add(unjudged, || UNSEEN_BODY.to_owned());
                continue;
            }
            judged.add(result, || {
                engine.map_or(String::new(), |(name, _)| unmeasured_by(name))
            });
        }
    };
    clearances(None, Some(&report.planned));
    let measured = |name: &str, load: usize| {
        let of_engine = report.engines.get(name)?;
        of_engine.iter().find(|each| each.load == load)
    };
    for &name in engines {
        for load in 1..=report.loads.len() {
            let found = measured(name, load);
            clearances(Some((name, load)), found.map(|found| &found.clearance));
        }
    }
    for &name in engines {
        for load in 1..=report.loads.len() {
            let effort = measured(name, load).map(|found| &found.effort);
            let engine = Some((name, load));
            let missing = || unmeasured_by(name);
            if let Some(limit) = general.max_peak_torque_ratio {
                let value = effort.map(|effort| effort.peak_torque_ratio);
                judged.add(
                    at_most(engine, "max_peak_torque_ratio", value, limit, "1"),
                    missing,
                );
            }
            if !general.allow_contact {
                let value = effort.map(|effort| {
                    if effort.contact.occurred {
                        effort.contact.peak_force_n.max(f64::MIN_POSITIVE)
                    } else {
                        0.0
                    }
                });
                judged.add(at_most(engine, "allow_contact", value, 0.0, "N"), missing);
            }
        }
    }
    if engines.len() > 1 {
        let difference = report.engine_difference;
        for (criterion, limit_mm, value) in [
            (
                "max_engine_difference_peak_mm",
                general.max_engine_difference_peak_mm,
                difference.map(|each| each.peak_tip_m),
            ),
            (
                "max_engine_difference_settled_mm",
                general.max_engine_difference_settled_mm,
                difference.map(|each| each.settled_tip_m),
            ),
        ] {
            if let Some(limit_mm) = limit_mm {
                let result = at_most(None, criterion, value, limit_mm * 1e-3, "m");
                judged.add(result, || UNCOMPARED.to_owned());
            }
        }
    }
    judged
}

fn about(engine: Option<(&str, usize)>, criterion: &str) -> CriterionResult {
    CriterionResult {
        goal: SUBJECT.to_owned(),
        label: engine.map(|(_, load)| format!("payload {load}")),
        engine: engine.map(|(name, _)| name.to_owned()),
        criterion: criterion.to_owned(),
        value: None,
        limit: None,
        unit: "1",
        pass: false,
        detail: match engine {
            Some(_) => String::new(),
            None => "of the planned motions".to_owned(),
        },
        requirement: None,
    }
}

fn at_most(
    engine: Option<(&str, usize)>,
    criterion: &str,
    value: Option<f64>,
    limit: f64,
    unit: &'static str,
) -> CriterionResult {
    CriterionResult {
        value,
        limit: Some(limit),
        unit,
        pass: value.is_some_and(|value| value <= limit),
        detail: String::new(),
        ..about(engine, criterion)
    }
}
