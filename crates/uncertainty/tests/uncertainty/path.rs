//! The law of a needle's path against arms and patients that are settled and measured as in a run.

use nalgebra::{Matrix3, Point3, Vector3};
use needlebench_numerics::random::SplitMix64;
use needlebench_probability::{Body, draw};
use needlebench_scenario::ResolvedScenario;
use needlebench_uncertainty::budget::{BudgetCase, Samples, budget, path_law};
use needlebench_uncertainty::{Layout, Truth, settle_after};

use crate::common::{ALL, POSTURES, imperfect, imperfect_in_tissue, motion_to, servo};

const DRAWS: usize = 40_000;

/// A breath held at a level that drifts, mostly.
const LEVEL: &str = "[imperfections.breathing]\nsince_image_s = 90\nheld_s = 12\n\
                     skin_drift_mm_s = [0, 0.05, 0]\n";

/// How far each needle is off at skin and tip, budget's axes, m.
fn full_draws_m(resolved: &ResolvedScenario) -> Vec<[Vector3<f64>; 2]> {
    let imperfections = resolved.imperfections.as_ref().expect("given");
    let (cell, goal) = (&resolved.cell, &resolved.goals[0]);
    let trajectory = motion_to(resolved, POSTURES[0], 0.1);
    let servo = servo(resolved);
    let place = resolved.phantom.as_ref();
    let place = place.map(|placed| &placed.world_from_phantom);
    let exit = cell.robot.world_from_flange(&POSTURES[0]) * cell.tool.flange_from_guide_exit;
    let depths_m = [goal.standoff_m.unwrap_or(0.0), goal.insertion_length_m];
    let planned = depths_m.map(|depth_m| exit * Point3::new(0.0, 0.0, depth_m));
    let from_world = goal.world_from_guide_exit.rotation.inverse();
    let layout = Layout::new(imperfections);
    let rows = layout.hypercube(DRAWS, &mut SplitMix64::new(5));
    let each = rows.iter().map(|row| {
        let truth = Truth::new(cell, place, imperfections, &layout, row, 0).unwrap();
        let settled = settle_after(&servo, &truth.dynamics(cell), &truth, &trajectory).unwrap();
        let needle = truth.needle_points(cell, &settled.position, depths_m);
        let wanted = truth.wanted(goal, &planned);
        [0, 1].map(|at| from_world * (needle[at] - wanted[at]))
    });
    each.collect()
}

/// The same by the law.
fn drawn_m(resolved: &ResolvedScenario) -> Vec<[Vector3<f64>; 2]> {
    let imperfections = resolved.imperfections.as_ref().expect("given");
    let trajectory = motion_to(resolved, POSTURES[0], 0.1);
    let servo = servo(resolved);
    let goal = &resolved.goals[0];
    let case = BudgetCase::of(resolved, goal, &servo, imperfections, &trajectory);
    let law = path_law(&case).expect("not perfect");
    let in_budget = |along_x: Vector3<f64>| Vector3::new(along_x.y, along_x.z, along_x.x);
    let each = (0..DRAWS as u64).map(|index| {
        let path = draw(&law, 3, index);
        [(0.0, Body::Wall), (1.0, Body::Lung)]
            .map(|(fraction, body)| in_budget(path.at(&law, fraction, body)))
    });
    each.collect()
}

/// Of entry and tip, one number.
type Distance = fn(&[Vector3<f64>; 2]) -> f64;

/// By Jacobians, and by other draws.
#[test]
fn covariances_of_entry_with_tip_are_those_of_draws() {
    let tissue = "[imperfections.guide]\n[imperfections.needle]\n";
    let cases = vec![
        ("all", imperfect(ALL)),
        (
            "breath",
            imperfect("[imperfections.breathing]\nfree = true\n"),
        ),
        ("level", imperfect(LEVEL)),
        ("play", imperfect("[imperfections.guide]\n")),
        ("unknown bevel", imperfect_in_tissue(tissue)),
        (
            "known bevel",
            imperfect_in_tissue(&format!(
                "{tissue}bevel = \"3:00\"\nbevel_spread_deg = 30\n"
            )),
        ),
    ];
    for (name, resolved) in cases {
        let imperfections = resolved.imperfections.as_ref().expect("given");
        let trajectory = motion_to(&resolved, POSTURES[0], 0.1);
        let (servo, goal) = (servo(&resolved), &resolved.goals[0]);
        let case = BudgetCase::of(&resolved, goal, &servo, imperfections, &trajectory);
        let samples = Samples {
            total: 20_000,
            each_source: 0,
        };
        let total = budget(&case, samples, 7).expect("a budget").total;
        let cross = total.skin_with_target.expect("of a whole budget");
        let matrix = |rows: [[f64; 3]; 3]| Matrix3::from_fn(|row, column| rows[row][column]);
        let apart = matrix(cross.analytic_m2) - matrix(cross.monte_carlo_m2.expect("drawn"));
        let [skin, target] =
            [total.at_skin, total.at_target].map(|point| point.analytic.covariance().norm());
        let off = apart.norm() / (skin * target).sqrt();
        assert!(off < 0.07, "{name}: {off}");
        let size = matrix(cross.analytic_m2).norm() / (skin * target).sqrt();
        assert!(size > 0.3, "{name}: {size}");
    }
}

