//! How long it took.

use std::time::Duration;

use quick_junit::{Report, TestCase, TestCaseStatus};

/// Shares a time out evenly among all cases of a document that were not skipped, and says so: what a case took by
/// itself is not known, as many are computed at once.
pub(super) fn share_time(document: &mut Report, total: Duration) {
    let has_run = |case: &&mut TestCase| !matches!(case.status, TestCaseStatus::Skipped { .. });
    let cases = document
        .test_suites
        .iter_mut()
        .flat_map(|suite| &mut suite.test_cases);
    let count = cases.filter(has_run).count();
    let each = total / u32::try_from(count.max(1)).unwrap_or(u32::MAX);
    for suite in &mut document.test_suites {
        let mut of_suite = Duration::ZERO;
        for case in suite.test_cases.iter_mut().filter(has_run) {
            case.set_time(each);
            of_suite += each;
        }
        suite.set_time(of_suite);
        suite.add_property(("time", "of all cases together, shared evenly"));
    }
    document.set_time(total);
}

/// A time of a report's timings.
pub(super) fn seconds(seconds: f64) -> Duration {
    Duration::try_from_secs_f64(seconds).unwrap_or_default()
}
