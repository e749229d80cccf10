//! A run: a suite for each goal, a case for each configuration.

use std::collections::BTreeMap;
use std::time::Duration;

use needlebench_cell::rule_in_words;
use needlebench_evaluation::report::{CriterionResult, Report, Status, TraceOutcome};
use needlebench_evaluation::{excitation, iso9283};
use needlebench_show::number::value_and_limit;
use quick_junit::{NonSuccessKind, SerializeError, TestCase, TestCaseStatus, TestSuite};

use super::failure::{failure, not_judged};
use super::times::{seconds, share_time};
use crate::table::verdict::{missed_as_expected, qualifying};

/// Reports as one JUnit document. Of two runs of the same inputs its times alone differ: each report's time
/// of planning and simulation, shared evenly among its cases.
///
/// A rejected configuration counts as skipped unless that contradicts its expected outcome.
pub fn junit(reports: &[&Report]) -> Result<String, SerializeError> {
    let mut document = quick_junit::Report::new("needlebench");
    let mut total = Duration::ZERO;
    for report in reports {
        let mut of_report = quick_junit::Report::new("");
        for goal in &report.goals {
            let mut suite = TestSuite::new(format!("{}.{}", report.scenario.name, goal.name));
            for configuration in &goal.configurations {
                let failures: Vec<String> = report
                    .criteria
                    .iter()
                    .filter(|result| result.goal == goal.name && !result.pass)
                    .filter(|result| result.label.as_deref() == Some(configuration.label))
                    // As the verdict has it; the lines of its values say that it failed.
                    .filter(|result| !missed_as_expected(report, result))
                    .map(described)
                    .collect();
                let open = open(report, &goal.name, Some(configuration.label));
                let status = if !failures.is_empty() {
                    failure(&failures.join("; "))
                } else if !open.is_empty() {
                    not_judged(&open)
                } else if configuration.status == Status::Rejected {
                    let mut status = TestCaseStatus::skipped();
                    if let Some(rejection) = configuration.rejections.first() {
                        status.set_message(format!(
                            "{}: {}",
                            rule_in_words(rejection.rule),
                            rejection.detail
                        ));
                    }
                    status
                } else if configuration.engines.is_empty() {
                    failure("measured by no engine")
                } else {
                    TestCaseStatus::success()
                };
                let mut case = TestCase::new(configuration.label, status);
                add_requirements(&mut case, report, &goal.name, Some(configuration.label));
                add_values(&mut case, report, &goal.name, Some(configuration.label));
                case.set_classname(format!("{}.{}", report.scenario.name, goal.name));
                suite.add_test_case(case);
            }
            let failures: Vec<String> = report
                .criteria
                .iter()
                .filter(|result| result.goal == goal.name && result.label.is_none() && !result.pass)
                .map(described)
                .collect();
            let open = open(report, &goal.name, None);
            let status = if !failures.is_empty() {
                failure(&failures.join("; "))
            } else if !open.is_empty() {
                not_judged(&open)
            } else {
                TestCaseStatus::success()
            };
            let mut case = TestCase::new("goal", status);
            add_requirements(&mut case, report, &goal.name, None);
            add_values(&mut case, report, &goal.name, None);
            case.set_classname(format!("{}.{}", report.scenario.name, goal.name));
            suite.add_test_case(case);
            for note in qualifying(report) {
                suite.add_property(("note", note));
            }
            of_report.add_test_suite(suite);
        }
        for (subject, is_there) in [
            (iso9283::SUBJECT, report.iso9283.is_some()),
            (excitation::SUBJECT, report.excitation.is_some()),
        ] {
            if is_there || report.criteria.iter().any(|each| each.goal == subject) {
                of_report.add_test_suite(suite_of(report, subject));
            }
        }
        if !report.engine_failures.is_empty() {
            let mut suite = TestSuite::new(format!("{}.engines", report.scenario.name));
            for broken in &report.engine_failures {
                let mut status = TestCaseStatus::non_success(NonSuccessKind::Error);
                status.set_message(broken.message.clone());
                suite.add_test_case(TestCase::new(broken.engine.clone(), status));
            }
            of_report.add_test_suite(suite);
        }
        let took = ["planning_s", "simulation_s", "referee_s"].map(|key| report.timings.get(key));
        let took = seconds(took.into_iter().flatten().sum());
        share_time(&mut of_report, took);
        document.add_test_suites(of_report.test_suites);
        total += took;
    }
    document.set_time(total);
    document.to_string()
}

/// Name of the properties of requirements.
pub(super) const REQUIREMENT: &str = "requirement";

