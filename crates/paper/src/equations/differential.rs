//! Equations 39 to 47: the Jacobian and one step of the numerical method.

use nalgebra::{Matrix3, Matrix4, Matrix6, Rotation3, UnitQuaternion, Vector3, Vector6};
use needlebench_kinematics::random::SplitMix64;
use needlebench_kinematics::rotation_vector;
use serde::Serialize;

use super::{Equation, Posture, Sample, Unit, Verdict};
use crate::dh::{Arm, origin, rotation};

fn z_axis(frame: &Matrix4<f64>) -> Vector3<f64> {
    frame.fixed_view::<3, 1>(0, 2).into_owned()
}

/// Equation 39 with the axes `z_(first) ... z_(first + 5)` in its angular part.
fn jacobian_with_axes_from(frames: &[Matrix4<f64>; 7], first: usize) -> Matrix6<f64> {
    let flange = origin(&frames[6]);
    Matrix6::from_columns(&std::array::from_fn::<_, 6, _>(|i| {
        // The partial derivative of the position by a joint turning about z_(i).
        let linear = z_axis(&frames[i]).cross(&(flange - origin(&frames[i])));
        let angular = z_axis(&frames[i + first]);
        Vector6::new(
            linear.x, linear.y, linear.z, angular.x, angular.y, angular.z,
        )
    }))
}

/// Equation 39 as printed: `J_w = [z_1 ... z_6]`.
pub fn jacobian_printed(frames: &[Matrix4<f64>; 7]) -> Matrix6<f64> {
    jacobian_with_axes_from(frames, 1)
}

/// Equation 39 mended: `J_w = [z_0 ... z_5]`.
pub fn jacobian(frames: &[Matrix4<f64>; 7]) -> Matrix6<f64> {
    jacobian_with_axes_from(frames, 0)
}

/// How far equation 45 as printed is off at one angle.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct TurnReport {
    pub angle_rad: f64,
    /// Largest error over the angle, over axes all round.
    pub worst_relative_error: f64,
    /// Smallest length of what it takes for the rotation vector, rad: zero is a false solution.
    pub least_length_rad: f64,
}

/// Tries equation 45 as printed on rotations by 10, 90 and 120 degrees.
pub fn turns_as_printed() -> Vec<TurnReport> {
    const AXES: usize = 10_000;
    let mut random = SplitMix64::new(super::SEED + 11);
    // The diagonal is the worst axis: a third of a turn about it swaps the axes.
    let diagonal = -Vector3::repeat(3.0_f64.sqrt().recip());
    let axes: Vec<Vector3<f64>> = std::iter::once(diagonal)
        .chain((0..AXES).map(|_| super::random_axis(&mut random)))
        .collect();
    [10.0_f64, 90.0, 120.0]
        .map(f64::to_radians)
        .map(|angle_rad| {
            let (mut worst, mut least) = (0.0_f64, f64::INFINITY);
            for axis in &axes {
                let wanted = Rotation3::new(axis * angle_rad).into_inner();
                let found = turn_printed(&wanted, &Matrix3::identity());
                worst = worst.max((found - axis * angle_rad).norm() / angle_rad);
                least = least.min(found.norm());
            }
            TurnReport {
                angle_rad,
                worst_relative_error: worst,
                least_length_rad: least,
            }
        })
        .into()
}

/// Equation 46: `s(w) v = w x v`.
pub fn skew(w: &Vector3<f64>) -> Matrix3<f64> {
    Matrix3::new(0.0, -w.z, w.y, w.z, 0.0, -w.x, -w.y, w.x, 0.0)
}

/// The three entries of a matrix in which equation 46 has plus signs.
pub fn vee(s: &Matrix3<f64>) -> Vector3<f64> {
    Vector3::new(s[(2, 1)], s[(0, 2)], s[(1, 0)])
}

/// Equation 45 as printed, with the derivative of the rotation taken as the difference
/// `R_d - R_0`.
pub fn turn_printed(wanted: &Matrix3<f64>, actual: &Matrix3<f64>) -> Vector3<f64> {
    vee(&((wanted - actual) * actual.transpose()))
}

/// Equation 45 mended: `vee(log(R_d R_0^T))`, in the base frame, rad.
pub fn turn(wanted: &Matrix3<f64>, actual: &Matrix3<f64>) -> Vector3<f64> {
    let relative = Rotation3::from_matrix_unchecked(wanted * actual.transpose());
    rotation_vector(&UnitQuaternion::from_rotation_matrix(&relative))
}

