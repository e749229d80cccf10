//! Two studies side by side.

use std::time::Duration;

use needlebench_study::compare::{StudyComparison, StudyFailure, what};
use quick_junit::{SerializeError, TestCase, TestCaseStatus, TestSuite};

use super::failure::failure as failed;
use super::times::share_time;
use crate::table::study_comparison::{failure_text, row};

/// The comparison as JUnit XML: a case for each threshold, and for each rate without one, with both values.
/// `elapsed` is shared evenly among the cases.
pub fn study_comparison_junit(
    comparison: &StudyComparison,
    elapsed: Duration,
) -> Result<String, SerializeError> {
    let mut document = quick_junit::Report::new("needlebench compare");
    let case = |suite: &str, name: String, values: String, failure: Option<String>| {
        let status = match failure {
            None => TestCaseStatus::success(),
            Some(message) => failed(&message),
        };
        let mut case = TestCase::new(name, status);
        case.set_classname(suite);
        case.set_system_out(values);
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
        thresholds.add_test_case(case(
            "compare.thresholds",
            name,
            each.detail.clone(),
            failure,
        ));
    }
    document.add_test_suite(thresholds);
    let mut rates = TestSuite::new("compare.rates");
    let unlimited = |failure: &&StudyFailure| failure.threshold.is_none();
    for change in comparison
        .changes
        .iter()
        .filter(|each| ["working_layouts", "success_rate"].contains(&each.metric.as_str()))
    {
        let [_, a, b, by, _] = row(change);
        let mut failures = comparison.failures.iter().filter(unlimited);
        let failure = failures.find(|each| each.metric == change.metric && each.of == change.of);
        rates.add_test_case(case(
            "compare.rates",
            what(change),
            format!("{a} to {b}, change {by}"),
            failure.map(failure_text),
        ));
    }
    document.add_test_suite(rates);
    share_time(&mut document, elapsed);
    document.to_string()
}
