//! The pairs that an SRDF disables, compared with the model.

use needlebench_cell::Cell;
use needlebench_input::Finding;
use needlebench_kinematics::JOINT_LABELS;
use needlebench_robot::{LinkMember, Srdf};
use serde::Serialize;

use needlebench_clearance::{PairExamination, PairState};

/// What the model says to a disabled pair.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum SrdfVerdict {
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
pub(super) struct SrdfAnswer {
    /// Index into [`Srdf::disabled`].
    pub pair: usize,
    /// The answer.
    pub verdict: SrdfVerdict,
    /// Index into the examinations; `None` for an unknown link, and for two links of one body.
    pub examination: Option<usize>,
    /// What is wrong, for pairs that are refuted or unknown.
    pub finding: Option<Finding>,
}

/// Checks every disabled pair of an SRDF against the pairs that were examined.
///
/// Links that share a joint are justified by that alone: the model leaves them out as well.
pub(super) fn check_srdf(
    srdf: &Srdf,
    cell: &Cell,
    members: &[LinkMember],
    examined: &[PairExamination],
) -> Vec<SrdfAnswer> {
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
            let [first, second] = match srdf.bodies_of(disabled, cell, members) {
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
                        "keep the pair enabled: needlebench checks it regardless of the SRDF",
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

#[cfg(test)]
mod tests {
    use std::path::Path;

    use needlebench_clearance::{ClearanceModel, PairSettings, examine_pairs};
    use needlebench_scenario::{Overrides, load_scenario};

    use super::*;

    #[test]
    fn an_srdf_is_believed_only_where_the_model_agrees() {
        use SrdfVerdict::{Justified, Refuted, UnknownLink, Unproven};
        let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenarios/table3.toml");
        let resolved = load_scenario(Path::new(file), &Overrides::default()).unwrap();
        let cell = &resolved.cell;
        // As shipped with a widespread UR3 description.
        let text = r#"<robot name="ur5">
  <disable_collisions link1="shoulder_link" link2="upper_arm_link"/>
  <disable_collisions link1="forearm_link" link2="wrist_3_link" reason="Never"/>
  <disable_collisions link1="wrist_1_link" link2="wrist_3_link" reason="Never"/>
  <disable_collisions link1="tool0" link2="wrist_3_link" reason="Adjacent"/>
  <disable_collisions link1="wrist_3_link" link2="gantry" reason="Never"/>
  <disable_collisions link1="wrist_3_link" link2="ee_link" reason="Never"/>
</robot>"#;
        let srdf = Srdf::parse("ur3_gripper.srdf", text).unwrap();
        let settings = PairSettings {
            samples: 2000,
            ..PairSettings::default()
        };
        let examined = examine_pairs(cell, &settings);
        let answers = check_srdf(&srdf, cell, &resolved.robot_description.members, &examined);
        let verdicts: Vec<_> = answers.iter().map(|answer| answer.verdict).collect();
        assert_eq!(
            verdicts,
            [
                Justified,
                Refuted,
                Justified,
                Justified,
                Unproven,
                UnknownLink
            ]
        );
        let refuted = answers[1].finding.as_ref().unwrap();
        assert_eq!(refuted.line, Some(3));
        assert!(refuted.message.contains("'Never'"), "{refuted}");
        // The posture that it names shows it.
        let pair = &examined[answers[1].examination.unwrap()];
        let model = ClearanceModel::new(cell);
        let shown = model.all_pairs(&pair.least_at);
        let deepest = shown
            .iter()
            .find(|found| {
                let bodies = cell.pairs[found.pair];
                [(bodies.a, bodies.b), (bodies.b, bodies.a)].contains(&(pair.a, pair.b))
            })
            .unwrap();
        assert!(deepest.separation.distance_m < 0.0);
    }
}
