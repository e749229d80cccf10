//! Pareto sets and rankings: properties on random values, and made-up configurations.

use std::collections::BTreeMap;

use needlebench_evaluation::metric::{Metric, metrics};
use needlebench_evaluation::pareto::{Scale, dominates, pareto_set};
use needlebench_evaluation::ranking::{SAME_SCORE, rank_goal};
use needlebench_evaluation::report::{
    ClassClearance, ClearanceReport, ConfigurationReport, EngineReport, GoalReport, MarginReport,
    MarginsReport, PhaseReport, Status,
};
use needlebench_evaluation::room::RoomReport;
use needlebench_evaluation::{EngineDifference, MotionMeasurement, NeedleMeasurement};
use needlebench_kinematics::ik::Configuration;
use needlebench_scenario::ranking::{MetricRanking, RankingSection};
use needlebench_uncertainty::budget::{ErrorBudget, Moments, PointBudget, SourceBudget};
use proptest::prelude::*;

use crate::likely::{event, probability_report};

/// Sums of a dozen numbers from 0 to 1.
const ROUNDING: f64 = 1e-12;

fn clearance(minimum_m: f64, certified_lower_bound_m: Option<f64>) -> ClassClearance {
    ClassClearance {
        minimum_m,
        certified_lower_bound_m,
        breath_allowance_m: None,
        behind_cuts_m: None,
        pair: ["forearm.2".into(), "skin".into()],
        witness_points_m: [[0.0; 3], [minimum_m, 0.0, 0.0]],
        phase: "transfer",
        time_s: Some(1.0),
        engine: Some("rapier".into()),
    }
}

fn needle(tip_error_m: f64) -> NeedleMeasurement {
    NeedleMeasurement {
        tip_position_error_m: tip_error_m,
        depth_error_m: 0.0,
        lateral_error_m: 1e-4,
        needle_angle_error_rad: 1e-3,
        guide_position_error_m: 1e-4,
        entry_point_error_m: Some(1e-4),
        entry_lateral_error_m: Some(1e-4),
        axial_angle_error_rad: Some(1e-3),
        sagittal_angle_error_rad: Some(1e-3),
        true_target_error_m: Some(1e-3),
        true_target_lateral_m: Some(5e-4),
    }
}

/// A budget of what is known of all sources together.
fn budget(rms_m: f64) -> ErrorBudget {
    let moments = Moments {
        bias_m: [rms_m, 0.0, 0.0],
        covariance_m2: [[0.0; 3]; 3],
        rms_m,
        lateral_rms_m: rms_m,
    };
    let point = || PointBudget {
        analytic: moments,
        monte_carlo: None,
        radius_95_m: Some(2.0 * rms_m),
        drawn_radius_95_m: None,
        covariance_difference: None,
        bias_difference_m: None,
    };
    ErrorBudget {
        samples: 0,
        sources: Vec::new(),
        total: SourceBudget {
            source: None,
            basis: None,
            at_skin: point(),
            at_target: point(),
            skin_with_target: None,
        },
        dominant: None,
        before_insertion: Some(moments),
        in_tissue: None,
        of_breath: None,
        breathing_freely: Some(moments),
    }
}

fn room(elbow_as_preferred: Option<bool>, side: Option<f64>) -> RoomReport {
    RoomReport {
        free_fraction: 0.6,
        sight_fraction: 0.7,
        hand_cone_half_angle_rad: 0.3,
        preferred_side_free_fraction: side,
        elbow_as_preferred,
        ..RoomReport::default()
    }
}

fn engine(tip_error_m: f64) -> EngineReport {
    EngineReport {
        unexplained_tip_m: None,
        needle: needle(tip_error_m),
        motion: MotionMeasurement {
            settling_time_s: Some(0.1),
            peak_tracking_error_m: 1e-4,
            peak_torque_ratio: 0.5,
            ..MotionMeasurement::default()
        },
        clearance: ClearanceReport::default(),
    }
}

