//! Equations 29 to 38: `q3`, `q2` and `q4`.

use std::f64::consts::{PI, TAU};

use nalgebra::RealField;

use super::arm_plane::{p4_of, planar_forward, planar_up, r1, r1_printed, r2, wrist_1_in_plane};
use super::side::Side;
use super::{Equation, Posture, Unit, Verdict, angle_error, either_sign};
use crate::dh::{Arm, largest_entry};
use needlebench_kinematics::ik::Shoulder;

/// Equation 31.
pub fn c3<T: RealField + Copy>(arm: &Arm<T>, r1: T, r2: T) -> T {
    let two = T::one() + T::one();
    (r1 * r1 + r2 * r2 - (arm.a2 * arm.a2 + arm.a3 * arm.a3)) / (two * arm.a2 * arm.a3)
}

/// Equation 33; not a number where the elbow cannot reach.
pub fn q3<T: RealField + Copy>(c3: T, sign: T) -> T {
    (sign * (T::one() - c3 * c3).sqrt()).atan2(c3)
}

/// Equation 34.
pub fn alpha<T: RealField + Copy>(r1: T, r2: T) -> T {
    r2.atan2(r1)
}

/// Equation 35 as printed, with one argument: read as an arc tangent.
pub fn beta_printed(arm: &Arm<f64>, q3: f64) -> f64 {
    libm::atan(arm.a3 * libm::sin(q3) * arm.a2 + arm.a3 * libm::cos(q3))
}

/// Equation 35 with its comma.
pub fn beta<T: RealField + Copy>(arm: &Arm<T>, q3: T) -> T {
    (arm.a3 * q3.sin()).atan2(arm.a2 + arm.a3 * q3.cos())
}

/// Equation 37: `q2` and `q3` mirrored about the shoulder axis.
pub fn mirrored<T: RealField + Copy>(q2: T, q3: T) -> (T, T) {
    (T::pi() - q2, -q3)
}

/// `C3` of equation 31 from the wanted pose; the sign of `r1` does not matter to it.
fn c3_of(posture: &Posture) -> f64 {
    let p4 = p4_of(posture);
    c3(
        &posture.arm,
        r1_printed(&posture.arm, &p4),
        r2(&posture.arm, &p4),
    )
}

fn error_of_29(posture: &Posture) -> f64 {
    let p4 = p4_of(posture);
    let (r1, r2) = (r1_printed(&posture.arm, &p4), r2(&posture.arm, &p4));
    let (a2, a3) = (posture.arm.a2, posture.arm.a3);
    let (q2, q23) = (posture.q[1], posture.q[1] + posture.q[2]);
    let left = r1 * r1 + r2 * r2 - (a2 * a2 + a3 * a3);
    let middle = 2.0 * a2 * a3 * (libm::cos(q23) * libm::cos(q2) + libm::sin(q23) * libm::sin(q2));
    let right = 2.0 * a2 * a3 * libm::cos(q23 - q2);
    (left - middle).abs().max((middle - right).abs())
}

fn error_of_30(posture: &Posture) -> f64 {
    let q23 = posture.q[1] + posture.q[2];
    (libm::cos(q23 - posture.q[1]) - libm::cos(posture.q[2])).abs()
}

fn error_of_31(posture: &Posture) -> f64 {
    (c3_of(posture) - libm::cos(posture.q[2])).abs()
}

fn error_of_32(posture: &Posture) -> f64 {
    let c3 = c3_of(posture);
    either_sign(|sign| (sign * (1.0 - c3 * c3).sqrt() - libm::sin(posture.q[2])).abs())
}

fn error_of_33(posture: &Posture) -> f64 {
    let c3 = c3_of(posture);
    either_sign(|sign| angle_error(q3(c3, sign), posture.q[2]))
}

fn error_of_34(posture: &Posture, r1: f64) -> f64 {
    let (forward, up) = wrist_1_in_plane(posture);
    let found = alpha(r1, r2(&posture.arm, &p4_of(posture)));
    angle_error(found, libm::atan2(up, forward))
}

/// The angle that `q2` is short of the line to wrist 1, by forward kinematics.
fn true_beta(posture: &Posture) -> f64 {
    let (forward, up) = wrist_1_in_plane(posture);
    libm::atan2(up, forward) - posture.q[1]
}

fn error_of_36(posture: &Posture, r1: f64) -> f64 {
    let r2 = r2(&posture.arm, &p4_of(posture));
    let found = alpha(r1, r2) - beta(&posture.arm, posture.q[2]);
    angle_error(found, posture.q[1])
}

/// Whether both shoulders reach the pose with the wrists that Table 2 calls folded, so that both
/// have an elbow.
fn both_shoulders_reach(posture: &Posture) -> bool {
    [(Shoulder::Right, 1.0), (Shoulder::Left, -1.0)]
        .into_iter()
        .all(|(shoulder, wrist_sign)| {
            let side = Side::of(&posture.arm, &posture.target, shoulder, wrist_sign);
            q3(c3(&posture.arm, side.r1, side.r2), 1.0).is_finite()
        })
}

