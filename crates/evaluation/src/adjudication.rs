//! Discrepancy analysis, where the engines differ by more than the envelope allows: in which quantity, when, which
//! engine is nearer to the reference solution, and why.

use needlebench_cell::Cell;
use needlebench_engine::{PlantState, Recording};
use needlebench_kinematics::{JOINT_COUNT, JOINT_LABELS, Joints};
use needlebench_scenario::Goal;
use needlebench_scenario::envelope::EnvelopeSection;
use serde::Serialize;

use crate::engine_pairs::pairs;
use crate::needle::tip_of;
use crate::referee::{RefereeReport, StepDifference, measured_order};

/// A torque within this fraction of its limit was cut by it.
const AT_LIMIT: f64 = 1.0 - 1e-12;

/// Where the engines' difference at half the step is below this fraction of that at the whole one,
/// the step made it. Halving the step halves the error of a method of first order.
const SHRINKS_WITH_STEP: f64 = 0.75;

/// Contacts that begin this many steps apart are no longer one and the same event.
const ONSET_STEPS: f64 = 1.5;

/// The engines' differences in one configuration, compared with the scenario's envelope; of more than two engines,
/// those of the pair that differs most in a quantity.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Adjudication {
    /// Every quantity that could be evaluated.
    pub quantities: Vec<JudgedQuantity>,
}

impl Adjudication {
    /// Whether anything is beyond its limit.
    pub fn has_breach(&self) -> bool {
        self.quantities.iter().any(|each| !each.pass)
    }

    /// Whether any quantity that a reference integrator without contacts can evaluate is beyond its limit.
    pub fn needs_referee(&self) -> bool {
        self.quantities
            .iter()
            .any(|each| !each.pass && !each.quantity.contains(".contact_"))
    }
}

/// One quantity of the envelope.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct JudgedQuantity {
    /// Key of the scenario, `engines.envelope.peak_tip_um` and so on.
    pub quantity: &'static str,
    /// Largest difference.
    pub value: f64,
    /// What is allowed.
    pub limit: f64,
    /// Unit of both.
    pub unit: &'static str,
    /// When it was largest.
    pub time_s: f64,
    /// Joint that it is of.
    pub joint: Option<&'static str>,
    /// Engines that differ by it; left out where there are but two.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub engines: Option<[&'static str; 2]>,
    /// Kept or not.
    pub pass: bool,
    /// Who is right and why; none where the limit is kept.
    pub ruling: Option<Ruling>,
}

/// Who is right, and why the engines differ.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Ruling {
    /// When the limit was first exceeded.
    pub first_time_s: f64,
    /// Engine closer to the reference integrator; none where there is none, as in contact.
    pub nearer: Option<String>,
    /// Likely cause.
    pub cause: Cause,
    /// What the cause was decided by, in words with numbers.
    pub evidence: String,
}

/// Likely cause of a difference of the engines.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Cause {
    /// The engines met at different times, or only one did.
    ContactOnset,
    /// Both are in contact, and one gives way more.
    ContactSoftness,
    /// A torque was at its limit: the servo no longer holds the engines together.
    Saturation,
    /// The difference shrinks with the step.
    StepTooLong,
    /// None of these: the engines do not simulate the same thing.
    ModelsDiffer,
}

impl Cause {
    /// In words.
    pub fn words(self) -> &'static str {
        match self {
            Self::ContactOnset => "contact begins at different times",
            Self::ContactSoftness => "contact compliance",
            Self::Saturation => "torque saturation",
            Self::StepTooLong => "time step too long",
            Self::ModelsDiffer => "unexplained: the engines simulate different models",
        }
    }
}

/// What an inquiry may know besides the recordings.
#[derive(Debug, Clone, Copy, Default)]
pub struct Evidence<'a> {
    /// The engines compared with the reference integrator.
    pub referee: Option<&'a RefereeReport>,
    /// How pairs of engines differ at the scenario's step and smaller ones.
    pub convergence: &'a [PairConvergence],
}

