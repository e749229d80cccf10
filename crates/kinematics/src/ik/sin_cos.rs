//! Sines and cosines of eight angles at once, in safe code that compilers turn into vectors.

use std::f64::consts::FRAC_2_PI;

/// Eight lanes: one per joint, and two that stay zero, so that vectors of two, four and eight fit.
pub(super) type Lanes = [f64; 8];

/// Beyond this the standard library takes over, rad. The reduction is exact far beyond it.
const LARGEST_RAD: f64 = 100.0;

/// `1.5 * 2^52`: adding it rounds to an integer and leaves that integer in the low bits.
const ROUND: f64 = 6_755_399_441_055_744.0;

/// `pi / 2` in three parts of 33, 33 and 53 bits (fdlibm, `e_rem_pio2.c`), so that a multiple of the
/// first two by less than 2^20 is exact.
const HALF_PI: [f64; 3] = [
    1.570_796_326_734_125_6,
    6.077_100_506_303_966e-11,
    2.022_266_248_795_950_6e-21,
];

/// `(sin x - x) / x^3` in powers of `x^2` up to `pi / 4` (fdlibm, `k_sin.c`).
const SIN: [f64; 6] = [
    -1.666_666_666_666_663_2e-1,
    8.333_333_333_322_49e-3,
    -1.984_126_982_985_795e-4,
    2.755_731_370_707_006_8e-6,
    -2.505_076_025_340_686_3e-8,
    1.589_690_995_211_55e-10,
];

/// `(cos x - 1 + x^2 / 2) / x^4` in powers of `x^2` up to `pi / 4` (fdlibm, `k_cos.c`).
const COS: [f64; 6] = [
    4.166_666_666_666_66e-2,
    -1.388_888_888_887_411e-3,
    2.480_158_728_947_673e-5,
    -2.755_731_435_139_066_3e-7,
    2.087_572_321_298_175e-9,
    -1.135_964_755_778_819_5e-11,
];

/// Sine and cosine of every lane, rad.
///
/// At most one unit in the last place from the nearest double up to 100 rad
/// (`sines_and_cosines_are_within_one_ulp`); farther off, or for numbers that are not finite, as
/// [`f64::sin_cos`]. No fused products: the same bits on every machine.
#[inline(always)]
pub(super) fn sin_cos(angles_rad: &Lanes) -> (Lanes, Lanes) {
    // Written so that NaN goes the slow way too.
    let near = angles_rad
        .iter()
        .fold(true, |near, angle| near & (angle.abs() <= LARGEST_RAD));
    if !near {
        return far(angles_rad);
    }
    let (mut sines, mut cosines) = ([0.0; 8], [0.0; 8]);
    for lane in 0..8 {
        let angle = angles_rad[lane];
        let shifted = angle * FRAC_2_PI + ROUND;
        let quadrant = shifted.to_bits();
        let turns = shifted - ROUND;
        // The rest of the angle as a sum of two doubles.
        let first = angle - turns * HALF_PI[0];
        let second = turns * HALF_PI[1];
        let high = first - second;
        let low = ((first - high) - second) - turns * HALF_PI[2];
        let x = high + low;
        let x_low = (high - x) + low;

        let z = x * x;
        let zz = z * z;
        let sin_tail =
            (SIN[1] + z * SIN[2]) + zz * ((SIN[3] + z * SIN[4]) + zz * SIN[5]);
        let cos_tail = (COS[0] + z * COS[1])
            + zz * ((COS[2] + z * COS[3]) + zz * (COS[4] + z * COS[5]));
        let cube = z * x;
        let sin = x - ((z * (0.5 * x_low - cube * sin_tail) - x_low) - cube * SIN[0]);
        let half = 0.5 * z;
        let one_less = 1.0 - half;
        let cos = one_less + (((1.0 - one_less) - half) + (z * (z * cos_tail) - x * x_low));

        // Odd quadrants swap the two; the second bit of the quadrant, and of the next one, negate.
        let swap = 0_u64.wrapping_sub(quadrant & 1);
        let (s, c) = (sin.to_bits(), cos.to_bits());
        let sin_bits = (s & !swap) | (c & swap);
        let cos_bits = (c & !swap) | (s & swap);
        sines[lane] = f64::from_bits(sin_bits ^ ((quadrant & 2) << 62));
        cosines[lane] = f64::from_bits(cos_bits ^ ((quadrant.wrapping_add(1) & 2) << 62));
    }
    (sines, cosines)
}

#[cold]
#[inline(never)]
fn far(angles_rad: &Lanes) -> (Lanes, Lanes) {
    (angles_rad.map(f64::sin), angles_rad.map(f64::cos))
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_2;

    use super::*;
    use crate::pose_sets::SplitMix64;

    /// Steps between neighbouring doubles from one to the other.
    fn ulps(a: f64, b: f64) -> u64 {
        if a == b {
            return 0;
        }
        assert_eq!(a.is_sign_negative(), b.is_sign_negative(), "{a:e} {b:e}");
        a.to_bits().abs_diff(b.to_bits())
    }

    fn worst(angles: &[f64]) -> u64 {
        let mut worst = 0;
        for chunk in angles.chunks_exact(8) {
            let lanes: Lanes = chunk.try_into().unwrap();
            let (sines, cosines) = sin_cos(&lanes);
            for i in 0..8 {
                worst = worst
                    .max(ulps(sines[i], lanes[i].sin()))
                    .max(ulps(cosines[i], lanes[i].cos()));
            }
        }
        worst
    }

    #[test]
    fn sines_and_cosines_are_within_one_ulp() {
        let mut random = SplitMix64::new(1);
        let anywhere: Vec<f64> = (0..400_000)
            .map(|_| random.uniform(-LARGEST_RAD, LARGEST_RAD))
            .collect();
        assert!(worst(&anywhere) <= 1);
        // Where the reduction cancels: multiples of a quarter turn, exact and a little off.
        let quarters: Vec<f64> = (-63_i32..=63)
            .flat_map(|k| (0..64).map(move |i| (k, i)))
            .map(|(k, i)| {
                let away = if i == 0 { 0.0 } else { (-f64::from(i)).exp2() };
                f64::from(k) * FRAC_PI_2 + away
            })
            .collect();
        assert!(worst(&quarters) <= 1);
    }

    #[test]
    fn far_angles_are_those_of_the_standard_library() {
        let lanes = [1e3, -1e6, 0.1, 2e9, 100.1, -7.0, 0.0, 1e300];
        let (sines, cosines) = sin_cos(&lanes);
        assert_eq!(sines, lanes.map(f64::sin));
        assert_eq!(cosines, lanes.map(f64::cos));
        let (sines, cosines) = sin_cos(&[f64::NAN; 8]);
        assert!(sines.iter().chain(&cosines).all(|value| value.is_nan()));
    }
}
