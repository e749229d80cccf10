//! Verdict.

use needlebench_cell::part_in_words;
use needlebench_kinematics::ik::Configuration;
use needlebench_scenario::scenario::CriteriaSection;
use needlebench_scenario::study::StudyMode;
use needlebench_scenario::{Expectation, Goal};

use crate::check_configuration;
use crate::report::{
    ConfigurationReport, CriterionResult, GoalReport, Judged, NotJudged, RouteReport, Status,
    Verdict,
};

/// Name of the criterion that a configuration comes out as the scenario expects.
pub const EXPECTED: &str = "expected";

/// Criterion of the margins that the planned needle keeps, and the rule that rejects where it does not.
const NEEDLE_ROUTE: &str = "needle_route";

/// Evaluates all configurations of all goals: sets each status, and returns every criterion that was evaluated or was
/// to be. `engines` are those that were to measure.
///
/// A feasible configuration is `failed` if it fails a criterion, or if no engine measured it. The verdict is `fail` if
/// any configuration fails a criterion, unless that was expected; if fewer configurations of a goal pass than required;
/// if the planned needle violates a required margin; or if a configuration's outcome is not the expected one. It is
/// `incomplete` if none of this is known and something was not measured that was to be evaluated.
pub fn judge(
    goals: &mut [GoalReport],
    planned: &[Goal],
    criteria: &CriteriaSection,
    engines: &[&str],
) -> (Verdict, Judged) {
    let mut all = Judged::default();
    let mut failed = false;
    for (report, goal) in goals.iter_mut().zip(planned) {
        let (mut working, mut open) = (0_u32, 0_u32);
        for configuration in &mut report.configurations {
            let expected = Configuration::from_label(configuration.label)
                .and_then(|each| goal.expected.get(&each));
            if configuration.rejections.is_empty() {
                let judged = check_configuration(
                    &goal.name,
                    configuration,
                    criteria,
                    StudyMode::Dynamic,
                    engines,
                );
                let missed = judged.results.iter().any(|result| !result.pass);
                let measured = !configuration.engines.is_empty();
                configuration.not_judged = judged.not_judged.len();
                configuration.status = if missed || !measured {
                    Status::Failed
                } else {
                    Status::Ok
                };
                match (missed, configuration.not_judged) {
                    (true, _) => failed |= expected != Some(&Expectation::Failed),
                    (false, 0) => working += 1,
                    (false, _) => open += 1,
                }
                all.extend(judged);
                if let Some(expected) = expected {
                    let result = check_expectation(&goal.name, configuration, expected);
                    // What is still open may come out as expected; what works is not rejected any more.
                    let undecided = !missed
                        && configuration.not_judged > 0
                        && !matches!(expected, Expectation::Rejected(_));
                    if undecided {
                        all.not_judged.push(NotJudged {
                            goal: result.goal,
                            label: result.label,
                            engine: None,
                            criterion: result.criterion,
                            reason: DEPENDS.to_owned(),
                            requirement: None,
                        });
                    } else {
                        failed |= !result.pass;
                        all.results.push(result);
                    }
                }
            } else {
                configuration.status = Status::Rejected;
                if let Some(expected) = expected {
                    let result = check_expectation(&goal.name, configuration, expected);
                    failed |= !result.pass;
                    all.results.push(result);
                }
            }
        }
        if let Some(route) = &report.needle_route {
            let result = check_route(goal, route);
            failed |= !result.pass;
            all.results.push(result);
        }
        let wanted = criteria.min_working_configurations;
        let known = working >= wanted || working + open < wanted;
        let result = CriterionResult {
            goal: goal.name.clone(),
            label: None,
            engine: None,
            criterion: "min_working_configurations".to_owned(),
            value: known.then(|| f64::from(working)),
            limit: Some(f64::from(wanted)),
            unit: "1",
            pass: working >= wanted,
            detail: String::new(),
            requirement: None,
        };
        failed |= known && !result.pass;
        all.add(result, || DEPENDS.to_owned());
    }
    (Verdict::of(failed, !all.not_judged.is_empty()), all)
}

/// Whether a goal expects of every configuration that the needle path rejects it.
pub fn route_is_expected(goal: &Goal) -> bool {
    Configuration::ALL.iter().all(|each| {
        let expected = goal.expected.get(each);
        matches!(expected, Some(Expectation::Rejected(rule)) if rule == NEEDLE_ROUTE)
    })
}

/// The margins of the needle path. A violated one still counts as met where every configuration is expected to
/// be rejected by it.
fn check_route(goal: &Goal, route: &RouteReport) -> CriterionResult {
    let does = if route.kept {
        "satisfies its margin to"
    } else {
        "violates its margin to"
    };
    CriterionResult {
        goal: goal.name.clone(),
        label: None,
        engine: None,
        criterion: NEEDLE_ROUTE.to_owned(),
        value: Some(route.distance_m),
        limit: Some(route.margin_m),
        unit: "m",
        pass: route.kept || route_is_expected(goal),
        detail: format!(
            "the planned needle {does} {} ({})",
            part_in_words(&route.part),
            route.tissue
        ),
        requirement: None,
    }
}

/// Why a criterion on outcomes of configurations is not evaluated.
const DEPENDS: &str = "depends on criteria that were not evaluated";

fn check_expectation(
    goal: &str,
    configuration: &ConfigurationReport,
    expected: &Expectation,
) -> CriterionResult {
    let first_rule = configuration
        .rejections
        .first()
        .map(|rejection| rejection.rule);
    let actual = first_rule.unwrap_or(configuration.status.name());
    let wanted = match expected {
        Expectation::Ok => "ok",
        Expectation::Failed => "failed",
        Expectation::Rejected(rule) => rule,
    };
    CriterionResult {
        goal: goal.to_owned(),
        label: Some(configuration.label.to_owned()),
        engine: None,
        criterion: EXPECTED.to_owned(),
        value: None,
        limit: None,
        unit: "1",
        // Before there was a word for what does not touch, `collision` was both.
        pass: actual == wanted || wanted == "collision" && actual == "too_close",
        detail: format!("expected {wanted}, got {actual}"),
        requirement: None,
    }
}
