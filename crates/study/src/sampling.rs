//! Points of the unit cube for the factors that are sampled.

use needlebench_numerics::random::SplitMix64;
use needlebench_scenario::study::SamplingMethod;

use needlebench_numerics::sobol::{DIMENSIONS, SobolDimension};

/// Most dimensions of the methods: those of Sobol's table.
pub(crate) fn most_dimensions(method: SamplingMethod) -> usize {
    match method {
        SamplingMethod::Sobol => DIMENSIONS,
        SamplingMethod::LatinHypercube | SamplingMethod::Random => usize::MAX,
    }
}

/// One dimension of a set of points; a coordinate depends on seed, dimension and number alone.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Dimension {
    seed: u64,
    points: u64,
    method: Method,
}

#[derive(Debug, Clone, PartialEq, Eq)]
enum Method {
    Sobol(Box<SobolDimension>),
    LatinHypercube,
    Random,
}

impl Dimension {
    pub fn new(method: SamplingMethod, dimension: usize, points: u64, seed: u64) -> Self {
        let seed =
            SplitMix64::new(seed ^ (dimension as u64 + 1).wrapping_mul(0xd134_2543_de82_ef95))
                .next_u64();
        let method = match method {
            SamplingMethod::Sobol => Method::Sobol(Box::new(SobolDimension::new(dimension, seed))),
            SamplingMethod::LatinHypercube => Method::LatinHypercube,
            SamplingMethod::Random => Method::Random,
        };
        Self {
            seed,
            points,
            method,
        }
    }

    /// Coordinate of a point, strictly between 0 and 1.
    pub fn coordinate(&self, index: u64) -> f64 {
        match &self.method {
            Method::Sobol(sequence) => sequence
                .coordinate(u32::try_from(index).expect("studies have at most 2^32 samples")),
            Method::LatinHypercube => {
                // Each point has a stratum of its own, and a random place in it.
                let stratum = permuted(index, self.points, self.seed);
                ((stratum as f64 + unit(self.seed, index)) / self.points as f64).min(LARGEST)
            }
            Method::Random => unit(self.seed, index),
        }
    }
}

/// Largest number below 1.
const LARGEST: f64 = 1.0 - f64::EPSILON / 2.0;

/// A number strictly between 0 and 1 from a seed and an index.
fn unit(seed: u64, index: u64) -> f64 {
    let bits = hash(seed, index) >> 12;
    (bits as f64 + 0.5) / 2.0_f64.powi(52)
}

fn hash(seed: u64, value: u64) -> u64 {
    SplitMix64::new(seed ^ value.wrapping_mul(0x9e37_79b9_7f4a_7c15)).next_u64()
}

/// Image of `index` under a random permutation of `0..count`, without a table: a Feistel network over
/// the least square of a power of two that holds `count`, walked until it comes out below it (Black
/// and Rogaway, "Ciphers with arbitrary finite domains", 2002).
fn permuted(index: u64, count: u64, seed: u64) -> u64 {
    const ROUNDS: u64 = 6;
    let half_bits = (64 - (count - 1).leading_zeros()).div_ceil(2).max(1);
    let mask = (1_u64 << half_bits) - 1;
    let mut at = index;
    loop {
        let (mut left, mut right) = (at >> half_bits, at & mask);
        for round in 0..ROUNDS {
            let mixed = hash(seed.wrapping_add(round), right) & mask;
            (left, right) = (right, left ^ mixed);
        }
        at = left << half_bits | right;
        if at < count {
            return at;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn permutations_are_permutations() {
        for count in [1, 2, 3, 7, 16, 100, 1000] {
            let mut images: Vec<u64> = (0..count).map(|index| permuted(index, count, 5)).collect();
            images.sort_unstable();
            assert_eq!(images, (0..count).collect::<Vec<_>>());
        }
    }

    #[test]
    fn a_latin_hypercube_has_one_point_in_every_stratum_of_every_dimension() {
        const POINTS: u64 = 37;
        for dimension in 0..5 {
            let axis = Dimension::new(SamplingMethod::LatinHypercube, dimension, POINTS, 1);
            let mut strata: Vec<u64> = (0..POINTS)
                .map(|index| {
                    #[expect(
                        clippy::cast_possible_truncation,
                        clippy::cast_sign_loss,
                        reason = "below 37"
                    )]
                    let stratum = (axis.coordinate(index) * POINTS as f64) as u64;
                    stratum
                })
                .collect();
            strata.sort_unstable();
            assert_eq!(strata, (0..POINTS).collect::<Vec<_>>());
        }
    }

    /// Means and correlations of the coordinates within five standard deviations of chance.
    #[test]
    fn dimensions_are_uniform_and_independent() {
        const POINTS: u64 = 4096;
        for method in [
            SamplingMethod::Sobol,
            SamplingMethod::LatinHypercube,
            SamplingMethod::Random,
        ] {
            let axes: Vec<_> = (0..6)
                .map(|k| Dimension::new(method, k, POINTS, 3))
                .collect();
            for (k, a) in axes.iter().enumerate() {
                for b in &axes[..k] {
                    let covariance: f64 = (0..POINTS)
                        .map(|i| (a.coordinate(i) - 0.5) * (b.coordinate(i) - 0.5))
                        .sum::<f64>()
                        / POINTS as f64;
                    // Variance of the product of two uniform variables: 1/144.
                    assert!(
                        covariance.abs() < 5.0 / 12.0 / (POINTS as f64).sqrt(),
                        "{method:?}"
                    );
                }
                let mean = (0..POINTS).map(|i| a.coordinate(i)).sum::<f64>() / POINTS as f64;
                assert!(
                    (mean - 0.5).abs() < 5.0 * (1.0 / 12.0_f64).sqrt() / (POINTS as f64).sqrt()
                );
            }
        }
    }
}
