//! Numbers in the tables of a study's statistics.

use needlebench_show::number::{in_percent, three_digits};
use needlebench_study::statistics::{Interval, Rate};

/// Reasons that are shown of each configuration.
pub(super) const MOST_REASONS: usize = 3;

pub(super) fn between(interval: Interval, text: impl Fn(f64) -> String) -> String {
    format!("{} .. {}", text(interval.low), text(interval.high))
}

/// `93.2 (92.1 .. 94.0)`.
pub(crate) fn rate_text(rate: &Rate) -> String {
    match (rate.rate, rate.interval) {
        (Some(share), Some(interval)) => {
            format!("{} ({})", in_percent(share), between(interval, in_percent))
        }
        _ => "-".to_owned(),
    }
}

pub(super) fn or_dash(value: Option<f64>) -> String {
    value.map_or("-".to_owned(), three_digits)
}

pub(super) fn case_list(cases: &[u64]) -> String {
    let cases: Vec<String> = cases.iter().map(ToString::to_string).collect();
    cases.join(", ")
}