/// Configuration `index` with every metric measured.
fn configuration(index: usize) -> ConfigurationReport {
    let classes = [
        "robot_phantom",
        "robot_table",
        "robot_gantry",
        "robot_mount",
        "robot_obstacle",
        "robot_person",
        "self",
        "tool_phantom",
        "guide_standoff",
        "needle_corridor",
        "needle_route",
    ];
    let posture_clearance_m = classes.map(|class| (class, 0.05)).into();
    let classes = classes.map(|class| (class, clearance(0.05, Some(0.05))));
    ConfigurationReport {
        status: Status::Ok,
        joints_rad: Some([0.0; 6]),
        roll_rad: Some(0.0),
        margins: Some(MarginsReport {
            joint_limit: 0.4,
            wrist_sine: 0.3,
            elbow_sine: 0.4,
            shoulder_m: 0.05,
            manipulability_m3: 0.01,
        }),
        motion: [
            ("transfer", 0.0, 5.0),
            ("approach", 5.0, 7.0),
            ("hold", 7.0, 8.0),
        ]
        .map(|(phase, start_s, end_s)| PhaseReport {
            phase,
            start_s,
            end_s,
        })
        .into(),
        engines: BTreeMap::from([
            ("mujoco".to_owned(), engine(3e-4)),
            ("rapier".to_owned(), engine(1e-4)),
        ]),
        engine_difference: Some(EngineDifference {
            peak_tip_m: 1e-6,
            settled_tip_m: 1e-9,
            ..EngineDifference::default()
        }),
        clearance: ClearanceReport::new(BTreeMap::from(classes)),
        posture_clearance_m,
        surplus_m: Some(0.02),
        entry_to_target_m: Some(0.08),
        predicted: Some(needle(2e-4)),
        tip_sensitivity_m_per_rad: Some(0.8),
        ..ConfigurationReport::new(Configuration::ALL[index].label())
    }
}

fn with_margin(index: usize, joint_limit: f64) -> ConfigurationReport {
    let mut made = configuration(index);
    made.margins.as_mut().unwrap().joint_limit = joint_limit;
    made
}

fn with_clearance(mut made: ConfigurationReport, clearance_m: f64) -> ConfigurationReport {
    let found = made.clearance.classes.get_mut("robot_phantom").unwrap();
    *found = clearance(clearance_m, Some(clearance_m));
    made.clearance = ClearanceReport::new(made.clearance.classes);
    made
}

fn goal(configurations: Vec<ConfigurationReport>) -> GoalReport {
    GoalReport {
        name: "pose".into(),
        lesion: None,
        entry_m: None,
        true_target_m: None,
        target_m: [0.0; 3],
        axis: [0.0, 0.0, 1.0],
        insertion_length_m: 0.1,
        standoff_m: None,
        needle_route: None,
        fissures_crossed: Vec::new(),
        needle: None,
        configurations,
        recommended: None,
        ranking: None,
    }
}

fn ranked(configurations: Vec<ConfigurationReport>) -> GoalReport {
    let mut goal = goal(configurations);
    rank_goal(&mut goal, &RankingSection::default());
    goal
}

fn chosen(goal: &GoalReport) -> &str {
    &goal.recommended.as_ref().unwrap().label
}

fn read(configuration: &ConfigurationReport, key: &str) -> Option<f64> {
    Metric::of_key(key).unwrap().read(configuration)
}

/// As it was planned, and never simulated.
fn planned(mut made: ConfigurationReport) -> ConfigurationReport {
    made.engines.clear();
    for found in made.clearance.classes.values_mut() {
        found.engine = None;
    }
    made
}

#[test]
fn every_metric_is_read_from_a_report_that_has_everything() {
    let simulated = ConfigurationReport {
        room: Some(room(Some(true), None)),
        budget: Some(budget(3e-4)),
        probability: Some(probability_report(
            event(Some(0.95), [0.94, 0.96], None),
            event(Some(1e-3), [0.9e-3, 1.1e-3], Some(0.01)),
        )),
        ..configuration(0)
    };
    let planned = ConfigurationReport {
        margin: Some(MarginReport {
            attainable_m: Some(0.02),
            achieved_m: Some(0.01),
            class: Some("robot_table"),
            limited_by: Some("transfer"),
            search: "budget",
            straight: None,
            classes: BTreeMap::new(),
        }),
        retreat_clearance: simulated.clearance.clone(),
        ..planned(simulated.clone())
    };
    for metric in metrics() {
        let values = [&simulated, &planned].map(|made| metric.read(made));
        assert!(values.iter().any(Option::is_some), "{}", metric.key);
        let compares = metric.better.is_none() || metric.resolution > 0.0;
        assert!(compares, "{}", metric.key);
    }
}

