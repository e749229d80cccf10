//! A needle that tissue bends, in the budget.

use crate::common::{POSTURES, imperfect, imperfect_in_tissue, motion_to, servo};
use needlebench_scenario::ResolvedScenario;
use needlebench_uncertainty::Source;
use needlebench_uncertainty::budget::{BudgetCase, ErrorBudget, Samples, budget};

const SAMPLES: usize = 10_000;

fn budget_of(blocks: &str) -> (ErrorBudget, Option<[f64; 2]>) {
    budget_in(&imperfect(blocks))
}

fn budget_in(resolved: &ResolvedScenario) -> (ErrorBudget, Option<[f64; 2]>) {
    let trajectory = motion_to(resolved, POSTURES[0], 0.1);
    let goal = &resolved.goals[0];
    let servo = servo(resolved);
    let imperfections = resolved.imperfections.as_ref().expect("given");
    let case = BudgetCase::of(resolved, goal, &servo, imperfections, &trajectory);
    let samples = Samples {
        total: SAMPLES,
        each_source: SAMPLES,
    };
    let found = budget(&case, samples, 11).expect("a needle and its guide");
    let path = goal.needle_path.as_ref().expect("it is in a patient");
    (found, path.pushed_towards)
}

/// The distribution of 512 draws against 10 000 others through the truth of each.
#[test]
fn bends_of_a_known_and_of_an_unknown_bevel_are_those_of_other_draws() {
    for bevel in ["unknown", "3:00", "posterior"] {
        let blocks = format!(
            "[imperfections.guide]\n[imperfections.needle]\nmodel = \"tissue\"\nbevel = \"{bevel}\"\n"
        );
        let (found, _) = budget_of(&blocks);
        let sources: Vec<_> = found
            .sources
            .iter()
            .filter_map(|each| each.source)
            .collect();
        assert_eq!(sources, [Source::Needle], "play is solved with the needle");
        for (place, point) in [
            ("skin", found.total.at_skin),
            ("target", found.total.at_target),
        ] {
            let off = point.covariance_difference.expect("both vary");
            assert!(off < 0.07, "{bevel}: spread at the {place} off by {off}");
            let drawn = point.monte_carlo.expect("drawn");
            let error_m = drawn.rms_m / (SAMPLES as f64).sqrt();
            let bias_m = point.bias_difference_m.expect("drawn");
            assert!(
                bias_m < 6.0 * error_m,
                "{bevel}: bias at the {place} off by {bias_m}"
            );
        }
        let [low_m, high_m] = found.total.at_target.drawn_radius_95_m.expect("drawn");
        let radius_m = found.total.at_target.radius_95_m.expect("asked for");
        let slack_m = 0.02 * radius_m;
        assert!(
            (low_m - slack_m..=high_m + slack_m).contains(&radius_m),
            "{bevel}: {radius_m}"
        );
    }
}

/// A bevel that looks one way bends the needle the other way, one that may look anywhere nowhere on the mean.
#[test]
fn the_mean_bend_is_away_from_the_bevels_face() {
    let blocks = "[imperfections.needle]\nmodel = \"tissue\"\nbevel = \"3:00\"\n";
    let (known, towards) = budget_of(blocks);
    let towards = towards.expect("it is known");
    // At three o'clock the face looks to +y of a guide whose x is towards the head.
    let [x, y, along] = known.total.at_target.analytic.bias_m;
    let mean_m = x * towards[0] + y * towards[1];
    assert!(mean_m > 0.3e-3, "{mean_m}");
    let across_m = x * towards[1] - y * towards[0];
    assert!(
        across_m.abs() < 1e-9 && along.abs() < 1e-9,
        "{across_m} {along}"
    );
    let (other_way, back) = budget_of(&blocks.replace("3:00", "9:00"));
    let back = back.expect("it is known");
    assert!((back[0] + towards[0]).abs() < 1e-9 && (back[1] + towards[1]).abs() < 1e-9);
    let [x, y, _] = other_way.total.at_target.analytic.bias_m;
    assert!((x * towards[0] + y * towards[1] + mean_m).abs() < 1e-9);
    let (unknown, _) = budget_of("[imperfections.needle]\nmodel = \"tissue\"\n");
    assert!(unknown.total.at_target.analytic.bias().norm() < 1e-12);
    let rms_m = |found: &ErrorBudget| found.total.at_target.analytic.rms_m;
    assert!((rms_m(&unknown) / rms_m(&known) - 1.0).abs() < 1e-9);
}

