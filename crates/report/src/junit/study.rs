//! The criteria of a study.

use std::time::Duration;

use needlebench_study::statistics::CriterionResult;
use quick_junit::{SerializeError, TestCase, TestCaseStatus, TestSuite};

use super::failure::{failure, not_judged};
use super::run::REQUIREMENT;
use super::times::share_time;

/// The criteria of a study as one JUnit document; `headline` says what the study is no answer to, and
/// `elapsed` is shared evenly among the cases.
pub(crate) fn study_junit(
    name: &str,
    headline: Option<&str>,
    criteria: &[CriterionResult],
    elapsed: Duration,
) -> Result<String, SerializeError> {
    let mut document = quick_junit::Report::new("needlebench study");
    let mut suite = TestSuite::new(name.to_owned());
    if let Some(headline) = headline {
        suite.add_property(("headline", headline));
    }
    if let Some(choice) = criteria.iter().find_map(|each| each.choice.as_deref()) {
        suite.add_property(("choice", choice));
    }
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
            failure(&format!(
                "{}: {}; cases {:?}",
                criterion.detail,
                value_and_limit(criterion),
                criterion.cases
            ))
        };
        let mut case = TestCase::new(format!("{}{of}", criterion.criterion), status);
        case.set_classname(name.to_owned());
        if let Some(requirement) = &criterion.requirement {
            case.add_property((REQUIREMENT, requirement.as_str()));
        }
        let text = format!("{}: {}", criterion.detail, value_and_limit(criterion));
        case.set_system_out(match headline {
            Some(headline) => format!("{text}\n{headline}"),
            None => text,
        });
        suite.add_test_case(case);
    }
    document.add_test_suite(suite);
    share_time(&mut document, elapsed);
    document.to_string()
}

fn value_and_limit(criterion: &CriterionResult) -> String {
    let value = criterion.value;
    let value = value.map_or_else(|| "no value".to_owned(), |value| format!("{value:.4}"));
    let text = format!("{value}, limit {} {}", criterion.limit, criterion.unit);
    text.trim_end().to_owned()
}