/// The peak difference of two engines from each other by the step.
#[derive(Debug, Clone, PartialEq)]
pub struct PairConvergence {
    /// The engines, in the order of their recordings.
    pub engines: [&'static str; 2],
    /// Their difference, the first entry at the scenario's own step.
    pub steps: Vec<StepDifference>,
}

/// The engines' differences and the envelope, without an inquiry; none unless there are two engines.
pub fn judge_differences(
    cell: &Cell,
    goal: &Goal,
    envelope: &EnvelopeSection,
    runs: &[&Recording],
) -> Option<Adjudication> {
    let quantities = measured_over_pairs(cell, goal, envelope, runs)
        .into_iter()
        .map(|(quantity, _)| quantity.judged)
        .collect();
    (runs.len() > 1).then_some(Adjudication { quantities })
}

/// The same, and for every limit that is exceeded which engine is closer to it and why.
pub fn adjudicate(
    cell: &Cell,
    goal: &Goal,
    envelope: &EnvelopeSection,
    effort_limit_nm: &Joints,
    runs: &[&Recording],
    evidence: Evidence<'_>,
) -> Option<Adjudication> {
    let quantities = measured_over_pairs(cell, goal, envelope, runs)
        .into_iter()
        .map(
            |(
                Measured {
                    mut judged,
                    first_s,
                },
                pair,
            )| {
                judged.ruling = first_s.map(|first_s| {
                    let (cause, words) = cause(&judged, first_s, effort_limit_nm, pair, evidence);
                    Ruling {
                        first_time_s: first_s,
                        nearer: nearer(cause, pair, evidence),
                        cause,
                        evidence: words,
                    }
                });
                judged
            },
        )
        .collect();
    (runs.len() > 1).then_some(Adjudication { quantities })
}

struct Measured {
    judged: JudgedQuantity,
    /// When its limit was first exceeded.
    first_s: Option<f64>,
}

impl Measured {
    /// The largest of a series of differences: time, value and joint.
    fn over(
        quantity: &'static str,
        limit: f64,
        unit: &'static str,
        series: impl Iterator<Item = (f64, f64, Option<&'static str>)>,
    ) -> Self {
        let mut judged = JudgedQuantity {
            quantity,
            value: 0.0,
            limit,
            unit,
            time_s: 0.0,
            joint: None,
            engines: None,
            pass: true,
            ruling: None,
        };
        let mut first_s = None;
        for (time_s, value, joint) in series {
            if value > judged.value {
                (judged.value, judged.time_s, judged.joint) = (value, time_s, joint);
            }
            if value > limit && first_s.is_none() {
                first_s = Some(time_s);
            }
        }
        judged.pass = first_s.is_none();
        Self { judged, first_s }
    }
}

fn first_contact(recording: &Recording) -> Option<usize> {
    recording
        .state
        .iter()
        .position(|state| state.contact.count > 0)
}

const PEAK_TIP: &str = "engines.envelope.peak_tip_um";
const JOINT_TORQUE: &str = "engines.envelope.joint_torque_nm";
const SETTLED_TIP: &str = "engines.envelope.settled_tip_nm";

/// What is evaluated of two motions that touch nothing.
pub(crate) const WITHOUT_CONTACT: [&str; 3] = [PEAK_TIP, JOINT_TORQUE, SETTLED_TIP];

/// Every quantity with the pair of engines that differs most in it.
fn measured_over_pairs<'a>(
    cell: &Cell,
    goal: &Goal,
    envelope: &EnvelopeSection,
    runs: &[&'a Recording],
) -> Vec<(Measured, [&'a Recording; 2])> {
    let mut found: Vec<(Measured, [&Recording; 2])> = Vec::new();
    for [a, b] in pairs(runs) {
        let pair = [*a, *b];
        for mut measured in measured(cell, goal, envelope, pair) {
            if runs.len() > 2 {
                measured.judged.engines = Some(pair.map(|each| each.engine.name));
            }
            let quantity = measured.judged.quantity;
            let known = found
                .iter_mut()
                .find(|(each, _)| each.judged.quantity == quantity);
            match known {
                Some(known) if measured.judged.value > known.0.judged.value => {
                    *known = (measured, pair);
                }
                Some(_) => {}
                None => found.push((measured, pair)),
            }
        }
    }
    found
}

fn measured(
    cell: &Cell,
    goal: &Goal,
    envelope: &EnvelopeSection,
    [a, b]: [&Recording; 2],
) -> Vec<Measured> {
    let tip = |state: &PlantState| tip_of(cell, goal, &state.world_from_flange);
    let states = a.state.len().min(b.state.len());
    // A contact is found in the state after the step that it acted in.
    let free = [a, b]
        .into_iter()
        .filter_map(first_contact)
        .min()
        .map_or(states, |index| index.saturating_sub(1).min(states));
    let distance = |k: usize| (tip(&a.state[k]) - tip(&b.state[k])).norm();
    let mut found = vec![
        Measured::over(
            PEAK_TIP,
            envelope.peak_tip_um * 1e-6,
            "m",
            (0..free).map(|k| (a.time_s[k], distance(k), None)),
        ),
        Measured::over(
            JOINT_TORQUE,
            envelope.joint_torque_nm,
            "N m",
            (0..free.min(a.steps()).min(b.steps())).map(|k| {
                let difference = (a.torque_nm[k] - b.torque_nm[k]).abs();
                let joint = difference.imax();
                (
                    a.time_s[k],
                    difference[joint],
                    Some(JOINT_LABELS[joint.min(JOINT_COUNT - 1)]),
                )
            }),
        ),
    ];
    let Some(last) = states.checked_sub(1) else {
        return found;
    };
    let settled = |quantity, limit, unit, value| {
        Measured::over(
            quantity,
            limit,
            unit,
            std::iter::once((a.time_s[last], value, None)),
        )
    };
    let touching = [a, b].map(|each| each.state[last].contact.count > 0);
    if touching.contains(&true) {
        let [one, other] = [a, b].map(|each| each.state[last].contact.normal_force_n);
        let larger = one.max(other);
        // Bodies that merely touch have no force to compare.
        let relative = if larger > 0.0 {
            (one - other).abs() / larger
        } else {
            0.0
        };
        found.push(settled(
            "engines.envelope.contact_tip_um",
            envelope.contact_tip_um * 1e-6,
            "m",
            distance(last),
        ));
        found.push(settled(
            "engines.envelope.contact_force_relative",
            envelope.contact_force_relative,
            "1",
            relative,
        ));
    } else if free == states {
        found.push(settled(
            SETTLED_TIP,
            envelope.settled_tip_nm * 1e-9,
            "m",
            distance(last),
        ));
    }
    found
}

/// The likely cause of a breach, with what it is decided by.
///
/// Contact goes first, because nothing else matters once the bodies meet; then saturation, because
/// an arm that is not held drifts at any step; then the step.
fn cause(
    judged: &JudgedQuantity,
    first_s: f64,
    effort_limit_nm: &Joints,
    runs: [&Recording; 2],
    evidence: Evidence<'_>,
) -> (Cause, String) {
    let names = runs.map(|each| each.engine.name);
    let onsets = runs.map(|each| first_contact(each).map(|index| each.time_s[index]));
    if onsets.iter().flatten().any(|onset_s| *onset_s <= first_s) {
        return contact_cause(judged, names, onsets, runs);
    }
    let saturated = runs.map(|each| first_saturation(each, effort_limit_nm, first_s));
    if let Some((engine, (time_s, joint))) = names
        .into_iter()
        .zip(saturated)
        .find_map(|(name, found)| Some((name, found?)))
    {
        return (
            Cause::Saturation,
            format!("torque of {joint} saturated in {engine} at {time_s:.3} s"),
        );
    }
    let of_pair = evidence
        .convergence
        .iter()
        .find(|each| each.engines == names);
    let convergence = of_pair.map_or(&[][..], |each| &each.steps);
    let [whole, half, ..] = convergence else {
        return (
            Cause::ModelsDiffer,
            "no contact, no saturated torque, and no run with a smaller step".to_owned(),
        );
    };
    let shrunk = half.peak_tip_m / whole.peak_tip_m;
    let words = format!(
        "tip difference {:.3} um at step {:.3} ms and {:.3} um at step {:.3} ms{}",
        whole.peak_tip_m * 1e6,
        whole.timestep_s * 1e3,
        half.peak_tip_m * 1e6,
        half.timestep_s * 1e3,
        measured_order(convergence).map_or(String::new(), |order| format!(", order {order:.2}")),
    );
    if shrunk < SHRINKS_WITH_STEP {
        (Cause::StepTooLong, words)
    } else {
        (Cause::ModelsDiffer, words)
    }
}

fn contact_cause(
    judged: &JudgedQuantity,
    names: [&str; 2],
    onsets: [Option<f64>; 2],
    runs: [&Recording; 2],
) -> (Cause, String) {
    let apart_s = match onsets {
        [Some(a), Some(b)] => (a - b).abs(),
        _ => f64::INFINITY,
    };
    if apart_s > ONSET_STEPS * runs[0].timestep_s {
        let describe = |name: &str, onset: Option<f64>| {
            onset.map_or(format!("never in {name}"), |time_s| {
                format!("at {time_s:.4} s in {name}")
            })
        };
        return (
            Cause::ContactOnset,
            format!(
                "contact begins {} and {}",
                describe(names[0], onsets[0]),
                describe(names[1], onsets[1])
            ),
        );
    }
    let describe = |name: &str, recording: &Recording| {
        let at = recording
            .time_s
            .partition_point(|time_s| *time_s < judged.time_s)
            .min(recording.state.len() - 1);
        let contact = &recording.state[at].contact;
        format!(
            "penetration {:.3} um at {:.3} N in {name}",
            contact.deepest_penetration_m * 1e6,
            contact.normal_force_n
        )
    };
    (
        Cause::ContactSoftness,
        format!(
            "at {:.4} s: {} and {}",
            judged.time_s,
            describe(names[0], runs[0]),
            describe(names[1], runs[1])
        ),
    )
}

/// First time, up to `until_s`, at which a torque was at its limit, and the joint's label.
fn first_saturation(
    recording: &Recording,
    effort_limit_nm: &Joints,
    until_s: f64,
) -> Option<(f64, &'static str)> {
    recording
        .torque_nm
        .iter()
        .zip(&recording.time_s)
        .take_while(|(_, time_s)| **time_s <= until_s)
        .find_map(|(torque_nm, &time_s)| {
            let joint =
                (0..JOINT_COUNT).find(|&i| torque_nm[i].abs() >= effort_limit_nm[i] * AT_LIMIT)?;
            Some((time_s, JOINT_LABELS[joint]))
        })
}

/// The engine of a pair that stays nearer to the reference integrator under held torques: in closed loop a servo hides
/// most of what an engine gets wrong. None where one of them was not compared with it.
fn nearer(cause: Cause, pair: [&Recording; 2], evidence: Evidence<'_>) -> Option<String> {
    if matches!(cause, Cause::ContactOnset | Cause::ContactSoftness) {
        return None;
    }
    let referee = evidence.referee?;
    let apart_m = |each: &Recording| {
        let found = referee.engines.get(each.engine.name)?;
        Some(found.held_torques.as_ref()?.peak_tip_m)
    };
    let [one, other] = pair;
    let nearer = if apart_m(one)? <= apart_m(other)? {
        one
    } else {
        other
    };
    Some(nearer.engine.name.to_owned())
}

/// A breach in one sentence, for the report's remarks; none where the limit is kept.
pub fn sentence(judged: &JudgedQuantity) -> Option<String> {
    let ruling = judged.ruling.as_ref()?;
    let joint = judged
        .joint
        .map_or(String::new(), |joint| format!(" of {joint}"));
    let nearer = ruling.nearer.as_ref().map_or(String::new(), |engine| {
        format!(" {engine} is closer to the reference integrator;")
    });
    let engines = judged
        .engines
        .map_or("engines".to_owned(), |engines| engines.join(" and "));
    Some(format!(
        "{engines} differ{joint} from {:.3} s, most at {:.3} s;{nearer} likely cause: {} ({})",
        ruling.first_time_s,
        judged.time_s,
        ruling.cause.words(),
        ruling.evidence
    ))
}
