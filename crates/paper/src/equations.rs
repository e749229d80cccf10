//! Equations 1 to 47, each as printed and as corrected, against forward kinematics.
//!
//! Both forms take the target pose and what the paper has computed before; the ground truth is the joint vector of
//! the pose. The printed and corrected form of each equation, with remarks, is in `equations.json`.

use std::collections::BTreeMap;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

use nalgebra::{
    Matrix3, Matrix4, Matrix6, Rotation3, Translation3, UnitQuaternion, Vector3, Vector6,
};
use needlebench_kinematics::ik::{Configuration, Shoulder, wrap_angle};
use needlebench_kinematics::pose_sets::PoseSet;
use needlebench_kinematics::{Joints, UrGeometry};
use needlebench_numerics::random::SplitMix64;
use serde::{Deserialize, Serialize};

use super::Watch;
use super::closed_form::{
    Mended, Side, alpha, beta, c3, entry_31, entry_33, l, mirrored, p4, q1, q3, q5, q6, q234, r1,
    r1_printed, r2,
};
use super::dh::{Arm, Target, inverse, largest_entry, origin, rotation};
use super::numerical::{
    Jacobian, Turn, jacobian, jacobian_printed, pose_difference, printed_pseudo_inverse_step,
    pseudo_inverse_step, stacked, turn, turn_printed, vee,
};

/// Errors of one form of an equation over all postures.
#[derive(Debug, Clone, Copy, Default, Serialize)]
pub struct Errors {
    /// Largest error; null where the form is undefined at every posture.
    pub max: f64,
    pub rms: f64,
    /// Share of postures at which the error is above the failure bound or undefined, 0 to 1.
    pub failing: f64,
    /// Share of postures at which the form is undefined, 0 to 1.
    pub undefined: f64,
}

impl Errors {
    fn new(errors: &[f64], bound: f64) -> Self {
        let defined = || errors.iter().copied().filter(|error| error.is_finite());
        let share = |part: usize| part as f64 / errors.len().max(1) as f64;
        let within = defined().filter(|error| *error <= bound).count();
        let squares: f64 = defined().map(|error| error * error).sum();
        Self {
            max: defined().reduce(f64::max).unwrap_or(f64::NAN),
            rms: (squares / defined().count() as f64).sqrt(),
            failing: share(errors.len() - within),
            undefined: share(errors.len() - defined().count()),
        }
    }
}

/// One equation, or a claim about one, from `equations.json`, with its results.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct EquationReport {
    pub number: String,
    pub name: String,
    /// In a small notation: `_x`, `^x`, `_{..}`, `^{..}`.
    pub as_printed: String,
    pub as_corrected: String,
    /// Of the printed form: `right`, `needs_another` (right once another equation is corrected, or with a
    /// condition), `typo` or `wrong`.
    pub verdict: String,
    pub remark: String,
    /// Unit of its error; `m, 1`: largest entry of a difference of pose matrices.
    pub unit: String,
    /// Postures on which it is tested: `random`, those that are `well_conditioned`, or exactly `singular`.
    pub sample: String,
    /// Its bounds, one of [`BOUNDS`].
    #[serde(skip_serializing)]
    bounds: String,
    /// Postures at which the equation applies.
    #[serde(skip_deserializing)]
    pub postures: usize,
    #[serde(skip_deserializing)]
    pub printed: Errors,
    #[serde(skip_deserializing)]
    pub corrected: Errors,
    /// Bound on the corrected form.
    #[serde(skip_deserializing)]
    pub tolerance: f64,
    /// Bound above which the printed form fails.
    #[serde(skip_deserializing)]
    pub failure_bound: f64,
    /// The corrected form satisfies its bound at every posture.
    #[serde(skip_deserializing)]
    pub holds: bool,
}

