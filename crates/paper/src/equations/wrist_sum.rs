//! Equations 12 to 19: the sum `q234 = q2 + q3 + q4`.

use nalgebra::{Matrix4, RealField};

use super::{Equation, Posture, Unit, angle_error};
use crate::dh::{Target, inverse, largest_entry};

/// Equation 16: entry (3, 1) of frame 4, from the wanted pose.
pub fn entry_31<T: RealField + Copy>(target: &Target<T>, q5: T, q6: T) -> T {
    let (s5, c5) = q5.sin_cos();
    let (s6, c6) = q6.sin_cos();
    target.n.z * c5 * c6 - target.a.z * s5 - target.o.z * c5 * s6
}

/// Equation 17: entry (3, 3) of frame 4, from the wanted pose.
pub fn entry_33<T: RealField + Copy>(target: &Target<T>, q6: T) -> T {
    let (s6, c6) = q6.sin_cos();
    -target.o.z * c6 - target.n.z * s6
}

/// Equation 19.
pub fn q234<T: RealField + Copy>(target: &Target<T>, q5: T, q6: T) -> T {
    let (s5, c5) = q5.sin_cos();
    let (s6, c6) = q6.sin_cos();
    (target.n.z * c5 * c6 - target.a.z * s5 - target.o.z * c5 * s6)
        .atan2(target.o.z * c6 + target.n.z * s6)
}

/// Equation 13: frame 4 from the wanted pose.
fn frame_4_from_target(posture: &Posture) -> Matrix4<f64> {
    let [_, _, _, _, fifth, sixth] = posture.links;
    posture.pose * inverse(&sixth) * inverse(&fifth)
}

fn error_of_frame_4(posture: &Posture) -> f64 {
    largest_entry(&posture.frames[4], &frame_4_from_target(posture))
}

fn error_of_14(posture: &Posture) -> f64 {
    (posture.frames[4][(2, 0)] - libm::sin(posture.q234())).abs()
}

fn error_of_15(posture: &Posture) -> f64 {
    (posture.frames[4][(2, 2)] + libm::cos(posture.q234())).abs()
}

fn error_of_16(posture: &Posture) -> f64 {
    let found = entry_31(&posture.target, posture.q[4], posture.q[5]);
    (found - posture.frames[4][(2, 0)]).abs()
}

fn error_of_17(posture: &Posture) -> f64 {
    let found = entry_33(&posture.target, posture.q[5]);
    (found - posture.frames[4][(2, 2)]).abs()
}

fn error_of_18(posture: &Posture) -> f64 {
    let of = |frame: &Matrix4<f64>| libm::atan2(frame[(2, 0)], -frame[(2, 2)]);
    let from_joints = angle_error(of(&posture.frames[4]), posture.q234());
    let from_target = angle_error(of(&frame_4_from_target(posture)), posture.q234());
    from_joints.max(from_target)
}

fn error_of_19(posture: &Posture) -> f64 {
    let found = q234(&posture.target, posture.q[4], posture.q[5]);
    angle_error(found, posture.q234())
}

pub(super) const EQUATIONS: &[Equation] = &[
    Equation {
        number: "12, 13",
        name: "frame 4, from joints and from pose",
        printed_text: "^0_4A = ^0_1A ^1_2A ^2_3A ^3_4A;  ^0_4T = ^0_6T_d (^5_6A)^{−1} (^4_5A)^{−1}",
        mended_text: "the same",
        printed: error_of_frame_4,
        mended: error_of_frame_4,
        ..Equation::right(Unit::One)
    },
    Equation {
        number: "14",
        name: "entry (3, 1) of ⁰₄A",
        printed_text: "^0_4A(3,1) = sin q_{234}",
        mended_text: "the same",
        printed: error_of_14,
        mended: error_of_14,
        ..Equation::right(Unit::One)
    },
    Equation {
        number: "15",
        name: "entry (3, 3) of ⁰₄A",
        printed_text: "^0_4A(3,3) = −cos q_{234}",
        mended_text: "the same",
        printed: error_of_15,
        mended: error_of_15,
        ..Equation::right(Unit::One)
    },
    Equation {
        number: "16",
        name: "entry (3, 1) of ⁰₄T",
        printed_text: "^0_4T(3,1) = n_zC_5C_6 − a_zS_5 − o_zC_5S_6",
        mended_text: "the same",
        printed: error_of_16,
        mended: error_of_16,
        ..Equation::right(Unit::One)
    },
    Equation {
        number: "17",
        name: "entry (3, 3) of ⁰₄T",
        printed_text: "^0_4T(3,3) = −o_zC_6 − n_zS_6",
        mended_text: "the same",
        printed: error_of_17,
        mended: error_of_17,
        ..Equation::right(Unit::One)
    },
    Equation {
        number: "18",
        name: "sum of joints 2 to 4, from frame 4",
        printed_text: "q_{234} = atan2(^0_4A(3,1), −^0_4A(3,3)) = atan2(^0_4T(3,1), −^0_4T(3,3))",
        mended_text: "the same",
        printed: error_of_18,
        mended: error_of_18,
        ..Equation::right(Unit::Radian)
    },
    Equation {
        number: "19",
        name: "sum of joints 2 to 4, from the pose",
        printed_text: "q_{234} = atan2(n_zC_5C_6 − a_zS_5 − o_zC_5S_6, o_zC_6 + n_zS_6)",
        mended_text: "the same",
        printed: error_of_19,
        mended: error_of_19,
        ..Equation::right(Unit::Radian)
    },
];
