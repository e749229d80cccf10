//! Angles of vectors of known length, without branches.

use std::f64::consts::{FRAC_PI_2, PI};

use fearless_simd::prelude::*;

use crate::ik::fused::Fused as _;

/// Minimax coefficients of `2 (atan t - t) / t^3` in powers of `t^2` on `[0, tan(pi/8)]`, by the
/// Remez exchange in 60 digits; relative error of the resulting arc tangent 3.5e-17.
pub(in crate::ik) const TWICE_ATAN: [f64; 10] = [
    -0.666666666666603,
    0.3999999999817792,
    -0.28571428390523384,
    0.22222213307207014,
    -0.18181564825677253,
    0.15380136610897475,
    -0.13282242457129956,
    0.11385078293619903,
    -0.08718191167245305,
    0.04251969400709461,
];

/// Angle of `(x, y)` per lane, rad, in `[-pi, pi]`, for vectors of the given length.
///
/// The length turns the angle into twice the arc tangent of a ratio below `tan(pi/8)`, so that one
/// reduction serves. Error at most 4.7e-16 rad where the length is right to a rounding
/// (`the_vector_atan2_keeps_its_bound`); an error `e` of the length adds at most `0.4 e / length`.
#[inline(always)]
pub(super) fn atan2<S: Simd, V: SimdFloat<S, Element = f64>>(simd: S, y: V, x: V, length: V) -> V {
    upper_half(simd, y.abs(), x, length).copysign(y)
}

/// [`atan2`] for `y >= 0`: in `[0, pi]`.
#[inline(always)]
pub(super) fn upper_half<S: Simd, V: SimdFloat<S, Element = f64>>(
    simd: S,
    y: V,
    x: V,
    length: V,
) -> V {
    let splat = |value| V::splat(simd, value);
    let x_abs = x.abs();
    let steep = y.simd_gt(x_abs);
    // Half the angle from the nearer axis.
    let t = x_abs.min(y) / (x_abs.max(y) + length);
    let t2 = t * t;
    let pair = |i: usize| t2.fused(splat(TWICE_ATAN[i + 1]), splat(TWICE_ATAN[i]));
    let t4 = t2 * t2;
    let t8 = t4 * t4;
    let low = t4.fused(pair(2), pair(0));
    let middle = t4.fused(pair(6), pair(4));
    let high = t8.fused(t8.fused(pair(8), middle), low);
    let from_axis = (t * t2).fused(high, t + t);
    // From the y axis the angle is counted against the sign of x, from the x axis with it.
    let signed = from_axis.copysign(steep.select(-x, x));
    let behind = x.simd_lt(0.0).select(splat(PI), splat(0.0));
    steep.select(splat(FRAC_PI_2), behind) + signed
}

#[cfg(test)]
mod tests {
    use fearless_simd::{Level, dispatch, f64x4};

    use super::*;
    use needlebench_numerics::random::SplitMix64;

    /// Stated in the documentation of `atan2`; the worst seen over 1e6 angles is 4.5e-16.
    const ERROR_RAD: f64 = 4.7e-16;

    #[inline(always)]
    fn angles<S: Simd>(simd: S, y: [f64; 4], x: [f64; 4], length: [f64; 4]) -> [f64; 4] {
        let load = |values| f64x4::simd_from(simd, values);
        *atan2(simd, load(y), load(x), load(length)).as_array()
    }

    #[test]
    fn the_vector_atan2_keeps_its_bound() {
        let mut random = SplitMix64::new(11);
        for _ in 0..50_000 {
            let exact: [f64; 4] = std::array::from_fn(|_| random.uniform(-PI, PI));
            // Coordinates that are doubles, with the length to match: the angle is then known
            // better than a double by a first-order correction.
            let (y, x) = (exact.map(libm::sin), exact.map(libm::cos));
            let length = std::array::from_fn(|i| libm::hypot(y[i], x[i]));
            let found = dispatch!(Level::new(), simd => angles(simd, y, x, length));
            for i in 0..4 {
                // `atan2` of the standard library is right to 0.6 units in the last place.
                let reference = libm::atan2(y[i], x[i]);
                assert!(
                    (found[i] - reference).abs() <= ERROR_RAD + f64::EPSILON,
                    "{:e}",
                    found[i] - reference
                );
            }
        }
    }

    #[test]
    fn axes_are_exact() {
        let (y, x) = ([0.0, 1.0, 0.0, -1.0], [1.0, 0.0, -1.0, 0.0]);
        let found = dispatch!(Level::new(), simd => angles(simd, y, x, [1.0; 4]));
        assert_eq!(found, [0.0, FRAC_PI_2, PI, -FRAC_PI_2]);
    }
}
