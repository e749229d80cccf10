//! A replay: a case for each criterion.

use std::time::Duration;

use needlebench_bench::replay::{ReplayReport, SUBJECT};
use needlebench_evaluation::report::{CriterionResult, NotJudged};
use needlebench_show::number::value_and_limit;
use quick_junit::{NonSuccessKind, SerializeError, TestCase, TestCaseStatus, TestSuite};

use super::failure::{failure, not_judged};
use super::run::REQUIREMENT;
use super::times::share_time;

/// A replay as a JUnit document. Of two replays its times alone differ: `elapsed`,
/// shared evenly among its cases.
pub(crate) fn replay_junit(
    report: &ReplayReport,
    elapsed: Duration,
) -> Result<String, SerializeError> {
    let mut document = quick_junit::Report::new("needlebench");
    let name = format!("{SUBJECT}.{}", report.log.source.file);
    let mut suite = TestSuite::new(name);
    add_criteria(&mut suite, &report.criteria, &report.not_judged);
    for broken in &report.engine_failures {
        let mut status = TestCaseStatus::non_success(NonSuccessKind::Error);
        status.set_message(broken.message.clone());
        suite.add_test_case(TestCase::new(broken.engine.clone(), status));
    }
    document.add_test_suite(suite);
    share_time(&mut document, elapsed);
    document.to_string()
}

/// A case for each criterion, with the name of the suite as its class.
pub(super) fn add_criteria(
    suite: &mut TestSuite,
    criteria: &[CriterionResult],
    open_ones: &[NotJudged],
) {
    let of = |engine: &Option<String>| {
        engine
            .as_ref()
            .map_or(String::new(), |engine| format!(" ({engine})"))
    };
    for result in criteria {
        let number = |value: Option<f64>| value.unwrap_or(f64::NAN);
        let (value, limit) =
            value_and_limit(number(result.value), number(result.limit), result.unit);
        let text = format!("{}: {value}, limit {limit}", result.detail);
        let status = if result.pass {
            TestCaseStatus::success()
        } else {
            failure(&text)
        };
        let mut case = TestCase::new(
            format!("{}{}", result.criterion, of(&result.engine)),
            status,
        );
        if let Some(requirement) = &result.requirement {
            case.add_property((REQUIREMENT, requirement.as_str()));
        }
        case.set_classname(suite.name.clone());
        case.set_system_out(text);
        suite.add_test_case(case);
    }
    for open in open_ones {
        let title = format!("{}{}", open.criterion, of(&open.engine));
        let mut case = TestCase::new(title, not_judged(&open.reason));
        if let Some(requirement) = &open.requirement {
            case.add_property((REQUIREMENT, requirement.as_str()));
        }
        case.set_classname(suite.name.clone());
        suite.add_test_case(case);
    }
}
