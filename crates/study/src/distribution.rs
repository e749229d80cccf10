//! Distributions of continuous factors.

use needlebench_numerics::normal;
use needlebench_scenario::study::{Distribution, NormalSection};

/// Share of a distribution on either side that counts as beyond its ends.
const TAIL: f64 = 1e-3;

/// Value below which a share `p`, strictly between 0 and 1, of the distribution lies.
///
/// Of a truncated normal distribution to about 1e-9 of its width, far within the tails less.
pub(crate) fn quantile(distribution: &Distribution, p: f64) -> f64 {
    match *distribution {
        Distribution::Uniform { low, high } => low + (high - low) * p,
        Distribution::Normal(NormalSection {
            mean,
            sd,
            within: None,
        }) => mean + sd * normal::quantile(p),
        Distribution::Normal(NormalSection {
            mean,
            sd,
            within: Some([low, high]),
        }) => {
            let ends = [low, high].map(|end| (end - mean) / sd);
            // In the lower tail probabilities keep their digits: an upper range is mirrored.
            let mirrored = ends[0] + ends[1] > 0.0;
            let [from, to, p] = if mirrored {
                [-ends[1], -ends[0], 1.0 - p]
            } else {
                [ends[0], ends[1], p]
            };
            let [below_from, below_to] = [from, to].map(normal::probability_below);
            let z = normal::quantile(below_from + (below_to - below_from) * p);
            (mean + sd * if mirrored { -z } else { z }).clamp(low, high)
        }
    }
}

/// Ends of a distribution: of its range, or of its middle 99.8 %.
pub(crate) fn ends(distribution: &Distribution) -> [f64; 2] {
    match *distribution {
        Distribution::Uniform { low, high } => [low, high],
        Distribution::Normal(NormalSection {
            within: Some(ends), ..
        }) => {
            let [low, high] = [TAIL, 1.0 - TAIL].map(|p| quantile(distribution, p));
            // Ends that cut the middle are ends of the range.
            if ends[1] - ends[0] < 1.25 * (high - low) {
                ends
            } else {
                [low, high]
            }
        }
        Distribution::Normal(_) => [TAIL, 1.0 - TAIL].map(|p| quantile(distribution, p)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `scipy.stats.truncnorm((low - mean) / sd, (high - mean) / sd, mean, sd).ppf(p)`.
    #[test]
    fn quantiles_of_truncated_normal_distributions_are_those_of_scipy() {
        for (mean, sd, low, high, p, expected) in SCIPY {
            let normal = NormalSection {
                mean,
                sd,
                within: Some([low, high]),
            };
            let ours = quantile(&Distribution::Normal(normal), p);
            assert!(
                (ours - expected).abs() < 1e-9 * (high - low),
                "{ours} {expected}"
            );
        }
    }

    const SCIPY: [(f64, f64, f64, f64, f64, f64); 5] = [
        (0.0, 1.0, -1.0, 2.0, 0.3, -0.2424038178892269),
        (10.0, 5.0, 0.0, 12.0, 0.9, 11.165454386322653),
        (0.0, 1.0, 3.0, 5.0, 0.5, 3.2050938082099796),
        (0.0, 1.0, -5.0, -3.0, 0.1, -3.642030914652575),
        (100.0, 20.0, 150.0, 260.0, 0.99, 176.75395129949294),
    ];

    #[test]
    fn distributions_without_ends_keep_their_middle() {
        let normal = Distribution::Normal(NormalSection {
            mean: 1.0,
            sd: 2.0,
            within: None,
        });
        assert_eq!(quantile(&normal, 0.5), 1.0);
        let [low, high] = ends(&normal);
        // 99.9 % quantile of the normal distribution.
        assert!((high - (1.0 + 2.0 * 3.090_232_306_167_813)).abs() < 1e-9);
        assert!((low + high - 2.0).abs() < 1e-9);
        assert_eq!(
            ends(&Distribution::Uniform {
                low: -3.0,
                high: 4.0
            }),
            [-3.0, 4.0]
        );
    }
}