/// Bounds on errors: one that the corrected form satisfies at every posture, and one above which the printed form
/// fails.
const BOUNDS: [(&str, [f64; 2]); 10] = [
    // A few products of numbers below 1: five times the worst error seen (2e-15).
    ("rounding", [1e-14, 1e-9]),
    // A root or an `atan2` near zero, as near a singular posture, loses half of the digits.
    ("near_singular", [1e-9, 1e-9]),
    // The same, of the printed form too, which is no failure.
    ("lost_digits", [1e-9, 1e-7]),
    // Difference quotients have an error of 1e-12 of their own.
    ("differences", [1e-11, 1e-9]),
    // Steps of 1e-4 rad leave their square: 1e-4 of themselves, times curvature.
    ("first_order", [1e-3, 1e-3]),
    // Curvature over the smallest singular value of a well-conditioned posture.
    ("inverse", [2e-2, 2e-2]),
    // The share of a guess's error that remains after one step, multiplied by curvature and singular values.
    ("one_step", [0.2, 0.2]),
    // A logarithm of an exponential.
    ("logarithm", [1e-13, 1e-9]),
    // Singular values down to 1e-9 of the largest count, and amplify rounding.
    ("pseudo_inverse", [1e-12, 1e-6]),
    // Products of lengths below 0.3 m; the printed form fails by 1.
    ("determinant", [1e-15, 0.5]),
];