/// An axis that is aimed against the mean bend has no bias left, and what is left is what a goal's answer says.
#[test]
fn what_is_aimed_against_is_the_mean() {
    for more in [
        "",
        "turn_at_mm = 25\n",
        "tip = \"bevel\"\nbevel_spread_deg = 40\n",
    ] {
        let block = format!(
            "[imperfections.guide]\n[imperfections.needle]\nbevel = \"3:00\"\nforces.wall_n = 0.2\n{more}"
        );
        let of = |blocks: &str| budget_in(&imperfect_in_tissue(blocks)).0;
        let [straight, aimed] = [of(&block), of(&format!("{block}aim = true\n"))];
        let [before, after] = [&straight, &aimed].map(|found| &found.total.at_target.analytic);
        let [before_m, after_m] = [before, after].map(|found| found.bias().norm());
        // A turn leaves little to aim against.
        let slack_m = 0.03 * before_m.max(0.3 * before.rms_m);
        assert!(after_m < slack_m, "{more}: {before_m} {after_m}");
        assert!(
            after.rms_m < 1.001 * before.rms_m,
            "{more}: {} {}",
            after.rms_m,
            before.rms_m
        );
        // Other draws through the truth of each.
        let drawn = aimed.total.at_target;
        let error_m = drawn.monte_carlo.expect("drawn").rms_m / (SAMPLES as f64).sqrt();
        let bias_m = drawn.bias_difference_m.expect("drawn");
        assert!(bias_m < 6.0 * error_m, "{more}: {bias_m}");
        let off = drawn.covariance_difference.expect("both vary");
        assert!(off < 0.12, "{more}: {off}");
    }
}

/// The depth that is chosen for a turn leaves hardly more than the best of all that are drawn.
#[test]
fn the_best_turn_is_that_of_all_draws() {
    for gauge_force in ["0.085", "0.3"] {
        let block = format!(
            "[imperfections.guide]\n[imperfections.needle]\nforces.wall_n = {gauge_force}\n"
        );
        let rms_m = |more: &str| {
            let (found, _) = budget_of(&format!("{block}{more}"));
            found.total.at_target.analytic.rms_m
        };
        let least_m = (1..=12)
            .map(|step| rms_m(&format!("turn_at_mm = {}\n", 4 * step)))
            .fold(f64::INFINITY, f64::min);
        let chosen_m = rms_m("turn_at = \"best\"\n");
        assert!(chosen_m < 1.03 * least_m, "{chosen_m} {least_m}");
    }
}

/// A turn on the way, a rolled bevel and a symmetric tip bend less, as the sources of their coefficients say.
#[test]
fn hands_and_tips_bend_a_needle_less() {
    let rms_m = |more: &str| {
        let (found, _) = budget_of(&format!(
            "[imperfections.needle]\nmodel = \"tissue\"\n{more}"
        ));
        found.total.at_target.analytic.rms_m
    };
    let usual_m = rms_m("");
    for (more, at_most) in [
        ("turn_at_mm = 25\n", 0.9),
        ("tip = \"rolled\"\n", 0.21),
        ("tip = \"symmetric\"\n", 0.09),
        ("forces.living = 0.5\n", 0.51),
    ] {
        assert!(
            rms_m(more) < at_most * usual_m,
            "{more} {} {usual_m}",
            rms_m(more)
        );
    }
    assert!(
        rms_m("bore_mm = 0.838\n") > 1.05 * usual_m,
        "without its stylet"
    );
}