/// Rows 3 and 4 of Table 2, with everything right but the indices of beta: the worse of the two
/// poses that they give.
fn error_of_indices(posture: &Posture, own_beta: bool) -> f64 {
    let right = Side::of(&posture.arm, &posture.target, Shoulder::Right, 1.0);
    let left = Side::of(&posture.arm, &posture.target, Shoulder::Left, -1.0);
    let mut worst: f64 = 0.0;
    for sign in [1.0, -1.0] {
        let q3_left = q3(c3(&posture.arm, left.r1, left.r2), sign);
        let q3_right = q3(c3(&posture.arm, right.r1, right.r2), sign);
        let q3_of_beta = if own_beta { q3_left } else { q3_right };
        let q2 = alpha(left.r1, left.r2) - beta(&posture.arm, q3_of_beta);
        let joints = left.joints(q2, q3_left);
        let pose = posture.arm.base_from_flange(&joints);
        worst = worst.max(largest_entry(&pose, &posture.pose));
    }
    worst
}

/// The mirror itself: the mirrored links reach as far back as the others reach ahead.
fn error_of_mirror(posture: &Posture) -> f64 {
    let (q2, q3) = (posture.q[1], posture.q[2]);
    let (mirror_q2, mirror_q3) = mirrored(q2, q3);
    let forward = planar_forward(&posture.arm, q2, q3);
    let up = planar_up(&posture.arm, q2, q3);
    let mirror_forward = planar_forward(&posture.arm, mirror_q2, mirror_q3);
    let mirror_up = planar_up(&posture.arm, mirror_q2, mirror_q3);
    (forward + mirror_forward).abs().max((up - mirror_up).abs())
}

/// `q2` and `q3` from the unsigned `r1`, mirrored or not: the better sign of the elbow.
fn error_with_mirror(posture: &Posture, mirror: bool) -> f64 {
    let p4 = p4_of(posture);
    let (r1, r2) = (r1_printed(&posture.arm, &p4), r2(&posture.arm, &p4));
    let c3 = c3(&posture.arm, r1, r2);
    either_sign(|sign| {
        let found_q3 = q3(c3, sign);
        let found_q2 = alpha(r1, r2) - beta(&posture.arm, found_q3);
        let (q2, q3) = if mirror {
            mirrored(found_q2, found_q3)
        } else {
            (found_q2, found_q3)
        };
        angle_error(q2, posture.q[1]).max(angle_error(q3, posture.q[2]))
    })
}

fn error_of_rule_printed(posture: &Posture) -> f64 {
    error_with_mirror(posture, posture.shoulder == Shoulder::Left)
}

fn error_of_rule(posture: &Posture) -> f64 {
    error_with_mirror(posture, r1(&p4_of(posture), posture.q[0]) < 0.0)
}

/// `q4` as the paper's own steps give it for the branch of the posture, not wrapped.
fn q4_unwrapped(posture: &Posture) -> f64 {
    let p4 = p4_of(posture);
    let (r1, r2) = (r1(&p4, posture.q[0]), r2(&posture.arm, &p4));
    let (q2, q3) = (
        alpha(r1.abs(), r2) - beta(&posture.arm, posture.q[2] * r1.signum()),
        posture.q[2] * r1.signum(),
    );
    let (q2, q3) = if r1 < 0.0 { mirrored(q2, q3) } else { (q2, q3) };
    let sum = super::wrist_sum::q234(&posture.target, posture.q[4], posture.q[5]);
    sum - q3 - q2
}

/// Error of an angle, or how far it lies outside the joint's range of two turns, rad.
fn beyond_two_turns(angle_rad: f64, expected_rad: f64) -> f64 {
    let beyond = (angle_rad.abs() - TAU).max(0.0);
    beyond.max(angle_error(angle_rad, expected_rad))
}

fn error_of_38_printed(posture: &Posture) -> f64 {
    beyond_two_turns(q4_unwrapped(posture), posture.q[3])
}

fn error_of_38(posture: &Posture) -> f64 {
    let wrapped = needlebench_kinematics::ik::wrap_angle(q4_unwrapped(posture));
    let beyond_half_turn = (wrapped.abs() - PI).max(0.0);
    beyond_two_turns(wrapped, posture.q[3]).max(beyond_half_turn)
}

/// Where a root or an `atan2` loses digits near a singular posture.
const NEAR_SINGULAR: f64 = 1e-9;

