//! A case that failed, and one that could not be judged.

use quick_junit::{NonSuccessKind, TestCaseStatus};

/// Failed, and why.
pub(super) fn failure(reason: &str) -> TestCaseStatus {
    let mut status = TestCaseStatus::non_success(NonSuccessKind::Failure);
    status.set_message(reason);
    status
}

/// Not judged, and why: JUnit's `error`, which no reader takes for passed.
pub(super) fn not_judged(reason: &str) -> TestCaseStatus {
    let mut status = TestCaseStatus::non_success(NonSuccessKind::Error);
    status.set_message(format!("not judged: {reason}"));
    status
}
