//! Sobol's sequence with Owen's scrambling, any point by its number.
//!
//! Direction numbers: Joe and Kuo, SIAM Journal on Scientific Computing 30(5), 2008, table
//! `new-joe-kuo-6.21201`; the points without scrambling are those of SciPy's `qmc.Sobol`, in its order
//! (Gray code). Scrambling: Owen, "Randomly permuted (t,m,s)-nets and (t,s)-sequences", 1995: each bit is
//! flipped or not by a hash of the bits above it, so every prefix of 2^k points keeps its balance.

use crate::random::SplitMix64;

/// Number of dimensions that the table goes to.
pub const DIMENSIONS: usize = 40;

/// Primitive polynomials with their leading and trailing coefficient, and initial direction numbers,
/// from the second dimension on.
const TABLE: [(u32, &[u32]); DIMENSIONS - 1] = [
    (3, &[1]),
    (7, &[1, 3]),
    (11, &[1, 3, 1]),
    (13, &[1, 1, 1]),
    (19, &[1, 1, 3, 3]),
    (25, &[1, 3, 5, 13]),
    (37, &[1, 1, 5, 5, 17]),
    (41, &[1, 1, 5, 5, 5]),
    (47, &[1, 1, 7, 11, 19]),
    (55, &[1, 1, 5, 1, 1]),
    (59, &[1, 1, 1, 3, 11]),
    (61, &[1, 3, 5, 5, 31]),
    (67, &[1, 3, 3, 9, 7, 49]),
    (91, &[1, 1, 1, 15, 21, 21]),
    (97, &[1, 3, 1, 13, 27, 49]),
    (103, &[1, 1, 1, 15, 7, 5]),
    (109, &[1, 3, 1, 15, 13, 25]),
    (115, &[1, 1, 5, 5, 19, 61]),
    (131, &[1, 3, 7, 11, 23, 15, 103]),
    (137, &[1, 3, 7, 13, 13, 15, 69]),
    (143, &[1, 1, 3, 13, 7, 35, 63]),
    (145, &[1, 3, 5, 9, 1, 25, 53]),
    (157, &[1, 3, 1, 13, 9, 35, 107]),
    (167, &[1, 3, 1, 5, 27, 61, 31]),
    (171, &[1, 1, 5, 11, 19, 41, 61]),
    (185, &[1, 3, 5, 3, 3, 13, 69]),
    (191, &[1, 1, 7, 13, 1, 19, 1]),
    (193, &[1, 3, 7, 5, 13, 19, 59]),
    (203, &[1, 1, 3, 9, 25, 29, 41]),
    (211, &[1, 3, 5, 13, 23, 1, 55]),
    (213, &[1, 3, 7, 3, 13, 59, 17]),
    (229, &[1, 3, 1, 3, 5, 53, 69]),
    (239, &[1, 1, 5, 5, 23, 33, 13]),
    (241, &[1, 1, 7, 7, 1, 61, 123]),
    (247, &[1, 1, 7, 9, 13, 61, 49]),
    (253, &[1, 3, 3, 5, 3, 55, 33]),
    (285, &[1, 3, 1, 15, 31, 13, 49, 245]),
    (299, &[1, 3, 5, 15, 31, 59, 63, 97]),
    (301, &[1, 3, 1, 11, 11, 11, 77, 249]),
];

/// Bits of a coordinate.
const BITS: usize = 32;

/// One dimension of the sequence.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SobolDimension {
    directions: [u32; BITS],
    scramble_seed: u64,
}

impl SobolDimension {
    /// Dimension `dimension` below [`DIMENSIONS`], scrambled by a seed of its own.
    pub fn new(dimension: usize, scramble_seed: u64) -> Self {
        Self {
            directions: directions(dimension),
            scramble_seed,
        }
    }

    /// Coordinate of a point, strictly between 0 and 1.
    pub fn coordinate(&self, index: u32) -> f64 {
        let x = scrambled(self.bits(index), self.scramble_seed);
        (f64::from(x) + 0.5) / 2.0_f64.powi(32)
    }

    /// Binary digits of a coordinate before scrambling.
    fn bits(&self, index: u32) -> u32 {
        let gray = index ^ (index >> 1);
        self.directions
            .iter()
            .enumerate()
            .filter(|(bit, _)| gray >> bit & 1 == 1)
            .fold(0, |x, (_, direction)| x ^ direction)
    }
}

