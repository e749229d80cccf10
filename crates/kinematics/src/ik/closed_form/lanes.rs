//! The closed form in vectors: branches of one pose side by side, or poses side by side.
//!
//! Every angle is carried as (cosine, sine) to the end, so that the eight solutions need 20
//! `atan2` and no sine or cosine. Nothing branches: a configuration that does not exist gets the
//! posture with its roots clamped to zero, and its bit is off.

use std::f64::consts::{PI, TAU};

use fearless_simd::prelude::*;
use fearless_simd::{f64x2, f64x4};

use super::atan2::{atan2, upper_half};
use super::{ClosedForm, Tolerance};
use crate::ik::fused::Fused as _;
use crate::{Pose, UrGeometry};

/// Lanes of the widest vectors.
const MOST_LANES: usize = 8;

/// Beyond these the signs that decide on branches are certain in double precision, and the rows'
/// residuals are at rounding level. With `root / d4 > 1e-4` the error of `q1` is below
/// `1e4 x 4 x 2^-53`, with `|s5| > 1e-4` that of `q6` below `1e-8`, and that of `1 -+ cos q3`
/// below `1e-7` (`bounds_of_the_fast_path_hold`).
const CERTAIN_ROOT: f64 = 1e-4;
const CERTAIN_S5: f64 = 1e-4;
const CERTAIN_C3: f64 = 1e-6;

/// Within a tolerance, which turns `q1` the farther the smaller the root is, fewer poses take the
/// careful path in all if roots count as certain only beyond this.
const CERTAIN_ROOT_WITHIN: f64 = 1e-2;

/// Off by no more than this, a squared norm is scaled to one exactly.
const CERTAIN_NORM: f64 = 2e-6;

/// A squared distance from the shoulder axis beyond this is that of no pose an arm is asked for, m^2.
const CERTAIN_RHO_SQUARED: f64 = 1e9;

/// Beyond which the signs are certain, and no branch exists within a tolerance.
#[derive(Debug, Clone, Copy)]
pub(super) struct Bounds {
    /// Of `rho^2 - d4^2`, m^2.
    root: (f64, f64),
    /// Of the lesser of `1 - cos q3` and `1 + cos q3`.
    closing: (f64, f64),
}

impl Bounds {
    pub(super) fn new(g: &UrGeometry, tolerance: Tolerance) -> Self {
        let certain_root = if tolerance.m > 0.0 {
            CERTAIN_ROOT_WITHIN
        } else {
            CERTAIN_ROOT
        };
        let root = (certain_root * g.d4).powi(2);
        // Next to the bounds of s5 and of the root, a tolerance turns q6 and q1 by so much more.
        let turned_m = tolerance.rad * g.d5.abs() / CERTAIN_S5 + tolerance.m / certain_root;
        let longest = (g.a2 + g.a3).abs();
        let closing = 2.0 * longest * (tolerance.m + turned_m) / (g.a2 * g.a3).abs();
        Self {
            root: (-root - 4.0 * g.d4.abs() * tolerance.m, root),
            closing: (-CERTAIN_C3 - closing, CERTAIN_C3),
        }
    }
}

/// Columns of the rotation, and the wrist centre seen from the shoulder.
struct Target<V> {
    n: [V; 3],
    o: [V; 3],
    a: [V; 3],
    centre: [V; 3],
    /// By how much the quaternion's squared norm is off one.
    off_unit: V,
}

