//! Postures of a nominal arm by shoulder, elbow and `q2 + q3 + q4`, corrected for a calibration.
//!
//! With those three given, the closed form places five of the pose's six degrees of freedom at
//! every pose, singular ones included: `q1` by equation 9, wrist 1 a length `d5` from the wrist
//! centre along the axis of joint 5, `q2` and `q3` by equations 31 to 36, and `q5` and `q6` by the
//! rotation that is left. What is left over is whether the axis of joint 5 stands square to the
//! flange's: one number, whose zeros are the solutions.
//!
//! A calibrated arm is brought under this form by a corrected pose: the one that the nominal arm
//! has where the calibrated one has the wanted pose. It depends on the posture, but slowly, so that
//! a step or two from the correction of a neighbour settles it.

use std::sync::LazyLock;

use fearless_simd::prelude::*;
use fearless_simd::{Level, dispatch};

use super::super::numerical::{Numerical, Placed};
use crate::ik::fused::Fused as _;
use crate::{JOINT_COUNT, Joints, Pose, UrGeometry};

/// Vector instructions of this machine, found once.
static LEVEL: LazyLock<Level> = LazyLock::new(Level::new);

/// Postures of a block.
pub(super) const BLOCK: usize = 8;

/// One value for each.
pub(super) type Lanes = [f64; BLOCK];

/// One wanted pose seen from one shoulder.
pub(super) struct Chart<'a> {
    numerical: &'a Numerical,
    geometry: &'a UrGeometry,
    /// In the controller's base frame.
    pub wanted: Placed<f64>,
    /// Sign of the wrist centre's way ahead.
    pub shoulder: f64,
}

/// Postures side by side.
#[derive(Debug, Clone, Copy)]
pub(super) struct Block {
    /// Which: sign of `sin q3`, cosine and sine of `q2 + q3 + q4`.
    pub elbow: Lanes,
    pub cos_234: Lanes,
    pub sin_234: Lanes,
    /// What the nominal arm would have to reach if the calibration did everywhere the same as at
    /// these postures. On input, a neighbour's.
    pub corrected: Placed<Lanes>,
    pub cosines: [Lanes; JOINT_COUNT],
    pub sines: [Lanes; JOINT_COUNT],
    /// Cosine of the angle between the axis of joint 5 and the flange's; zero at a solution.
    pub askew: Lanes,
}

impl Block {
    /// Of no posture yet, near one pose.
    pub(super) fn near(pose: &Placed<f64>) -> Self {
        let zero = [0.0; BLOCK];
        Self {
            elbow: zero,
            cos_234: zero,
            sin_234: zero,
            corrected: Placed {
                columns: pose.columns.map(|column| column.map(|x| [x; BLOCK])),
                position: pose.position.map(|x| [x; BLOCK]),
            },
            cosines: [zero; JOINT_COUNT],
            sines: [zero; JOINT_COUNT],
            askew: zero,
        }
    }

    pub(super) fn joints(&self, lane: usize) -> Joints {
        Joints::from_fn(|i, _| libm::atan2(self.sines[i][lane], self.cosines[i][lane]))
    }

    pub(super) fn corrected(&self, lane: usize) -> Placed<f64> {
        Placed {
            columns: self.corrected.columns.map(|column| column.map(|x| x[lane])),
            position: self.corrected.position.map(|x| x[lane]),
        }
    }
}

/// The wrist centre for one shoulder.
#[derive(Debug, Clone, Copy)]
pub(super) struct Centre {
    /// `rho^2 - d4^2`, m^2.
    pub root_squared: f64,
    /// Height over the shoulder, m.
    pub up: f64,
}

/// Vectors across lanes.
struct Posture<V> {
    cosines: [V; JOINT_COUNT],
    sines: [V; JOINT_COUNT],
    askew: V,
    corrected: Placed<V>,
}

#[inline(always)]
fn dot<S: Simd, V: SimdFloat<S, Element = f64>>(a: &[V; 3], b: &[V; 3]) -> V {
    a[0].fused(b[0], a[1].fused(b[1], a[2] * b[2]))
}

/// A sum of three vectors with their factors. No closures here: they are not inlined into vector
/// code.
#[inline(always)]
fn mixed<S: Simd, V: SimdFloat<S, Element = f64>>(v: &[[V; 3]; 3], by: [V; 3]) -> [V; 3] {
    [
        by[0].fused(v[0][0], by[1].fused(v[1][0], by[2] * v[2][0])),
        by[0].fused(v[0][1], by[1].fused(v[1][1], by[2] * v[2][1])),
        by[0].fused(v[0][2], by[1].fused(v[1][2], by[2] * v[2][2])),
    ]
}