fn directions(dimension: usize) -> [u32; BITS] {
    let mut v = [0_u32; BITS];
    if dimension == 0 {
        for (k, direction) in v.iter_mut().enumerate() {
            *direction = 1 << (BITS - 1 - k);
        }
        return v;
    }
    let (polynomial, initial) = TABLE[dimension - 1];
    let degree = initial.len();
    for k in 0..BITS {
        v[k] = if k < degree {
            initial[k] << (BITS - 1 - k)
        } else {
            // Bratley and Fox, ACM TOMS 14(1), 1988, equation 2.
            let first = v[k - degree] ^ (v[k - degree] >> degree);
            (1..degree)
                .filter(|i| polynomial >> (degree - i) & 1 == 1)
                .fold(first, |x, i| x ^ v[k - i])
        };
    }
    v
}

/// Nested uniform scrambling: a random permutation of the halves at every node of the tree of bits.
fn scrambled(x: u32, seed: u64) -> u32 {
    (0..BITS).fold(0, |flips, bit| {
        // The bits above this one, behind a one that marks how many they are.
        let prefix = (1_u64 << bit) | (u64::from(x) >> (BITS - bit));
        let flip =
            SplitMix64::new(seed ^ prefix.wrapping_mul(0x9e37_79b9_7f4a_7c15)).next_u64() >> 63;
        flips | u32::from(flip == 1) << (BITS - 1 - bit)
    }) ^ x
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Point 1000 of SciPy 1.x `qmc.Sobol(40, scramble=False, bits=32)`, times 2^32.
    const POINT_1000: [u32; DIMENSIONS] = [
        0x38400000, 0x18c00000, 0x84c00000, 0xad400000, 0x47c00000, 0xe8400000, 0x0bc00000,
        0xe6400000, 0x80400000, 0x11c00000, 0x15c00000, 0x41400000, 0x29400000, 0x62400000,
        0x24c00000, 0x5ec00000, 0xb8400000, 0x58400000, 0xfdc00000, 0xb9c00000, 0x85c00000,
        0x8cc00000, 0xf3400000, 0x8a400000, 0x95400000, 0xe8400000, 0x0a400000, 0xfac00000,
        0x0f400000, 0x57400000, 0x25c00000, 0x25400000, 0x4bc00000, 0x97c00000, 0xcd400000,
        0xc5400000, 0xd9400000, 0xd4c00000, 0x4ec00000, 0x7ac00000,
    ];

    #[test]
    fn points_without_scrambling_are_those_of_scipy() {
        for (dimension, expected) in POINT_1000.into_iter().enumerate() {
            let bits = SobolDimension::new(dimension, 0).bits(1000);
            assert_eq!(bits, expected, "dimension {dimension}");
        }
    }

    #[test]
    fn every_power_of_two_of_scrambled_points_fills_all_strata() {
        for dimension in 0..DIMENSIONS {
            let sequence = SobolDimension::new(dimension, 7 + dimension as u64);
            for log in [0, 3, 8] {
                let points = 1_u32 << log;
                let mut hit = vec![0; points as usize];
                for index in 0..points {
                    #[expect(
                        clippy::cast_possible_truncation,
                        clippy::cast_sign_loss,
                        reason = "below 256"
                    )]
                    let stratum = (sequence.coordinate(index) * f64::from(points)) as usize;
                    hit[stratum] += 1;
                }
                assert!(
                    hit.iter().all(|&count| count == 1),
                    "dimension {dimension}, {points} points"
                );
            }
        }
    }

    /// The integral of a product of smooth functions converges much faster than the random 1/sqrt(n).
    #[test]
    fn integrals_converge_faster_than_by_chance() {
        const POINTS: u32 = 4096;
        /// By chance the error is `sqrt((4/3)^3 - 1) / sqrt(n)` = 0.018 (one standard deviation).
        const ERROR: f64 = 5e-4;
        let dimensions: Vec<_> = (0..3)
            .map(|k| SobolDimension::new(k, 99 + k as u64))
            .collect();
        let sum: f64 = (0..POINTS)
            .map(|index| {
                dimensions
                    .iter()
                    .map(|each| 2.0 * each.coordinate(index))
                    .product::<f64>()
            })
            .sum();
        assert!((sum / f64::from(POINTS) - 1.0).abs() < ERROR);
    }

    #[test]
    fn another_seed_gives_other_points() {
        let [a, b] = [1, 2].map(|seed| SobolDimension::new(3, seed).coordinate(5));
        assert_ne!(a, b);
    }
}