impl<V: Copy> Target<V> {
    /// From a unit quaternion `(w, x, y, z)` and a position.
    #[inline(always)]
    fn new<S: Simd>(simd: S, g: &UrGeometry, q: [V; 4], p: [V; 3]) -> Self
    where
        V: SimdFloat<S, Element = f64>,
    {
        let [w, x, y, z] = q;
        let splat = |value| V::splat(simd, value);
        let norm_squared = w.fused(w, x.fused(x, y.fused(y, z * z)));
        // 2 / norm_squared to second order: exact to rounding within `CERTAIN_NORM`.
        let off_unit = norm_squared - splat(1.0);
        let s = (off_unit * 2.0).fused(off_unit - splat(1.0), splat(2.0));
        let (sx, sy, sz) = (s * x, s * y, s * z);
        let (xx, yy, zz) = (sx * x, sy * y, sz * z);
        let (xy, xz, yz) = (sx * y, sx * z, sy * z);
        let (wx, wy, wz) = (sx * w, sy * w, sz * w);
        let one = splat(1.0);
        let a = [xz + wy, yz - wx, one - (xx + yy)];
        Self {
            n: [one - (yy + zz), xy + wz, xz - wy],
            o: [xy - wz, one - (xx + zz), yz + wx],
            a,
            centre: [
                a[0].fused(splat(-g.d6), p[0]),
                a[1].fused(splat(-g.d6), p[1]),
                a[2].fused(splat(-g.d6), p[2] - g.d1),
            ],
            off_unit,
        }
    }
}

/// Equations 9 to 22 for one shoulder and the fold wrist.
struct Fold<V> {
    cos_sin_1: [V; 2],
    cos_sin_5: [V; 2],
    cos_sin_6: [V; 2],
    cos_sin_234: [V; 2],
    /// `centre` ahead of the shoulder axis, m.
    forward: V,
    s5_squared: V,
}

/// Equation 9's root: `rho^2` and `rho^2 - d4^2`.
#[inline(always)]
fn shoulder_root<S: Simd, V: SimdFloat<S, Element = f64>>(
    simd: S,
    g: &UrGeometry,
    target: &Target<V>,
) -> (V, V) {
    let [cx, cy, _] = target.centre;
    let rho_squared = cx.fused(cx, cy * cy);
    (rho_squared, rho_squared - V::splat(simd, g.d4 * g.d4))
}

#[inline(always)]
fn fold<S: Simd, V: SimdFloat<S, Element = f64>>(
    simd: S,
    g: &UrGeometry,
    target: &Target<V>,
    rho_squared: V,
    forward: V,
    fold_sign: V,
) -> Fold<V> {
    let splat = |value| V::splat(simd, value);
    let Target {
        n, o, a, centre, ..
    } = target;
    let inverse = splat(1.0) / rho_squared.max(splat(f64::MIN_POSITIVE));
    let (fx, fy) = (forward * inverse, splat(g.d4) * inverse);
    let c1 = fx.fused(centre[0], -(fy * centre[1]));
    let s1 = fy.fused(centre[0], fx * centre[1]);
    // Along the axis of joints 2, 3 and 4, and ahead in the arm's plane.
    let along = |v: &[V; 3]| v[0].fused(s1, -(v[1] * c1));
    let ahead = |v: &[V; 3]| v[0].fused(c1, v[1] * s1);
    let (n1, o1, c5) = (along(n), along(o), along(a));
    let s5_squared = n1.fused(n1, o1 * o1);
    let s5 = fold_sign * s5_squared.sqrt(); // eq 10
    // Square root and division side by side instead of one after the other.
    let inverse = s5 * (splat(1.0) / s5_squared.max(splat(f64::MIN_POSITIVE)));
    let (c6, s6) = (n1 * inverse, -(o1 * inverse)); // eq 11, sign corrected
    // Direction of wrist 1 from the wrist centre; its components are those of q2 + q3 + q4.
    let s234 = -(ahead(o).fused(c6, ahead(n) * s6));
    let c234 = o[2].fused(c6, n[2] * s6); // eq 19
    Fold {
        cos_sin_1: [c1, s1],
        cos_sin_5: [c5, s5],
        cos_sin_6: [c6, s6],
        cos_sin_234: [c234, s234],
        forward,
        s5_squared,
    }
}

/// Equations 24 to 36 for one shoulder and wrist: both elbows.
struct Elbows<V> {
    /// The lesser of `1 - cos q3` and `1 + cos q3`.
    closing: V,
    /// Magnitude of `sin q3`, and `cos q3`.
    cos_sin_3: [V; 2],
    /// `q2` for a positive and a negative `sin q3`, times `length`.
    cos_sin_2: [[V; 2]; 2],
    /// The squared reach, or what is left of it where the elbow does not close, m^2.
    length: V,
}

