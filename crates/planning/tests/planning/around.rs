//! Motions around what blocks the straight one.

use std::path::Path;

use needlebench_cell::Rule;
use needlebench_clearance::ClearanceModel;
use needlebench_kinematics::JOINT_COUNT;
use needlebench_kinematics::trajectory::{JointTrajectory, Phase};
use needlebench_planning::{GoalPlan, Planner};
use needlebench_scenario::{Overrides, ResolvedScenario, load_scenario, resolve_scenario};

/// Limits are compared at samples of a path; between two of them a joint may exceed its own by this
/// much, relatively.
const BETWEEN_SAMPLES: f64 = 0.02;

fn folder() -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios")
}

fn parked_low() -> ResolvedScenario {
    load_scenario(&folder().join("parked_low.toml"), &Overrides::default())
        .expect("the shipped scenario is sound")
}

fn changed(from: &str, to: &str) -> ResolvedScenario {
    let text = std::fs::read_to_string(folder().join("parked_low.toml")).unwrap();
    assert!(text.contains(from));
    let text = text.replace(from, to);
    resolve_scenario("test.toml", &text, &folder(), &Overrides::default())
        .unwrap_or_else(|findings| panic!("{findings:?}"))
}

fn plan(resolved: &ResolvedScenario, goal: usize) -> GoalPlan {
    let model = ClearanceModel::new(&resolved.cell);
    Planner::new(resolved, &model)
        .unwrap()
        .plan(&resolved.goals[goal])
}

#[test]
fn a_way_around_is_free_smooth_and_within_the_limits() {
    let resolved = parked_low();
    let model = ClearanceModel::new(&resolved.cell);
    let mut around = 0;
    for found in &plan(&resolved, 0).configurations {
        let (true, Some(search)) = (found.rejections.is_empty(), &found.search) else {
            continue;
        };
        around += 1;
        assert!(search.waypoints > 2 && search.checks > 0);
        let trajectory = found.trajectory.as_ref().unwrap();
        assert_eq!(trajectory.sample(0.0).position, resolved.start);
        let end = found.candidate.as_ref().unwrap().joints;
        assert!((trajectory.end() - end).amax() < 1e-12);
        let limits = &resolved.motion;
        let mut time_s = 0.0;
        while time_s < trajectory.duration_s() {
            let state = trajectory.sample(time_s);
            for joint in 0..JOINT_COUNT {
                let most = |limit: f64| limit * (1.0 + BETWEEN_SAMPLES);
                assert!(state.velocity[joint].abs() <= most(limits.velocity[joint]));
                assert!(state.acceleration[joint].abs() <= most(limits.acceleration[joint]));
            }
            let minima = model.minimum_per_class(&state.position);
            for pair in minima.iter().filter(|pair| pair.class.is_physical()) {
                assert!(
                    pair.separation.distance_m > 0.0,
                    "{} at {time_s}",
                    found.configuration
                );
            }
            time_s += 5e-3;
        }
    }
    assert!(around >= 2, "{around}");
}

/// Postures of a trajectory, evenly spaced by path length.
fn postures(trajectory: &JointTrajectory) -> Vec<[f64; JOINT_COUNT]> {
    const STEP_RAD: f64 = 0.02;
    let mut out = Vec::new();
    let (mut time_s, mut travelled) = (0.0, STEP_RAD);
    let mut last = trajectory.sample(0.0).position;
    while time_s < trajectory.duration_s() {
        let here = trajectory.sample(time_s).position;
        travelled += (here - last).norm();
        if travelled >= STEP_RAD {
            out.push(here.into());
            travelled = 0.0;
        }
        last = here;
        time_s += 1e-3;
    }
    out
}

#[test]
fn the_retreat_leaves_along_the_needle_and_passes_the_way_in_backwards() {
    let resolved = parked_low();
    let mut seen = 0;
    for found in &plan(&resolved, 0).configurations {
        let Some(retreat) = &found.retreat else {
            assert!(!found.rejections.is_empty());
            continue;
        };
        seen += 1;
        let there = found.trajectory.as_ref().unwrap();
        assert!((retreat.sample(0.0).position - there.end()).amax() < 1e-12);
        assert!((retreat.end() - resolved.start).amax() < 1e-12);
        let phases: Vec<Phase> = retreat.phases().iter().map(|phase| phase.0).collect();
        assert_eq!(phases, [Phase::Retract, Phase::Return]);
        let way_in = postures(there);
        for posture in postures(retreat) {
            let nearest = way_in
                .iter()
                .map(|other| {
                    let squares = posture.iter().zip(other).map(|(a, b)| (a - b).powi(2));
                    squares.sum::<f64>().sqrt()
                })
                .fold(f64::INFINITY, f64::min);
            // Twice the spacing of the postures that are compared.
            assert!(nearest < 0.04, "{nearest}");
        }
    }
    assert!(seen > 0);
}

#[test]
fn the_same_seed_gives_the_same_motion_and_every_seed_gives_one() {
    let works = |seed: u64| {
        let resolved = changed("seed = 1", &format!("seed = {seed}"));
        let plan = plan(&resolved, 0);
        let works: Vec<bool> = plan
            .configurations
            .iter()
            .map(|found| found.rejections.is_empty())
            .collect();
        (plan, works)
    };
    let (first, expected) = works(1);
    assert_eq!(works(1).0, first);
    for seed in 2..6 {
        assert_eq!(works(seed).1, expected, "seed {seed}");
    }
}

#[test]
fn without_checks_a_blocked_straight_motion_is_a_collision() {
    let resolved = changed("[planning]\n", "[planning]\nmotion_checks = 0\n");
    let plan = plan(&resolved, 0);
    let right_up_fold = &plan.configurations[1];
    assert_eq!(right_up_fold.rejections[0].rule, Rule::Collision);
    assert!(
        right_up_fold.rejections[0]
            .detail
            .contains("in the transfer")
    );
    assert!(right_up_fold.search.is_none() && right_up_fold.retreat.is_none());
}

#[test]
fn a_search_that_ends_without_a_motion_says_so() {
    let resolved = changed("[planning]\n", "[planning]\nmotion_checks = 40\n");
    let plan = plan(&resolved, 0);
    let found = plan
        .configurations
        .iter()
        .find(|found| {
            found
                .rejections
                .iter()
                .any(|each| each.rule == Rule::NoMotion)
        })
        .expect("forty postures are too few for one of them");
    let rejection = &found.rejections[0];
    assert!(
        rejection.detail.contains("no alternative path found"),
        "{rejection:?}"
    );
    assert!(rejection.detail.contains("on the joint-space line"));
    // Each of the searches stops once the budget is used up; one more straight way may be looked at.
    let effort = found.search.expect("it was searched");
    assert!(effort.checks < 400, "{effort:?}");
    assert_eq!(effort.waypoints, 0);
}
