//! Numbers of twice the precision of a double: an unevaluated sum of two doubles.
//!
//! Algorithms of Dekker (1971) and Knuth, with the fused multiply-add for exact products; see
//! Joldes, Muller and Popescu, *Tight and rigorous error bounds for basic building blocks of
//! double-word arithmetic*, ACM TOMS 44 (2017): relative errors of at most 10 x 2^-106.

use std::ops::{Add, Div, Mul, Neg, Sub};

/// `high + low`, with `|low|` at most half a unit in the last place of `high`.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Extended {
    high: f64,
    low: f64,
}

impl Extended {
    pub(super) const ZERO: Self = Self {
        high: 0.0,
        low: 0.0,
    };

    /// Nearest double.
    pub(super) fn rounded(self) -> f64 {
        self.high
    }

    pub(super) fn is_negative(self) -> bool {
        self.high < 0.0
    }

    /// Square root; zero for what is not positive.
    pub(super) fn sqrt(self) -> Self {
        if self.high <= 0.0 {
            return Self::ZERO;
        }
        let root = self.high.sqrt();
        let square = Self::product(root, root);
        quick_sum(root, (self - square).high / (2.0 * root))
    }

    pub(super) fn squared(self) -> Self {
        self * self
    }

    /// The exact product of two doubles.
    pub(super) fn product(a: f64, b: f64) -> Self {
        let high = a * b;
        Self {
            high,
            low: a.mul_add(b, -high),
        }
    }
}

/// The exact sum of two doubles.
fn sum(a: f64, b: f64) -> Extended {
    let high = a + b;
    let b_rounded = high - a;
    let low = (a - (high - b_rounded)) + (b - b_rounded);
    Extended { high, low }
}

/// The exact sum of two doubles of which the first is the greater.
fn quick_sum(a: f64, b: f64) -> Extended {
    let high = a + b;
    Extended {
        high,
        low: b - (high - a),
    }
}

impl From<f64> for Extended {
    fn from(value: f64) -> Self {
        Self {
            high: value,
            low: 0.0,
        }
    }
}

impl Add for Extended {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        let high = sum(self.high, other.high);
        let low = sum(self.low, other.low);
        let partial = quick_sum(high.high, high.low + low.high);
        quick_sum(partial.high, partial.low + low.low)
    }
}

impl Neg for Extended {
    type Output = Self;

    fn neg(self) -> Self {
        Self {
            high: -self.high,
            low: -self.low,
        }
    }
}

impl Sub for Extended {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl Mul for Extended {
    type Output = Self;

    fn mul(self, other: Self) -> Self {
        let product = Self::product(self.high, other.high);
        let cross = self.high.mul_add(other.low, self.low * other.high);
        quick_sum(product.high, product.low + cross)
    }
}

impl Mul<f64> for Extended {
    type Output = Self;

    fn mul(self, other: f64) -> Self {
        let product = Self::product(self.high, other);
        quick_sum(product.high, self.low.mul_add(other, product.low))
    }
}

impl Div for Extended {
    type Output = Self;

    fn div(self, other: Self) -> Self {
        let quotient = self.high / other.high;
        let remainder = self - other * quotient;
        let correction = remainder.high / other.high;
        let refined = quick_sum(quotient, correction);
        let remainder = self - other * refined;
        refined + Self::from(remainder.high / other.high)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use needlebench_numerics::random::SplitMix64;

    /// The bound of the cited paper's weakest operation.
    const RELATIVE: f64 = 1.3e-31;

    #[test]
    fn quotients_and_roots_are_undone_by_products() {
        let mut random = SplitMix64::new(5);
        for _ in 0..10_000 {
            let a = Extended::from(random.uniform(0.1, 2.0))
                + Extended::from(random.uniform(-1e-17, 1e-17));
            let b = Extended::from(random.uniform(-2.0, -0.1))
                + Extended::from(random.uniform(-1e-17, 1e-17));
            let error = |x: Extended, y: Extended| ((x - y).rounded() / y.rounded()).abs();
            assert!(error((a / b) * b, a) < 4.0 * RELATIVE);
            assert!(error(a.sqrt().squared(), a) < 4.0 * RELATIVE);
            assert!(error((a + b) - b, a) < 100.0 * RELATIVE);
        }
    }

    #[test]
    fn what_doubles_lose_is_kept() {
        let tiny = Extended::from(1.0) + Extended::from(1e-25) - Extended::from(1.0);
        assert_eq!(tiny.rounded(), 1e-25);
        // (1 + 2^-40)^2 - 1 - 2^-39 = 2^-80.
        let e = (2.0_f64).powi(-40);
        let square = (Extended::from(1.0) + Extended::from(e)).squared();
        let left = square - Extended::from(1.0) - Extended::from(2.0 * e);
        assert_eq!(left.rounded(), (2.0_f64).powi(-80));
    }
}
