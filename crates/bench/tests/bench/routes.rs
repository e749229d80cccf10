//! The joint plan of route and robot against everything that could have been chosen: every configuration at every one of its
//! rolls, each judged in full as `check` judges a posture.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use needlebench_bench::preview::GoalPreview;
use needlebench_bench::study::{NO_ENTRY, rows_without_scenario};
use needlebench_bench::{EntryFinder, Preview};
use needlebench_parallel::{Control, Silent};
use needlebench_patient::routes::{
    RouteAnswer, RoutePlan, RouteTask, WithRobot, free_routes, plan_routes,
};
use needlebench_scenario::scenario::RouteSection;
use needlebench_scenario::study::StudyMode;
use needlebench_scenario::{
    Change, ChooseEntry, EntryChooser, Goal, KeyPath, Overrides, PhantomMove, PlacedPhantom,
    ScenarioFamily,
};

use needlebench_study::Outcome;

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

/// The cell of the studies, with goals that are left to be planned among others.
fn planned_chest(finder: &Arc<EntryFinder>) -> ScenarioFamily {
    let path =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios/studies/routes_chest.toml");
    let finder: Arc<dyn ChooseEntry> = Arc::clone(finder) as _;
    let overrides = Overrides {
        choose_entry: Some(EntryChooser(finder)),
        ..Overrides::default()
    };
    ScenarioFamily::load(&path, &overrides).unwrap()
}

fn first_planned(family: &ScenarioFamily) -> String {
    let mut goals = family.base().scenario.goals.iter();
    let planned = goals.find(|goal| goal.route.is_some());
    planned.unwrap().name.clone()
}

/// Where the needle enters, in the patient's frame, to a millionth of a millimetre.
fn entry_mm(placed: &PlacedPhantom, goal: &Goal) -> [String; 3] {
    let entry = placed.world_from_phantom.inverse() * goal.entry_m.unwrap();
    [0, 1, 2].map(|axis| format!("{:.6}", entry[axis] * 1e3))
}

#[test]
fn the_entry_of_a_layout_is_the_choice_of_the_whole_plan() {
    let control = Control {
        threads: 2,
        cancel: &AtomicBool::new(false),
        progress: &Silent,
    };
    let family = planned_chest(&Arc::default());
    let mut compared = 0;
    let sections = &family.base().scenario.goals;
    for section in sections.iter().filter(|section| section.route.is_some()) {
        for wanted in [1, 4, 7, 8] {
            let mut resolved = family.base().clone();
            resolved.scenario.criteria.min_working_configurations = wanted;
            let task = RouteTask {
                resolved: &resolved,
                section,
                rules: section.route.as_ref().unwrap(),
                robot: WithRobot::Yes,
                directions: 1500,
            };
            let anatomy = task.solids().unwrap();
            let free = free_routes(&task, &anatomy, &control).unwrap();
            let whole = free.plan_with_robot(&task, &anatomy, &control).unwrap();
            let served = free.best_served(&task, &control).unwrap();
            let Some(chosen) = &whole.chosen else {
                assert_eq!(served, None);
                continue;
            };
            let (route, served) = (&whole.routes[chosen.route], served.unwrap());
            assert_eq!(served.direction_deg, route.direction_deg);
            assert_eq!(
                (served.working, Some(served.best)),
                (route.working, route.best)
            );
            compared += 1;
        }
    }
    assert!(compared >= 10, "{compared}");
}

#[test]
fn what_is_kept_of_a_patient_changes_no_entry() {
    let finder = Arc::default();
    let family = planned_chest(&finder);
    let goal = first_planned(&family);
    let changes = |along_mm: f64, size: &str| {
        [
            ("phantom.position_mm[0]", Change::Add(along_mm)),
            ("phantom.model", Change::Set(size.into())),
        ]
        .map(|(key, change)| (KeyPath::parse(key).unwrap(), change))
    };
    let mut entries = Vec::new();
    for size in ["male-p50-supine", "female-p5-supine"] {
        for along_mm in [0.0, 30.0] {
            let changes = changes(along_mm, size);
            // One that has kept nothing, and one that has seen other layouts.
            let fresh = planned_chest(&Arc::default());
            let entry = |family: &ScenarioFamily| {
                let resolved = family.vary(&goal, &changes).unwrap();
                let placed = resolved.phantom.as_ref().unwrap();
                entry_mm(placed, &resolved.goals[0])
            };
            let entry_mm = entry(&family);
            assert_eq!(entry_mm, entry(&fresh));
            entries.push(entry_mm);
        }
    }
    // Another size has another entry: a finder that took everybody for the first patient would be seen.
    assert_ne!(entries[0], entries[2]);
}

#[test]
fn a_planned_entry_goes_with_the_patient() {
    let family = planned_chest(&Arc::default());
    let goal = first_planned(&family);
    let moves = family.phantom_moves(&goal, &[]).unwrap();
    let at = |by: PhantomMove| {
        let resolved = moves.resolved(&by).unwrap();
        let quickly = moves.moved(&by).unwrap();
        let found = entry_mm(resolved.phantom.as_ref().unwrap(), &resolved.goals[0]);
        assert_eq!(found, entry_mm(&quickly.phantom, &quickly.goal));
        found
    };
    let here = at(PhantomMove::Shift([0.0; 3]));
    assert_eq!(at(PhantomMove::Shift([60.0, -40.0, 0.0])), here);
    assert_eq!(at(PhantomMove::Turn([5.0, 0.0])), here);
}

#[test]
fn a_layout_that_no_entry_serves_counts_as_one_where_nothing_works() {
    let family = planned_chest(&Arc::default());
    let margin = Change::Set(40.0.into());
    let changes = [(KeyPath::parse("goal.route.margin_mm").unwrap(), margin)];
    let findings = family.vary(&first_planned(&family), &changes).unwrap_err();
    for mode in [StudyMode::Static, StudyMode::Planned] {
        for row in rows_without_scenario(&findings, mode) {
            assert_eq!((row.outcome, row.mode), (Outcome::Rejected, mode));
            assert_eq!(row.detail, NO_ENTRY);
        }
    }
}
