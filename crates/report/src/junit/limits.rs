//! Limits that the command line gives, each a case.

use std::time::Duration;

use quick_junit::{SerializeError, TestCase, TestCaseStatus, TestSuite};

use super::failure::{failure, not_judged};
use super::times::share_time;

/// A limit and the value compared with it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct JudgedLimit {
    /// Its name.
    pub criterion: String,
    /// The value with its unit; none where it was not measured.
    pub value: Option<String>,
    /// The limit with its unit.
    pub limit: String,
    /// Whether it is satisfied.
    pub pass: bool,
}

/// Limits of a file that was measured, as JUnit XML.
pub fn limits_junit(
    file: &str,
    limits: &[JudgedLimit],
    elapsed: Duration,
) -> Result<String, SerializeError> {
    let mut document = quick_junit::Report::new("needlebench iso9283");
    let name = format!("iso9283.{file}");
    let mut suite = TestSuite::new(name.clone());
    for each in limits {
        let limit = &each.limit;
        let value = each.value.as_deref().unwrap_or("not measured");
        let status = match (each.pass, &each.value) {
            (true, _) => TestCaseStatus::success(),
            (false, Some(value)) => failure(&format!("{value}, limit {limit}")),
            (false, None) => not_judged("not measured"),
        };
        let mut case = TestCase::new(each.criterion.clone(), status);
        case.set_classname(name.clone());
        case.set_system_out(format!("{}: {value}, limit {limit}", each.criterion));
        suite.add_test_case(case);
    }
    document.add_test_suite(suite);
    share_time(&mut document, elapsed);
    document.to_string()
}
