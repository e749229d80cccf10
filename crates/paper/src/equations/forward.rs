//! Equations 1 to 8 and Table 1: forward kinematics and the wanted pose.

use std::f64::consts::FRAC_PI_2;

use nalgebra::{Matrix4, Translation3, UnitQuaternion, Vector3};

use super::{Equation, Posture, Unit, Verdict};
use crate::dh::{Arm, inverse, largest_entry, origin, rotation};

/// `theta, d, a, alpha` of the six links.
fn parameters(posture: &Posture) -> [[f64; 4]; 6] {
    let Arm {
        d1,
        a2,
        a3,
        d4,
        d5,
        d6,
    } = posture.arm;
    let q = &posture.q;
    [
        [q[0], d1, 0.0, FRAC_PI_2],
        [q[1], 0.0, a2, 0.0],
        [q[2], 0.0, a3, 0.0],
        [q[3], d4, 0.0, FRAC_PI_2],
        [q[4], d5, 0.0, -FRAC_PI_2],
        [q[5], d6, 0.0, 0.0],
    ]
}

/// The four elementary matrices of equation 2's first line, multiplied.
fn elementary_product([theta, d, a, alpha]: [f64; 4]) -> Matrix4<f64> {
    let about_z = nalgebra::Rotation3::from_axis_angle(&Vector3::z_axis(), theta);
    let about_x = nalgebra::Rotation3::from_axis_angle(&Vector3::x_axis(), alpha);
    about_z.to_homogeneous()
        * Translation3::new(0.0, 0.0, d).to_homogeneous()
        * Translation3::new(a, 0.0, 0.0).to_homogeneous()
        * about_x.to_homogeneous()
}

/// Largest error over the six links.
fn over_links(error: impl Fn(usize) -> f64) -> f64 {
    (0..6).map(error).fold(0.0, f64::max)
}

fn error_of_1(posture: &Posture) -> f64 {
    let parameters = parameters(posture);
    over_links(|i| {
        let [theta, d, a, alpha] = parameters[i];
        // The same rotation by quaternions: x and y axes turned first, then moved.
        let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), theta);
        let twist = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), alpha);
        let mut expected = (turn * twist).to_homogeneous();
        let place = turn * Vector3::new(a, 0.0, d);
        expected.fixed_view_mut::<3, 1>(0, 3).copy_from(&place);
        largest_entry(&elementary_product(parameters[i]), &expected)
    })
}

fn error_of_2(posture: &Posture) -> f64 {
    let parameters = parameters(posture);
    over_links(|i| largest_entry(&posture.links[i], &elementary_product(parameters[i])))
}

fn error_of_3(posture: &Posture) -> f64 {
    largest_entry(&posture.frames[6], &posture.pose)
}

fn error_of_position(posture: &Posture, arm: &Arm<f64>) -> f64 {
    (origin(&arm.base_from_flange(&posture.q)) - posture.target.p).norm()
}

fn error_of_table_1_d6(posture: &Posture) -> f64 {
    let printed = Arm {
        d6: 0.0,
        ..posture.arm
    };
    error_of_position(posture, &printed)
}

fn error_of_table_1_signs(posture: &Posture) -> f64 {
    let positive = Arm {
        a2: posture.arm.a2.abs(),
        a3: posture.arm.a3.abs(),
        ..posture.arm
    };
    error_of_position(posture, &positive)
}

fn error_of_table_1(posture: &Posture) -> f64 {
    error_of_position(posture, &posture.arm)
}

/// The wanted pose put together from its columns; the third row's second entry is given.
fn from_columns(posture: &Posture, third_row_second: f64) -> Matrix4<f64> {
    let (n, o, a, p) = (
        posture.target.n,
        posture.target.o,
        posture.target.a,
        posture.target.p,
    );
    Matrix4::new(
        n.x,
        o.x,
        a.x,
        p.x, //
        n.y,
        o.y,
        a.y,
        p.y, //
        n.z,
        third_row_second,
        a.z,
        p.z, //
        0.0,
        0.0,
        0.0,
        1.0,
    )
}