#[test]
fn metrics_are_the_worst_of_the_engines_and_the_least_of_the_surroundings() {
    let mut made = with_clearance(configuration(0), 0.03);
    assert_eq!(read(&made, "tip_error"), Some(3e-4));
    assert_eq!(read(&made, "clearance"), Some(0.03));
    assert_eq!(read(&made, "self_clearance"), Some(0.05));
    assert_eq!(read(&made, "singularity_margin"), Some(0.3));
    assert_eq!(read(&made, "motion_time"), Some(7.0));
    // A proven bound is another number than the nearest approach.
    let table = made.clearance.classes.get_mut("robot_table").unwrap();
    table.certified_lower_bound_m = Some(0.02);
    assert_eq!(read(&made, "clearance"), Some(0.02));
    assert_eq!(read(&made, "clearance_attained"), Some(0.03));
    // Where one class has no bound nothing is proven of all.
    let table = made.clearance.classes.get_mut("robot_table").unwrap();
    table.certified_lower_bound_m = None;
    assert_eq!(read(&made, "clearance"), None);
    assert_eq!(read(&made, "to_table_attained"), Some(0.05));
}

#[test]
fn planned_and_simulated_motions_have_metrics_of_their_own() {
    let simulated = with_clearance(configuration(0), 0.03);
    let planned = planned(simulated.clone());
    for (stem, value) in [("clearance", 0.03), ("self_clearance", 0.05)] {
        let key = |end: &str| format!("{stem}{end}");
        for end in ["", "_attained"] {
            assert_eq!(read(&simulated, &key(end)), Some(value));
            assert_eq!(read(&planned, &key(end)), None);
        }
        for end in ["_planned", "_planned_attained"] {
            assert_eq!(read(&simulated, &key(end)), None);
            assert_eq!(read(&planned, &key(end)), Some(value));
        }
        // That of the posture does not depend on the motion.
        assert_eq!(read(&simulated, &key("_posture")), Some(0.05));
        assert_eq!(read(&planned, &key("_posture")), Some(0.05));
    }
    assert_eq!(read(&simulated, "tip_error"), Some(3e-4));
    assert_eq!(read(&planned, "tip_error"), None);
    assert_eq!(read(&planned, "tip_error_predicted"), Some(2e-4));
}

#[test]
fn ranking_takes_the_error_over_all_draws_where_there_is_a_budget() {
    let tip_metric = |goal: &GoalReport| {
        let terms = &goal.configurations[0].ranking.as_ref().unwrap().terms;
        let mut found = terms.iter().filter(|term| term.metric.starts_with("tip_"));
        found
            .find(|term| term.metric != "tip_sensitivity")
            .map(|term| (term.metric, term.value))
    };
    let with_budget = |index| ConfigurationReport {
        budget: Some(budget(5e-4)),
        ..configuration(index)
    };
    let goal = ranked(vec![with_budget(0), with_budget(1)]);
    assert_eq!(tip_metric(&goal), Some(("tip_rms", 5e-4)));
    let goal = ranked(vec![configuration(0), configuration(1)]);
    assert_eq!(tip_metric(&goal), Some(("tip_error", 3e-4)));
    // Where one has none, neither would be the same for both.
    let goal = ranked(vec![with_budget(0), configuration(1)]);
    assert_eq!(tip_metric(&goal), None);
}

#[test]
fn ranking_takes_the_nearest_approach_where_nothing_is_proven() {
    let sampled = |index| {
        let mut made = configuration(index);
        for found in made.clearance.classes.values_mut() {
            found.certified_lower_bound_m = None;
        }
        made
    };
    let goal = ranked(vec![sampled(0), sampled(1)]);
    let metrics = &goal.ranking.as_ref().unwrap().metrics;
    assert_eq!(metrics[0].name, "clearance_attained");
    assert!(metrics[0].not_measured_for.is_empty());
}

#[test]
fn clearance_of_the_final_posture_alone_is_not_that_of_the_motion() {
    let mut made = planned(configuration(0));
    for found in made.clearance.classes.values_mut() {
        (found.phase, found.time_s) = ("final_posture", None);
    }
    for stem in [
        "clearance",
        "self_clearance",
        "needle_corridor",
        "arm_to_skin",
    ] {
        for end in ["", "_attained", "_planned", "_planned_attained"] {
            assert_eq!(read(&made, &format!("{stem}{end}")), None, "{stem}{end}");
        }
    }
}

