//! Verdict.

use needlebench_cell::scenario::CriteriaSection;
use needlebench_cell::study::StudyMode;
use needlebench_cell::{Expectation, Goal};
use needlebench_kinematics::ik::Configuration;

use crate::check_configuration;
use crate::report::{
    ConfigurationReport, CriterionResult, GoalReport, RouteReport, Status, Verdict,
};

/// Criterion of the margins that the planned needle keeps, and the rule that rejects where it does not.
const NEEDLE_ROUTE: &str = "needle_route";

/// Judges all configurations of all goals: sets each status, and returns the verdict with every
/// criterion that was checked.
///
/// A configuration that works is `failed` if it misses a criterion. The verdict is `fail` if any
/// configuration is, unless that was expected; if a goal has fewer working configurations than
/// asked for; if the planned needle comes too near to what it has to keep away from; or if a
/// configuration's outcome is not the expected one.
pub fn judge(
    goals: &mut [GoalReport],
    planned: &[Goal],
    criteria: &CriteriaSection,
    both_engines_ran: bool,
) -> (Verdict, Vec<CriterionResult>) {
    let mut results = Vec::new();
    let mut failed = false;
    for (report, goal) in goals.iter_mut().zip(planned) {
        for configuration in &mut report.configurations {
            let expected = Configuration::from_label(configuration.label)
                .and_then(|each| goal.expected.get(&each));
            if configuration.rejections.is_empty() {
                let checked = check_configuration(
                    &goal.name,
                    configuration,
                    criteria,
                    StudyMode::Dynamic,
                    both_engines_ran,
                );
                let met = checked.iter().all(|result| result.pass);
                let measured = !configuration.engines.is_empty();
                configuration.status = if met && measured {
                    Status::Ok
                } else {
                    Status::Failed
                };
                if configuration.status == Status::Failed && expected != Some(&Expectation::Failed)
                {
                    failed = true;
                }
                results.extend(checked);
            } else {
                configuration.status = Status::Rejected;
            }
            if let Some(expected) = expected {
                let result = check_expectation(&goal.name, configuration, expected);
                failed |= !result.pass;
                results.push(result);
            }
        }
        if let Some(route) = &report.needle_route {
            let result = check_route(goal, route);
            failed |= !result.pass;
            results.push(result);
        }
        let working = report
            .configurations
            .iter()
            .filter(|each| each.status == Status::Ok)
            .count();
        let wanted = f64::from(criteria.min_working_configurations);
        let enough = working as f64 >= wanted;
        failed |= !enough;
        results.push(CriterionResult {
            goal: goal.name.clone(),
            label: None,
            engine: None,
            criterion: "min_working_configurations".to_owned(),
            value: Some(working as f64),
            limit: Some(wanted),
            unit: "1",
            pass: enough,
            detail: String::new(),
        });
    }
    (if failed { Verdict::Fail } else { Verdict::Pass }, results)
}

/// The margins of the needle's route. One that is missed is met all the same where it is what is expected
/// of every configuration.
fn check_route(goal: &Goal, route: &RouteReport) -> CriterionResult {
    let is_expected = Configuration::ALL.iter().all(|each| {
        let expected = goal.expected.get(each);
        matches!(expected, Some(Expectation::Rejected(rule)) if rule == NEEDLE_ROUTE)
    });
    let does = if route.kept {
        "keeps away from"
    } else {
        "does not keep away from"
    };
    CriterionResult {
        goal: goal.name.clone(),
        label: None,
        engine: None,
        criterion: NEEDLE_ROUTE.to_owned(),
        value: Some(route.distance_m),
        limit: Some(route.margin_m),
        unit: "m",
        pass: route.kept || is_expected,
        detail: format!(
            "the planned needle {does} {} ({})",
            route.part, route.tissue
        ),
    }
}

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
        criterion: "expected".to_owned(),
        value: None,
        limit: None,
        unit: "1",
        pass: actual == wanted,
        detail: format!("expected {wanted}, got {actual}"),
    }
}
