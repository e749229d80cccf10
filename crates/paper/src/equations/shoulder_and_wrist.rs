//! Equations 9 to 11: `q1`, `q5` and `q6`.

use nalgebra::RealField;

use super::{Equation, Posture, Unit, Verdict, angle_error, either_sign};
use crate::dh::{Arm, Target};

/// Equation 9. `sign` is that of the root: positive for the right shoulder.
pub fn q1<T: RealField + Copy>(arm: &Arm<T>, target: &Target<T>, sign: T) -> T {
    let x = target.p.x - arm.d6 * target.a.x;
    let y = arm.d6 * target.a.y - target.p.y;
    let root = (y * y + x * x - arm.d4 * arm.d4).sqrt();
    arm.d4.atan2(sign * root) - y.atan2(x)
}

/// Equation 10.
pub fn q5<T: RealField + Copy>(target: &Target<T>, q1: T, sign: T) -> T {
    let (s1, c1) = q1.sin_cos();
    let n = target.n.x * s1 - target.n.y * c1;
    let o = target.o.x * s1 - target.o.y * c1;
    (sign * (n * n + o * o).sqrt()).atan2(target.a.x * s1 - target.a.y * c1)
}

/// Equation 11 as printed.
pub fn q6_printed<T: RealField + Copy>(target: &Target<T>, q1: T, q5: T) -> T {
    let (s1, c1) = q1.sin_cos();
    let s5 = q5.sin();
    ((-target.o.x * s1 - target.o.y * c1) / s5).atan2((target.n.x * s1 - target.n.y * c1) / s5)
}

/// Equation 11 with the sign of `o_y C1` mended.
pub fn q6<T: RealField + Copy>(target: &Target<T>, q1: T, q5: T) -> T {
    let (s1, c1) = q1.sin_cos();
    let s5 = q5.sin();
    ((-target.o.x * s1 + target.o.y * c1) / s5).atan2((target.n.x * s1 - target.n.y * c1) / s5)
}

fn error_of_q1(posture: &Posture) -> f64 {
    either_sign(|sign| angle_error(q1(&posture.arm, &posture.target, sign), posture.q[0]))
}

fn error_of_q5(posture: &Posture) -> f64 {
    either_sign(|sign| angle_error(q5(&posture.target, posture.q[0], sign), posture.q[4]))
}

fn error_of_q6_printed(posture: &Posture) -> f64 {
    let found = q6_printed(&posture.target, posture.q[0], posture.q[4]);
    angle_error(found, posture.q[5])
}

fn error_of_q6(posture: &Posture) -> f64 {
    let found = q6(&posture.target, posture.q[0], posture.q[4]);
    angle_error(found, posture.q[5])
}

pub(super) const EQUATIONS: &[Equation] = &[
    Equation {
        number: "9",
        name: "shoulder angle",
        printed_text: "q_1 = atan2(d_4, ±√((d_6a_y − p_y)^2 + (p_x − d_6a_x)^2 − d_4^2)) − atan2(d_6a_y − p_y, p_x − d_6a_x)",
        mended_text: "the same, wrapped to (−π, π]; needs (d_6a_y − p_y)^2 + (p_x − d_6a_x)^2 ≥ d_4^2",
        printed: error_of_q1,
        mended: error_of_q1,
        // A root near zero (the shoulder's singularity) loses half of the digits.
        tolerance: 1e-9,
        ..Equation::right(Unit::Radian)
    },
    Equation {
        number: "10",
        name: "wrist 2 angle",
        printed_text: "q_5 = atan2(±√((n_xS_1 − n_yC_1)^2 + (o_xS_1 − o_yC_1)^2), a_xS_1 − a_yC_1)",
        mended_text: "the same; both signs are valid at each q_1",
        printed: error_of_q5,
        mended: error_of_q5,
        tolerance: 1e-9,
        ..Equation::right(Unit::Radian)
    },
    Equation {
        number: "11",
        name: "wrist 3 angle",
        printed_text: "q_6 = atan2((−o_xS_1 − o_yC_1)/S_5, (n_xS_1 − n_yC_1)/S_5)",
        mended_text: "q_6 = atan2((−o_xS_1 + o_yC_1)/S_5, (n_xS_1 − n_yC_1)/S_5)",
        printed: error_of_q6_printed,
        mended: error_of_q6,
        tolerance: 1e-9,
        verdict: Verdict::Wrong,
        remark: "wrong sign; fails for every pose",
        ..Equation::right(Unit::Radian)
    },
];