#[test]
fn what_is_missing_or_not_finite_was_not_measured() {
    let mut made = configuration(0);
    made.tip_sensitivity_m_per_rad = None;
    made.margins.as_mut().unwrap().joint_limit = f64::NAN;
    made.engines
        .get_mut("rapier")
        .unwrap()
        .motion
        .settling_time_s = None;
    made.engines
        .get_mut("rapier")
        .unwrap()
        .needle
        .tip_position_error_m = f64::INFINITY;
    for name in [
        "tip_sensitivity",
        "joint_margin",
        "settling_time",
        "tip_error",
    ] {
        assert_eq!(read(&made, name), None, "{name}");
    }
    made.engines.clear();
    assert_eq!(read(&made, "peak_torque"), None);
}

#[test]
fn metric_that_one_configuration_lacks_counts_for_none() {
    let mut blind = with_margin(0, 0.4);
    blind.tip_sensitivity_m_per_rad = None;
    let goal = ranked(vec![blind, with_margin(1, 0.4)]);
    let metrics = &goal.ranking.as_ref().unwrap().metrics;
    let missing = metrics.iter().find(|each| each.name == "tip_sensitivity");
    assert_eq!(missing.unwrap().not_measured_for, ["Right-Down-Fold"]);
    for each in &goal.configurations {
        let terms = &each.ranking.as_ref().unwrap().terms;
        assert!(terms.iter().all(|term| term.metric != "tip_sensitivity"));
        assert!(each.pareto);
    }
    let scores: Vec<f64> = goal
        .configurations
        .iter()
        .map(|each| each.ranking.as_ref().unwrap().score)
        .collect();
    assert_eq!(scores[0], scores[1]);
}

#[test]
fn terms_add_up_to_the_score_and_each_is_weight_times_utility() {
    let goal = ranked(vec![configuration(0), with_margin(1, 0.1)]);
    for each in &goal.configurations {
        let ranking = each.ranking.as_ref().unwrap();
        let weights: f64 = ranking.terms.iter().map(|term| term.weight).sum();
        let sum: f64 = ranking.terms.iter().map(|term| term.contribution).sum();
        assert!((sum - ranking.score).abs() < ROUNDING);
        for term in &ranking.terms {
            let expected = term.weight * term.utility / weights;
            assert!((term.contribution - expected).abs() < ROUNDING, "{term:?}");
            assert!((0.0..=1.0).contains(&term.utility), "{term:?}");
        }
    }
}

#[test]
fn more_clearance_is_chosen_and_dominates() {
    let goal = ranked(vec![
        with_clearance(configuration(0), 0.02),
        with_clearance(configuration(1), 0.03),
    ]);
    assert_eq!(chosen(&goal), "Right-Up-Fold");
    let dominance = goal.configurations[0].dominated_by.as_ref().unwrap();
    assert_eq!(dominance.label, "Right-Up-Fold");
    assert_eq!(dominance.better_in, ["clearance"]);
    assert_eq!(goal.ranking.as_ref().unwrap().pareto_set, ["Right-Up-Fold"]);
    let reason = &goal.recommended.as_ref().unwrap().reason;
    assert!(
        reason.contains("better in clearance (certified 30.0 mm vs. 20.0 mm"),
        "{reason}"
    );
    // Nothing speaks for the other one.
    assert!(reason.contains("no single weight change"), "{reason}");
}

#[test]
fn what_the_metrics_do_not_resolve_is_not_told_apart() {
    let goal = ranked(vec![
        with_clearance(configuration(0), 0.0300),
        with_clearance(configuration(1), 0.0304),
        with_clearance(configuration(2), 0.0250),
    ]);
    assert_eq!(chosen(&goal), "Right-Up-Fold");
    assert_eq!(
        goal.ranking.as_ref().unwrap().not_told_apart,
        ["Right-Down-Fold"]
    );
    let recommended = goal.recommended.as_ref().unwrap();
    assert!(
        recommended
            .summary
            .contains("tied with Right-Down-Fold (within the metrics' resolution)"),
        "{}",
        recommended.summary
    );
    let far = ranked(vec![
        with_clearance(configuration(0), 0.02),
        with_clearance(configuration(1), 0.04),
    ]);
    assert!(far.ranking.unwrap().not_told_apart.is_empty());
    assert!(far.recommended.unwrap().summary.contains("best of 2"));
}

