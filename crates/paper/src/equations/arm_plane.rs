//! Equations 20 to 28: the origin of frame 4, and where it lies in the plane of the arm.

use nalgebra::{RealField, Vector3};

use super::{Equation, Posture, Unit, Verdict};
use crate::dh::{Arm, Target, origin};

/// Equations 20 to 22: origin of frame 4 in the base frame, m.
pub fn p4<T: RealField + Copy>(arm: &Arm<T>, target: &Target<T>, q6: T) -> Vector3<T> {
    let (s6, c6) = q6.sin_cos();
    let of = |p: T, a: T, o: T, n: T| p - a * arm.d6 + arm.d5 * o * c6 + arm.d5 * n * s6;
    Vector3::new(
        of(target.p.x, target.a.x, target.o.x, target.n.x),
        of(target.p.y, target.a.y, target.o.y, target.n.y),
        of(target.p.z, target.a.z, target.o.z, target.n.z),
    )
}

/// Equation 23: distance of frame 4's origin from the shoulder axis, m.
pub fn l<T: RealField + Copy>(p4: &Vector3<T>) -> T {
    (p4.x * p4.x + p4.y * p4.y).sqrt()
}

/// Equation 24 as printed, m: never negative.
pub fn r1_printed<T: RealField + Copy>(arm: &Arm<T>, p4: &Vector3<T>) -> T {
    let l = l(p4);
    (l * l - arm.d4 * arm.d4).sqrt()
}

/// Equation 24 with its sign, m: negative where the arm reaches back over its shoulder.
pub fn r1<T: RealField + Copy>(p4: &Vector3<T>, q1: T) -> T {
    let (s1, c1) = q1.sin_cos();
    p4.x * c1 + p4.y * s1
}

/// Equation 25, m.
pub fn r2<T: RealField + Copy>(arm: &Arm<T>, p4: &Vector3<T>) -> T {
    p4.z - arm.d1
}

/// Equation 26, m.
pub fn r3<T: RealField + Copy>(r1: T, r2: T) -> T {
    (r1 * r1 + r2 * r2).sqrt()
}

/// Equation 27, right side, m.
pub fn planar_forward<T: RealField + Copy>(arm: &Arm<T>, q2: T, q3: T) -> T {
    arm.a2 * q2.cos() + arm.a3 * (q2 + q3).cos()
}

/// Equation 28, right side, m.
pub fn planar_up<T: RealField + Copy>(arm: &Arm<T>, q2: T, q3: T) -> T {
    arm.a2 * q2.sin() + arm.a3 * (q2 + q3).sin()
}

/// Where forward kinematics has wrist 1 in the plane of the arm, m: ahead of and above the
/// shoulder.
pub(super) fn wrist_1_in_plane(posture: &Posture) -> (f64, f64) {
    let (s1, c1) = libm::sincos(posture.q[0]);
    let from_shoulder = origin(&posture.frames[3]) - origin(&posture.frames[1]);
    (from_shoulder.x * c1 + from_shoulder.y * s1, from_shoulder.z)
}

pub(super) fn p4_of(posture: &Posture) -> Vector3<f64> {
    p4(&posture.arm, &posture.target, posture.q[5])
}

fn error_of_p4(posture: &Posture, axis: usize) -> f64 {
    (p4_of(posture)[axis] - origin(&posture.frames[4])[axis]).abs()
}

fn error_of_23(posture: &Posture) -> f64 {
    let expected = origin(&posture.frames[4]);
    (l(&p4_of(posture)) - libm::hypot(expected.x, expected.y)).abs()
}

fn error_of_24_printed(posture: &Posture) -> f64 {
    let found = r1_printed(&posture.arm, &p4_of(posture));
    (found - wrist_1_in_plane(posture).0).abs()
}

fn error_of_24(posture: &Posture) -> f64 {
    let found = r1(&p4_of(posture), posture.q[0]);
    (found - wrist_1_in_plane(posture).0).abs()
}

fn error_of_25(posture: &Posture) -> f64 {
    let found = r2(&posture.arm, &p4_of(posture));
    (found - wrist_1_in_plane(posture).1).abs()
}

