//! Judged answers: a case for each solution that there is, and for each answer with a defect.

use needlebench_bench::judge::answers::{AnswersReport, QuestionReport};
use quick_junit::{Report, SerializeError, TestCase, TestCaseStatus, TestSuite};

use super::failure::failure;
use crate::table::answers::defect;

/// Answers as a JUnit document.
///
/// # Errors
/// The document cannot be written.
pub fn answers_junit(report: &AnswersReport) -> Result<String, SerializeError> {
    let mut document = Report::new("needlebench");
    for question in &report.questions {
        let name = format!("{}.answers.{}", report.scenario, question.name);
        let mut suite = TestSuite::new(name.clone());
        for (title, status) in cases(question, report.is_partial) {
            let mut case = TestCase::new(title, status);
            case.set_classname(name.clone());
            suite.add_test_case(case);
        }
        document.add_test_suite(suite);
    }
    document.to_string()
}

fn cases(question: &QuestionReport, is_partial: bool) -> Vec<(String, TestCaseStatus)> {
    let mut cases = Vec::new();
    let lacks = question.lacks(is_partial);
    let mut names: Vec<&str> = Vec::new();
    for solution in &question.solutions {
        let same = names.iter().filter(|name| **name == solution.label).count();
        names.push(solution.label);
        let title = match same {
            0 => solution.label.to_owned(),
            _ => format!("{} ({})", solution.label, same + 1),
        };
        let status = if !solution.answered_by.is_empty() {
            TestCaseStatus::success()
        } else if lacks {
            failure(&format!(
                "missing: {:?} rad is a solution",
                solution.joints_rad
            ))
        } else {
            let mut status = TestCaseStatus::skipped();
            status.set_message("missing, and one right answer is enough");
            status
        };
        cases.push((title, status));
    }
    for answer in &question.answers {
        if answer.defects.is_empty() {
            continue;
        }
        let defects: Vec<String> = answer.defects.iter().map(defect).collect();
        let text = format!(
            "{} ({} mm and {} deg off, joints {:?} rad)",
            defects.join("; "),
            answer.off_m * 1e3,
            answer.off_rad.to_degrees(),
            answer.joints_rad
        );
        let title = match answer.line {
            Some(line) => format!("answer {} (line {line})", answer.number),
            None => format!("answer {}", answer.number),
        };
        cases.push((title, failure(&text)));
    }
    cases
}