pub(super) const EQUATIONS: &[Equation] = &[
    Equation {
        number: "29",
        name: "law of cosines",
        printed_text: "r_1^2 + r_2^2 − (a_2^2 + a_3^2) = 2a_2a_3(C_{23}C_2 + S_{23}S_2) = 2a_2a_3cos(q_{23} − q_2)",
        mended_text: "the same",
        printed: error_of_29,
        mended: error_of_29,
        ..Equation::right(Unit::SquareMetre)
    },
    Equation {
        number: "30",
        name: "difference of sums",
        printed_text: "cos(q_{23} − q_2) = cos q_3 ≡ C_3",
        mended_text: "the same",
        printed: error_of_30,
        mended: error_of_30,
        ..Equation::right(Unit::One)
    },
    Equation {
        number: "31",
        name: "cosine of the elbow",
        printed_text: "C_3 = (r_1^2 + r_2^2 − (a_2^2 + a_3^2)) / (2a_2a_3)",
        mended_text: "the same; unreachable if |C_3| > 1",
        printed: error_of_31,
        mended: error_of_31,
        ..Equation::right(Unit::One)
    },
    Equation {
        number: "32",
        name: "sine of the elbow",
        printed_text: "sin q_3 = ±√(1 − C_3^2)",
        mended_text: "the same",
        printed: error_of_32,
        mended: error_of_32,
        tolerance: NEAR_SINGULAR,
        ..Equation::right(Unit::One)
    },
    Equation {
        number: "33",
        name: "elbow angle",
        printed_text: "q_3 = atan2(±√(1 − C_3^2), C_3)",
        mended_text: "the same",
        printed: error_of_33,
        mended: error_of_33,
        tolerance: NEAR_SINGULAR,
        ..Equation::right(Unit::Radian)
    },
    Equation {
        number: "34",
        name: "direction of wrist 1",
        printed_text: "α = atan2(r_2, r_1), with equation 24's r_1",
        mended_text: "the same, with the signed r_1",
        printed: |posture| error_of_34(posture, r1_printed(&posture.arm, &p4_of(posture))),
        mended: |posture| error_of_34(posture, r1(&p4_of(posture), posture.q[0])),
        tolerance: NEAR_SINGULAR,
        failure: 1e-7,
        verdict: Verdict::NeedsAnother,
        remark: "right with the signed r_1 of equation 24",
        ..Equation::right(Unit::Radian)
    },
    Equation {
        number: "35",
        name: "angle between upper arm and that direction",
        printed_text: "β = atan2(a_3S_3 a_2 + a_3C_3)",
        mended_text: "β = atan2(a_3S_3, a_2 + a_3C_3)",
        printed: |posture| {
            let found = beta_printed(&posture.arm, posture.q[2]);
            angle_error(found, true_beta(posture))
        },
        mended: |posture| angle_error(beta(&posture.arm, posture.q[2]), true_beta(posture)),
        tolerance: NEAR_SINGULAR,
        verdict: Verdict::Typo,
        remark: "the comma is lost: one argument, here read as an arc tangent",
        ..Equation::right(Unit::Radian)
    },
    Equation {
        number: "36",
        name: "shoulder lift",
        printed_text: "q_2 = α − β, with equation 24's r_1",
        mended_text: "the same, with the signed r_1",
        printed: |posture| error_of_36(posture, r1_printed(&posture.arm, &p4_of(posture))),
        mended: |posture| error_of_36(posture, r1(&p4_of(posture), posture.q[0])),
        tolerance: NEAR_SINGULAR,
        failure: 1e-7,
        verdict: Verdict::NeedsAnother,
        remark: "right with the signed r_1 of equation 24",
        ..Equation::right(Unit::Radian)
    },
    Equation {
        number: "36, indices",
        name: "which β goes with which α",
        printed_text: "q_{2,3} = α_2 − β_1, q_{2,4} = α_2 − β_2",
        mended_text: "q_{2,3} = α_2 − β_3, q_{2,4} = α_2 − β_4",
        printed: |posture| error_of_indices(posture, false),
        mended: |posture| error_of_indices(posture, true),
        applies: both_shoulders_reach,
        // The poses carry the lost digits of q1 near the shoulder's singularity.
        tolerance: NEAR_SINGULAR,
        verdict: Verdict::Wrong,
        remark: "wrong indices; pose error of rows 3 and 4 of Table 2, where both shoulders reach",
        ..Equation::right(Unit::Pose)
    },
    Equation {
        number: "37",
        name: "mirror",
        printed_text: "(q_2, q_3) → (π − q_2, −q_3) turns r_1 into −r_1",
        mended_text: "the same",
        printed: error_of_mirror,
        mended: error_of_mirror,
        ..Equation::right(Unit::Metre)
    },
    Equation {
        number: "37, rule",
        name: "when to mirror",
        printed_text: "mirror q_2, q_3 at every q_{1,2}",
        mended_text: "mirror iff r_1 < 0; not at all with the signed r_1",
        printed: error_of_rule_printed,
        mended: error_of_rule,
        tolerance: NEAR_SINGULAR,
        failure: 1e-7,
        verdict: Verdict::Wrong,
        remark: "the side of the shoulder does not decide it",
        ..Equation::right(Unit::Radian)
    },
    Equation {
        number: "38",
        name: "wrist 1 angle",
        printed_text: "q_4 = q_{234} − q_3 − q_2",
        mended_text: "the same, wrapped to (−π, π]",
        printed: error_of_38_printed,
        mended: error_of_38,
        tolerance: NEAR_SINGULAR,
        verdict: Verdict::NeedsAnother,
        remark: "right modulo 2π, but some values lie outside the joint's ±2π; the error counts that",
        ..Equation::right(Unit::Radian)
    },
];
