//! The joint plan of route and robot against everything that could have been chosen: every configuration at every one of its
//! rolls, each judged in full as `check` judges a posture.

use std::path::Path;
use std::sync::atomic::AtomicBool;

use needlebench_bench::preview::GoalPreview;
use needlebench_bench::progress::Silent;
use needlebench_bench::routes::{RouteAnswer, RoutePlan, RouteTask, WithRobot, plan_routes};
use needlebench_bench::{Control, Preview};
use needlebench_cell::scenario::RouteSection;
use needlebench_cell::{Change, KeyPath, Overrides, ScenarioFamily};

use crate::directed::entering_by_direction;

/// Reasons that only the plan has: the expected error, beyond what a posture shows.
const BY_ERROR: [&str; 2] = ["margin_with_error", "expected_error"];

fn plan(family: &ScenarioFamily) -> RoutePlan {
    let control = Control {
        threads: 2,
        cancel: &AtomicBool::new(false),
        progress: &Silent,
    };
    let rules = RouteSection::default();
    let mut resolved = family.base().clone();
    // As many as some route of this goal has.
    resolved.scenario.criteria.min_working_configurations = 2;
    let task = RouteTask {
        resolved: &resolved,
        section: &family.base().scenario.goals[0],
        rules: &rules,
        robot: WithRobot::Yes,
        directions: 2000,
    };
    plan_routes(&task, &task.solids().unwrap(), &control).unwrap()
}

/// What `check` says of a route with the guide turned to a direction.
fn checked(family: &ScenarioFamily, goal: &str, route: &RouteAnswer, roll_deg: f64) -> GoalPreview {
    let changes = [
        (
            "goal.entry_direction_deg",
            Change::Set(route.direction_deg.into()),
        ),
        ("goal.roll_deg", Change::Set(roll_deg.into())),
    ];
    let changes = changes.map(|(key, change)| (KeyPath::parse(key).unwrap(), change));
    let resolved = family.vary(goal, &changes).unwrap();
    let (preview, _) = Preview::of(&resolved).unwrap();
    preview.goals.into_iter().next().unwrap()
}

/// Whether each configuration works at any of some directions about the needle.
fn exhaustive(family: &ScenarioFamily, goal: &str, route: &RouteAnswer, rolls: u32) -> [bool; 8] {
    let mut works = [false; 8];
    for roll in 0..rolls {
        let roll_deg = 360.0 / f64::from(rolls) * f64::from(roll);
        let said = checked(family, goal, route, roll_deg);
        let is_kept = said.needle_route.as_ref().is_none_or(|route| route.kept);
        for (works, each) in works.iter_mut().zip(&said.configurations) {
            *works |= each.works && is_kept;
        }
    }
    works
}

#[test]
fn what_serves_a_route_is_what_an_exhaustive_search_finds() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios/supine_suite.toml");
    let family = ScenarioFamily::load(&path, &Overrides::default()).unwrap();
    let name = family.base().scenario.goals[0].name.clone();
    let plan = plan(&family);
    assert!(
        plan.free >= 20 && plan.routes.len() >= 5,
        "{} {}",
        plan.free,
        plan.routes.len()
    );
    let by_direction = entering_by_direction(&path);
    let (mut working, mut not) = (0, 0);
    for route in plan
        .routes
        .iter()
        .filter(|route| route.blocked.is_none())
        .step_by(4)
    {
        let found = exhaustive(&by_direction, &name, route, plan.rolls);
        for (index, (said, works)) in route.configurations.iter().zip(found).enumerate() {
            let reason = said.reason.as_deref();
            let by_posture = said.works || reason.is_some_and(|it| BY_ERROR.contains(&it));
            assert_eq!(
                by_posture, works,
                "{:?} {}: {reason:?}",
                route.direction_deg, said.label
            );
            if !works {
                not += 1;
                continue;
            }
            working += 1;
            // The posture that is told is one of them, and as clear as is told.
            let roll_deg = said.roll_rad.unwrap().to_degrees();
            let there = &checked(&by_direction, &name, route, roll_deg).configurations[index];
            assert!(there.works);
            let joints = there
                .joints_rad
                .unwrap()
                .into_iter()
                .zip(said.joints_rad.unwrap());
            for (a, b) in joints {
                assert!((a - b).abs() < 1e-9, "{a} {b}");
            }
            assert!(there.nearest.as_ref().unwrap().distance_m <= said.clearance_m.unwrap() + 1e-9);
        }
    }
    assert!(working >= 10 && not >= 5, "{working} {not}");
    // The first in which as many work as wanted, and in it one that works.
    let first = plan
        .routes
        .iter()
        .position(|route| route.working >= plan.wanted);
    let chosen = plan.chosen.as_ref().expect("a route is served");
    assert_eq!(Some(chosen.route), first);
    let label = chosen.configuration.unwrap();
    let served = plan.routes[chosen.route]
        .configurations
        .iter()
        .find(|each| each.label == label)
        .unwrap();
    assert!(served.works);
    // Nothing that works beats what is said to be unbeaten, and what beats nothing is in it.
    let aims = |route: usize, label: &str| {
        let answer = &plan.routes[route];
        let each = answer
            .configurations
            .iter()
            .find(|each| each.label == label)
            .unwrap();
        [
            answer.risk.log_odds,
            -each.clearance_m.unwrap(),
            each.error.map_or(0.0, |error| error.target_lateral_rms_m),
            -each.free_fraction.unwrap(),
        ]
    };
    let all: Vec<(usize, &str)> = plan
        .routes
        .iter()
        .enumerate()
        .flat_map(|(index, route)| {
            let works = route.configurations.iter().filter(|each| each.works);
            works.map(move |each| (index, each.label))
        })
        .collect();
    for &(route, label) in &all {
        let own = aims(route, label);
        let is_beaten = all.iter().any(|&(other, by)| {
            let theirs = aims(other, by);
            let pairs = || own.iter().zip(&theirs);
            pairs().all(|(own, theirs)| theirs <= own) && pairs().any(|(own, theirs)| theirs < own)
        });
        assert_eq!(
            plan.pareto.contains(&(route, label)),
            !is_beaten,
            "{route} {label}"
        );
    }
}
