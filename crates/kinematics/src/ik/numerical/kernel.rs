//! Fast forward kinematics and Jacobian of a chain of six revolute joints.
//!
//! Each fixed transform between two joints is brought to Hayati's form, a turn about the first
//! axis, a shift, a twist about x, and a turn about the second axis. The turns join the joints'
//! own, so that a joint costs two plane rotations.

use std::f64::consts::{FRAC_2_PI, FRAC_PI_2, PI};

use fearless_simd::prelude::*;
use nalgebra::{Matrix3, Matrix6, Rotation3, Vector3, Vector6};

use crate::chain::stacked;
use crate::ik::closed_form::TWICE_ATAN;
use crate::ik::fused::Fused as _;
use crate::{Chain, JOINT_COUNT, Joints, Pose};

/// Sines and cosines, within one unit in the last place of one for angles up to 100 rad
/// (`sines_and_cosines_are_right`); by the standard library beyond.
///
/// Reduction by Cody and Waite with pi/2 in three parts, and the polynomials of Sun's fdlibm.
#[inline(always)]
pub(in super::super) fn sin_cos<const N: usize>(angles: &[f64; N]) -> ([f64; N], [f64; N]) {
    const LARGEST_RAD: f64 = 100.0;
    /// Adding it rounds to an integer, found in the low bits.
    const ROUND: f64 = 6_755_399_441_055_744.0;
    const FIRST: f64 = 1.570_796_326_734_125_6;
    const SECOND: f64 = 6.077_100_506_303_966e-11;
    const THIRD: f64 = 2.022_266_248_795_950_6e-21;
    let (mut sines, mut cosines) = ([0.0; N], [0.0; N]);
    // Written so that NaN counts as large.
    if !angles.iter().all(|angle| angle.abs() <= LARGEST_RAD) {
        for i in 0..N {
            (sines[i], cosines[i]) = libm::sincos(angles[i]);
        }
        return (sines, cosines);
    }
    for i in 0..N {
        let shifted = angles[i] * FRAC_2_PI + ROUND;
        let quadrant = shifted.to_bits();
        let quarters = shifted - ROUND;
        let coarse = angles[i] - quarters * FIRST;
        let fine = quarters * SECOND;
        let high = coarse - fine;
        let low = ((coarse - high) - fine) - quarters * THIRD;
        let r = high + low;
        let r_low = (high - r) + low;
        let z = r * r;
        let z2 = z * z;
        let sine_tail = (8.333_333_333_322_49e-3 + z * -1.984_126_982_985_795e-4)
            + z2 * ((2.755_731_370_707_007e-6 + z * -2.505_076_025_340_686_3e-8)
                + z2 * 1.589_690_995_211_55e-10);
        let cosine_tail = (4.166_666_666_666_66e-2 + z * -1.388_888_888_887_411e-3)
            + z2 * ((2.480_158_728_947_673e-5 + z * -2.755_731_435_139_066_3e-7)
                + z2 * (2.087_572_321_298_175e-9 + z * -1.135_964_755_778_819_5e-11));
        let cube = z * r;
        let sine = r
            - ((z * (0.5 * r_low - cube * sine_tail) - r_low) + cube * 1.666_666_666_666_663_2e-1);
        let half = 0.5 * z;
        let near_one = 1.0 - half;
        let cosine = near_one + (((1.0 - near_one) - half) + (z * (z * cosine_tail) - r * r_low));
        // Odd quadrants swap sine and cosine; bit 1 is the sign.
        let swap = 0_u64.wrapping_sub(quadrant & 1);
        let (sine_bits, cosine_bits) = (sine.to_bits(), cosine.to_bits());
        let sine_bits_out = (sine_bits & !swap) | (cosine_bits & swap);
        let cosine_bits_out = (cosine_bits & !swap) | (sine_bits & swap);
        sines[i] = f64::from_bits(sine_bits_out ^ ((quadrant & 2) << 62));
        cosines[i] = f64::from_bits(cosine_bits_out ^ ((quadrant.wrapping_add(1) & 2) << 62));
    }
    (sines, cosines)
}

