//! How long it took.

use std::time::Duration;

use quick_junit::Report;

/// Shares a time out evenly among all cases of a document: what a case took by itself is not known, as many are
/// computed at once.
pub(super) fn share_time(document: &mut Report, total: Duration) {
    let count: usize = document
        .test_suites
        .iter()
        .map(|suite| suite.test_cases.len())
        .sum();
    let each = total / u32::try_from(count.max(1)).unwrap_or(u32::MAX);
    for suite in &mut document.test_suites {
        let cases = u32::try_from(suite.test_cases.len()).unwrap_or(u32::MAX);
        for case in &mut suite.test_cases {
            case.set_time(each);
        }
        suite.set_time(each * cases);
    }
    document.set_time(total);
}

/// A time of a report's timings.
pub(super) fn seconds(seconds: f64) -> Duration {
    Duration::try_from_secs_f64(seconds).unwrap_or_default()
}