/// The requirements that criteria on a configuration stand for, or on a goal as a whole: each once, with the
/// criterion and what came of it.
fn add_requirements(case: &mut TestCase, report: &Report, goal: &str, label: Option<&str>) {
    let mut counts: BTreeMap<(&str, &str), [u64; 3]> = BTreeMap::new();
    for each in &report.criteria {
        if each.goal == goal
            && each.label.as_deref() == label
            && let Some(requirement) = &each.requirement
        {
            let count = counts.entry((requirement, &each.criterion)).or_default();
            count[usize::from(!each.pass)] += 1;
        }
    }
    for each in &report.not_judged {
        if each.goal == goal
            && each.label.as_deref() == label
            && let Some(requirement) = &each.requirement
        {
            counts.entry((requirement, &each.criterion)).or_default()[2] += 1;
        }
    }
    for ((requirement, criterion), [met, missed, open]) in counts {
        let outcome = TraceOutcome::of(met, missed, open).words();
        let text = format!("{requirement} ({criterion}: {outcome})");
        case.add_property((REQUIREMENT, text.as_str()));
    }
}

/// Evaluated criteria of a configuration, or of the goal as a whole: each value with its limit, a line each.
fn add_values(case: &mut TestCase, report: &Report, goal: &str, label: Option<&str>) {
    let all = report.criteria.iter();
    let of_it = all.filter(|each| each.goal == goal && each.label.as_deref() == label);
    let lines: Vec<String> = of_it.map(judged).collect();
    if !lines.is_empty() {
        case.set_system_out(lines.join("\n"));
    }
}

/// `met` or `failed`, and of what.
fn judged(result: &CriterionResult) -> String {
    let word = if result.pass { "met" } else { "failed" };
    format!("{word}: {}", described(result))
}

/// Criteria not evaluated of a configuration, or of the goal as a whole, and why.
fn open(report: &Report, goal: &str, label: Option<&str>) -> String {
    let all = report.not_judged.iter();
    let of_it = all.filter(|each| each.goal == goal && each.label.as_deref() == label);
    let texts: Vec<String> = of_it
        .map(|each| format!("{}: {}", each.criterion, each.reason))
        .collect();
    texts.join("; ")
}

/// An ISO 9283 test or an excitation run: a case for each criterion.
fn suite_of(report: &Report, subject: &str) -> TestSuite {
    let name = format!("{}.{subject}", report.scenario.name);
    let mut suite = TestSuite::new(name.clone());
    for note in qualifying(report) {
        suite.add_property(("note", note));
    }
    for result in report.criteria.iter().filter(|each| each.goal == subject) {
        let status = if result.pass {
            TestCaseStatus::success()
        } else {
            failure(&described(result))
        };
        let engine = result
            .engine
            .as_ref()
            .map_or(String::new(), |engine| format!(" ({engine})"));
        let what = case_of(subject, result.label.as_deref(), &result.criterion);
        let mut case = TestCase::new(format!("{what}{engine}"), status);
        if let Some(requirement) = &result.requirement {
            case.add_property((REQUIREMENT, requirement.as_str()));
        }
        case.set_classname(name.clone());
        case.set_system_out(judged(result));
        suite.add_test_case(case);
    }
    for each in report.not_judged.iter().filter(|each| each.goal == subject) {
        let engine = each.engine.as_ref();
        let engine = engine.map_or(String::new(), |engine| format!(" ({engine})"));
        let what = case_of(subject, each.label.as_deref(), &each.criterion);
        let mut case = TestCase::new(format!("{what}{engine}"), not_judged(&each.reason));
        if let Some(requirement) = &each.requirement {
            case.add_property((REQUIREMENT, requirement.as_str()));
        }
        case.set_classname(name.clone());
        suite.add_test_case(case);
    }
    suite
}

fn described(result: &CriterionResult) -> String {
    let engine = result
        .engine
        .as_ref()
        .map_or(String::new(), |engine| format!(" ({engine})"));
    match (result.value, result.limit) {
        (Some(value), Some(limit)) => {
            let (value, limit) = value_and_limit(value, limit, result.unit);
            let detail = match result.detail.as_str() {
                "" => String::new(),
                detail => format!(" ({detail})"),
            };
            format!(
                "{}{engine}: {value}, limit {limit}{detail}",
                result.criterion
            )
        }
        _ => format!("{}{engine}: {}", result.criterion, result.detail),
    }
}

/// Name of a criterion's case: with its payload, of which a run has several.
fn case_of(subject: &str, label: Option<&str>, criterion: &str) -> String {
    match label.filter(|_| subject == excitation::SUBJECT) {
        Some(label) => format!("{criterion}, {label}"),
        None => criterion.to_owned(),
    }
}
