//! Places that have a name and no body: the guide, goals, people.

use std::collections::BTreeSet;

use needlebench_kinematics::Pose;
use needlebench_scenario::ResolvedScenario;
use needlebench_scenario::people::Person;

use crate::MovesWith;

/// A place with a name.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Mark {
    /// `guide_entry`, `GOAL/target`, `GOAL/doctor/feet`, `GOAL/doctor/eyes_1.75`.
    pub name: String,
    /// What it moves with.
    pub frame: MovesWith,
    /// Its pose in that frame.
    pub place: Pose,
}

/// The ends of the guide on the flange, entry and target of each goal, and where people stand and look from while a goal
/// is served.
pub(crate) fn marks(resolved: &ResolvedScenario) -> Vec<Mark> {
    let tool = &resolved.cell.tool;
    let on_flange = |name: &str, pose: &Pose| Mark {
        name: name.to_owned(),
        frame: MovesWith::Flange,
        place: *pose,
    };
    let mut marks = vec![
        on_flange("guide_entry", &tool.flange_from_guide_entry),
        on_flange("guide_exit", &tool.flange_from_guide_exit),
    ];
    let in_world = |name: String, point: nalgebra::Point3<f64>| Mark {
        name,
        frame: MovesWith::World,
        place: Pose::translation(point.x, point.y, point.z),
    };
    for (index, goal) in resolved.goals.iter().enumerate() {
        let places = [("entry", goal.entry_m), ("target", Some(goal.target_m))];
        for (which, point) in places {
            marks.extend(point.map(|point| in_world(format!("{}/{which}", goal.name), point)));
        }
        for person in people(resolved, index) {
            let name = format!("{}/{}", goal.name, person.name);
            marks.push(in_world(format!("{name}/feet"), person.position_m));
            for &stature_m in &person.statures_m {
                let eyes_m = person.eyes_m(stature_m);
                marks.push(in_world(format!("{name}/eyes_{stature_m:.2}"), eyes_m));
            }
        }
    }
    // Statures that are the same to a centimetre are one.
    let mut seen = BTreeSet::new();
    marks.retain(|mark| seen.insert(mark.name.clone()));
    marks
}

/// The people around while a goal is served.
pub(crate) fn people(resolved: &ResolvedScenario, goal: usize) -> &[Person] {
    resolved.people.by_goal.get(goal).map_or(&[], Vec::as_slice)
}
