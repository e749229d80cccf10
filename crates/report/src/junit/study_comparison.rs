//! Two studies side by side.

use needlebench_study::compare::{StudyComparison, StudyFailure, what};
use quick_junit::{SerializeError, TestCase, TestCaseStatus, TestSuite};

use super::failure::failure as failed;
use crate::table::study_comparison::failure_text;

/// The comparison as JUnit XML: a case for each threshold, and for each rate without one.
pub fn study_comparison_junit(comparison: &StudyComparison) -> Result<String, SerializeError> {
    let mut document = quick_junit::Report::new("needlebench compare");
    let case = |suite: &str, name: String, failure: Option<String>| {
        let status = match failure {
            None => TestCaseStatus::success(),
            Some(message) => failed(&message),
        };
        let mut case = TestCase::new(name, status);
        case.set_classname(suite);
        case
    };
    let mut thresholds = TestSuite::new("compare.thresholds");
    for each in &comparison.thresholds {
        let of = each
            .of
            .as_ref()
            .map_or(String::new(), |of| format!(" {of}"));
        let name = format!("{} = {}{of}", each.threshold, each.limit);
        let failure = (!each.pass).then(|| each.detail.clone());
        thresholds.add_test_case(case("compare.thresholds", name, failure));
    }
    document.add_test_suite(thresholds);
    let mut rates = TestSuite::new("compare.rates");
    let unlimited = |failure: &&StudyFailure| failure.threshold.is_none();
    for change in comparison
        .changes
        .iter()
        .filter(|each| ["working_layouts", "success_rate"].contains(&each.metric.as_str()))
    {
        let mut failures = comparison.failures.iter().filter(unlimited);
        let failure = failures.find(|each| each.metric == change.metric && each.of == change.of);
        rates.add_test_case(case(
            "compare.rates",
            what(change),
            failure.map(failure_text),
        ));
    }
    document.add_test_suite(rates);
    document.to_string()
}