/// `wanted actual^T v`.
#[inline(always)]
fn through<S: Simd, V: SimdFloat<S, Element = f64>>(
    wanted: &[[f64; 3]; 3],
    actual: &[[V; 3]; 3],
    v: &[V; 3],
) -> [V; 3] {
    let (x, y, z) = (dot(&actual[0], v), dot(&actual[1], v), dot(&actual[2], v));
    [
        x * wanted[0][0] + y * wanted[1][0] + z * wanted[2][0],
        x * wanted[0][1] + y * wanted[1][1] + z * wanted[2][1],
        x * wanted[0][2] + y * wanted[1][2] + z * wanted[2][2],
    ]
}

/// By half a turn about z.
#[inline(always)]
fn turned<S: Simd, V: SimdFloat<S, Element = f64>>(v: &[V; 3]) -> [V; 3] {
    [-v[0], -v[1], v[2]]
}

/// A direction; zeros where there is none.
#[inline(always)]
fn unit<S: Simd, V: SimdFloat<S, Element = f64>>(simd: S, x: V, y: V) -> (V, V) {
    let squared = x.fused(x, y * y).max(V::splat(simd, f64::MIN_POSITIVE));
    let inverse = V::splat(simd, 1.0) / squared.sqrt();
    (x * inverse, y * inverse)
}

impl<'a> Chart<'a> {
    /// `base_from_flange` in the controller's base frame.
    pub(super) fn new(
        numerical: &'a Numerical,
        geometry: &'a UrGeometry,
        base_from_flange: &Pose,
        shoulder: f64,
    ) -> Self {
        let rotation = base_from_flange.rotation.to_rotation_matrix().into_inner();
        Self {
            numerical,
            geometry,
            wanted: Placed {
                columns: std::array::from_fn(|i| rotation.column(i).into_owned().into()),
                position: base_from_flange.translation.vector.into(),
            },
            shoulder,
        }
    }

    /// Where the nominal arm would have the wrist centre.
    pub(super) fn centre(&self) -> Centre {
        let (g, a) = (self.geometry, &self.wanted.columns[2]);
        let [x, y, z]: [f64; 3] = std::array::from_fn(|i| self.wanted.position[i] - g.d6 * a[i]);
        Centre {
            root_squared: (x * x + y * y) - g.d4 * g.d4,
            up: z - g.d1,
        }
    }

    /// Fills in postures and corrections of a block, in so many rounds.
    pub(super) fn settle(&self, block: &mut Block, rounds: u32) {
        dispatch!(*LEVEL, simd => self.settle_at(simd, block, rounds));
    }

    #[inline(always)]
    fn settle_at<S: Simd>(&self, simd: S, block: &mut Block, rounds: u32) {
        let width = <S as Simd>::f64s::LEN;
        for first in (0..BLOCK).step_by(width) {
            let load =
                |lanes: &Lanes| <S as Simd>::f64s::from_slice(simd, &lanes[first..first + width]);
            let load_3 = |v: &[Lanes; 3]| [load(&v[0]), load(&v[1]), load(&v[2])];
            let Placed { columns, position } = &block.corrected;
            let mut pose = Placed {
                columns: [
                    load_3(&columns[0]),
                    load_3(&columns[1]),
                    load_3(&columns[2]),
                ],
                position: load_3(position),
            };
            let place = [
                load(&block.elbow),
                load(&block.cos_234),
                load(&block.sin_234),
            ];
            let mut left = rounds;
            // Stands here once: it is long, and compiled for each kind of processor.
            let posture = loop {
                let posture = self.posture(simd, &pose, &place);
                left = left.saturating_sub(1);
                if left == 0 {
                    break posture;
                }
                pose = posture.corrected;
            };
            let store = |value: &<S as Simd>::f64s, lanes: &mut Lanes| {
                value.store_slice(&mut lanes[first..first + width]);
            };
            for i in 0..JOINT_COUNT {
                store(&posture.cosines[i], &mut block.cosines[i]);
                store(&posture.sines[i], &mut block.sines[i]);
            }
            store(&posture.askew, &mut block.askew);
            for i in 0..3 {
                store(
                    &posture.corrected.position[i],
                    &mut block.corrected.position[i],
                );
                for k in 0..3 {
                    store(
                        &posture.corrected.columns[i][k],
                        &mut block.corrected.columns[i][k],
                    );
                }
            }
        }
    }