/// A vector turned by a matrix. Without closures, which are not inlined into vector code.
#[inline(always)]
fn rotated<S: Simd, V: SimdFloat<S, Element = f64>>(m: &Matrix3<f64>, v: &[V; 3]) -> [V; 3] {
    [
        v[0] * m[(0, 0)] + v[1] * m[(0, 1)] + v[2] * m[(0, 2)],
        v[0] * m[(1, 0)] + v[1] * m[(1, 1)] + v[2] * m[(1, 2)],
        v[0] * m[(2, 0)] + v[1] * m[(2, 1)] + v[2] * m[(2, 2)],
    ]
}

/// A sum of three vectors with their factors.
#[inline(always)]
fn mixed<S: Simd, V: SimdFloat<S, Element = f64>>(v: &[[V; 3]; 3], by: [f64; 3]) -> [V; 3] {
    [
        v[0][0] * by[0] + v[1][0] * by[1] + v[2][0] * by[2],
        v[0][1] * by[0] + v[1][1] * by[1] + v[2][1] * by[2],
        v[0][2] * by[0] + v[1][2] * by[1] + v[2][2] * by[2],
    ]
}

/// A chain prepared for fast evaluation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Kernel {
    /// Cosine and sine of the turn added to each joint's own.
    turn_cos: [f64; JOINT_COUNT],
    turn_sin: [f64; JOINT_COUNT],
    /// Cosine and sine of the twist after each joint.
    twist: [(f64, f64); JOINT_COUNT],
    /// Shift after each joint, before the twist, m.
    arm: [Vector3<f64>; JOINT_COUNT],
    base_rotation: Matrix3<f64>,
    base_position: Vector3<f64>,
    tool_rotation: Matrix3<f64>,
    /// Sum of the shifts' lengths, m.
    pub reach_m: f64,
}

/// A pose seen from the first joint, with the tool's own rotation taken off.
#[derive(Debug, Clone, Copy)]
pub(in super::super) struct Target {
    rotation: Matrix3<f64>,
    position: Vector3<f64>,
}

/// A frame: the columns of its rotation, and its origin, m.
#[derive(Debug, Clone, Copy)]
pub(in super::super) struct Placed<V> {
    pub columns: [[V; 3]; 3],
    pub position: [V; 3],
}

/// The chain at some joint positions, seen from the first joint.
#[derive(Debug, Clone, Copy)]
pub(super) struct State {
    /// Geometric Jacobian: three rows in m/rad, three in rad/rad.
    pub jacobian: Matrix6<f64>,
    rotation: Matrix3<f64>,
    position: Vector3<f64>,
}

/// Cosine and sine of the direction `(x, y)`, with those within rounding of a right angle made
/// exact; `(1, 0)` where there is no direction.
fn direction(y: f64, x: f64) -> (f64, f64) {
    const ROUNDING: f64 = 5e-16;
    let length = libm::hypot(y, x);
    if length < 1e-15 {
        return (1.0, 0.0);
    }
    let snapped = |value: f64| {
        if value.abs() < ROUNDING {
            0.0
        } else if (value.abs() - 1.0).abs() < ROUNDING {
            value.signum()
        } else {
            value
        }
    };
    (snapped(x / length), snapped(y / length))
}

fn about_z((cosine, sine): (f64, f64)) -> Matrix3<f64> {
    Matrix3::new(cosine, -sine, 0.0, sine, cosine, 0.0, 0.0, 0.0, 1.0)
}

fn about_x((cosine, sine): (f64, f64)) -> Matrix3<f64> {
    Matrix3::new(1.0, 0.0, 0.0, 0.0, cosine, -sine, 0.0, sine, cosine)
}

