//! A case that failed, and one that could not be evaluated.

use quick_junit::{NonSuccessKind, TestCaseStatus};

/// Failed, and why.
pub(super) fn failure(reason: &str) -> TestCaseStatus {
    let mut status = TestCaseStatus::non_success(NonSuccessKind::Failure);
    status.set_message(reason);
    status
}

/// Not evaluated, and why: JUnit's `error`, which no reader counts as passed.
pub(super) fn not_judged(reason: &str) -> TestCaseStatus {
    let mut status = TestCaseStatus::non_success(NonSuccessKind::Error);
    status.set_message(format!("not evaluated: {reason}"));
    status
}