fn error_of_26(posture: &Posture) -> f64 {
    let p4 = p4_of(posture);
    let found = r3(r1_printed(&posture.arm, &p4), r2(&posture.arm, &p4));
    let expected = (origin(&posture.frames[3]) - origin(&posture.frames[1])).norm();
    (found - expected).abs()
}

fn error_of_27_printed(posture: &Posture) -> f64 {
    let left = r1_printed(&posture.arm, &p4_of(posture));
    (left - planar_forward(&posture.arm, posture.q[1], posture.q[2])).abs()
}

fn error_of_27(posture: &Posture) -> f64 {
    let left = r1(&p4_of(posture), posture.q[0]);
    (left - planar_forward(&posture.arm, posture.q[1], posture.q[2])).abs()
}

fn error_of_28(posture: &Posture) -> f64 {
    let left = r2(&posture.arm, &p4_of(posture));
    (left - planar_up(&posture.arm, posture.q[1], posture.q[2])).abs()
}

pub(super) const EQUATIONS: &[Equation] = &[
    Equation {
        number: "20",
        name: "frame 4, x",
        printed_text: "p_{x4} = p_x − a_xd_6 + d_5o_xC_6 + d_5n_xS_6",
        mended_text: "the same",
        printed: |posture| error_of_p4(posture, 0),
        mended: |posture| error_of_p4(posture, 0),
        ..Equation::right(Unit::Metre)
    },
    Equation {
        number: "21",
        name: "frame 4, y",
        printed_text: "p_{y4} = p_y − a_yd_6 + d_5o_yC_6 + d_5n_yS_6",
        mended_text: "the same",
        printed: |posture| error_of_p4(posture, 1),
        mended: |posture| error_of_p4(posture, 1),
        ..Equation::right(Unit::Metre)
    },
    Equation {
        number: "22",
        name: "frame 4, z",
        printed_text: "p_{z4} = p_z − a_zd_6 + d_5o_zC_6 + d_5n_zS_6",
        mended_text: "the same",
        printed: |posture| error_of_p4(posture, 2),
        mended: |posture| error_of_p4(posture, 2),
        ..Equation::right(Unit::Metre)
    },
    Equation {
        number: "23",
        name: "distance from the shoulder axis",
        printed_text: "l = √(p_{x4}^2 + p_{y4}^2)",
        mended_text: "the same",
        printed: error_of_23,
        mended: error_of_23,
        ..Equation::right(Unit::Metre)
    },
    Equation {
        number: "24",
        name: "reach in the arm's plane",
        printed_text: "r_1 = √(l^2 − d_4^2)",
        mended_text: "r_1 = p_{x4}C_1 + p_{y4}S_1, with its sign",
        printed: error_of_24_printed,
        mended: error_of_24,
        // The printed root loses digits where the reach is near zero, which is no failure.
        failure: 1e-9,
        verdict: Verdict::Wrong,
        remark: "the sign is lost: fails wherever the arm reaches back over its shoulder",
        ..Equation::right(Unit::Metre)
    },
    Equation {
        number: "25",
        name: "height in the arm's plane",
        printed_text: "r_2 = p_{z4} − d_1",
        mended_text: "the same",
        printed: error_of_25,
        mended: error_of_25,
        ..Equation::right(Unit::Metre)
    },
    Equation {
        number: "26",
        name: "distance from the shoulder",
        printed_text: "r_3 = √(r_1^2 + r_2^2)",
        mended_text: "the same",
        printed: error_of_26,
        mended: error_of_26,
        ..Equation::right(Unit::Metre)
    },
    Equation {
        number: "27",
        name: "reach of the two links",
        printed_text: "r_1 = a_2C_2 + a_3C_{23}, with equation 24's r_1",
        mended_text: "the same, with the signed r_1",
        printed: error_of_27_printed,
        mended: error_of_27,
        failure: 1e-9,
        verdict: Verdict::NeedsAnother,
        remark: "right with the signed r_1 of equation 24",
        ..Equation::right(Unit::Metre)
    },
    Equation {
        number: "28",
        name: "height of the two links",
        printed_text: "r_2 = a_2S_2 + a_3S_{23}",
        mended_text: "the same",
        printed: error_of_28,
        mended: error_of_28,
        ..Equation::right(Unit::Metre)
    },
];