impl Kernel {
    pub(super) fn new(chain: &Chain) -> Self {
        let mut rotations = [Matrix3::identity(); JOINT_COUNT];
        let mut positions = [Vector3::zeros(); JOINT_COUNT];
        let mut previous = Matrix3::identity();
        for (i, joint) in chain.joints.iter().enumerate() {
            // Frames whose z axes are the joint axes.
            let aligned = Rotation3::rotation_between(&Vector3::z(), &joint.axis).map_or_else(
                || Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, -1.0)),
                Rotation3::into_inner,
            );
            let origin = &joint.parent_from_joint;
            rotations[i] = previous * origin.rotation.to_rotation_matrix().into_inner() * aligned;
            positions[i] = previous * origin.translation.vector;
            previous = aligned.transpose();
        }
        let tool = &chain.wrist_3_from_flange;
        let tool_rotation = previous * tool.rotation.to_rotation_matrix().into_inner();
        let tool_position = previous * tool.translation.vector;
        let mut turns = [Matrix3::identity(); JOINT_COUNT];
        let mut twist = [(1.0, 0.0); JOINT_COUNT];
        let mut arm = [Vector3::zeros(); JOINT_COUNT];
        for i in 1..JOINT_COUNT {
            let r = rotations[i];
            // The next axis is (sin a sin b, -cos a sin b, cos b).
            let sin_b = libm::hypot(r[(0, 2)], r[(1, 2)]);
            let a = direction(r[(0, 2)], -r[(1, 2)]);
            let a = if sin_b < 1e-15 { (1.0, 0.0) } else { a };
            let b = direction(sin_b, r[(2, 2)]);
            let rest = about_x(b).transpose() * about_z(a).transpose() * r;
            turns[i - 1] *= about_z(a);
            turns[i] = about_z(direction(rest[(1, 0)], rest[(0, 0)]));
            twist[i - 1] = b;
            arm[i - 1] = about_z(a).transpose() * positions[i];
        }
        arm[JOINT_COUNT - 1] = tool_position;
        let (mut turn_cos, mut turn_sin) = ([0.0; JOINT_COUNT], [0.0; JOINT_COUNT]);
        for i in 0..JOINT_COUNT {
            (turn_cos[i], turn_sin[i]) = direction(turns[i][(1, 0)], turns[i][(0, 0)]);
        }
        Self {
            turn_cos,
            turn_sin,
            twist,
            arm,
            base_rotation: rotations[0],
            base_position: positions[0],
            tool_rotation,
            reach_m: arm.iter().map(Vector3::norm).sum(),
        }
    }

    /// Prepares a pose in the chain's base.
    pub(super) fn target(&self, pose: &Pose) -> Target {
        let into_base = self.base_rotation.transpose();
        let rotation = pose.rotation.to_rotation_matrix().into_inner();
        Target {
            rotation: into_base * rotation * self.tool_rotation.transpose(),
            position: into_base * (pose.translation.vector - self.base_position),
        }
    }

    /// Forward kinematics from cosines and sines of the joints, in the chain's base, postures
    /// across lanes.
    #[inline(always)]
    pub(super) fn placed<S: Simd, V: SimdFloat<S, Element = f64>>(
        &self,
        simd: S,
        own_cos: &[V; JOINT_COUNT],
        own_sin: &[V; JOINT_COUNT],
    ) -> Placed<V> {
        let zero = V::splat(simd, 0.0);
        let one = V::splat(simd, 1.0);
        let (mut x, mut y, mut z) = ([one, zero, zero], [zero, one, zero], [zero, zero, one]);
        let mut p = [zero; 3];
        for i in 0..JOINT_COUNT {
            let c = own_cos[i] * self.turn_cos[i] - own_sin[i] * self.turn_sin[i];
            let s = own_sin[i] * self.turn_cos[i] + own_cos[i] * self.turn_sin[i];
            let shift = &self.arm[i];
            for k in 0..3 {
                let (xk, yk) = (x[k], y[k]);
                x[k] = c.fused(xk, s * yk);
                y[k] = c.fused(yk, -(s * xk));
                p[k] = p[k] + x[k] * shift[0] + y[k] * shift[1] + z[k] * shift[2];
            }
            if i + 1 < JOINT_COUNT {
                let (cosine, sine) = self.twist[i];
                for k in 0..3 {
                    let (yk, zk) = (y[k], z[k]);
                    y[k] = yk * cosine + zk * sine;
                    z[k] = zk * cosine - yk * sine;
                }
            }
        }
        let last = [
            rotated(&self.base_rotation, &x),
            rotated(&self.base_rotation, &y),
            rotated(&self.base_rotation, &z),
        ];
        let [px, py, pz] = rotated(&self.base_rotation, &p);
        let tool = &self.tool_rotation;
        let base = &self.base_position;
        Placed {
            columns: [
                mixed(&last, [tool[(0, 0)], tool[(1, 0)], tool[(2, 0)]]),
                mixed(&last, [tool[(0, 1)], tool[(1, 1)], tool[(2, 1)]]),
                mixed(&last, [tool[(0, 2)], tool[(1, 2)], tool[(2, 2)]]),
            ],
            position: [px + base[0], py + base[1], pz + base[2]],
        }
    }

    /// Forward kinematics and Jacobian.
    #[inline(always)]
    pub(super) fn state(&self, q: &Joints) -> State {
        let (own_sin, own_cos) = sin_cos::<JOINT_COUNT>(q.as_ref());
        let (mut x, mut y, mut z) = (Vector3::x(), Vector3::y(), Vector3::z());
        let mut position = Vector3::zeros();
        let (mut axes, mut origins) = ([z; JOINT_COUNT], [position; JOINT_COUNT]);
        for i in 0..JOINT_COUNT {
            let c = own_cos[i] * self.turn_cos[i] - own_sin[i] * self.turn_sin[i];
            let s = own_sin[i] * self.turn_cos[i] + own_cos[i] * self.turn_sin[i];
            (x, y) = (x * c + y * s, y * c - x * s);
            let shift = &self.arm[i];
            position += (x * shift[0] + y * shift[1]) + z * shift[2];
            if i + 1 < JOINT_COUNT {
                let (cosine, sine) = self.twist[i];
                (y, z) = (y * cosine + z * sine, z * cosine - y * sine);
                (axes[i + 1], origins[i + 1]) = (z, position);
            }
        }
        let mut jacobian = Matrix6::zeros();
        for i in 0..JOINT_COUNT {
            let linear = axes[i].cross(&(position - origins[i]));
            jacobian.set_column(i, &stacked(&linear, &axes[i]));
        }
        State {
            jacobian,
            rotation: Matrix3::from_columns(&[x, y, z]),
            position,
        }
    }
}

