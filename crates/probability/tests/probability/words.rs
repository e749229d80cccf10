//! Counts of 1000 needles.

use needlebench_probability::{Estimate, Interval, Method, Told, bound_label, estimate_label};

fn found(told: Told, probability: Option<f64>, low: f64, high: f64) -> String {
    estimate_label(&Estimate {
        told,
        probability,
        interval: Interval { low, high },
        draws: 10_000,
        hits: 1,
        effective_size: 1.0,
        method: Method::Plain,
        influences: Vec::new(),
    })
}

#[test]
fn estimates_are_counts_with_their_interval() {
    let estimated = |probability, low, high| found(Told::Estimated, Some(probability), low, high);
    assert_eq!(estimated(0.9612, 0.9571, 0.9649), "961 (957 to 965)");
    assert_eq!(estimated(2.13e-3, 1.41e-3, 3.02e-3), "2.1 (1.4 to 3.0)");
    assert_eq!(estimated(6.96e-5, 4.9e-5, 9.2e-5), "0.070 (0.049 to 0.092)");
    assert_eq!(estimated(9.96e-3, 9.1e-3, 10.9e-3), "10 (9 to 11)");
    assert_eq!(
        estimated(1.2e-6, 0.8e-6, 1.7e-6),
        "0.0012 (less than 0.0010 to 0.0017)"
    );
    assert_eq!(estimated(1.0, 0.99, 1.0), "1000 (990 to 1000)");
    assert_eq!(
        estimated(0.9996, 0.9992, 0.9998),
        "999.60 (999.20 to 999.80)"
    );
}

#[test]
fn nothing_below_a_millionth_is_a_number() {
    assert_eq!(
        found(Told::Estimated, Some(4e-7), 3e-7, 5e-7),
        "less than 0.0010"
    );
    assert_eq!(found(Told::NoHits, None, 0.0, 3.7e-6), "less than 0.0037");
    assert_eq!(found(Told::NoHits, None, 0.0, 3.7e-4), "less than 0.37");
    assert_eq!(
        found(Told::BelowWhatCanBeTold, None, 1e-6, 3.7e-5),
        "less than 0.037"
    );
    assert_eq!(
        found(Told::AtPlan, None, 0.0, 1.0),
        "the planned path does already"
    );
}

#[test]
fn bounds_are_rounded_up() {
    let at_most = bound_label;
    assert_eq!(at_most(0.01301), "at most 14");
    assert_eq!(at_most(0.9e-3), "at most 0.90");
    assert_eq!(at_most(0.8812e-3), "at most 0.89");
    assert_eq!(at_most(1.0), "at most 1000");
    assert_eq!(at_most(1e-30), "at most 0.0010");
}