#[test]
fn noise_decides_nothing() {
    let goal = ranked(vec![
        with_clearance(with_margin(0, 0.4), 0.02),
        with_clearance(with_margin(1, 0.4 + 1e-12), 0.02 + 1e-12),
    ]);
    assert!(goal.configurations.iter().all(|each| each.pareto));
    let scores = [0, 1].map(|at| goal.configurations[at].ranking.as_ref().unwrap().score);
    assert!((scores[0] - scores[1]).abs() < SAME_SCORE);
    assert_eq!(chosen(&goal), "Right-Down-Fold");
    let reason = &goal.recommended.as_ref().unwrap().reason;
    assert!(reason.contains("scores are equal"), "{reason}");
}

#[test]
fn ample_clearance_is_ample() {
    let goal = ranked(vec![
        with_clearance(with_margin(0, 0.1), 0.3),
        with_clearance(with_margin(1, 0.4), 0.12),
    ]);
    // The table is at 50 mm from both, so take it away.
    let mut made = goal.configurations;
    for each in &mut made {
        for class in [
            "robot_table",
            "robot_gantry",
            "robot_mount",
            "robot_obstacle",
            "robot_person",
            "tool_phantom",
        ] {
            each.clearance.classes.remove(class);
        }
    }
    let goal = ranked(made);
    assert_eq!(chosen(&goal), "Right-Up-Fold");
    let term = |at: usize| -> needlebench_evaluation::ranking::Term {
        let ranking = goal.configurations[at].ranking.as_ref().unwrap();
        let mut terms = ranking.terms.iter();
        terms
            .find(|term| term.metric == "clearance")
            .unwrap()
            .clone()
    };
    assert_eq!(term(0).utility, term(1).utility);
    assert!(term(0).value > term(1).value && term(0).counted_as == term(1).counted_as);
    // A difference is a difference, however ample: neither beats the other.
    assert!(goal.configurations.iter().all(|each| each.pareto));
}

#[test]
fn reason_prints_what_was_measured_and_not_what_counts() {
    // Both are beyond the best anchor of 100 mm.
    let goal = ranked(vec![
        with_clearance(with_margin(0, 0.4), 0.03),
        with_clearance(with_margin(1, 0.4), 0.02),
    ]);
    let reason = &goal.recommended.as_ref().unwrap().reason;
    for term in &goal.configurations[0].ranking.as_ref().unwrap().terms {
        assert!(term.utility <= 1.0);
    }
    assert!(
        reason.contains("(certified 30.0 mm vs. 20.0 mm"),
        "{reason}"
    );
}

#[test]
fn smallest_change_of_a_weight_is_where_the_scores_are_even() {
    let goal = ranked(vec![
        with_clearance(with_margin(0, 0.1), 0.04),
        with_clearance(with_margin(1, 0.4), 0.02),
    ]);
    let first = chosen(&goal).to_owned();
    let ranking = goal.ranking.as_ref().unwrap();
    let change = ranking.smallest_weight_change.as_ref().unwrap();
    assert_eq!(&change.then_first, ranking.runner_up.as_ref().unwrap());
    let chosen_at = |weight: f64| {
        let mut section = RankingSection::default();
        let key = match change.metric {
            "clearance" => &mut section.clearance_mm,
            "joint_margin" => &mut section.joint_margin,
            other => panic!("{other} is the same for both"),
        };
        *key = MetricRanking {
            weight: Some(weight),
            ..MetricRanking::default()
        };
        let mut goal = goal.clone();
        rank_goal(&mut goal, &section);
        chosen(&goal).to_owned()
    };
    let step = 1e-6 * (change.even_at - change.weight);
    assert_eq!(chosen_at(change.even_at - step), first);
    assert_eq!(chosen_at(change.even_at + step), change.then_first);
}

#[test]
fn effort_can_put_first_what_is_not_in_the_pareto_set_and_the_reason_says_so() {
    // Slightly less margin, much less torque.
    let mut easy = with_margin(1, 0.4);
    for engine in easy.engines.values_mut() {
        engine.motion.peak_torque_ratio = 0.3;
    }
    let goal = ranked(vec![with_margin(0, 0.42), easy]);
    assert_eq!(chosen(&goal), "Right-Up-Fold");
    assert!(!goal.configurations[1].pareto);
    let reason = &goal.recommended.as_ref().unwrap().reason;
    assert!(reason.contains("not in the Pareto set"), "{reason}");
}

