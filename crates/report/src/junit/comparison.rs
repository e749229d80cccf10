//! Two results side by side.

use std::time::Duration;

use needlebench_evaluation::compare::{Change, Comparison};
use quick_junit::{SerializeError, TestCase, TestCaseStatus, TestSuite};

use super::failure::{failure, not_judged};
use super::times::share_time;
use crate::table::comparison::metric_texts;

/// The comparison as JUnit XML: a suite for each goal, a case for each configuration with both values of what
/// changed. `elapsed` is shared evenly among the cases.
pub fn comparison_junit(
    comparison: &Comparison,
    elapsed: Duration,
) -> Result<String, SerializeError> {
    let mut document = quick_junit::Report::new("needlebench compare");
    let case = |suite: &str, name: &str, goal: Option<&str>, label: Option<&str>| {
        let failures: Vec<&str> = comparison
            .failures
            .iter()
            .filter(|failure| failure.goal.as_deref() == goal && failure.label.as_deref() == label)
            .map(|failure| failure.detail.as_str())
            .collect();
        let status = if failures.is_empty() {
            TestCaseStatus::success()
        } else {
            failure(&failures.join("; "))
        };
        let mut case = TestCase::new(name, status);
        case.set_classname(suite);
        case
    };
    for goal in &comparison.goals {
        let name = format!("compare.{}", goal.name());
        let mut suite = TestSuite::new(name.clone());
        for each in &goal.configurations {
            let mut of_it = case(&name, &each.label, Some(goal.name()), Some(&each.label));
            let changed = each
                .telling_metrics()
                .filter(|found| found.outcome != Change::Same);
            let lines: Vec<String> = changed
                .map(|found| {
                    let [words, a, b, change, outcome] = metric_texts(found);
                    format!("{outcome}: {words}: {a} to {b}, change {change}")
                })
                .collect();
            of_it.set_system_out(if lines.is_empty() {
                "no changes".to_owned()
            } else {
                lines.join("\n")
            });
            suite.add_test_case(of_it);
        }
        suite.add_test_case(case(&name, "goal", Some(goal.name()), None));
        document.add_test_suite(suite);
    }
    let mut suite = TestSuite::new("compare");
    suite.add_test_case(case("compare", "thresholds", None, None));
    for reason in &comparison.incomplete {
        suite.add_test_case(TestCase::new("complete", not_judged(reason)));
    }
    document.add_test_suite(suite);
    share_time(&mut document, elapsed);
    document.to_string()
}
