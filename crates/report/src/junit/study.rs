//! The criteria of a study.

use needlebench_study::statistics::CriterionResult;
use quick_junit::{SerializeError, TestCase, TestCaseStatus, TestSuite};

use super::failure::{failure, not_judged};

/// The criteria of a study as one JUnit document.
pub fn study_junit(name: &str, criteria: &[CriterionResult]) -> Result<String, SerializeError> {
    let mut document = quick_junit::Report::new("needlebench study");
    let mut suite = TestSuite::new(name.to_owned());
    for criterion in criteria {
        let of = criterion
            .of
            .as_ref()
            .map_or(String::new(), |of| format!(" {of}"));
        let status = if criterion.pass {
            TestCaseStatus::success()
        } else if !criterion.is_judged() {
            not_judged(&criterion.detail)
        } else {
            let value = criterion
                .value
                .map_or_else(|| "nothing".to_owned(), |value| format!("{value:.4}"));
            failure(&format!(
                "{}: {value}, limit {} {}; cases {:?}",
                criterion.detail, criterion.limit, criterion.unit, criterion.cases
            ))
        };
        let mut case = TestCase::new(format!("{}{of}", criterion.criterion), status);
        case.set_classname(name.to_owned());
        suite.add_test_case(case);
    }
    document.add_test_suite(suite);
    document.to_string()
}
