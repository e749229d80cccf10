//! Probabilities in words: counts of needles.

use crate::estimate::{Estimate, Told};
use crate::interval::LEAST_PRINTED;

/// Needles that are counted.
const OF: f64 = 1000.0;

/// An estimate as a count of 1000 needles, with its interval: `2.1 (1.4 to 3.0)`.
pub fn estimate_label(estimate: &Estimate) -> String {
    let interval = estimate.interval;
    match (estimate.told, estimate.probability) {
        (Told::AtPlan, _) => "the planned path does already".to_owned(),
        (Told::Estimated, Some(probability)) if probability >= LEAST_PRINTED => {
            // 999.6 of 1000 is not all of them.
            let like = if probability < 0.5 {
                probability
            } else {
                1.0 - interval.low
            };
            let [value, low, high] =
                [probability, interval.low, interval.high].map(|each| count(each, like));
            format!("{value} ({low} to {high})")
        }
        (Told::Estimated, Some(_)) => format!("less than {}", least()),
        (Told::NoHits | Told::BelowWhatCanBeTold | Told::Estimated, _) => {
            format!("less than {}", count_above(interval.high))
        }
    }
}

/// An upper bound of a probability as a count of 1000 needles: `at most 14`.
pub fn bound_label(at_most: f64) -> String {
    format!("at most {}", count_above(at_most))
}

/// A count with two digits of `like`, at most whole needles: intervals have the digits of what they are of.
fn count(probability: f64, like: f64) -> String {
    if probability < LEAST_PRINTED {
        return format!("less than {}", least());
    }
    let decimals = decimals(like);
    format!("{:.decimals$}", OF * probability)
}

/// The same, rounded up, as one end of what is known.
fn count_above(probability: f64) -> String {
    if probability < LEAST_PRINTED {
        return least();
    }
    let decimals = decimals(probability);
    let scale = (0..decimals).fold(1.0, |scale, _| 10.0 * scale);
    // Rounding of the product is no reason for another digit.
    let rounded = (OF * probability * scale * (1.0 - 1e-12)).ceil() / scale;
    format!("{rounded:.decimals$}")
}

fn least() -> String {
    format!("{:.4}", OF * LEAST_PRINTED)
}

/// Decimals that two digits of a count take.
fn decimals(probability: f64) -> usize {
    let mut decimals = 0;
    let mut scaled = OF * probability;
    while scaled < 9.95 && decimals < 4 {
        scaled *= 10.0;
        decimals += 1;
    }
    decimals
}
