//! A case that failed.

use quick_junit::{NonSuccessKind, TestCaseStatus};

/// Failed, and why.
pub(super) fn failure(reason: &str) -> TestCaseStatus {
    let mut status = TestCaseStatus::non_success(NonSuccessKind::Failure);
    status.set_message(reason);
    status
}