/// By hand: `E [(level + shape)^2] - E [shape]^2` along the amplitudes, and the mean with the drift.
#[test]
fn a_held_breath_has_its_level_and_drift() {
    /// Rounding of micrometres.
    const ROUNDING_M: f64 = 1e-12;
    let resolved = imperfect(LEVEL);
    let imperfections = resolved.imperfections.as_ref().expect("given");
    let trajectory = motion_to(&resolved, POSTURES[0], 0.1);
    let (servo, goal) = (servo(&resolved), &resolved.goals[0]);
    let case = BudgetCase::of(&resolved, goal, &servo, imperfections, &trajectory);
    let samples = Samples {
        total: 20_000,
        each_source: 0,
    };
    let whole = budget(&case, samples, 7).expect("a budget");
    let (mean, square) = (0.05 * 3.0 / 8.0, 0.05 * 35.0 / 128.0);
    let level_sd = (0.045_f64.powi(2) + (0.0017 * 90.0_f64).powi(2)).sqrt();
    let variance = level_sd.powi(2) + square - mean * mean;
    let drifts_m = [[0.0, 0.6e-3, 0.0], [0.0, 0.0, 1.8e-3]].map(Vector3::from);
    let amplitudes_m = [[0.0, -5e-3, 0.0], [0.0, -2e-3, -8e-3]].map(Vector3::from);
    let points = [&whole.total.at_skin, &whole.total.at_target];
    for ((point, amplitude_m), drift_m) in points.into_iter().zip(amplitudes_m).zip(drifts_m) {
        let off_m = point.analytic.bias().norm() - (amplitude_m * mean + drift_m).norm();
        assert!(off_m.abs() < ROUNDING_M, "{off_m}");
        let expected_m2 = variance * amplitude_m.norm_squared();
        let off = point.analytic.covariance().trace() / expected_m2 - 1.0;
        assert!(off.abs() < 1e-9, "{off}");
        // Of 20 000 stratified draws of a breath that fails in a twentieth of all.
        assert!(point.covariance_difference.expect("drawn") < 0.05);
        assert!(point.bias_difference_m.expect("drawn") < 20e-6);
        let [low_m, high_m] = point.drawn_radius_95_m.expect("drawn");
        let radius_m = point.radius_95_m.expect("drawn");
        assert!(
            (low_m..=high_m).contains(&radius_m),
            "{low_m} {radius_m} {high_m}"
        );
    }
    // Who breathes freely holds nothing that drifts, at the same level.
    let free = whole.breathing_freely.expect("it is held");
    let at_mean_m = amplitudes_m[1] * (3.0 / 8.0);
    assert!((free.bias().norm() - at_mean_m.norm()).abs() < ROUNDING_M);
    let share = level_sd.powi(2) + 35.0 / 128.0 - 9.0 / 64.0;
    let expected_m2 = share * amplitudes_m[1].norm_squared();
    assert!((free.covariance().trace() / expected_m2 - 1.0).abs() < 1e-9);
}

#[test]
fn entry_and_tip_go_together_as_in_runs() {
    let tissue = "[imperfections]\n[imperfections.calibration]\n[imperfections.registration]\n\
                  [imperfections.imaging]\n[imperfections.guide]\n[imperfections.breathing]\n[imperfections.needle]\n";
    let cases = vec![
        ("all", imperfect(ALL)),
        (
            "free",
            imperfect(&ALL.replace("hold_failure = 0", "free = true")),
        ),
        (
            "level",
            imperfect(&ALL.replace("hold_failure = 0", "since_image_s = 90\nheld_s = 12")),
        ),
        (
            "free at a level",
            imperfect(&ALL.replace("hold_failure = 0", "free = true\nsince_image_s = 90")),
        ),
        ("unknown bevel", imperfect_in_tissue(tissue)),
        (
            "known bevel",
            imperfect_in_tissue(&format!("{tissue}bevel = \"3:00\"\n")),
        ),
    ];
    for (name, resolved) in cases {
        let [full, law] = [full_draws_m(&resolved), drawn_m(&resolved)];
        let of: [(&str, Distance); 5] = [
            ("entry", |[entry, _]| entry.norm()),
            ("tip", |[_, tip]| tip.norm()),
            ("tip less entry", |[entry, tip]| (tip - entry).norm()),
            ("tip and entry", |[entry, tip]| (tip + entry).norm()),
            ("lateral", |[_, tip]| tip.xy().norm()),
        ];
        for (what, value) in of {
            let sorted = [&full, &law].map(|draws| {
                let mut values: Vec<f64> = draws.iter().map(value).collect();
                values.sort_by(f64::total_cmp);
                values
            });
            for percent in [10, 50, 90, 99] {
                let [full_m, law_m] = sorted
                    .each_ref()
                    .map(|values| values[DRAWS / 100 * percent]);
                let off = law_m / full_m - 1.0;
                assert!(
                    off.abs() < 0.05,
                    "{name}, {what}, {percent} %: {full_m} {law_m}"
                );
            }
        }
    }
}
