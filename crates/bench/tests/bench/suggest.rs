//! Proposed entries against all others on a grid of another kind, judged by what `check` says of each.

use std::path::Path;
use std::sync::atomic::AtomicBool;

use nalgebra::{Point3, Vector3};
use needlebench_bench::Preview;
use needlebench_bench::suggest::suggest_entries;
use needlebench_parallel::{Control, Silent};
use needlebench_planning::{bent_route, judge_route};
use needlebench_scenario::scenario::GoalSection;
use needlebench_scenario::{
    Change, GoalPlacer, KeyPath, Overrides, ResolvedScenario, ScenarioFamily, load_scenario,
};

use crate::directed::entering_by_direction;

/// How much better an entry may be that is not proposed, of a score from 0 to 1: what is lost between directions that
/// are 3 deg apart, and by asking the robot for the best routes alone. Seen: none is better, the best is 0.008 worse.
const MISSED: f64 = 0.01;
/// Steps of the other grid, deg.
const STEP_DEG: u16 = 4;

/// The score as its documentation has it, from what `check` says of a goal; none at the ends of the chest and for a
/// needle that is too oblique, which are not proposed.
fn score(resolved: &ResolvedScenario, preview: &Preview) -> Option<f64> {
    let (goal, said) = (&resolved.goals[0], &preview.goals[0]);
    let placed = resolved.phantom.as_ref().unwrap();
    let to_phantom = placed.world_from_phantom.inverse();
    let entry = to_phantom * goal.entry_m.unwrap();
    let depth_mm = goal.entry_to_target_m().unwrap() * 1e3;
    let route = said.needle_route.as_ref().unwrap();
    let criterion_mm = resolved.scenario.criteria.min_clearance_mm.needle_route;
    let kept_mm = (route.margin_m * 1e3).max(criterion_mm.unwrap_or(0.0));
    let spare_mm = route.distance_m * 1e3 - kept_mm;
    // Normal of the skin from how depth changes about a point inside, not from its faces.
    let inside = entry + (to_phantom.rotation * goal.axis.into_inner()) * 1e-4;
    let depth = |at: Point3<f64>| placed.phantom.skin_signed_depth(&at);
    let slope = Vector3::from_fn(|axis, _| {
        let mut step = Vector3::zeros();
        step[axis] = 1e-6;
        depth(inside + step) - depth(inside - step)
    });
    let needle = to_phantom.rotation * goal.axis.into_inner();
    let angle_deg = slope.angle(&needle).to_degrees();
    let half_mm = 0.5 * placed.phantom.parameters.as_ref().unwrap().length_mm;
    let is_at_end = slope.normalize().z.abs() > 0.5_f64.sqrt() || entry.z * 1e3 > 0.5 * half_mm;
    if is_at_end || angle_deg > 60.0 {
        return None;
    }
    let between =
        |worst: f64, best: f64, value: f64| ((value - worst) / (best - worst)).clamp(0.0, 1.0);
    let fissures = if said.fissures_crossed.is_empty() {
        0.5
    } else {
        0.0
    };
    let sum = between(140.0, 40.0, depth_mm)
        + between(0.0, 5.0, spare_mm)
        + between(60.0, 0.0, angle_deg)
        + fissures
        + said.working as f64 / 8.0;
    Some(sum / 4.5)
}

