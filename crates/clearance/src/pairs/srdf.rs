//! The pairs that an SRDF disables, held against the model.

use needlebench_cell::{Cell, Finding, Srdf};
use needlebench_kinematics::JOINT_LABELS;
use serde::Serialize;

use super::{PairExamination, PairState};

/// What the model says to a disabled pair.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum SrdfVerdict {
    /// It shares a joint, cannot move, is proven never to touch, or always does.
    Justified,
    /// It did not touch at any posture looked at, which proves nothing.
    Unproven,
    /// It touches at some posture.
    Refuted,
    /// It names a link that the robot does not have.
    UnknownLink,
}

/// A disabled pair and the model's answer.
#[derive(Debug, Clone, PartialEq)]
pub struct SrdfAnswer {
    /// Index into [`Srdf::disabled`].
    pub pair: usize,
    /// The answer.
    pub verdict: SrdfVerdict,
    /// Index into the examinations; `None` for an unknown link, and for two links of one body.
    pub examination: Option<usize>,
    /// What is wrong, for pairs that are refuted or unknown.
    pub finding: Option<Finding>,
}

/// Checks every disabled pair of an SRDF against [`examine_pairs`](super::examine_pairs).
///
/// Links that share a joint are justified by that alone: the model leaves them out as well.
pub fn check_srdf(srdf: &Srdf, cell: &Cell, examined: &[PairExamination]) -> Vec<SrdfAnswer> {
    srdf.disabled
        .iter()
        .enumerate()
        .map(|(index, disabled)| {
            let answer = |verdict, examination, finding| SrdfAnswer {
                pair: index,
                verdict,
                examination,
                finding,
            };
            let [first, second] = match srdf.bodies_of(disabled, cell) {
                Ok(bodies) => bodies,
                Err(finding) => return answer(SrdfVerdict::UnknownLink, None, Some(finding)),
            };
            let found = examined.iter().position(|each| {
                (each.a, each.b) == (first, second) || (each.a, each.b) == (second, first)
            });
            let Some(found) = found else {
                return answer(SrdfVerdict::Justified, None, None);
            };
            let pair = &examined[found];
            match pair.state {
                PairState::Checked if pair.least_m < 0.0 => {
                    let message = refutation(&disabled.reason, pair);
                    let finding = srdf.finding(disabled, message).hint(
                        "leave the pair enabled: needlebench measures it, whatever the SRDF says",
                    );
                    answer(SrdfVerdict::Refuted, Some(found), Some(finding))
                }
                PairState::Checked => answer(SrdfVerdict::Unproven, Some(found), None),
                _ => answer(SrdfVerdict::Justified, Some(found), None),
            }
        })
        .collect()
}

fn refutation(reason: &str, pair: &PairExamination) -> String {
    let reason = match reason {
        "" => String::new(),
        reason => format!(" as '{reason}'"),
    };
    let posture: Vec<String> = JOINT_LABELS
        .iter()
        .zip(pair.least_at.iter())
        .map(|(joint, q)| format!("{joint} {:.1}", q.to_degrees()))
        .collect();
    format!(
        "disabled{reason}, but they collide at {:.1} % of random postures, {:.1} mm deep at {} deg",
        pair.collision_rate * 100.0,
        -pair.least_m * 1e3,
        posture.join(", ")
    )
}