#[inline(always)]
fn elbows<S: Simd, V: SimdFloat<S, Element = f64>>(
    simd: S,
    g: &UrGeometry,
    ahead: V,
    up: V,
) -> Elbows<V> {
    let splat = |value| V::splat(simd, value);
    let (a2, a3) = (g.a2, g.a3);
    let scale = 1.0 / (2.0 * a2 * a3);
    let reach_squared = ahead.fused(ahead, up * up);
    // Without cancellation at the stretched and at the folded elbow.
    let one_minus = reach_squared.fused(splat(-scale), splat((a2 + a3).powi(2) * scale));
    let one_plus = reach_squared.fused(splat(scale), splat(-(a2 - a3).powi(2) * scale));
    let zero = splat(0.0);
    let c3 = (one_plus - one_minus) * 0.5; // eq 31
    let s3 = (one_minus * one_plus).max(zero).sqrt(); // eq 32
    // Direction of wrist 1 from the shoulder in the frame of the upper arm (eq 35).
    let (bx, by) = (c3.fused(splat(a3), splat(a2)), s3 * a3);
    let (ax, ux) = (ahead * bx, up * bx);
    let positive = [up.fused(by, ax), ahead.fused(-by, ux)];
    let negative = [up.fused(-by, ax), ahead.fused(by, ux)];
    Elbows {
        closing: one_minus.min(one_plus),
        cos_sin_3: [c3, s3],
        cos_sin_2: [positive, negative], // eq 36
        length: reach_squared,
    }
}

#[inline(always)]
fn fold_elbows<S: Simd, V: SimdFloat<S, Element = f64>>(
    simd: S,
    g: &UrGeometry,
    target: &Target<V>,
    fold: &Fold<V>,
    d5: f64,
) -> Elbows<V> {
    let d5 = V::splat(simd, d5);
    let ahead = d5.fused(-fold.cos_sin_234[1], fold.forward);
    let up = d5.fused(fold.cos_sin_234[0], target.centre[2]);
    elbows(simd, g, ahead, up)
}

/// `q2`, `q3` and `q4` for a positive and for a negative `sin q3`.
#[inline(always)]
fn elbow_angles<S: Simd, V: SimdFloat<S, Element = f64>>(
    simd: S,
    elbows: &Elbows<V>,
    q234: V,
) -> [[V; 2]; 3] {
    let [c3, s3] = elbows.cos_sin_3;
    let q3 = upper_half(simd, s3, c3, V::splat(simd, 1.0));
    let [[xp, yp], [xn, yn]] = elbows.cos_sin_2;
    let positive = atan2(simd, yp, xp, elbows.length);
    let negative = atan2(simd, yn, xn, elbows.length);
    [
        [positive, negative],
        [q3, -q3],
        [
            wrap(simd, q234 - positive - q3), // eq 38
            wrap(simd, q234 - negative + q3),
        ],
    ]
}

/// Brings a sum of angles into `[-pi, pi]`.
#[inline(always)]
fn wrap<S: Simd, V: SimdFloat<S, Element = f64>>(simd: S, angle: V) -> V {
    let turns = (angle * (1.0 / TAU)).round_ties_even();
    turns.fused(V::splat(simd, -TAU), angle)
}

/// Angle of a `(cosine, sine)`, in `[-pi, pi]`.
#[inline(always)]
fn angle<S: Simd, V: SimdFloat<S, Element = f64>>(simd: S, [x, y]: [V; 2]) -> V {
    atan2(simd, y, x, V::splat(simd, 1.0))
}

/// The angle half a turn on, in `[-pi, pi]`.
#[inline(always)]
fn half_turn<S: Simd, V: SimdFloat<S, Element = f64>>(simd: S, angle: V) -> V {
    angle - V::splat(simd, PI).copysign(angle)
}

