//! The two ways to the error budget agree.

use crate::common::{ALL, POSTURES, imperfect, motion_to, servo};
use nalgebra::{Translation3, Vector3};
use needlebench_kinematics::Chain;
use needlebench_scenario::Goal;
use needlebench_scenario::imperfections::ArmPopulation;
use needlebench_uncertainty::Source;
use needlebench_uncertainty::budget::{BudgetCase, ErrorBudget, Samples, SourceBudget, budget};

/// Samples of the figure that is held: 10 000.
const SAMPLES: usize = 10_000;

/// Largest relative difference of the covariances.
const COVARIANCE: f64 = 0.05;

/// Standard errors of a mean over the draws that a bias may be off by.
const STANDARD_ERRORS: f64 = 3.0;

/// Largest difference of the biases besides, m: what a budget of first order leaves out.
const BIAS_M: f64 = 2e-6;

fn budgets(blocks: &str, samples: usize) -> Vec<ErrorBudget> {
    let resolved = imperfect(blocks);
    let servo = servo(&resolved);
    POSTURES
        .into_iter()
        .map(|posture| {
            let trajectory = motion_to(&resolved, posture, 0.1);
            let case = BudgetCase {
                cell: &resolved.cell,
                goal: &resolved.goals[0],
                place: resolved
                    .phantom
                    .as_ref()
                    .map(|placed| &placed.world_from_phantom),
                servo: &servo,
                imperfections: resolved.imperfections.as_ref().expect("given"),
                trajectory: &trajectory,
                timestep_s: 1e-3,
                held_off_m: [Vector3::zeros(); 2],
            };
            let samples = Samples {
                total: samples,
                each_source: samples,
            };
            budget(&case, samples, 5).expect("the markers are sound and the drives strong enough")
        })
        .collect()
}

/// A motion of somebody else ends beside its goal: the mean square of all grows by the square of that and by twice its product
/// with the bias, by Jacobians and by draws; sources alone stay as they are.
#[test]
fn where_the_arm_is_held_beside_its_goal_is_a_bias_of_all() {
    let resolved = imperfect(ALL);
    let servo = servo(&resolved);
    let trajectory = motion_to(&resolved, POSTURES[0], 0.1);
    let mut goal = resolved.goals[0].clone();
    goal.world_from_guide_exit = resolved.cell.robot.world_from_flange(&trajectory.end())
        * resolved.cell.tool.flange_from_guide_exit;
    let at_goal = |goal: &Goal| {
        let imperfections = resolved.imperfections.as_ref().unwrap();
        let case = BudgetCase::of(&resolved, goal, &servo, imperfections, &trajectory).as_held();
        let samples = Samples {
            total: 400,
            each_source: 0,
        };
        budget(&case, samples, 5).unwrap()
    };
    let held = at_goal(&goal);
    let off_m = Vector3::new(3e-3, -2e-3, 1e-3);
    goal.world_from_guide_exit *= Translation3::from(-off_m);
    let beside = at_goal(&goal);
    assert_eq!(held.sources, beside.sources);
    let both = [
        (&held.total.at_skin, &beside.total.at_skin),
        (&held.total.at_target, &beside.total.at_target),
    ];
    for (held, beside) in both {
        let drawn = [held, beside].map(|point| point.monte_carlo.unwrap());
        for [held, beside] in [[held.analytic, beside.analytic], drawn] {
            let expected = held.rms_m * held.rms_m
                + 2.0 * Vector3::from(held.bias_m).dot(&off_m)
                + off_m.norm_squared();
            let found = beside.rms_m * beside.rms_m;
            assert!(
                (found - expected).abs() < 1e-6 * expected,
                "{found} and {expected}"
            );
        }
    }
}

#[test]
fn jacobians_and_ten_thousand_draws_agree_for_every_source_and_for_all() {
    for (posture, budget) in budgets(ALL, SAMPLES).iter().enumerate() {
        assert_eq!(budget.sources.len(), 13);
        for each in budget.sources.iter().chain([&budget.total]) {
            for (place, point) in [("skin", each.at_skin), ("target", each.at_target)] {
                let what = format!("posture {posture}, {:?} at the {place}", each.source);
                let Some(covariance) = point.covariance_difference else {
                    let is_of_the_target = each.source == Some(Source::Imaging);
                    assert!(is_of_the_target && place == "skin", "{what} does not vary");
                    continue;
                };
                let bias_m = point.bias_difference_m.expect("sampled");
                assert!(
                    covariance <= COVARIANCE,
                    "{what}: covariance off by {covariance:.4}"
                );
                let spread_m = point.analytic.covariance().trace().sqrt();
                let drawn_m = STANDARD_ERRORS * spread_m / (SAMPLES as f64).sqrt();
                assert!(
                    bias_m <= BIAS_M + drawn_m,
                    "{what}: bias off by {bias_m:.3e} m"
                );
            }
        }
    }
}

