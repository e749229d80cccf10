//! People, their lines of sight, and the free space.

use std::collections::BTreeMap;

use needlebench_evaluation::report::ConfigurationReport;
use needlebench_evaluation::room::{RoomModel, sight_segments};
use needlebench_kinematics::Joints;
use needlebench_scenario::ResolvedScenario;
use needlebench_scenario::people::Person;
use serde_json::{Value, json};

use super::mesh::surface;
use super::pack::Pack;
use super::scene::pose;
use crate::picture::voxel_surface;

/// Lines of sight that are shown per stature, half to the skin and half to the needle, as in the
/// pictures.
const LINES_DRAWN: u32 = 8;

/// People and the hemisphere about a goal's entry point.
pub(super) fn people(resolved: &ResolvedScenario, room: &RoomModel<'_>, goal: usize) -> Value {
    let sector = room.sector(goal);
    let (center, out) = (sector.center_m, sector.outwards);
    let people: Vec<Value> = resolved.people.by_goal[goal].iter().map(person).collect();
    json!({
        "people": people,
        "sector": {
            "center": [center.x, center.y, center.z],
            "outwards": [out.x, out.y, out.z],
            "radius": sector.radius_m,
        },
    })
}

fn person(person: &Person) -> Value {
    let eyes: BTreeMap<String, [f64; 3]> = person
        .statures_m
        .iter()
        .map(|&stature_m| {
            let eyes = person.eyes_m(stature_m);
            (format!("{stature_m:.2}"), [eyes.x, eyes.y, eyes.z])
        })
        .collect();
    let at = person.position_m;
    let shortest_m = person.statures_m.iter().copied().fold(f64::MAX, f64::min);
    json!({
        "name": person.name,
        "position": [at.x, at.y, at.z],
        "shortest": shortest_m,
        "eyes": eyes,
    })
}

/// Lines of sight, occupied space and hand cone of a configuration.
pub(super) fn configuration(
    resolved: &ResolvedScenario,
    room: &RoomModel<'_>,
    goal: usize,
    report: &ConfigurationReport,
    pack: &mut Pack,
) -> Option<Value> {
    let q = Joints::from_column_slice(&report.joints_rad?);
    report.room.as_ref()?;
    let lines = lines_of_sight(resolved, room, goal, &q);
    let sector = room.sector(goal);
    let taken = room.taken(goal, &q);
    let surface = taken
        .contains(&true)
        .then(|| surface(pack, &voxel_surface(&sector.grid, &taken)));
    Some(json!({
        "sight": pack.f32s(lines),
        "taken": surface,
        "guideEntry": pose(&room.guide_entry(&q)),
    }))
}

/// Some lines of sight past a posture, seven numbers each: eye, end, and 1 where the line is blocked there.
pub(super) fn lines_of_sight(
    resolved: &ResolvedScenario,
    room: &RoomModel<'_>,
    goal: usize,
    q: &Joints,
) -> Vec<f64> {
    let obstacles = room.obstacles().all(q);
    let mut sight = obstacles.lines();
    let targets = room.targets(goal, q);
    let mut lines: Vec<f64> = Vec::new();
    for person in &resolved.people.by_goal[goal] {
        for &stature_m in &person.statures_m {
            let eyes_m = person.eyes_m(stature_m);
            let segments =
                sight_segments(&eyes_m, person.head_movement_m, &targets, LINES_DRAWN / 2);
            for [eye, target] in segments {
                let blocked = sight.first_on_the_way(&eye, &target);
                let end = blocked
                    .as_ref()
                    .map_or(target, |(t, _)| eye + (target - eye) * *t);
                let flag = f64::from(u8::from(blocked.is_some()));
                lines.extend([eye.x, eye.y, eye.z, end.x, end.y, end.z, flag]);
            }
        }
    }
    lines
}
