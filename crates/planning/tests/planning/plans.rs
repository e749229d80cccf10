//! Plans of whole scenarios.

use std::path::Path;

use needlebench_cell::Rule;
use needlebench_clearance::ClearanceModel;
use needlebench_kinematics::ik::Configuration;
use needlebench_kinematics::trajectory::Phase;
use needlebench_planning::{GoalPlan, Planner};
use needlebench_scenario::{Overrides, ResolvedScenario, load_scenario, resolve_scenario};

/// The figure for inverse kinematics: m and rad.
const IK_RESIDUAL: f64 = 1e-12;
/// The approach is a joint-space quintic between knots: ten times its worst deviation.
const LINE_M: f64 = 1e-8;

fn table3() -> ResolvedScenario {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios/table3.toml");
    load_scenario(&path, &Overrides::default()).expect("the shipped scenario is sound")
}

fn scenario(text: &str) -> ResolvedScenario {
    resolve_scenario("test.toml", text, Path::new(""), &Overrides::default())
        .unwrap_or_else(|findings| panic!("{findings:?}"))
}

fn plan(resolved: &ResolvedScenario) -> GoalPlan {
    let model = ClearanceModel::new(&resolved.cell);
    Planner::new(resolved, &model)
        .unwrap()
        .plan(&resolved.goals[0])
}

/// A chest beside the robot, with the patient's right lung towards it and the roll left free.
const BESIDE: &str = r#"
name = "beside"
[robot]
base_position_mm = [0, 0, 800]
base_rpy_deg = [0, 0, 180]
[tool]
urdf = "offset"
[phantom]
position_mm = [146, -597.5, 0]
[table]
center_mm = [300, -598]
top_height_mm = 739.5
[[goals]]
name = "lesion"
entry_mm = [-142.4, -32.9, 4.0]
lesion = "pleural_based"
"#;

fn beside() -> ResolvedScenario {
    // The entry is moved onto the skin first: the message says where it is.
    let text = BESIDE;
    let found = resolve_scenario("test.toml", text, Path::new(""), &Overrides::default());
    match found {
        Ok(resolved) => resolved,
        Err(findings) => {
            let hint = findings[0]
                .hint
                .clone()
                .expect("a hint with the point on the skin");
            let point = hint.rsplit("at ").next().expect("the point").to_owned();
            scenario(&text.replace("[-142.4, -32.9, 4.0]", &point))
        }
    }
}

#[test]
fn all_eight_configurations_of_table_3_reach_the_pose() {
    let resolved = table3();
    let plan = plan(&resolved);
    assert_eq!(plan.configurations.len(), 8);
    for (found, configuration) in plan.configurations.iter().zip(Configuration::ALL) {
        assert_eq!(found.configuration, configuration);
        let candidate = found.candidate.as_ref().expect("Table 3 has all eight");
        assert!(candidate.residual_m <= IK_RESIDUAL && candidate.residual_rad <= IK_RESIDUAL);
        let exit = resolved.cell.world_from_guide_exit(&candidate.joints);
        let planned = resolved.goals[0].world_from_guide_exit;
        assert!((exit.translation.vector - planned.translation.vector).norm() < IK_RESIDUAL);
        assert!(
            resolved
                .cell
                .robot
                .limits
                .first_violation(&candidate.joints)
                .is_none()
        );
    }
}

#[test]
fn motions_lead_from_the_start_along_the_needle_to_the_goal() {
    let resolved = table3();
    let goal = &resolved.goals[0];
    for found in &plan(&resolved).configurations {
        let trajectory = found.trajectory.as_ref().expect("all eight have a motion");
        assert_eq!(trajectory.sample(0.0).position, resolved.start);
        let end = found.candidate.as_ref().unwrap().joints;
        assert!((trajectory.sample(trajectory.duration_s()).position - end).amax() < 1e-12);
        let approach = trajectory
            .phases()
            .into_iter()
            .find(|phase| phase.0 == Phase::Approach);
        let (_, from_s, to_s) = approach.expect("there is an approach");
        let target = goal.world_from_guide_exit;
        for k in 0..=200 {
            let time_s = from_s + (to_s - from_s) * f64::from(k) / 200.0;
            let exit = resolved
                .cell
                .world_from_guide_exit(&trajectory.sample(time_s).position);
            let offset = exit.translation.vector - target.translation.vector;
            let along = offset.dot(&goal.axis);
            assert!((offset - goal.axis.into_inner() * along).norm() < LINE_M);
            assert!(exit.rotation.angle_to(&target.rotation) < 1e-7);
            assert!(along <= LINE_M && along >= -goal.approach_m - LINE_M);
        }
    }
}