/// One pose, branches across lanes. Writes all rows and which of them exist; whether every sign
/// is certain.
#[inline(always)]
pub(super) fn one_pose<S: Simd>(
    simd: S,
    g: &UrGeometry,
    bounds: &Bounds,
    pose: &Pose,
    out: &mut ClosedForm,
) -> bool {
    let q = pose.rotation.quaternion();
    let p = &pose.translation.vector;
    let splat = |value| f64x2::splat(simd, value);
    // Lanes: right, left.
    let target = Target::new(
        simd,
        g,
        [q.w, q.i, q.j, q.k].map(splat),
        [p.x, p.y, p.z].map(splat),
    );
    let (rho_squared, root_squared) = shoulder_root(simd, g, &target);
    let shoulder = f64x2::simd_from(simd, [1.0, -1.0]);
    let forward = shoulder * root_squared.max(splat(0.0)).sqrt();
    let fold = fold(simd, g, &target, rho_squared, forward, shoulder);
    // Lanes: right fold, right unfold, left fold, left unfold. An unfolded wrist is the folded
    // one turned by pi in q6 and in q2 + q3 + q4.
    let twice = |v: f64x2<S>| simd.combine_f64x2(v.zip_low(v), v.zip_high(v));
    let wrist = f64x4::simd_from(simd, [g.d5, -g.d5, g.d5, -g.d5]);
    let ahead = wrist.fused(-twice(fold.cos_sin_234[1]), twice(fold.forward));
    let up = wrist.fused(twice(fold.cos_sin_234[0]), twice(target.centre[2]));
    let elbows = elbows(simd, g, ahead, up);

    let four = |a, b, c, d| simd.combine_f64x4(simd.combine_f64x2(a, b), simd.combine_f64x2(c, d));
    let [[c1, s1], [c5, s5], [c6, s6], [c234, s234]] = [
        fold.cos_sin_1,
        fold.cos_sin_5,
        fold.cos_sin_6,
        fold.cos_sin_234,
    ];
    let outer = angle(simd, [four(c1, c5, c6, c234), four(s1, s5, s6, s234)]);
    let (q1_q5, q6_q234) = simd.split_f64x8(outer);
    let ((q1, q5), (q6, q234)) = (simd.split_f64x4(q1_q5), simd.split_f64x4(q6_q234));
    let shoulders = f64x4::simd_from(simd, [1.0, 1.0, -1.0, -1.0]);
    let q3 = shoulders
        * upper_half(
            simd,
            elbows.cos_sin_3[1],
            elbows.cos_sin_3[0],
            f64x4::splat(simd, 1.0),
        );
    let [positive, negative] = elbows.cos_sin_2;
    let q2 = atan2(
        simd,
        simd.combine_f64x4(positive[1], negative[1]),
        simd.combine_f64x4(positive[0], negative[0]),
        simd.combine_f64x4(elbows.length, elbows.length),
    );
    let (q2_positive, q2_negative) = simd.split_f64x8(q2);
    let right = shoulders.simd_gt(0.0);
    let q2_down = right.select(q2_positive, q2_negative);
    let q2_up = right.select(q2_negative, q2_positive);
    let eight = |down: f64x4<S>, up: f64x4<S>| {
        let (low, high) = down.interleave(up);
        simd.combine_f64x4(low, high)
    };
    let (q2, q3) = (eight(q2_down, q2_up), eight(q3, -q3));
    // An unfolded wrist: q6 and q2 + q3 + q4 a half turn on, q5 mirrored.
    let wrists = |fold: f64x2<S>, unfold: f64x2<S>| {
        let by_wrist = simd.combine_f64x2(fold.zip_low(unfold), fold.zip_high(unfold));
        eight(by_wrist, by_wrist)
    };
    let q4 = wrap(simd, wrists(q234, half_turn(simd, q234)) - q2 - q3); // eq 38
    let joints = [
        wrists(q1, q1),
        q2,
        q3,
        q4,
        wrists(q5, -q5),
        wrists(q6, half_turn(simd, q6)),
    ];
    let closes = elbows.closing.simd_ge(0.0) & twice_mask(simd, root_squared);
    for (row, values) in out.joints.iter_mut().zip(joints) {
        values.store_array(row);
    }
    out.exists = both_elbows(closes.to_bitmask());
    is_certain_root(bounds, root_squared).all_true()
        && is_certain_pose(&target, rho_squared).all_true()
        && is_certain_s5(simd, fold.s5_squared).all_true()
        && is_certain_elbow(bounds, elbows.closing).all_true()
}