fn error_of_4_printed(posture: &Posture) -> f64 {
    largest_entry(
        &from_columns(posture, posture.target.a.z),
        &posture.frames[6],
    )
}

fn error_of_4(posture: &Posture) -> f64 {
    largest_entry(
        &from_columns(posture, posture.target.o.z),
        &posture.frames[6],
    )
}

fn error_of_5(posture: &Posture) -> f64 {
    let orientation = rotation(&posture.frames[6]) - rotation(&posture.pose);
    let position = origin(&posture.frames[6]) - posture.target.p;
    orientation.amax().max(position.amax())
}

fn error_of_7_8(posture: &Posture) -> f64 {
    let from_joints = posture.links[1..]
        .iter()
        .fold(Matrix4::identity(), |product, link| product * link);
    let from_pose = inverse(&posture.links[0]) * posture.pose;
    largest_entry(&from_joints, &from_pose)
}

pub(super) const EQUATIONS: &[Equation] = &[
    Equation {
        number: "1",
        name: "one link",
        printed_text: "A = R_z(θ) T_z(d) T_x(a) R_x(α)",
        mended_text: "the same",
        printed: error_of_1,
        mended: error_of_1,
        remark: "the text says {i+1} to {i}; the matrices are i to i−1",
        ..Equation::right(Unit::One)
    },
    Equation {
        number: "2",
        name: "one link, multiplied out",
        printed_text: "A = [Cθ, −CαSθ, SαSθ, aCθ; Sθ, CαCθ, −SαCθ, aSθ; 0, Sα, Cα, d; 0, 0, 0, 1]",
        mended_text: "the same",
        printed: error_of_2,
        mended: error_of_2,
        ..Equation::right(Unit::One)
    },
    Equation {
        number: "3",
        name: "forward kinematics",
        printed_text: "^0_6A = ∏ ^{i−1}_iA, i = 1 … 6",
        mended_text: "the same",
        printed: error_of_3,
        mended: error_of_3,
        ..Equation::right(Unit::One)
    },
    Equation {
        number: "Table 1, d6",
        name: "offset of the flange",
        printed_text: "d_6 = 0",
        mended_text: "d_6 = 0.0819 m",
        printed: error_of_table_1_d6,
        mended: error_of_table_1,
        verdict: Verdict::Wrong,
        remark: "the row of joint 6 has no length; position error",
        ..Equation::right(Unit::Metre)
    },
    Equation {
        number: "Table 1, signs",
        name: "signs of the arm's lengths",
        printed_text: "a_2, a_3 without values or signs, read as positive",
        mended_text: "a_2 = −0.24365 m, a_3 = −0.21325 m",
        printed: error_of_table_1_signs,
        mended: error_of_table_1,
        verdict: Verdict::Wrong,
        remark: "not stated: both are negative in these frames; position error",
        ..Equation::right(Unit::Metre)
    },
    Equation {
        number: "4",
        name: "wanted pose",
        printed_text: "third row: n_z, a_z, a_z, p_z",
        mended_text: "third row: n_z, o_z, a_z, p_z",
        printed: error_of_4_printed,
        mended: error_of_4,
        verdict: Verdict::Typo,
        remark: "o_z is printed as a_z",
        ..Equation::right(Unit::One)
    },
    Equation {
        number: "5, 6",
        name: "orientation and position",
        printed_text: "^0_6A(q) = ^0_6T_d = [R_d, P_d; 0, 1]",
        mended_text: "the same",
        printed: error_of_5,
        mended: error_of_5,
        ..Equation::right(Unit::One)
    },
    Equation {
        number: "7, 8",
        name: "frame 1 to flange",
        printed_text: "^1_6A = ^1_2A ^2_3A ^3_4A ^4_5A ^5_6A;  ^1_6T = (^0_1A)^{−1} ^0_6T_d",
        mended_text: "the same",
        printed: error_of_7_8,
        mended: error_of_7_8,
        ..Equation::right(Unit::One)
    },
];