#[test]
fn preference_is_the_mean_of_what_is_stated() {
    let preference = |room: Option<RoomReport>| {
        let made = ConfigurationReport {
            room,
            ..configuration(0)
        };
        read(&made, "preference")
    };
    assert_eq!(preference(None), None);
    for (elbow, side, expected) in [
        (None, None, None),
        (Some(false), None, Some(0.0)),
        (None, Some(0.5), Some(0.5)),
        (Some(true), Some(0.5), Some(0.75)),
    ] {
        assert_eq!(preference(Some(room(elbow, side))), expected);
    }
}

#[test]
fn only_what_works_is_ranked() {
    let mut rejected = configuration(0);
    rejected.status = Status::Rejected;
    let mut failed = configuration(1);
    failed.status = Status::Failed;
    let goal = ranked(vec![rejected, failed, configuration(2)]);
    assert_eq!(chosen(&goal), "Right-Down-Unfold");
    let reason = &goal.recommended.as_ref().unwrap().reason;
    assert!(
        reason.starts_with("the only feasible configuration"),
        "{reason}"
    );
    for each in &goal.configurations[..2] {
        assert!(!each.pareto && each.ranking.is_none() && each.dominated_by.is_none());
    }
    let nothing = ranked(goal.configurations[..2].to_vec());
    assert_eq!(nothing.recommended, None);
    assert!(nothing.ranking.unwrap().order.is_empty());
}

#[test]
fn nothing_measured_is_said_and_not_scored() {
    let mut bare = configuration(0);
    bare.margins = None;
    bare.motion.clear();
    bare.engines.clear();
    bare.clearance = ClearanceReport::default();
    bare.tip_sensitivity_m_per_rad = None;
    let mut other = bare.clone();
    other.label = Configuration::ALL[1].label();
    let goal = ranked(vec![bare, other]);
    assert!(
        goal.configurations
            .iter()
            .all(|each| each.ranking.is_none())
    );
    let reason = &goal.recommended.as_ref().unwrap().reason;
    assert!(reason.contains("no metric with a weight"), "{reason}");
}

/// Resolution of all metrics below: above the noise, below the grid.
const RESOLUTION: f64 = 1e-3;

fn scale(resolution: f64, more_is_better: bool) -> Scale {
    Scale {
        resolution,
        more_is_better,
    }
}

#[test]
fn two_values_compare_by_their_own_difference() {
    use std::cmp::Ordering::{Equal, Greater, Less};
    let more = scale(0.5, true);
    for (a, b, expected) in [
        (1.0, 1.5, Equal),
        (1.5, 1.0, Equal),
        (1.0, 1.6, Less),
        (1.6, 1.0, Greater),
        (f64::NAN, 1.0, Less),
        (-f64::NAN, f64::NAN, Equal),
        (f64::INFINITY, f64::INFINITY, Equal),
        (f64::INFINITY, 1.0, Greater),
    ] {
        assert_eq!(more.compare(a, b), expected, "{a} {b}");
        let other_way = if a.is_nan() || b.is_nan() {
            expected
        } else {
            expected.reverse()
        };
        assert_eq!(scale(0.5, false).compare(a, b), other_way, "{a} {b}");
    }
}

/// Corridors of `table3`, mm: each within 0.5 of the next, the ends 0.73 apart.
#[test]
fn steps_below_the_resolution_do_not_chain_to_a_tie() {
    let scales = [scale(0.5, true), scale(0.1, true), scale(0.1, true)];
    let candidates = [[3.0, 3.0, 1.0], [3.3, 3.0, 0.0], [3.73, 2.0, 1.0]].map(Vec::from);
    // Through the middle one, the last would be even with the first in the corridor, and beaten.
    assert_eq!(pareto_set(&candidates, &scales), [true, false, true]);
    assert!(!dominates(&candidates[0], &candidates[2], &scales));
    assert!(dominates(&candidates[0], &candidates[1], &scales));
}

#[test]
fn those_who_beat_each_other_in_a_circle_are_equals() {
    let circle = [[0.0, 0.7, 1.4], [1.4, 0.0, 0.7], [0.7, 1.4, 0.0]].map(Vec::from);
    let scales = [scale(1.0, true); 3];
    let [a, b, c] = &circle;
    assert!(dominates(a, b, &scales) || dominates(b, a, &scales));
    assert!(dominates(b, c, &scales) || dominates(c, b, &scales));
    assert!(dominates(a, c, &scales) || dominates(c, a, &scales));
    assert_eq!(pareto_set(&circle, &scales), [true; 3]);
    let with_better = [circle.to_vec(), vec![vec![3.0; 3]]].concat();
    assert_eq!(
        pareto_set(&with_better, &scales),
        [false, false, false, true]
    );
}

