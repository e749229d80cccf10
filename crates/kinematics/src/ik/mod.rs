//! Inverse kinematics: closed form with all eight configurations, and Gauss-Newton.
//!
//! Equation numbers are those of Abdelaziz, Luo, Jiang and Chen, *Multiple configurations for
//! puncturing robot positioning*, in corrected form where the printed one is wrong.

mod calibrated;
mod closed_form;
mod configuration;
mod fused;
mod numerical;
mod solve;
mod wraps;

pub use closed_form::{
    Certificate, ClosedForm, ClosedFormSolution, FreeWrist, Preference, Tolerance, Unreachable,
    closed_form, closed_form_batch, closed_form_batch_within, closed_form_into, closed_form_within,
};
pub use configuration::{Configuration, Elbow, Shoulder, Wrist};
pub use numerical::{
    DampedOptions, GaussNewtonOptions, GaussNewtonStep, Numerical, NumericalResult, Stop,
    gauss_newton,
};
pub use solve::{Kinematics, Rows, Solution, SolutionKind, Solutions};
pub use wraps::{InvalidWeight, Wrap, WrapOrder, WrapSearch, Wraps, nearest_within_limits};

use std::f64::consts::{PI, TAU};

/// Angle wrapped to `(-pi, pi]`, rad.
pub fn wrap_angle(angle_rad: f64) -> f64 {
    if angle_rad > -PI && angle_rad <= PI {
        return angle_rad;
    }
    let wrapped = angle_rad - TAU * (angle_rad / TAU).round();
    if wrapped <= -PI {
        wrapped + TAU
    } else {
        wrapped
    }
}

#[cfg(test)]
mod tests;
#[cfg(test)]
mod wraps_tests;
