//! Postures with names: where the arm starts, and where it ends.

use needlebench_clearance::ClearanceModel;
use needlebench_kinematics::ik::Configuration;
use needlebench_kinematics::{Joints, NotUrGeometry};
use needlebench_planning::Planner;
use needlebench_scenario::ResolvedScenario;

/// A posture with a name of letters, digits and `_ - . /`.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct NamedPosture {
    /// `start`, or `GOAL/CONFIGURATION`.
    pub name: String,
    /// Joint positions, rad.
    pub joints: Joints,
}

/// The start posture, and for each goal the final posture of each configuration that violates no rule: the one that a
/// plan tries first, without a look at motions.
pub(crate) fn named_postures(
    resolved: &ResolvedScenario,
) -> Result<Vec<NamedPosture>, NotUrGeometry> {
    let mut postures = vec![NamedPosture {
        name: "start".to_owned(),
        joints: resolved.start,
    }];
    let model = ClearanceModel::new(&resolved.cell);
    let planner = Planner::new(resolved, &model)?;
    for goal in &resolved.goals {
        for (configuration, member) in Configuration::ALL.into_iter().zip(planner.postures(goal)) {
            if let Some(candidate) = member.candidate.as_ref().filter(|_| member.works()) {
                postures.push(NamedPosture {
                    name: format!("{}/{}", goal.name, configuration.label()),
                    joints: candidate.joints,
                });
            }
        }
    }
    Ok(postures)
}