/// Bits of shoulders and wrists to bits of configurations.
#[inline(always)]
fn both_elbows(branches: u64) -> u8 {
    const SPREAD: [u8; 16] = {
        let mut spread = [0; 16];
        let mut bits = 0;
        while bits < 16 {
            let mut branch = 0;
            while branch < 4 {
                if bits >> branch & 1 == 1 {
                    spread[bits] |= 0b11 << (2 * branch);
                }
                branch += 1;
            }
            bits += 1;
        }
        spread
    };
    let index = (branches & 0xF) as usize;
    SPREAD[index]
}

/// As many poses as there are lanes, poses across lanes. Returns a bit for each pose of which every
/// sign is certain.
#[inline(always)]
pub(super) fn many_poses<S: Simd>(
    simd: S,
    g: &UrGeometry,
    bounds: &Bounds,
    poses: &[Pose],
    out: &mut [ClosedForm],
) -> u64 {
    type V<S> = <S as Simd>::f64s;
    let splat = |value| V::<S>::splat(simd, value);
    assert!(poses.len() == V::<S>::LEN && out.len() == V::<S>::LEN);
    let mut fields = [[0.0; MOST_LANES]; 7];
    for (
        lane,
        Pose {
            rotation,
            translation,
        },
    ) in poses.iter().enumerate()
    {
        fields[0][lane] = rotation.w;
        fields[1][lane] = rotation.i;
        fields[2][lane] = rotation.j;
        fields[3][lane] = rotation.k;
        fields[4][lane] = translation.x;
        fields[5][lane] = translation.y;
        fields[6][lane] = translation.z;
    }
    let gather = |field: usize| V::<S>::from_slice(simd, &fields[field][..V::<S>::LEN]);
    let target = Target::new(
        simd,
        g,
        [gather(0), gather(1), gather(2), gather(3)],
        [gather(4), gather(5), gather(6)],
    );
    let (rho_squared, root_squared) = shoulder_root(simd, g, &target);
    let root = root_squared.max(splat(0.0)).sqrt();
    // All folds and elbows before any angle: the processor then has independent work at hand.
    let right = fold(simd, g, &target, rho_squared, root, splat(1.0));
    let left = fold(simd, g, &target, rho_squared, -root, splat(-1.0));
    let elbows = [
        fold_elbows(simd, g, &target, &right, g.d5),
        fold_elbows(simd, g, &target, &right, -g.d5),
        fold_elbows(simd, g, &target, &left, g.d5),
        fold_elbows(simd, g, &target, &left, -g.d5),
    ];
    let mut certain = is_certain_root(bounds, root_squared)
        & is_certain_pose(&target, rho_squared)
        & is_certain_s5(simd, right.s5_squared)
        & is_certain_s5(simd, left.s5_squared);
    let reachable = root_squared.simd_ge(0.0);
    let mut closing = [0; 4];
    for (bits, elbows) in closing.iter_mut().zip(&elbows) {
        certain &= is_certain_elbow(bounds, elbows.closing);
        *bits = (elbows.closing.simd_ge(0.0) & reachable).to_bitmask();
    }
    let (q1_right, q1_left) = (angle(simd, right.cos_sin_1), angle(simd, left.cos_sin_1));
    let (q5_right, q5_left) = (angle(simd, right.cos_sin_5), angle(simd, left.cos_sin_5));
    let (q6_right, q6_left) = (angle(simd, right.cos_sin_6), angle(simd, left.cos_sin_6));
    let q234_right = angle(simd, right.cos_sin_234);
    let q234_left = angle(simd, left.cos_sin_234);
    // An unfolded wrist: q6 and q2 + q3 + q4 half a turn on, q5 mirrored.
    let right_fold = elbow_angles(simd, &elbows[0], q234_right);
    let right_unfold = elbow_angles(simd, &elbows[1], half_turn(simd, q234_right));
    let left_fold = elbow_angles(simd, &elbows[2], q234_left);
    let left_unfold = elbow_angles(simd, &elbows[3], half_turn(simd, q234_left));
    // Down is a positive sin q3 on the right and a negative one on the left.
    let by_elbow = |joint: usize| {
        let ([rf, ru], [lf, lu]) = (
            [&right_fold[joint], &right_unfold[joint]],
            [&left_fold[joint], &left_unfold[joint]],
        );
        [rf[0], rf[1], ru[0], ru[1], lf[1], lf[0], lu[1], lu[0]]
    };
    let four = |right: [V<S>; 2], left: [V<S>; 2]| {
        let ([a, b], [c, d]) = (right, left);
        [a, a, b, b, c, c, d, d]
    };
    let joints = [
        four([q1_right; 2], [q1_left; 2]),
        by_elbow(0),
        by_elbow(1),
        by_elbow(2),
        four([q5_right, -q5_right], [q5_left, -q5_left]),
        four(
            [q6_right, half_turn(simd, q6_right)],
            [q6_left, half_turn(simd, q6_left)],
        ),
    ];
    for (joint, rows) in joints.iter().enumerate() {
        for first in (0..8).step_by(V::<S>::LEN) {
            let mut block = [splat(0.0); MOST_LANES];
            block[..V::<S>::LEN].copy_from_slice(&rows[first..first + V::<S>::LEN]);
            transpose(&mut block[..V::<S>::LEN]);
            for (out, row) in out.iter_mut().zip(&block) {
                row.store_slice(&mut out.joints[joint][first..first + V::<S>::LEN]);
            }
        }
    }
    for (lane, out) in out.iter_mut().enumerate() {
        let bit = |branch: usize| ((closing[branch] >> lane) & 1) << branch;
        out.exists = both_elbows(bit(0) | bit(1) | bit(2) | bit(3));
    }
    certain.to_bitmask()
}