/// Right side of equation 47: `[P_d - P_0; omega]`, m and rad.
pub fn pose_difference(
    wanted: &Matrix4<f64>,
    actual: &Matrix4<f64>,
    turn: fn(&Matrix3<f64>, &Matrix3<f64>) -> Vector3<f64>,
) -> Vector6<f64> {
    let linear = origin(wanted) - origin(actual);
    let angular = turn(&rotation(wanted), &rotation(actual));
    Vector6::new(
        linear.x, linear.y, linear.z, angular.x, angular.y, angular.z,
    )
}

/// Singular values below this share of the largest count as zero.
const RANK: f64 = 1e-9;

/// `J^+ dx`: the inverse where the matrix has full rank, as the paper has it, else the
/// pseudo-inverse by singular values.
pub fn pseudo_inverse_step(jacobian: &Matrix6<f64>, dx: &Vector6<f64>) -> Vector6<f64> {
    let lu = jacobian.lu();
    let pivots = lu.u().diagonal().abs();
    if pivots.min() > RANK * pivots.max()
        && let Some(step) = lu.solve(dx)
    {
        return step;
    }
    let svd = jacobian.svd(true, true);
    let cutoff = RANK * svd.singular_values.max();
    svd.solve(dx, cutoff).unwrap_or_else(|_| Vector6::zeros())
}

/// `J^T (J J^T)^-1 dx`, as printed; `None` where the product has no inverse.
fn printed_pseudo_inverse_step(jacobian: &Matrix6<f64>, dx: &Vector6<f64>) -> Option<Vector6<f64>> {
    let inverse = (jacobian * jacobian.transpose()).try_inverse()?;
    Some(jacobian.transpose() * inverse * dx)
}

/// Spacing of the difference quotients, rad: their truncation (`h^4/30`) and rounding (`eps/h`)
/// are both below 1e-12.
const DIFFERENCE_RAD: f64 = 2e-3;

/// Velocity of the flange for unit speed along `direction`, from positions alone: m and rad per
/// unit.
fn velocity_by_differences(arm: &Arm<f64>, q: &[f64; 6], direction: &[f64; 6]) -> Vector6<f64> {
    let at = |steps: f64| {
        let moved = std::array::from_fn(|i| q[i] + steps * DIFFERENCE_RAD * direction[i]);
        arm.base_from_flange(&moved)
    };
    let rate = (at(-2.0) - at(2.0) + (at(1.0) - at(-1.0)) * 8.0) / (12.0 * DIFFERENCE_RAD);
    let here = arm.base_from_flange(q);
    let linear = rate.fixed_view::<3, 1>(0, 3).into_owned();
    let spin = rate.fixed_view::<3, 3>(0, 0) * rotation(&here).transpose();
    // Skew but for rounding: both entries of each pair say the same.
    let angular = (vee(&spin) - vee(&spin.transpose())) * 0.5;
    Vector6::new(
        linear.x, linear.y, linear.z, angular.x, angular.y, angular.z,
    )
}

fn error_of_jacobian(posture: &Posture, jacobian: &Matrix6<f64>) -> f64 {
    (0..6)
        .map(|joint| {
            let direction = std::array::from_fn(|i| if i == joint { 1.0 } else { 0.0 });
            let expected = velocity_by_differences(&posture.arm, &posture.q, &direction);
            (jacobian.column(joint) - expected).amax()
        })
        .fold(0.0, f64::max)
}

fn error_of_40(posture: &Posture) -> f64 {
    // A sixth, so that the joints together turn no more than one alone does above.
    let speed = posture.step.map(|each| each / 6.0);
    let expected = velocity_by_differences(&posture.arm, &posture.q, &speed);
    (jacobian(&posture.frames) * Vector6::from(speed) - expected).amax()
}

/// Size of the steps with which the first-order equations are tried, rad.
const SMALL_STEP_RAD: f64 = 1e-4;

fn moved(posture: &Posture, size_rad: f64) -> [f64; 6] {
    std::array::from_fn(|i| posture.q[i] + size_rad * posture.step[i])
}

/// What is left of `X_d - X_0` after `J (q_d - q_0)`, over the size of the step.
fn error_of_41(posture: &Posture) -> f64 {
    let wanted = posture
        .arm
        .base_from_flange(&moved(posture, SMALL_STEP_RAD));
    let difference = pose_difference(&wanted, &posture.frames[6], turn);
    let step = Vector6::from(posture.step) * SMALL_STEP_RAD;
    (jacobian(&posture.frames) * step - difference).amax() / SMALL_STEP_RAD
}

/// What is left of `q_d - q_0` after the inverse of `J`, over the size of the step.
fn error_of_42(posture: &Posture) -> f64 {
    let wanted = posture
        .arm
        .base_from_flange(&moved(posture, SMALL_STEP_RAD));
    let difference = pose_difference(&wanted, &posture.frames[6], turn);
    let step = Vector6::from(posture.step) * SMALL_STEP_RAD;
    jacobian(&posture.frames)
        .lu()
        .solve(&difference)
        .map_or(f64::NAN, |found| (found - step).amax() / SMALL_STEP_RAD)
}

