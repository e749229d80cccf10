//! What is decided by bounds of travel is what evaluating every layout says.

use std::path::Path;

use needlebench_scenario::{Overrides, Setting};

use super::*;

fn family(name: &str) -> ScenarioFamily {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios");
    ScenarioFamily::load(&folder.join(name), &Overrides::default()).unwrap()
}

fn set(path: &str, setting: impl Into<Setting>) -> (KeyPath, Change) {
    (KeyPath::parse(path).unwrap(), Change::Set(setting.into()))
}

/// Coarse, but every kind of step: rays, bisections, turned directions, sweeps of the ball.
const SETTINGS: RobustnessSettings = RobustnessSettings {
    max_shift_mm: 90.0,
    max_tilt_deg: 20.0,
    step_mm: 6.0,
    step_deg: 2.5,
    shift_directions: 8,
    tilt_directions: 6,
    points_per_axis: 5,
    by_bounds: true,
};

#[test]
fn bounds_of_travel_change_nothing_that_is_reported() {
    let off = |key: &str| set(key, "off");
    let nominal = [
        off("criteria.max_tip_rms_mm"),
        set("planning.roll_samples", 8.0),
    ];
    let free = [set("planning.roll_samples", 8.0)];
    let fixed = [off("criteria.max_tip_rms_mm"), set("goal.roll_deg", 40.0)];
    let (mut broken, mut standing) = (0, 0);
    for (name, goal, changes, configurations) in [
        (
            "studies/chest.toml",
            "left_upper_anterior",
            &free[..],
            &[0, 3, 5][..],
        ),
        ("studies/chest.toml", "right_lower_lateral", &free, &[1, 6]),
        // A goal that stays where it is; a route that is judged; errors of real arms.
        ("table3.toml", "pose", &nominal[..1], &[0, 6]),
        ("table3.toml", "pose", &[], &[1]),
        (
            "supine_suite.toml",
            "right_pleural_lateral",
            &nominal,
            &[1, 2],
        ),
        ("supine_suite.toml", "right_upper_anterior", &fixed, &[1, 4]),
        // Obstacles, of which some are meshes, and a robot that hangs.
        (
            "hanging.toml",
            "right_upper_anterior",
            &nominal[1..],
            &[0, 1],
        ),
        // What is drawn of the arm decides where the needle is.
        ("imperfect.toml", "right_pleural_lateral", &[], &[1]),
    ] {
        let family = family(name);
        let goal = family
            .goals()
            .find(|each| *each == goal)
            .unwrap_or_else(|| panic!("{name} has {:?}", family.goals().collect::<Vec<_>>()));
        for index in configurations {
            let configuration = Configuration::ALL[*index];
            let found = |by_bounds: bool| {
                let settings = RobustnessSettings {
                    by_bounds,
                    ..SETTINGS
                };
                let found = robustness(&family, goal, changes, configuration, &settings, None);
                found.unwrap().expect("nobody cancelled it")
            };
            let fast = found(true);
            assert_eq!(fast, found(false), "{name} {goal} {configuration}");
            for each in [&fast.shift, &fast.tilt] {
                match &each.found {
                    Some(breaking) if breaking.radius > 0.0 => broken += 1,
                    Some(_) => {}
                    None => standing += 1,
                }
            }
        }
    }
    assert!(broken > 8 && standing + broken > 12, "{broken}, {standing}");
}