impl State {
    /// Position error (m) and rotation vector from here to the target (rad), by the log map.
    #[inline(always)]
    pub(super) fn error(&self, target: &Target) -> Vector6<f64> {
        let (here, there) = (&self.rotation, &target.rotation);
        let turn = |k| here.column(k).cross(&there.column(k));
        // Axis times sine, and cosine, of the angle between the two.
        let axial = (turn(0) + turn(1) + turn(2)) * 0.5;
        let along = |k| here.column(k).dot(&there.column(k));
        let trace = along(0) + along(1) + along(2);
        let cosine = 0.5 * (trace - 1.0);
        let sine_squared = axial.norm_squared();
        let angular = if cosine > 0.0 && sine_squared < 0.01 {
            axial * angle_over_sine(sine_squared)
        } else if cosine > -0.999 {
            let sine = sine_squared.sqrt();
            axial * (upper_angle(sine, cosine) / sine)
        } else {
            near_half_turn(target, self, &axial, cosine)
        };
        stacked(&(target.position - self.position), &angular)
    }
}

/// `asin(s) / s` for `s^2` below 0.01, by its series; error below 1e-17.
#[inline(always)]
fn angle_over_sine(s2: f64) -> f64 {
    const SERIES: [f64; 8] = [
        1.0,
        1.0 / 6.0,
        3.0 / 40.0,
        15.0 / 336.0,
        105.0 / 3456.0,
        945.0 / 42240.0,
        10395.0 / 599_040.0,
        135_135.0 / 9_676_800.0,
    ];
    SERIES.iter().rev().fold(0.0, |sum, term| term + s2 * sum)
}

/// Angle of `(cosine, sine)` with `sine >= 0`, rad; the length need not be one. As the closed form has it in lanes.
#[inline(always)]
fn upper_angle(sine: f64, cosine: f64) -> f64 {
    let length = (sine * sine + cosine * cosine).sqrt();
    let (x, flat) = (cosine.abs(), cosine.abs() >= sine);
    let t = x.min(sine) / (x.max(sine) + length);
    let t2 = t * t;
    let series = TWICE_ATAN
        .iter()
        .rev()
        .fold(0.0, |sum, term| term + t2 * sum);
    let from_axis = (t + t) + t * t2 * series;
    match (flat, cosine < 0.0) {
        (true, false) => from_axis,
        (true, true) => PI - from_axis,
        (false, false) => FRAC_PI_2 - from_axis,
        (false, true) => FRAC_PI_2 + from_axis,
    }
}

/// The rotation vector near half a turn, where the axis is lost in the antisymmetric part: from
/// the symmetric part, `cos I + (1 - cos) n n^T`.
#[cold]
#[inline(never)]
fn near_half_turn(
    target: &Target,
    state: &State,
    axial: &Vector3<f64>,
    cosine: f64,
) -> Vector3<f64> {
    let r = target.rotation * state.rotation.transpose();
    let most = r.diagonal().imax();
    let mut axis = Vector3::from_fn(|i, _| 0.5 * (r[(i, most)] + r[(most, i)]));
    axis[most] -= cosine;
    let angle = libm::atan2(axial.norm(), cosine);
    axis * angle.copysign(axis.dot(axial)) / axis.norm()
}

