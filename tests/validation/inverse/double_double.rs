//! Numbers of 106 bits, each the unevaluated sum of two doubles, real and complex.
//!
//! Dekker, *A floating-point technique for extending the available precision*, 1971; Knuth's exact
//! sum. Relative error of an operation: below 2^-100.

use std::f64::consts::{FRAC_PI_2, PI};
use std::ops::{Add, Div, Mul, Neg, Sub};

/// A real number, `high + low`, the second below half a last place of the first.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Real {
    high: f64,
    low: f64,
}

impl Real {
    pub const ZERO: Self = Self::of(0.0);
    pub const ONE: Self = Self::of(1.0);

    /// A double, exactly.
    pub const fn of(value: f64) -> Self {
        Self {
            high: value,
            low: 0.0,
        }
    }

    /// Rounded to a double.
    pub fn value(self) -> f64 {
        self.high
    }

    /// Sum of two doubles of which the first is the larger.
    fn normalised(high: f64, low: f64) -> Self {
        let sum = high + low;
        Self {
            high: sum,
            low: low - (sum - high),
        }
    }

    pub fn sqrt(self) -> Self {
        if self.high <= 0.0 {
            return Self::ZERO;
        }
        // One step of Newton's method doubles the digits.
        let root = Self::of(self.high.sqrt());
        root + (self - root * root) / (root + root)
    }

    /// Sine and cosine of an angle in `[-2 pi, 2 pi]`.
    pub fn sin_cos(angle: f64) -> (Self, Self) {
        /// pi / 2 minus its double.
        const FRAC_PI_2_LOW: f64 = 6.123233995736766e-17;
        let quarters = (angle / FRAC_PI_2).round();
        let quarter = Self {
            high: FRAC_PI_2,
            low: FRAC_PI_2_LOW,
        };
        let rest = Self::of(angle) - quarter * Self::of(quarters);
        let square = rest * rest;
        let (mut sin, mut cos) = (Self::ZERO, Self::ZERO);
        // Horner, from x^29 / 29! on, below 1e-33 for an eighth of a turn.
        for k in (1..=14).rev() {
            let k = 2.0 * f64::from(k);
            sin = square * (Self::ONE - sin) / Self::of(k * (k + 1.0));
            cos = square * (Self::ONE - cos) / Self::of(k * (k - 1.0));
        }
        let (sin, cos) = (rest * (Self::ONE - sin), Self::ONE - cos);
        match quarters.rem_euclid(4.0) {
            0.0 => (sin, cos),
            1.0 => (cos, -sin),
            2.0 => (-sin, -cos),
            _ => (-cos, sin),
        }
    }
}

/// Sum of two doubles and its rounding error.
fn two_sum(a: f64, b: f64) -> (f64, f64) {
    let sum = a + b;
    let part = sum - a;
    (sum, (a - (sum - part)) + (b - part))
}

/// Product of two doubles and its rounding error, by halves of 26 bits.
fn two_product(a: f64, b: f64) -> (f64, f64) {
    let split = |x: f64| {
        let scaled = 134_217_729.0 * x;
        let high = scaled - (scaled - x);
        (high, x - high)
    };
    let product = a * b;
    let ((ah, al), (bh, bl)) = (split(a), split(b));
    (product, ((ah * bh - product) + ah * bl + al * bh) + al * bl)
}

impl Add for Real {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        let (high, error) = two_sum(self.high, other.high);
        let (low, low_error) = two_sum(self.low, other.low);
        let sum = Self::normalised(high, error + low);
        Self::normalised(sum.high, sum.low + low_error)
    }
}

impl Neg for Real {
    type Output = Self;
    fn neg(self) -> Self {
        Self {
            high: -self.high,
            low: -self.low,
        }
    }
}

impl Sub for Real {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl Mul for Real {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        let (high, error) = two_product(self.high, other.high);
        Self::normalised(
            high,
            error + (self.high * other.low + self.low * other.high),
        )
    }
}

impl Div for Real {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        let first = self.high / other.high;
        let rest = self - other * Self::of(first);
        let second = rest.high / other.high;
        let rest = rest - other * Self::of(second);
        Self::normalised(first, second) + Self::of(rest.high / other.high)
    }
}

/// A complex number.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Complex {
    pub re: Real,
    pub im: Real,
}

impl Complex {
    pub const ZERO: Self = Self::real(Real::ZERO);
    pub const ONE: Self = Self::real(Real::ONE);

    pub const fn real(re: Real) -> Self {
        Self { re, im: Real::ZERO }
    }

    /// From doubles.
    pub const fn of(re: f64, im: f64) -> Self {
        Self {
            re: Real::of(re),
            im: Real::of(im),
        }
    }

    /// The larger of its parts: the magnitude, roughly.
    pub fn size(self) -> f64 {
        self.re.high.abs().max(self.im.high.abs())
    }

    pub fn scaled(self, factor: Real) -> Self {
        Self {
            re: self.re * factor,
            im: self.im * factor,
        }
    }

    /// Rounded to doubles.
    pub fn rounded(self) -> nalgebra::Complex<f64> {
        nalgebra::Complex::new(self.re.high, self.im.high)
    }

    /// `1 / self`.
    pub fn inverse(self) -> Self {
        let square = self.re * self.re + self.im * self.im;
        Self {
            re: self.re / square,
            im: -self.im / square,
        }
    }

    /// Angle whose cosine and sine these are: its real part in `(-pi, pi]`, and its imaginary part.
    pub fn angle(cosine: Self, sine: Self) -> (f64, f64) {
        // exp(i q) = cos + i sin, whose magnitude is exp(-Im q).
        let i_sine = Self {
            re: -sine.im,
            im: sine.re,
        };
        let (ahead, behind) = (cosine + i_sine, cosine - i_sine);
        let magnitude = |z: Self| libm::hypot(z.re.high, z.im.high);
        let (a, b) = (magnitude(ahead), magnitude(behind));
        let real = if a >= b {
            libm::atan2(ahead.im.high, ahead.re.high)
        } else {
            -libm::atan2(behind.im.high, behind.re.high)
        };
        // b^2 - a^2 = 4 (Im sin Re cos - Re sin Im cos), and ab = 1.
        let product = sine.im * cosine.re - sine.re * cosine.im;
        let imaginary = 0.5 * libm::asinh(2.0 * product.high);
        (if real <= -PI { PI } else { real }, imaginary)
    }
}

impl Add for Complex {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self {
            re: self.re + other.re,
            im: self.im + other.im,
        }
    }
}

impl Neg for Complex {
    type Output = Self;
    fn neg(self) -> Self {
        Self {
            re: -self.re,
            im: -self.im,
        }
    }
}

impl Sub for Complex {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl Mul for Complex {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        Self {
            re: self.re * other.re - self.im * other.im,
            im: self.re * other.im + self.im * other.re,
        }
    }
}