    /// The postures of places at corrected poses, and the corrections there.
    #[inline(always)]
    fn posture<S: Simd, V: SimdFloat<S, Element = f64>>(
        &self,
        simd: S,
        pose: &Placed<V>,
        [elbow, c234, s234]: &[V; 3],
    ) -> Posture<V> {
        let g = self.geometry;
        let splat = |value: f64| V::splat(simd, value);
        let zero = splat(0.0);
        let (c234, s234) = (*c234, *s234);
        let Placed {
            columns: [n, o, a],
            position: p,
        } = pose;
        // Equation 9, its root clamped.
        let [x, y, z] = [p[0] - a[0] * g.d6, p[1] - a[1] * g.d6, p[2] - a[2] * g.d6];
        let root_squared = x.fused(x, y * y) - splat(g.d4 * g.d4);
        let forward = root_squared.max(zero).sqrt() * self.shoulder;
        let (c1, s1) = unit(
            simd,
            forward.fused(x, -(y * g.d4)),
            forward.fused(y, x * g.d4),
        );
        // The arm's plane: its normal, the axis of joint 5, and the third.
        let axis = [s1, -c1, zero];
        let along = [-(s234 * c1), -(s234 * s1), c234];
        let third = [-(c1 * c234), -(s1 * c234), -s234];
        let (ahead, up) = (forward - s234 * g.d5, z - splat(g.d1) + c234 * g.d5);
        let reach_squared = ahead.fused(ahead, up * up);
        let scale = 1.0 / (2.0 * g.a2 * g.a3);
        let one_minus = (splat((g.a2 + g.a3).powi(2)) - reach_squared) * scale;
        let one_plus = (reach_squared - splat((g.a2 - g.a3).powi(2))) * scale;
        let c3 = ((one_plus - one_minus) * 0.5)
            .max(splat(-1.0))
            .min(splat(1.0));
        let s3 = (one_minus * one_plus).max(zero).sqrt() * *elbow;
        let (bx, by) = (c3 * g.a3 + splat(g.a2), s3 * g.a3);
        let (c2, s2) = unit(simd, ahead.fused(bx, up * by), up.fused(bx, -(ahead * by)));
        let (c23, s23) = (c2.fused(c3, -(s2 * s3)), s2.fused(c3, c2 * s3));
        let (c4, s4) = (c234.fused(c23, s234 * s23), s234.fused(c23, -(c234 * s23)));
        let (c6, s6) = unit(simd, dot(o, &along), dot(n, &along));
        let s5 = dot(n, &axis).fused(c6, -(dot(o, &axis) * s6));
        let (c5, s5) = unit(simd, dot(a, &axis), s5);
        let cosines = [c1, c2, c3, c4, c5, c6];
        let sines = [s1, s2, s3, s4, s5, s6];
        // Where the nominal arm is at these joints.
        let frame = [axis, along, third];
        let nominal_columns = [
            mixed(&frame, [s5 * c6, s6, -(c5 * c6)]),
            mixed(&frame, [-(s5 * s6), c6, c5 * s6]),
            mixed(&frame, [c5, zero, s5]),
        ];
        let (out, high) = (c2 * g.a2 + c23 * g.a3, s2 * g.a2 + s23 * g.a3);
        let end = &nominal_columns[2];
        let nominal_position = [
            c1 * out + axis[0] * g.d4 - along[0] * g.d5 + end[0] * g.d6,
            s1 * out + axis[1] * g.d4 - along[1] * g.d5 + end[1] * g.d6,
            high + splat(g.d1) - along[2] * g.d5 + end[2] * g.d6,
        ];
        // `base_link` is `base` turned by half a turn about z.
        let actual = self.numerical.placed(simd, &cosines, &sines);
        let [x, y, z] = &actual.columns;
        let actual_columns = [turned(x), turned(y), turned(z)];
        let actual_position = turned(&actual.position);
        // wanted (actual^T nominal), column by column.
        let wanted = self.wanted.columns;
        let columns = [
            through(&wanted, &actual_columns, &nominal_columns[0]),
            through(&wanted, &actual_columns, &nominal_columns[1]),
            through(&wanted, &actual_columns, &nominal_columns[2]),
        ];
        let wanted = self.wanted.position;
        let position = [
            splat(wanted[0]) + (nominal_position[0] - actual_position[0]),
            splat(wanted[1]) + (nominal_position[1] - actual_position[1]),
            splat(wanted[2]) + (nominal_position[2] - actual_position[2]),
        ];
        Posture {
            cosines,
            sines,
            askew: dot(a, &along),
            corrected: Placed { columns, position },
        }
    }
}