#[cfg(test)]
mod tests {
    use nalgebra::UnitQuaternion;

    use super::*;
    use crate::pose_sets::PoseSet;
    use crate::{UrGeometry, rotation_vector};
    use needlebench_numerics::random::SplitMix64;

    /// One unit in the last place of one; the worst over 1e6 angles is 1.2e-16.
    const SINE: f64 = 2.3e-16;

    /// Ten times the rounding of a chain of six, m and rad.
    const KINEMATICS: f64 = 1e-14;

    #[test]
    fn sines_and_cosines_are_right() {
        let mut random = SplitMix64::new(41);
        for count in 0..100_000 {
            let size = if count % 2 == 0 { 4.0 } else { 100.0 };
            let angle = random.uniform(-size, size);
            let (s, c) = sin_cos(&[angle; 8]);
            assert!((s[0] - libm::sin(angle)).abs() <= SINE, "{angle}");
            assert!((c[0] - libm::cos(angle)).abs() <= SINE, "{angle}");
        }
        let (s, _) = sin_cos(&[1e6, f64::NAN, 0.5, 0.0, 0.0, 0.0, 0.0, 0.0]);
        assert_eq!(s[0], libm::sin(1e6_f64));
        assert!(s[1].is_nan());
    }

    /// A chain with tilted axes, none of them z, and a tool.
    fn odd_chain() -> Chain {
        let mut chain = UrGeometry::UR3.chain();
        let mut random = SplitMix64::new(42);
        for joint in &mut chain.joints {
            let mut vector = || Vector3::from_fn(|_, _| random.uniform(-1.0, 1.0));
            joint.axis = nalgebra::Unit::new_normalize(vector());
            joint.parent_from_joint.rotation = UnitQuaternion::from_scaled_axis(vector());
        }
        chain.wrist_3_from_flange =
            Pose::new(Vector3::new(0.01, 0.02, 0.1), Vector3::new(0.2, 1.0, -0.3));
        chain
    }

    #[test]
    fn state_error_and_jacobian_are_the_chains() {
        let mut random = SplitMix64::new(43);
        for chain in [UrGeometry::UR3.chain(), odd_chain()] {
            let kernel = Kernel::new(&chain);
            for count in 0..2000 {
                let q = PoseSet::Generic.sample(&UrGeometry::UR3, &mut random, 0.0);
                let mut wanted = chain.base_link_from_flange(&PoseSet::Generic.sample(
                    &UrGeometry::UR3,
                    &mut random,
                    0.0,
                ));
                if count % 4 == 0 {
                    // Half a turn away, where the log map is delicate.
                    let axis = Vector3::from_fn(|_, _| random.uniform(-1.0, 1.0)).normalize();
                    let angle = PI - random.uniform(0.0, 1e-3) * random.uniform(0.0, 1.0);
                    wanted.rotation = UnitQuaternion::from_scaled_axis(axis * angle)
                        * chain.base_link_from_flange(&q).rotation;
                }
                let state = kernel.state(&q);
                let error = state.error(&kernel.target(&wanted));
                let actual = chain.base_link_from_flange(&q);
                let linear = wanted.translation.vector - actual.translation.vector;
                let angular = rotation_vector(&(wanted.rotation * actual.rotation.inverse()));
                let turned = |v: &Vector6<f64>, row| kernel.base_rotation * v.fixed_rows::<3>(row);
                assert!((turned(&error, 0) - linear).norm() < KINEMATICS);
                let gap = turned(&error, 3) - angular;
                // Half a turn either way is the same rotation.
                let turned_round = (gap.norm() - 2.0 * PI).abs() < 1e-6;
                assert!(
                    gap.norm() < 10.0 * KINEMATICS || turned_round,
                    "{}",
                    gap.norm()
                );
                for column in 0..JOINT_COUNT {
                    let (found, wanted) = (state.jacobian.column(column), chain.jacobian(&q));
                    for row in [0, 3] {
                        let gap =
                            turned(&found.into(), row) - wanted.fixed_view::<3, 1>(row, column);
                        assert!(gap.amax() < KINEMATICS);
                    }
                }
            }
        }
    }
}