/// Up to eight configurations in four metrics, on a grid with noise: ties and dominance are common.
fn values() -> impl Strategy<Value = Vec<Vec<f64>>> {
    let value = (0..4_i32, -1e-9..1e-9).prop_map(|(step, noise)| f64::from(step) + noise);
    prop::collection::vec(prop::collection::vec(value, 4), 1..=8)
}

fn four_scales() -> [Scale; 4] {
    std::array::from_fn(|metric| scale(RESOLUTION, metric % 2 == 0))
}

proptest! {
    #[test]
    fn members_are_those_that_nothing_beats_by_the_definition(values in values()) {
        let scales = four_scales();
        let members = pareto_set(&values, &scales);
        prop_assert!(members.iter().any(|member| *member));
        // From the words of the definition, metric by metric.
        let beats = |a: &[f64], b: &[f64]| {
            let lead = |metric: usize| if metric.is_multiple_of(2) { a[metric] - b[metric] } else { b[metric] - a[metric] };
            (0..4).all(|metric| lead(metric) >= -RESOLUTION) && (0..4).any(|metric| lead(metric) > RESOLUTION)
        };
        for (at, each) in values.iter().enumerate() {
            prop_assert_eq!(members[at], !values.iter().any(|other| beats(other, each)));
        }
    }

    #[test]
    fn pareto_set_is_the_same_in_any_order(values in values(), turn in 0..8_usize) {
        let members = pareto_set(&values, &four_scales());
        let turn = turn % values.len();
        let mut turned = values.clone();
        turned.rotate_left(turn);
        turned.reverse();
        let mut expected = members;
        expected.rotate_left(turn);
        expected.reverse();
        prop_assert_eq!(pareto_set(&turned, &four_scales()), expected);
    }

    #[test]
    fn noise_below_the_resolution_changes_no_member(values in values(), seed in any::<u64>()) {
        let mut state = seed;
        let mut noise = || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 40) as f64 / f64::from(1 << 24) * 1e-9
        };
        let noisy: Vec<Vec<f64>> = values
            .iter()
            .map(|each| each.iter().map(|value| value + noise()).collect())
            .collect();
        prop_assert_eq!(pareto_set(&noisy, &four_scales()), pareto_set(&values, &four_scales()));
    }

    #[test]
    fn what_is_dominated_scores_higher_by_no_more_than_resolutions_are_worth(
        margins in prop::collection::vec((0.0..0.6, 0.0..0.05), 2..=8)
    ) {
        // Joint margin and clearance differ, and both decide on the Pareto set.
        let made: Vec<ConfigurationReport> = margins
            .iter()
            .enumerate()
            .map(|(index, (margin, clearance_m))| {
                with_clearance(with_margin(index, *margin), *clearance_m)
            })
            .collect();
        let goal = ranked(made.clone());
        let score = |each: &ConfigurationReport| each.ranking.as_ref().unwrap().score;
        for each in &goal.configurations {
            prop_assert_eq!(each.pareto, each.dominated_by.is_none());
            if let Some(dominance) = &each.dominated_by {
                let other = goal.configurations.iter().find(|o| o.label == dominance.label).unwrap();
                prop_assert!(!each.pareto);
                let columns = &goal.ranking.as_ref().unwrap().metrics;
                let total: f64 = columns.iter().map(|metric| metric.weight).sum();
                // The steepest piece of a utility is half of it between two anchors.
                let worth = columns.iter().map(|metric| {
                    let step = (metric.half - metric.worst).abs().min((metric.best - metric.half).abs());
                    metric.weight / total * 0.5 * metric.resolution / step
                });
                prop_assert!(score(other) + worth.sum::<f64>() + ROUNDING >= score(each));
            }
        }
        // The order of the configurations decides between even scores alone.
        let mut turned = made;
        turned.reverse();
        let turned = ranked(turned);
        for each in &goal.configurations {
            let same = turned.configurations.iter().find(|o| o.label == each.label).unwrap();
            prop_assert_eq!(score(each), score(same));
            prop_assert_eq!(each.pareto, same.pareto);
        }
    }
}