#[test]
fn motions_that_pass_are_free_at_every_millisecond() {
    let resolved = table3();
    let model = ClearanceModel::new(&resolved.cell);
    for found in &plan(&resolved).configurations {
        if !found.rejections.is_empty() {
            continue;
        }
        let trajectory = found.trajectory.as_ref().unwrap();
        let mut time_s = 0.0;
        while time_s < trajectory.duration_s() {
            let minima = model.minimum_per_class(&trajectory.sample(time_s).position);
            for pair in minima.iter().filter(|pair| pair.class.is_physical()) {
                assert!(
                    pair.separation.distance_m > 0.0,
                    "{} {time_s}",
                    found.configuration
                );
            }
            time_s += 1e-3;
        }
    }
}

#[test]
fn a_blocked_corridor_names_what_stands_behind_the_guide() {
    let resolved = table3();
    let plan = plan(&resolved);
    let blocked: Vec<_> = plan
        .configurations
        .iter()
        .filter(|found| {
            found
                .rejections
                .first()
                .is_some_and(|r| r.rule == Rule::NeedleCorridor)
        })
        .collect();
    assert_eq!(blocked.len(), 2);
    for found in blocked {
        let rejection = &found.rejections[0];
        assert!(rejection.value < 0.0 && rejection.unit == "m");
        assert!(rejection.detail.contains("forearm"), "{}", rejection.detail);
    }
}

#[test]
fn a_table_in_the_way_is_a_collision_of_named_solids() {
    let mut text = std::fs::read_to_string(
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios/table3.toml"),
    )
    .unwrap();
    // A table that reaches under the arm, where low elbows go.
    text = text.replace(
        "center_mm = [300, -598]",
        "center_mm = [300, -298]\nwidth_mm = 1000",
    );
    text = text.replace(
        "top_height_mm = 763.5",
        "top_height_mm = 763.5\nthickness_mm = 30",
    );
    text = text.replace("[mount]", "");
    // Out of the bore, which would not let it through.
    text = text.replace("isocentre_mm = [1300,", "isocentre_mm = [2600,");
    // The elbow axis of Right-Down-Fold lies 18 mm below the base plane at 800 mm.
    let raised = scenario(&text.replace("top_height_mm = 763.5", "top_height_mm = 770"));
    let plan = plan(&raised);
    assert_eq!(
        plan.configurations[0].configuration.label(),
        "Right-Down-Fold"
    );
    let collision = plan.configurations[0]
        .rejections
        .iter()
        .find(|rejection| rejection.rule == Rule::Collision)
        .expect("the elbow is in the table");
    assert!(collision.detail.contains("table"), "{}", collision.detail);
    assert!(collision.value < 0.0);
}

#[test]
fn a_robot_that_stands_too_far_off_reaches_nothing_and_says_by_how_much() {
    let resolved = scenario(&table_text().replace(
        "base_position_mm = [0, 0, 800]",
        "base_position_mm = [0, 1200, 800]",
    ));
    for found in &plan(&resolved).configurations {
        assert!(found.candidate.is_none() && found.trajectory.is_none());
        let rejection = &found.rejections[0];
        assert_eq!(rejection.rule, Rule::Unreachable);
        assert!(rejection.value > 0.5 && rejection.unit == "m");
    }
}

fn table_text() -> String {
    // By entry and target: a flange pose would move with the robot.
    let resolved = beside();
    let goal = &resolved.goals[0];
    let placed = resolved.phantom.as_ref().unwrap();
    let entry = placed.world_from_phantom.inverse() * goal.entry_m.unwrap();
    let point = entry.coords * 1e3;
    BESIDE.replace(
        "[-142.4, -32.9, 4.0]",
        &format!("[{}, {}, {}]", point.x, point.y, point.z),
    )
}

#[test]
fn a_free_roll_turns_the_guide_but_not_the_needle() {
    let resolved = beside();
    let goal = &resolved.goals[0];
    let mut rolls = Vec::new();
    for found in &plan(&resolved).configurations {
        let Some(candidate) = &found.candidate else {
            continue;
        };
        let exit = resolved.cell.world_from_guide_exit(&candidate.joints);
        let planned = goal.world_from_guide_exit.translation.vector;
        assert!((exit.translation.vector - planned).norm() < 1e-11);
        let axis = exit.rotation * nalgebra::Vector3::z();
        assert!((axis - goal.axis.into_inner()).norm() < 1e-11);
        rolls.push(candidate.roll_rad);
    }
    assert!(!rolls.is_empty());
    assert!(
        rolls.iter().any(|roll| (roll - rolls[0]).abs() > 1e-6),
        "{rolls:?}"
    );
}

#[test]
fn more_rolls_never_lose_a_configuration() {
    let working = |roll_samples: u32| -> Vec<Configuration> {
        let text = format!(
            "{}\n[planning]\nroll_samples = {roll_samples}\n",
            table_text()
        );
        let plan = plan(&scenario(&text));
        let works = plan
            .configurations
            .iter()
            .filter(|found| found.rejections.is_empty());
        works.map(|found| found.configuration).collect()
    };
    // Every multiple of 30 degrees is one of 10 degrees too.
    let (few, many) = (working(12), working(36));
    assert!(!few.is_empty());
    assert!(
        few.iter().all(|configuration| many.contains(configuration)),
        "{few:?} {many:?}"
    );
}
