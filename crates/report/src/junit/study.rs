//! The criteria of a study.

use needlebench_study::statistics::CriterionResult;
use quick_junit::{SerializeError, TestCase, TestCaseStatus, TestSuite};

use super::failure::{failure, not_judged};
use super::run::REQUIREMENT;

/// The criteria of a study as one JUnit document; `headline` says what the study is no answer to.
pub fn study_junit(
    name: &str,
    headline: Option<&str>,
    criteria: &[CriterionResult],
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
        if let Some(requirement) = &criterion.requirement {
            case.add_property((REQUIREMENT, requirement.as_str()));
        }
        case.set_system_out(match headline {
            Some(headline) => format!("{}\n{headline}", criterion.detail),
            None => criterion.detail.clone(),
        });
        suite.add_test_case(case);
    }
    document.add_test_suite(suite);
    document.to_string()
}