#[test]
fn no_entry_of_another_grid_is_much_better_than_the_first_proposal() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios/supine_suite.toml");
    let family = ScenarioFamily::load(&path, &Overrides::default()).unwrap();
    let control = Control {
        threads: 2,
        cancel: &AtomicBool::new(false),
        progress: &Silent,
    };
    let name = "right_upper_anterior";
    let section = &family.base().scenario.goals[0];
    assert_eq!(section.name, name);
    let found = suggest_entries(family.base(), section, 3, &control).unwrap();
    let by_direction = entering_by_direction(&path);
    let at = |direction: [f64; 2]| {
        let key = KeyPath::parse("goal.entry_direction_deg").unwrap();
        by_direction.vary(name, &[(key, Change::Set(direction.into()))])
    };
    let first = &found.entries[0];
    let resolved = at(first.direction_deg).unwrap();
    let (preview, findings) = Preview::of(&resolved).unwrap();
    assert_eq!(findings, []);
    // Face by face and by slope the normal is the same; distances are those of `check`.
    assert!((score(&resolved, &preview).unwrap() - first.score).abs() < 1e-6);
    let (mut allowed, mut best) = (0, f64::NEG_INFINITY);
    for azimuth in (1..360).step_by(STEP_DEG.into()) {
        for elevation in (1..150).step_by(STEP_DEG.into()) {
            let direction = [f64::from(azimuth) - 180.0, f64::from(elevation) - 75.0];
            let Ok(resolved) = at(direction) else {
                continue;
            };
            let kept =
                judge_route(&resolved, &resolved.goals[0]).is_some_and(|judged| judged.is_kept());
            if !kept {
                continue;
            }
            let (preview, findings) = Preview::of(&resolved).unwrap();
            let scored = score(&resolved, &preview).filter(|_| findings.is_empty());
            if let Some(scored) = scored {
                allowed += 1;
                best = f64::max(best, scored);
            }
        }
    }
    println!(
        "{allowed} allowed, best {best:.3} against {:.3}",
        first.score
    );
    // 14: the lesion lies among ribs.
    assert!(allowed > 10, "{allowed}");
    assert!(
        best <= first.score + MISSED,
        "{best} against {}",
        first.score
    );
}

/// Farthest that a needle is from the chords of 5 mm that distances are measured to, m: an eighth of a chord's square
/// by a curvature of 4 per metre.
const CHORD_M: f64 = 15e-6;

/// How well skin and lungs are found along a line, m: a goal looks from its entry, a search from its target.
const SURFACE_M: f64 = 1e-6;

#[test]
fn proposals_for_a_needle_in_tissue_keep_their_margins_bent_by_what_its_goal_says() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../guide/examples/tissue.toml");
    let resolved = load_scenario(&path, &Overrides::default()).unwrap();
    let control = Control {
        threads: 2,
        cancel: &AtomicBool::new(false),
        progress: &Silent,
    };
    let section = &resolved.scenario.goals[0];
    let found = suggest_entries(&resolved, section, 3, &control).unwrap();
    assert!(!found.entries.is_empty());
    let placed = resolved.phantom.as_ref().unwrap();
    let expected = resolved.expected.as_ref().unwrap();
    let needle = expected.imperfections.tissue().unwrap();
    for entry in &found.entries {
        let bent = entry.bent.as_ref().unwrap();
        let margins = &bent.bent_margins;
        assert!(margins.iter().all(|each| each.distance_m >= each.margin_m));
        let goal = GoalSection {
            entry_mm: None,
            entry_direction_deg: Some(entry.direction_deg),
            ..section.clone()
        };
        let goal = GoalPlacer::new(&resolved).place(&goal).unwrap();
        let way = goal.needle_path.as_ref().unwrap();
        let inserted = needle.insert(&needle.medians(), way, goal.standoff_m.unwrap());
        let inserted = inserted.unwrap();
        let bend_m = inserted.path_m.last().unwrap()[0];
        assert!(
            (bend_m - bent.bend_m).abs() < SURFACE_M,
            "{bend_m} {}",
            bent.bend_m
        );
        let [x, y] = way.pushed_towards.unwrap();
        let aside = goal.world_from_guide_exit.rotation * Vector3::new(x, y, 0.0);
        let places = inserted.depths_m.iter().zip(&inserted.path_m);
        let points: Vec<Point3<f64>> = places
            .map(|(at_m, [off_m, _])| {
                goal.entry_m.unwrap() + goal.axis.into_inner() * *at_m + aside * *off_m
            })
            .collect();
        let nearest = bent_route(&resolved.cell, placed, &goal, &points).unwrap();
        let least_m = margins.iter().map(|each| each.distance_m);
        let least_m = least_m.fold(f64::INFINITY, f64::min);
        let off_m = (nearest.separation.distance_m - least_m).abs();
        assert!(off_m < CHORD_M, "{off_m}");
    }
}