fn error_of_44(posture: &Posture) -> f64 {
    let wanted = posture
        .arm
        .base_from_flange(&moved(posture, SMALL_STEP_RAD));
    let difference = origin(&wanted) - origin(&posture.frames[6]);
    let linear = jacobian(&posture.frames).fixed_rows::<3>(0).into_owned();
    let step = Vector6::from(posture.step) * SMALL_STEP_RAD;
    (linear * step - difference).amax() / SMALL_STEP_RAD
}

/// Equation 45 over the whole sphere of rotations: `R_d = exp(w) R_0`.
fn error_of_turn(posture: &Posture, turn: fn(&Matrix3<f64>, &Matrix3<f64>) -> Vector3<f64>) -> f64 {
    let actual = rotation(&posture.frames[6]);
    let wanted = Rotation3::new(posture.turn).into_inner() * actual;
    (turn(&wanted, &actual) - posture.turn).norm()
}

fn error_of_46(posture: &Posture) -> f64 {
    let w = posture.turn;
    let v = Vector3::from_column_slice(&posture.step[..3]);
    let product = (skew(&w) * v - w.cross(&v)).amax();
    product.max((vee(&skew(&w)) - w).amax())
}

/// Guess for one step of equation 47, rad: small enough that a right step leaves next to nothing.
const GUESS_RAD: f64 = 1e-3;

/// Joint error after one step of equation 47, over the joint error before it.
fn left_after_a_step(
    posture: &Posture,
    jacobian: fn(&[Matrix4<f64>; 7]) -> Matrix6<f64>,
    turn: fn(&Matrix3<f64>, &Matrix3<f64>) -> Vector3<f64>,
) -> f64 {
    let guess = moved(posture, GUESS_RAD);
    let frames = posture.arm.frames(&guess);
    let difference = pose_difference(&posture.pose, &frames[6], turn);
    let step = pseudo_inverse_step(&jacobian(&frames), &difference);
    let before = Vector6::from(posture.step) * GUESS_RAD;
    (before + step).amax() / before.amax()
}

/// How well a step explains a reachable difference of poses at a singular posture.
fn error_of_pseudo_inverse(posture: &Posture, step: &Vector6<f64>, dx: &Vector6<f64>) -> f64 {
    (jacobian(&posture.frames) * step - dx).amax()
}

fn reachable_difference(posture: &Posture) -> (Matrix6<f64>, Vector6<f64>) {
    let jacobian = jacobian(&posture.frames);
    (jacobian, jacobian * Vector6::from(posture.step))
}

/// The determinant of the Jacobian against the product of the three singular distances.
fn error_of_determinant(posture: &Posture) -> f64 {
    let arm = &posture.arm;
    let q = &posture.q;
    let forward =
        super::arm_plane::planar_forward(arm, q[1], q[2]) + arm.d5 * libm::sin(posture.q234());
    let product = arm.a2 * arm.a3 * libm::sin(q[2]) * libm::sin(q[4]) * forward;
    let determinant = jacobian(&posture.frames).determinant();
    (determinant.abs() - product.abs()).abs()
}

/// Smallest singular value over the largest, where the paper sees no singularity: 0 is singular.
fn regularity(posture: &Posture) -> f64 {
    let values = jacobian(&posture.frames).singular_values();
    values.min() / values.max()
}

/// Steps of 1e-4 rad leave their square: 1e-4 of themselves, times curvature.
const FIRST_ORDER: f64 = 1e-3;