/// Errors of the printed and of the corrected form at each posture, by the equation's number; not numbers where a
/// form is undefined.
#[derive(Default)]
struct Trials(BTreeMap<&'static str, [Vec<f64>; 2]>);

impl Trials {
    fn add(&mut self, number: &'static str, errors: [f64; 2]) {
        let tried = self.0.entry(number).or_default();
        tried
            .iter_mut()
            .zip(errors)
            .for_each(|(all, error)| all.push(error));
    }

    /// Error of an equation that is right as printed.
    fn right(&mut self, number: &'static str, error: f64) {
        self.add(number, [error; 2]);
    }
}

/// A joint vector with the results of forward kinematics.
struct Posture {
    arm: Arm<f64>,
    /// Joint positions, rad.
    q: [f64; 6],
    /// Frame `i` in frame `i - 1`.
    links: [Matrix4<f64>; 6],
    /// Frames 0 to 6 in the base frame.
    frames: [Matrix4<f64>; 7],
    /// The target pose: the library's forward kinematics, by quaternions.
    pose: Matrix4<f64>,
    target: Target<f64>,
    /// A direction in joint space, each entry uniform in (-1, 1).
    step: [f64; 6],
    /// A rotation vector: uniform axis, angle uniform in (0, pi), rad.
    turn: Vector3<f64>,
}

impl Posture {
    fn new(joints: &Joints, random: &mut SplitMix64) -> Self {
        let (arm, q) = (Arm::ur3(), (*joints).into());
        let pose = UrGeometry::UR3.base_from_flange(joints).to_homogeneous();
        Self {
            arm,
            q,
            links: arm.links(&q),
            frames: arm.frames(&q),
            pose,
            target: Target::of(&pose),
            step: std::array::from_fn(|_| random.uniform(-1.0, 1.0)),
            turn: random_axis(random) * random.uniform(0.0, PI),
        }
    }

    /// `q2 + q3 + q4`, rad.
    fn q234(&self) -> f64 {
        self.q[1] + self.q[2] + self.q[3]
    }

    fn moved(&self, size_rad: f64) -> [f64; 6] {
        std::array::from_fn(|i| self.q[i] + size_rad * self.step[i])
    }
}

/// A unit vector, uniform on the sphere: Archimedes' cylinder.
fn random_axis(random: &mut SplitMix64) -> Vector3<f64> {
    let z = random.uniform(-1.0, 1.0);
    let (sine, cosine) = libm::sincos(random.uniform(-PI, PI));
    let radius = (1.0 - z * z).sqrt();
    Vector3::new(radius * cosine, radius * sine, z)
}

/// Far from the singularities of wrist, elbow and shoulder: sines of at least 0.3, and 80 mm.
pub fn well_conditioned(q: &[f64; 6]) -> bool {
    let forward_m = UrGeometry::UR3.wrist_forward_m(&Joints::from(*q));
    let [elbow, wrist] = [q[2], q[4]].map(|angle| libm::sin(angle).abs());
    elbow >= 0.3 && wrist >= 0.3 && forward_m.abs() >= 0.08
}

/// Difference of two angles on the circle, rad, in `[0, pi]`.
pub fn angle_error(a: f64, b: f64) -> f64 {
    wrap_angle(a - b).abs()
}

/// The smaller error of the two signs of a root.
fn either_sign(error: impl Fn(f64) -> f64) -> f64 {
    let (positive, negative) = (error(1.0), error(-1.0));
    // Not `min`, which drops a NaN.
    if positive <= negative {
        positive
    } else {
        negative
    }
}

/// Equations 1 to 8 and Table 1: forward kinematics and the target pose.
fn forward(p: &Posture, trials: &mut Trials) {
    let arm = p.arm;
    let parameters = [
        [p.q[0], arm.d1, 0.0, FRAC_PI_2],
        [p.q[1], 0.0, arm.a2, 0.0],
        [p.q[2], 0.0, arm.a3, 0.0],
        [p.q[3], arm.d4, 0.0, FRAC_PI_2],
        [p.q[4], arm.d5, 0.0, -FRAC_PI_2],
        [p.q[5], arm.d6, 0.0, 0.0],
    ];
    let (x, z) = (Vector3::x_axis(), Vector3::z_axis());
    // The four elementary matrices of equation 2's first line.
    let products = parameters.map(|[theta, d, a, alpha]| {
        Rotation3::from_axis_angle(&z, theta).to_homogeneous()
            * Translation3::new(0.0, 0.0, d).to_homogeneous()
            * Translation3::new(a, 0.0, 0.0).to_homogeneous()
            * Rotation3::from_axis_angle(&x, alpha).to_homogeneous()
    });
    // The same by quaternions: x and y axes turned first, then moved.
    let expected = parameters.map(|[theta, d, a, alpha]| {
        let turn = UnitQuaternion::from_axis_angle(&z, theta);
        let mut expected = (turn * UnitQuaternion::from_axis_angle(&x, alpha)).to_homogeneous();
        let place = turn * Vector3::new(a, 0.0, d);
        expected.fixed_view_mut::<3, 1>(0, 3).copy_from(&place);
        expected
    });
    let over_links = |found: &[Matrix4<f64>; 6]| {
        let errors = found
            .iter()
            .zip(&products)
            .map(|(a, b)| largest_entry(a, b));
        errors.fold(0.0, f64::max)
    };
    trials.right("1", over_links(&expected));
    trials.right("2", over_links(&p.links));
    let of_pose = |wanted: &Matrix4<f64>| largest_entry(&p.frames[6], wanted);
    trials.right("3", of_pose(&p.pose));

    let off = |arm: Arm<f64>| (origin(&arm.base_from_flange(&p.q)) - p.target.p).norm();
    let without_d6 = Arm { d6: 0.0, ..arm };
    let positive = arm.with_positive_lengths();
    trials.add("Table 1, d6", [off(without_d6), off(arm)]);
    trials.add("Table 1, signs", [off(positive), off(arm)]);

    let mut printed = p.pose;
    printed[(2, 1)] = p.target.a.z;
    trials.add("4", [of_pose(&printed), of_pose(&p.pose)]);
    trials.right("5, 6", of_pose(&p.pose));
    let links = p.links[1..].iter();
    let from_joints = links.fold(Matrix4::identity(), |product, link| product * link);
    let from_pose = inverse(&p.links[0]) * p.pose;
    trials.right("7, 8", largest_entry(&from_joints, &from_pose));
}

/// Equations 9 to 19: `q1`, `q5`, `q6`, and the sum of joints 2 to 4.
fn shoulder_and_wrist(p: &Posture, trials: &mut Trials) {
    let (target, q) = (&p.target, &p.q);
    let error = either_sign(|sign| angle_error(q1(&p.arm, target, sign), q[0]));
    trials.right("9", error);
    let error = either_sign(|sign| angle_error(q5(target, q[0], sign), q[4]));
    trials.right("10", error);
    let errors = [false, true].map(|mended| angle_error(q6(target, q[0], q[4], mended), q[5]));
    trials.add("11", errors);

    let [_, _, _, _, fifth, sixth] = &p.links;
    let from_target = p.pose * inverse(sixth) * inverse(fifth);
    let frame = &p.frames[4];
    trials.right("12, 13", largest_entry(frame, &from_target));
    trials.right("14", (frame[(2, 0)] - libm::sin(p.q234())).abs());
    trials.right("15", (frame[(2, 2)] + libm::cos(p.q234())).abs());
    trials.right("16", (entry_31(target, q[4], q[5]) - frame[(2, 0)]).abs());
    trials.right("17", (entry_33(target, q[5]) - frame[(2, 2)]).abs());
    let errors = [frame, &from_target]
        .map(|frame| angle_error(libm::atan2(frame[(2, 0)], -frame[(2, 2)]), p.q234()));
    trials.right("18", errors[0].max(errors[1]));
    trials.right("19", angle_error(q234(target, q[4], q[5]), p.q234()));
}

/// Equations 27 and 28, right sides, m: how far ahead and up the two links reach.
fn two_links(arm: &Arm<f64>, q2: f64, q3: f64) -> [f64; 2] {
    let [(s2, c2), (s23, c23)] = [q2, q2 + q3].map(libm::sincos);
    [arm.a2 * c2 + arm.a3 * c23, arm.a2 * s2 + arm.a3 * s23]
}

/// Equations 20 to 38: frame 4, where it lies in the plane of the arm, and `q3`, `q2` and `q4`.
fn arm_plane(p: &Posture, trials: &mut Trials) {
    let (arm, [first, second, third, ..]) = (&p.arm, p.q);
    let p4 = p4(arm, &p.target, p.q[5]);
    let frame_4 = origin(&p.frames[4]);
    for (number, axis) in [("20", 0), ("21", 1), ("22", 2)] {
        trials.right(number, (p4[axis] - frame_4[axis]).abs());
    }
    let distance = libm::hypot(frame_4.x, frame_4.y);
    trials.right("23", (l(&p4) - distance).abs());

    // As printed, and with its sign.
    let reach = [r1_printed(arm, &p4), r1(&p4, first)];
    let up = r2(arm, &p4);
    let from_shoulder = origin(&p.frames[3]) - origin(&p.frames[1]);
    let (s1, c1) = libm::sincos(first);
    let [true_reach, true_up] = [from_shoulder.x * c1 + from_shoulder.y * s1, from_shoulder.z];
    trials.add("24", reach.map(|r1| (r1 - true_reach).abs()));
    trials.right("25", (up - true_up).abs());
    let r3 = (reach[0] * reach[0] + up * up).sqrt();
    trials.right("26", (r3 - from_shoulder.norm()).abs());
    let links = two_links(arm, second, third);
    trials.add("27", reach.map(|r1| (r1 - links[0]).abs()));
    trials.right("28", (up - links[1]).abs());

    let (a2, a3, sum) = (arm.a2, arm.a3, second + third);
    let left = reach[0] * reach[0] + up * up - (a2 * a2 + a3 * a3);
    let [(s2, c2), (s23, c23)] = [second, sum].map(libm::sincos);
    let middle = 2.0 * a2 * a3 * (c23 * c2 + s23 * s2);
    let right = 2.0 * a2 * a3 * libm::cos(sum - second);
    trials.right("29", (left - middle).abs().max((middle - right).abs()));
    let cosine = libm::cos(third);
    trials.right("30", (libm::cos(sum - second) - cosine).abs());
    let found = c3(arm, reach[0], up);
    trials.right("31", (found - cosine).abs());
    let root = (1.0 - found * found).sqrt();
    let error = either_sign(|sign| (sign * root - libm::sin(third)).abs());
    trials.right("32", error);
    let error = either_sign(|sign| angle_error(q3(found, sign), third));
    trials.right("33", error);

    let true_alpha = libm::atan2(true_up, true_reach);
    let errors = reach.map(|r1| angle_error(alpha(r1, up), true_alpha));
    trials.add("34", errors);
    // One argument without its comma, read as an arc tangent.
    let without_comma = libm::atan(a3 * libm::sin(third) * a2 + a3 * cosine);
    let errors = [without_comma, beta(arm, third)];
    let errors = errors.map(|beta| angle_error(beta, true_alpha - second));
    trials.add("35", errors);
    let errors = reach.map(|r1| angle_error(alpha(r1, up) - beta(arm, third), second));
    trials.add("36", errors);
    indices(p, trials);

    let [reach_back, up_again] = {
        let [q2, q3] = mirrored([second, third]);
        two_links(arm, q2, q3)
    };
    let error = (links[0] + reach_back)
        .abs()
        .max((links[1] - up_again).abs());
    trials.right("37", error);
    // The better sign of the elbow, from the unsigned r1.
    let with_mirror = |mirror: bool| {
        either_sign(|sign| {
            let q3 = q3(found, sign);
            let joints = [alpha(reach[0], up) - beta(arm, q3), q3];
            let [q2, q3] = if mirror { mirrored(joints) } else { joints };
            angle_error(q2, second).max(angle_error(q3, third))
        })
    };
    let is_left =
        Configuration::of(&UrGeometry::UR3, &Joints::from(p.q)).shoulder == Shoulder::Left;
    trials.add("37, rule", [is_left, reach[1] < 0.0].map(with_mirror));

    // `q4` as the paper's own steps give it for the branch of the posture.
    let q3 = third * reach[1].signum();
    let joints = [alpha(reach[1].abs(), up) - beta(arm, q3), q3];
    let [q2, q3] = if reach[1] < 0.0 {
        mirrored(joints)
    } else {
        joints
    };
    let unwrapped = q234(&p.target, p.q[4], p.q[5]) - q3 - q2;
    // Error of an angle, or how far it lies outside the joint's range.
    let beyond = |angle: f64, range: f64| {
        let beyond = (angle.abs() - range).max(0.0);
        beyond.max(angle_error(angle, p.q[3]))
    };
    trials.add(
        "38",
        [beyond(unwrapped, TAU), beyond(wrap_angle(unwrapped), PI)],
    );
}

/// Rows 3 and 4 of Table 2, with everything right but the indices of beta: the worse of the two poses that they
/// give, where both shoulders reach the pose with the wrists that the table calls folded.
fn indices(p: &Posture, trials: &mut Trials) {
    let arm = &p.arm;
    let sides = [(Shoulder::Right, 1.0), (Shoulder::Left, -1.0)];
    let sides =
        sides.map(|(shoulder, sign)| Side::new(arm, &p.target, shoulder, sign, Mended::ALL));
    if !sides.iter().all(|side| side.q3(arm, 1.0).is_finite()) {
        return;
    }
    let left = &sides[1];
    let errors = sides.map(|side_of_beta| {
        let errors = [1.0, -1.0].map(|sign| {
            let beta = beta(arm, side_of_beta.q3(arm, sign));
            let joints = left.joints([alpha(left.r1, left.r2) - beta, left.q3(arm, sign)]);
            largest_entry(&arm.base_from_flange(&joints), &p.pose)
        });
        errors[0].max(errors[1])
    });
    // The poses carry the lost digits of q1 near the shoulder's singularity.
    trials.add("36, indices", errors);
}

/// Spacing of the difference quotients, rad: their truncation (`h^4/30`) and rounding (`eps/h`)
/// are both below 1e-12.
const DIFFERENCE_RAD: f64 = 2e-3;

/// Velocity of the flange for unit speed along `direction`, from positions alone: m and rad per
/// unit.
fn velocity_by_differences(p: &Posture, direction: &[f64; 6]) -> Vector6<f64> {
    let at = |steps: f64| {
        let moved = std::array::from_fn(|i| p.q[i] + steps * DIFFERENCE_RAD * direction[i]);
        p.arm.base_from_flange(&moved)
    };
    let rate = (at(-2.0) - at(2.0) + (at(1.0) - at(-1.0)) * 8.0) / (12.0 * DIFFERENCE_RAD);
    let spin = rotation(&rate) * rotation(&p.frames[6]).transpose();
    // Skew but for rounding: both entries of each pair say the same.
    stacked(origin(&rate), (vee(&spin) - vee(&spin.transpose())) * 0.5)
}

/// Size of the steps with which the first-order equations are tried, rad.
const SMALL_STEP_RAD: f64 = 1e-4;
/// Guess for one step of equation 47, rad: small enough that a right step leaves next to nothing.
const GUESS_RAD: f64 = 1e-3;

/// Equations 39 to 47: the Jacobian, and one step of the numerical method.
fn differential(p: &Posture, trials: &mut Trials) {
    let found = jacobian(&p.frames);
    let velocities: [Vector6<f64>; 6] = std::array::from_fn(|joint| {
        velocity_by_differences(p, &std::array::from_fn(|i| f64::from(i == joint)))
    });
    let expected = Matrix6::from_columns(&velocities);
    let errors = [jacobian_printed(&p.frames), found].map(|found| (found - expected).amax());
    trials.add("39", errors);
    // A sixth, so that the joints together turn no more than one alone does above.
    let speed = p.step.map(|each| each / 6.0);
    let error = found * Vector6::from(speed) - velocity_by_differences(p, &speed);
    trials.right("40", error.amax());

    // Errors of first order are over the size of the step.
    let wanted = p.arm.base_from_flange(&p.moved(SMALL_STEP_RAD));
    let difference = pose_difference(&wanted, &p.frames[6], turn);
    let step = Vector6::from(p.step) * SMALL_STEP_RAD;
    let left = found * step - difference;
    trials.right("41", left.amax() / SMALL_STEP_RAD);
    let regular = well_conditioned(&p.q);
    if regular {
        let steps = found.lu().solve(&difference);
        let error = steps.map_or(f64::NAN, |found| (found - step).amax() / SMALL_STEP_RAD);
        trials.right("42, 43", error);
    }
    let of_position = left.fixed_rows::<3>(0).amax() / SMALL_STEP_RAD;
    trials.right("44", of_position);

    // Over the whole sphere of rotations: R_d = exp(w) R_0.
    let actual = rotation(&p.frames[6]);
    let wanted = Rotation3::new(p.turn).into_inner() * actual;
    let turns = [turn_printed as Turn, turn];
    trials.add(
        "45",
        turns.map(|turn| (turn(&wanted, &actual) - p.turn).norm()),
    );
    let skew = p.turn.cross_matrix();
    let v = Vector3::from_column_slice(&p.step[..3]);
    let error = (skew * v - p.turn.cross(&v)).amax();
    trials.right("46", error.max((vee(&skew) - p.turn).amax()));
    if regular {
        let frames = p.arm.frames(&p.moved(GUESS_RAD));
        let before = Vector6::from(p.step) * GUESS_RAD;
        // Joint error after a step over that before it.
        let left = |(jacobian, turn): (Jacobian, Turn)| {
            let difference = pose_difference(&p.pose, &frames[6], turn);
            let step = pseudo_inverse_step(&jacobian(&frames), &difference);
            (before + step).amax() / before.amax()
        };
        let forms = [
            (jacobian_printed as Jacobian, turn_printed as Turn),
            (jacobian, turn),
        ];
        trials.add("47", forms.map(left));
    }
}

/// The pseudo-inverse, and where the arm is singular, at a posture where it is.
fn singular(p: &Posture, trials: &mut Trials) {
    let jacobian = jacobian(&p.frames);
    // How well a step explains a difference of poses that can be reached.
    let dx = jacobian * Vector6::from(p.step);
    let error = |step: Vector6<f64>| (jacobian * step - dx).amax();
    let printed = printed_pseudo_inverse_step(&jacobian, &dx).map_or(f64::NAN, error);
    let mended = error(pseudo_inverse_step(&jacobian, &dx));
    trials.add("J⁺", [printed, mended]);

    // A posture that is singular although S5 says that it is not.
    let values = jacobian.singular_values();
    let missed = libm::sin(p.q[4]).abs() > 1e-3 && values.min() / values.max() < 1e-12;
    let [reach, _] = two_links(&p.arm, p.q[1], p.q[2]);
    let forward = reach + p.arm.d5 * libm::sin(p.q234());
    let product = p.arm.a2 * p.arm.a3 * libm::sin(p.q[2]) * libm::sin(p.q[4]) * forward;
    let error = (jacobian.determinant().abs() - product.abs()).abs();
    trials.add("singularities", [f64::from(missed), error]);
}

/// Singular postures are fewer: each needs a singular value decomposition or two.
const SINGULAR_SHARE: usize = 10;

/// Seed of the random postures.
pub const SEED: u64 = 20260101;

/// Tests every equation on `count` random postures.
pub fn evaluate(count: usize, watch: &Watch<'_>) -> Vec<EquationReport> {
    let mut equations: Vec<EquationReport> =
        serde_json::from_str(include_str!("equations.json")).expect("a list of equations");
    let mut trials = Trials::default();
    let mut random = SplitMix64::new(SEED);
    let mut posture = |set: PoseSet| {
        let q = set.sample(&UrGeometry::UR3, &mut random, 0.0);
        Posture::new(&q, &mut random)
    };
    for _ in watch.each(0..count) {
        let posture = posture(PoseSet::Generic);
        for group in [forward, shoulder_and_wrist, arm_plane, differential] {
            group(&posture, &mut trials);
        }
    }
    for index in watch.each(0..count / SINGULAR_SHARE) {
        let set = [PoseSet::Wrist, PoseSet::Elbow, PoseSet::Shoulder][index % 3];
        singular(&posture(set), &mut trials);
    }
    for equation in &mut equations {
        let [printed, mended] = trials.0.remove(&*equation.number).unwrap_or_default();
        let bounds = BOUNDS.iter().find(|(name, _)| *name == equation.bounds);
        let (_, [tolerance, failure_bound]) = *bounds.expect("one of the bounds");
        equation.postures = mended.len();
        equation.printed = Errors::new(&printed, failure_bound);
        equation.corrected = Errors::new(&mended, tolerance);
        (equation.tolerance, equation.failure_bound) = (tolerance, failure_bound);
        // An untested equation fails.
        equation.holds = !mended.is_empty() && equation.corrected.failing == 0.0;
    }
    equations
}

/// Error of equation 45 as printed at one angle.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct TurnReport {
    pub angle_rad: f64,
    /// Largest error over the angle, over axes all round.
    pub worst_relative_error: f64,
    /// Smallest length of what it takes for the rotation vector, rad: zero is a false solution.
    pub least_length_rad: f64,
}

/// Tests equation 45 as printed on rotations by 10, 90 and 120 degrees.
pub fn turns_as_printed() -> [TurnReport; 3] {
    const AXES: usize = 10_000;
    let mut random = SplitMix64::new(SEED + 11);
    // The diagonal is the worst axis: a third of a turn about it swaps the axes.
    let diagonal = -Vector3::repeat(3.0_f64.sqrt().recip());
    let others = (0..AXES).map(|_| random_axis(&mut random));
    let axes: Vec<Vector3<f64>> = std::iter::once(diagonal).chain(others).collect();
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
}
