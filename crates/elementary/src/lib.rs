//! Elementary functions under the names that the C library has for them, computed by the crate `libm`.
//!
//! The C library has several variants of most of them and picks one by the processor; their last bits differ. Our own
//! crates call `libm` by name. Of other people's crates not all do: rapier's constraints, eigenvalues in glamx and
//! whatever a later version brings take `sin` or `acos` from the C library. A program that has functions of these names
//! itself calls them instead, so that nothing in it computes otherwise on another machine. There is nothing to call
//! here: to depend on this crate is enough.
//!
//! `tests/validation/arithmetic/check.py` looks whether the program takes any of them from elsewhere.
#![cfg_attr(any(doc, doctest), doc = include_str!("../README.md"))]
#![expect(
    unsafe_code,
    reason = "functions are exported by name: one attribute, which counts as unsafe"
)]

macro_rules! functions {
    ($($name:ident($($argument:ident),+) -> $number:ty;)+) => {
        $(
            #[doc = concat!("`libm::", stringify!($name), "` for all code in the program.")]
            #[unsafe(no_mangle)]
            pub extern "C" fn $name($($argument: $number),+) -> $number {
                libm::$name($($argument),+)
            }
        )+
    };
}

functions! {
    acos(x) -> f64;
    acosh(x) -> f64;
    asin(x) -> f64;
    asinh(x) -> f64;
    atan(x) -> f64;
    atan2(y, x) -> f64;
    atanh(x) -> f64;
    cbrt(x) -> f64;
    cos(x) -> f64;
    cosh(x) -> f64;
    erf(x) -> f64;
    erfc(x) -> f64;
    exp(x) -> f64;
    exp10(x) -> f64;
    exp2(x) -> f64;
    expm1(x) -> f64;
    hypot(x, y) -> f64;
    lgamma(x) -> f64;
    log(x) -> f64;
    log10(x) -> f64;
    log1p(x) -> f64;
    log2(x) -> f64;
    pow(x, y) -> f64;
    sin(x) -> f64;
    sinh(x) -> f64;
    tan(x) -> f64;
    tanh(x) -> f64;
    tgamma(x) -> f64;
    acosf(x) -> f32;
    acoshf(x) -> f32;
    asinf(x) -> f32;
    asinhf(x) -> f32;
    atan2f(y, x) -> f32;
    atanf(x) -> f32;
    atanhf(x) -> f32;
    cbrtf(x) -> f32;
    cosf(x) -> f32;
    coshf(x) -> f32;
    erfcf(x) -> f32;
    erff(x) -> f32;
    exp10f(x) -> f32;
    exp2f(x) -> f32;
    expf(x) -> f32;
    expm1f(x) -> f32;
    hypotf(x, y) -> f32;
    lgammaf(x) -> f32;
    log10f(x) -> f32;
    log1pf(x) -> f32;
    log2f(x) -> f32;
    logf(x) -> f32;
    powf(x, y) -> f32;
    sinf(x) -> f32;
    sinhf(x) -> f32;
    tanf(x) -> f32;
    tanhf(x) -> f32;
    tgammaf(x) -> f32;
}

/// Sine and cosine, for all code in the program. The places are the caller's.
#[unsafe(no_mangle)]
pub extern "C" fn sincos(x: f64, sine: &mut f64, cosine: &mut f64) {
    (*sine, *cosine) = libm::sincos(x);
}

/// [`sincos`] in single precision.
#[unsafe(no_mangle)]
pub extern "C" fn sincosf(x: f32, sine: &mut f32, cosine: &mut f32) {
    (*sine, *cosine) = libm::sincosf(x);
}