pub(super) const EQUATIONS: &[Equation] = &[
    Equation {
        number: "39",
        name: "Jacobian",
        printed_text: "J_v = ∂P/∂q, J_w = [z_1 … z_6]",
        mended_text: "J_v = ∂P/∂q, J_w = [z_0 … z_5]",
        printed: |posture| error_of_jacobian(posture, &jacobian_printed(&posture.frames)),
        mended: |posture| error_of_jacobian(posture, &jacobian(&posture.frames)),
        // The difference quotients' own error is 1e-12.
        tolerance: 1e-11,
        verdict: Verdict::Wrong,
        remark: "wrong index: joint i turns about z_{i−1}; against difference quotients",
        ..Equation::right(Unit::One)
    },
    Equation {
        number: "40",
        name: "velocities",
        printed_text: "Ẋ = J q̇",
        mended_text: "the same, with the mended J",
        printed: error_of_40,
        mended: error_of_40,
        tolerance: 1e-11,
        failure: 1e-9,
        remark: "against difference quotients",
        ..Equation::right(Unit::One)
    },
    Equation {
        number: "41",
        name: "differences",
        printed_text: "X_d − X_0 = J(q_d − q_0)",
        mended_text: "the same; first order",
        printed: error_of_41,
        mended: error_of_41,
        tolerance: FIRST_ORDER,
        failure: FIRST_ORDER,
        remark: "steps of 1e-4 rad; error over the step",
        ..Equation::right(Unit::One)
    },
    Equation {
        number: "42, 43",
        name: "one step",
        printed_text: "q_d = q_0 + J^{−1}ΔX",
        mended_text: "the same; first order, and where J has an inverse",
        printed: error_of_42,
        mended: error_of_42,
        // Curvature over the smallest singular value of a well-conditioned posture.
        tolerance: 2e-2,
        failure: 2e-2,
        sample: Sample::WellConditioned,
        remark: "steps of 1e-4 rad from well-conditioned postures; error over the step",
        ..Equation::right(Unit::One)
    },
    Equation {
        number: "44",
        name: "position part",
        printed_text: "ΔX_v = P_d − P_0",
        mended_text: "the same",
        printed: error_of_44,
        mended: error_of_44,
        tolerance: FIRST_ORDER,
        failure: FIRST_ORDER,
        remark: "steps of 1e-4 rad; error over the step",
        ..Equation::right(Unit::One)
    },
    Equation {
        number: "45",
        name: "orientation part",
        printed_text: "ΔX_R = Ṙ R_0^T = s(ω), with Ṙ read as R_d − R_0",
        mended_text: "ω = vee(log(R_d R_0^T)), base frame",
        printed: |posture| error_of_turn(posture, turn_printed),
        mended: |posture| error_of_turn(posture, turn),
        tolerance: 1e-13,
        failure: 1e-9,
        verdict: Verdict::Wrong,
        remark: "ill-typed: a rate set equal to a difference, and R_dR_0^T − 1 is not skew",
        ..Equation::right(Unit::Radian)
    },
    Equation {
        number: "46",
        name: "skew-symmetric matrix",
        printed_text: "s(ω) = [0, −ω_z, ω_y; ω_z, 0, −ω_x; −ω_y, ω_x, 0]",
        mended_text: "the same",
        printed: error_of_46,
        mended: error_of_46,
        remark: "right as a definition",
        ..Equation::right(Unit::One)
    },
    Equation {
        number: "47",
        name: "Gauss-Newton step",
        printed_text: "q_d = q_0 + J^+[P_d − P_0; ω], with 39 and 45 as printed",
        mended_text: "the same, with 39 and 45 mended; for a square J this is Newton-Raphson",
        printed: |posture| left_after_a_step(posture, jacobian_printed, turn_printed),
        mended: |posture| left_after_a_step(posture, jacobian, turn),
        tolerance: 0.2,
        failure: 0.2,
        sample: Sample::WellConditioned,
        verdict: Verdict::NeedsAnother,
        remark: "share of a guess's error (1e-3 rad) that is left after one step",
        ..Equation::right(Unit::One)
    },
    Equation {
        number: "J⁺",
        name: "pseudo-inverse",
        printed_text: "J^+ = J^T(JJ^T)^{−1}",
        mended_text: "by singular values, those below 1e-9 of the largest left out",
        printed: |posture| {
            let (jacobian, dx) = reachable_difference(posture);
            let step = printed_pseudo_inverse_step(&jacobian, &dx);
            step.map_or(f64::NAN, |step| {
                error_of_pseudo_inverse(posture, &step, &dx)
            })
        },
        mended: |posture| {
            let (jacobian, dx) = reachable_difference(posture);
            let step = pseudo_inverse_step(&jacobian, &dx);
            error_of_pseudo_inverse(posture, &step, &dx)
        },
        tolerance: 1e-12,
        failure: 1e-6,
        sample: Sample::Singular,
        verdict: Verdict::Wrong,
        remark: "at exact singularities JJ^T has no inverse: undefined just where it is meant for",
        ..Equation::right(Unit::One)
    },
    Equation {
        number: "singularities",
        name: "where the arm is singular",
        printed_text: "S_5 = 0",
        mended_text: "S_5 = 0 (wrist), S_3 = 0 (elbow), ρ = d_4 (shoulder): |det J| = |a_2a_3S_3S_5(a_2C_2 + a_3C_{23} + d_5S_{234})|",
        // A posture that is singular although S5 says that it is not.
        printed: |posture| {
            let missed = libm::sin(posture.q[4]).abs() > 1e-3 && regularity(posture) < 1e-12;
            if missed { 1.0 } else { 0.0 }
        },
        mended: error_of_determinant,
        tolerance: 1e-15,
        failure: 0.5,
        sample: Sample::Singular,
        verdict: Verdict::Wrong,
        remark: "incomplete: elbow and shoulder are not named; printed: 1 for a singularity that is missed",
        ..Equation::right(Unit::One)
    },
];