/// What the second order of origins that are turned by up to 7 mrad is of a mean square; 2.7e-4 is seen.
const SECOND_ORDER: f64 = 1e-3;

/// The nine real arms themselves, without a distribution and without a Jacobian: the mean square of the tip over
/// them is that of the population, whose covariance counts one arm less.
#[test]
fn an_uncalibrated_arm_is_as_far_off_as_the_nine_real_arms() {
    let blocks = "[imperfections.calibration]\nclass = \"nominal_kinematics\"\n";
    let resolved = imperfect(blocks);
    let robot = &resolved.cell.robot;
    let imperfections = resolved.imperfections.as_ref().expect("given");
    let population = imperfections.calibration.as_ref().expect("given");
    let others = (population.modes.len() as f64 - 1.0).sqrt();
    for (posture, budget) in POSTURES.into_iter().zip(budgets(blocks, 0)) {
        let depth_m = resolved.goals[0].insertion_length_m;
        let in_flange =
            resolved.cell.tool.flange_from_guide_exit * nalgebra::Point3::new(0.0, 0.0, depth_m);
        let tip = |chain: &Chain| chain.base_link_from_flange(&posture) * in_flange;
        let off_m: Vec<f64> = population
            .modes
            .iter()
            .map(|mode| {
                let arm = std::array::from_fn(|i| population.mean[i] + mode[i] * others);
                let real = ArmPopulation::moved(&robot.chain, &arm);
                (tip(&real) - tip(&robot.chain)).norm()
            })
            .collect();
        let count = off_m.len() as f64;
        assert_eq!(count, 9.0);
        let mean_square_m2 = off_m.iter().map(|each| each * each).sum::<f64>() / count;
        let point = budget.total.at_target;
        assert!(point.monte_carlo.is_none());
        let spread_m2 = point.analytic.covariance().trace() * (count - 1.0) / count;
        let by_budget_m2 = point.analytic.bias().norm_squared() + spread_m2;
        println!("{mean_square_m2:e} m^2 of the arms, {by_budget_m2:e} m^2 by the budget");
        assert!((by_budget_m2 / mean_square_m2 - 1.0).abs() < SECOND_ORDER);
    }
}

#[test]
fn elastic_joints_sag_more_under_a_payload_that_is_heavier_than_believed() {
    let payload = "[imperfections.payload]\nmass_error_kg = 0.3\n";
    let elasticity = "[imperfections.elasticity]\n";
    let bias = |blocks: &str| budgets(blocks, 0)[1].total.at_target.analytic.bias();
    let both = bias(&format!("{payload}{elasticity}"));
    let sum = bias(payload) + bias(elasticity);
    assert!(
        (both - sum).norm() > 1e-5,
        "the gears carry the extra weight too"
    );
}

/// A maker's calibration is measured on an arm that sags, and so has a part of the sag in it: counted twice,
/// the tip is off by more. With nominal lengths too, as that calibration is what they are off by.
#[test]
fn sag_that_a_calibration_has_taken_for_geometry_is_not_counted_twice() {
    for class in ["factory_calibrated", "nominal_kinematics"] {
        let sag = |under_gravity: bool| -> f64 {
            let blocks = format!(
                "[imperfections.calibration]\nclass = \"{class}\"\n\
                 measured_under_gravity = {under_gravity}\n[imperfections.elasticity]\n"
            );
            let of_gears = |budget: &ErrorBudget| {
                let source = |each: &&SourceBudget| each.source == Some(Source::Elasticity);
                budget
                    .sources
                    .iter()
                    .find(source)
                    .unwrap()
                    .at_target
                    .analytic
                    .rms_m
            };
            budgets(&blocks, 0).iter().map(of_gears).sum()
        };
        assert!(
            sag(true) < 0.9 * sag(false),
            "{class}: {} {}",
            sag(true),
            sag(false)
        );
    }
}

/// `F L^3 / (3 E I)` of a steel rod of 1.27 mm over 86 mm, by hand: 0.830 mm at 0.1 N.
#[test]
fn needle_bends_as_a_cantilever_does() {
    let budget = &budgets("[imperfections.needle]\nmodel = \"cantilever\"\n", 0)[0];
    let at_target = budget.total.at_target.analytic;
    assert!(
        (at_target.rms_m - 0.8302e-3).abs() < 1e-6,
        "{}",
        at_target.rms_m
    );
    let [_, _, (along_m, _)] = at_target.principal();
    assert!(along_m < 1e-9, "across the needle alone: {along_m}");
}

