//! A judged motion that leads to no goal: a case for each criterion.

use needlebench_bench::judge::free::FreeReport;
use needlebench_show::number::value_and_limit;
use quick_junit::{Report, SerializeError, TestCase, TestCaseStatus, TestSuite};

use super::failure::{failure, not_judged};

/// The motion as a JUnit document.
///
/// # Errors
/// The document cannot be written.
pub fn free_junit(report: &FreeReport) -> Result<String, SerializeError> {
    let mut document = Report::new("needlebench");
    let name = format!("{}.motion.{}", report.scenario, report.source.file);
    let mut suite = TestSuite::new(name.clone());
    let mut add = |title: &str, status: TestCaseStatus| {
        let mut case = TestCase::new(title, status);
        case.set_classname(name.clone());
        suite.add_test_case(case);
    };
    for result in &report.criteria {
        let number = |value: Option<f64>| value.unwrap_or(f64::NAN);
        let (value, limit) =
            value_and_limit(number(result.value), number(result.limit), result.unit);
        let text = format!("{value}, limit {limit}: {}", result.detail);
        let status = if result.pass {
            TestCaseStatus::success()
        } else {
            failure(&text)
        };
        add(&result.criterion, status);
    }
    for open in &report.not_judged {
        add(&open.criterion, not_judged(&open.reason));
    }
    document.add_test_suite(suite);
    document.to_string()
}