/// Transposes as many vectors as they have lanes, by perfect shuffles.
#[inline(always)]
fn transpose<S: Simd, V: SimdBase<S>>(rows: &mut [V]) {
    let half = rows.len() / 2;
    let mut width = 1;
    while width < rows.len() {
        let mut shuffled = [rows[0]; MOST_LANES];
        for i in 0..half {
            let (low, high) = rows[i].interleave(rows[i + half]);
            shuffled[2 * i] = low;
            shuffled[2 * i + 1] = high;
        }
        rows.copy_from_slice(&shuffled[..rows.len()]);
        width *= 2;
    }
}

#[inline(always)]
fn is_certain_root<S: Simd, V: SimdFloat<S, Element = f64>>(
    bounds: &Bounds,
    root_squared: V,
) -> V::Mask {
    root_squared.simd_lt(bounds.root.0) | root_squared.simd_gt(bounds.root.1)
}

/// Whether the numbers are a pose that squares do not spoil.
#[inline(always)]
fn is_certain_pose<S: Simd, V: SimdFloat<S, Element = f64>>(
    target: &Target<V>,
    rho_squared: V,
) -> V::Mask {
    let up = target.centre[2];
    target.off_unit.abs().simd_le(CERTAIN_NORM)
        & up.fused(up, rho_squared).simd_lt(CERTAIN_RHO_SQUARED)
}

#[inline(always)]
fn is_certain_s5<S: Simd, V: SimdFloat<S, Element = f64>>(simd: S, s5_squared: V) -> V::Mask {
    s5_squared.simd_gt(V::splat(simd, CERTAIN_S5.powi(2)))
}

#[inline(always)]
fn is_certain_elbow<S: Simd, V: SimdFloat<S, Element = f64>>(
    bounds: &Bounds,
    closing: V,
) -> V::Mask {
    closing.simd_lt(bounds.closing.0) | closing.simd_gt(bounds.closing.1)
}

#[inline(always)]
fn twice_mask<S: Simd>(simd: S, root_squared: f64x2<S>) -> <f64x4<S> as SimdBase<S>>::Mask {
    simd.combine_f64x2(root_squared, root_squared).simd_ge(0.0)
}