#[test]
fn breath_that_is_not_held_is_said_beside_one_that_is() {
    let budget = &budgets("[imperfections.breathing]\nhold_failure = 0\n", 0)[0];
    let (held, free) = (
        budget.total.at_target.analytic.rms_m,
        budget.breathing_freely.unwrap().rms_m,
    );
    // E[sin^8] = 35/128 of the amplitude of 2 and 8 mm squared.
    let expected_m = (68.0_f64 * 35.0 / 128.0).sqrt() * 1e-3;
    assert!((free - expected_m).abs() < 1e-9, "{free}");
    assert!(held < 0.1 * free);
}

/// Six markers, three of them hardly seen along the slices, of a target that is seen best across them.
const MEASURED: &str = "
[imperfections.registration]
markers_mm = [[-110, -90, -90], [110, -90, -90], [-130, -70, 80], [130, -70, 80], [0, -115, -120], [0, -110, 110]]
covariance_mm2 = [
    [0.01, 0.01, 1.2, 0, 0, 0.01],
    [0.02, 0.01, 1.0, 0.005, 0, 0],
    [0.01, 0.02, 0.9, 0, -0.02, 0],
    [0.3, 0.04, 0.05, 0.08, 0, 0],
    [0.04, 0.04, 0.04, 0, 0, 0],
    [0.02, 0.03, 0.05, 0, 0, 0.03],
]
[imperfections.imaging]
covariance_mm2 = [0.04, 0.05, 0.6, 0.01, 0.05, -0.08]
";

/// Four standard errors of the norm of a covariance's difference from that many draws: at most `sqrt(2)` of its own
/// norm over the root of their number each, in six elements; and what first order leaves out.
const MEASURED_COVARIANCE: f64 = 0.05;

#[test]
fn measured_covariances_give_what_draws_of_weighted_fits_give() {
    let blocks = format!(
        "{MEASURED}[imperfections.skin_markers]\n[imperfections.breathing]\nhold_failure = 0\n"
    );
    for budget in budgets(&blocks, SAMPLES) {
        let named: Vec<&str> = budget.sources.iter().map(SourceBudget::in_words).collect();
        let expected = [
            "marker localisation, measured",
            "skin_markers",
            "target localisation, measured",
            "breathing",
        ];
        assert_eq!(named, expected);
        for each in budget.sources.iter().chain([&budget.total]) {
            let point = each.at_target;
            let what = each.in_words();
            let covariance = point.covariance_difference.expect("it varies");
            println!("{what}: covariance off by {covariance:.4}");
            assert!(covariance <= MEASURED_COVARIANCE, "{what}: {covariance}");
            let spread_m = point.analytic.covariance().trace().sqrt();
            let drawn_m = STANDARD_ERRORS * spread_m / (SAMPLES as f64).sqrt();
            let bias_m = point.bias_difference_m.expect("sampled");
            assert!(
                bias_m <= BIAS_M + drawn_m,
                "{what}: bias off by {bias_m:e} m"
            );
        }
    }
}

/// Rounding of one way to the same numbers beside another.
const SAME: f64 = 1e-10;

#[test]
fn equal_covariances_are_what_one_localisation_error_is() {
    // 0.6 mm in all: 0.12 mm^2 along each axis.
    let assumed = "[imperfections.registration]\nlocalisation_error_mm = 0.6\n";
    let places = MEASURED.lines().find(|line| line.starts_with("markers_mm"));
    let equal = ["[0.12, 0.12, 0.12, 0, 0, 0]"; 6].join(", ");
    let measured = format!(
        "[imperfections.registration]\n{}\ncovariance_mm2 = [{equal}]\n",
        places.unwrap()
    );
    for (assumed, measured) in budgets(assumed, 0).iter().zip(budgets(&measured, 0)) {
        let at_target = |budget: &ErrorBudget| budget.sources[0].at_target.analytic;
        let (assumed, measured) = (at_target(assumed), at_target(&measured));
        let size = assumed.covariance().norm();
        let apart = (assumed.covariance() - measured.covariance()).norm();
        assert!(apart < SAME * size, "{apart:e} of {size:e}");
        assert!((assumed.bias() - measured.bias()).norm() < SAME * assumed.rms_m);
    }
}

#[test]
fn localisations_are_named_for_what_they_rest_on_where_one_was_measured() {
    let imaging = MEASURED.find("[imperfections.imaging]").unwrap();
    let named = |blocks: &str| -> Vec<&'static str> {
        let budget = &budgets(blocks, 0)[0];
        budget.sources.iter().map(SourceBudget::in_words).collect()
    };
    assert_eq!(
        named(&format!(
            "{}[imperfections.imaging]\n",
            &MEASURED[..imaging]
        )),
        [
            "marker localisation, measured",
            "target localisation, assumed"
        ]
    );
    assert_eq!(
        named(&format!(
            "{}[imperfections.registration]\n",
            &MEASURED[imaging..]
        )),
        [
            "marker localisation, assumed",
            "target localisation, measured"
        ]
    );
    assert_eq!(
        named("[imperfections.registration]\n[imperfections.imaging]\n"),
        ["registration", "imaging"]
    );
}
