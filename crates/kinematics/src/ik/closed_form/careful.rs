//! The closed form near and at its singularities, decided in extended precision.
//!
//! The pose is taken as exactly what its doubles say. Which branches it has depends on three
//! signs, of `rho^2 - d4^2`, `s5^2` and `1 -+ cos q3`; here all three are computed in twice the
//! precision of a double, so that the branches of the pose as given are known even where a
//! rounding of the pose would make or unmake them. A branch that the pose misses by no more than
//! such a rounding ([`ROUNDING`]) is kept as a touching one: it solves the pose within rounding,
//! and often it is the posture that the pose was made from.

use std::f64::consts::PI;

use super::super::{Configuration, Elbow, Shoulder, Wrist, wrap_angle};
use super::extended::Extended;
use super::family::FreeWrist;
use super::{Certificate, ClosedForm, Preference, Tolerance, Unreachable};
use crate::{Pose, UrGeometry};

/// What a pose may be off by from having been computed in doubles: 32 roundings of a metre or of
/// a radian. Rows that need it solve the pose within it.
const ROUNDING: f64 = 32.0 * f64::EPSILON;

/// A position beyond this has lost the millimetres of an arm, and its square may overflow, m.
const FARTHEST_M: f64 = 1e6;

/// A squared norm of a quaternion off one by more than this is no rounding, not even of single
/// precision, twice 1e-6: it is refused rather than scaled.
const NOT_UNIT: f64 = 2e-6;

/// Two branches nearer to one another than this are one row, rad: the square root of a double's
/// rounding, by which rounding moves either of them. Their middle solves the pose within 1e-16.
const MERGED_RAD: f64 = 1.5e-8;

/// Sine of wrist 2 from which on it does not matter to the wrist which of two merged shoulders an arm has: what turns
/// the shoulder by [`MERGED_RAD`] turns wrist 3 by that over this, 3e-7 rad.
const WRIST_APART: f64 = 0.05;

/// Double precision decides signs of squared lengths beyond this, relative to the arm's reach
/// squared and to the amplification by the wrist.
const DOUBLE_DECIDES: f64 = 32.0 * f64::EPSILON;

/// In-plane and axial components of the pose for one shoulder.
struct Arm {
    shoulder: Shoulder,
    c1: Extended,
    s1: Extended,
    /// Wrist centre ahead of the shoulder axis, m.
    ahead: Extended,
    merged: bool,
    /// The wrist centre is nearer to the shoulder axis than it can be.
    touching: bool,
    /// By how much `q1` may turn without moving the flange by more than the slack, rad.
    slack_rad: f64,
}

/// What the fold wrist of one shoulder makes of the pose.
struct Fold {
    q5: f64,
    q6: f64,
    s5: f64,
    s234: Extended,
    c234: Extended,
}

/// Whether the elbow closes: both not negative.
struct Closing {
    one_minus: f64,
    one_plus: f64,
    /// m^2.
    reach_squared: f64,
}

struct Solver<'a> {
    geometry: &'a UrGeometry,
    preference: Preference<'a>,
    n: [Extended; 3],
    o: [Extended; 3],
    a: [Extended; 3],
    /// Wrist centre from the shoulder's height, m.
    centre: [Extended; 3],
    out: &'a mut ClosedForm,
    used_extended: bool,
    /// What the pose may be off by.
    slack: Tolerance,
    /// The rows being made exist only within the slack.
    touching: bool,
}

/// Solves with all care; about a microsecond.
#[cold]
pub(super) fn solve(
    geometry: &UrGeometry,
    pose: &Pose,
    preference: Preference<'_>,
    tolerance: Tolerance,
    out: &mut ClosedForm,
) {
    out.exists = 0;
    out.merged = 0;
    out.free = 0;
    out.touching = 0;
    if defect(pose).is_some() {
        out.certificate = Certificate::NotAPose;
        return;
    }
    let mut solver = Solver::new(geometry, pose, preference, out);
    for arm in solver.shoulders().into_iter().flatten() {
        solver.wrists(&arm);
    }
    let used_extended = solver.used_extended;
    if tolerance.m.max(tolerance.rad) > ROUNDING && solver.out.exists != u8::MAX {
        solver.slack = Tolerance {
            m: tolerance.m.max(ROUNDING),
            rad: tolerance.rad.max(ROUNDING),
        };
        for arm in solver.shoulders().into_iter().flatten() {
            solver.wrists(&arm);
        }
    }
    out.certificate = if out.exists == 0 {
        Certificate::NearestOnly
    } else if out.free != 0 {
        Certificate::FreeJoint
    } else if out.merged != 0 {
        Certificate::MergedBranches
    } else if used_extended {
        Certificate::DecidedInExtendedPrecision
    } else {
        Certificate::Complete
    };
}

/// The family of a shoulder at a pose, if wrist 3 is free there.
pub(super) fn free_wrist(
    geometry: &UrGeometry,
    pose: &Pose,
    shoulder: Shoulder,
) -> Option<FreeWrist> {
    let mut scratch = ClosedForm::BLANK;
    let mut solver = Solver::new(geometry, pose, Preference::default(), &mut scratch);
    let arms = solver.shoulders();
    let arm = arms
        .into_iter()
        .flatten()
        .find(|arm| arm.shoulder == shoulder)?;
    let aligned = solver.aligned(&arm)?;
    Some(solver.family(&aligned))
}

/// Why configurations of a shoulder and wrist do not exist: recomputed when asked for. `None` if
/// they do, within rounding.
pub(super) fn unreachable(
    geometry: &UrGeometry,
    pose: &Pose,
    shoulder: Shoulder,
    wrist: Wrist,
) -> Option<Unreachable> {
    if let Some(defect) = defect(pose) {
        return Some(defect);
    }
    let [n, o, a] = columns(pose).map(|column| column.map(Extended::rounded));
    let p = &pose.translation.vector;
    let centre: [f64; 3] = std::array::from_fn(|i| p[i] - a[i] * geometry.d6);
    let rho = libm::hypot(centre[0], centre[1]);
    let root_squared = (rho - geometry.d4.abs()) * (rho + geometry.d4.abs());
    if root_squared < 0.0 && rho < geometry.d4.abs() - ROUNDING {
        let missing_m = geometry.d4.abs() - rho;
        return Some(Unreachable::WristTooNear { missing_m });
    }
    let forward = shoulder.sign() * root_squared.max(0.0).sqrt();
    let (s1, c1) = (
        (geometry.d4 * centre[0] + forward * centre[1]) / rho.powi(2),
        (forward * centre[0] - geometry.d4 * centre[1]) / rho.powi(2),
    );
    let (n1, o1) = (n[0] * s1 - n[1] * c1, o[0] * s1 - o[1] * c1);
    let s5 = libm::hypot(n1, o1).max(f64::MIN_POSITIVE) * wrist.sign(shoulder);
    let (c6, s6) = (n1 / s5, -o1 / s5);
    let ahead_of = |v: &[f64; 3]| v[0] * c1 + v[1] * s1;
    let ahead = forward + geometry.d5 * (ahead_of(&o) * c6 + ahead_of(&n) * s6);
    let up = centre[2] - geometry.d1 + geometry.d5 * (o[2] * c6 + n[2] * s6);
    let reach = libm::hypot(ahead, up);
    let (longest, shortest) = (
        (geometry.a2 + geometry.a3).abs(),
        (geometry.a2 - geometry.a3).abs(),
    );
    if reach > longest + ROUNDING {
        let missing_m = reach - longest;
        Some(Unreachable::ElbowTooShort { missing_m })
    } else if reach < shortest - ROUNDING {
        let missing_m = shortest - reach;
        Some(Unreachable::ElbowTooLong { missing_m })
    } else {
        None
    }
}

/// What makes numbers no pose.
pub(in super::super) fn defect(pose: &Pose) -> Option<Unreachable> {
    let (p, q) = (&pose.translation.vector, &pose.rotation.coords);
    if !p.iter().chain(q.iter()).all(|value| value.is_finite()) {
        return Some(Unreachable::NotFinite);
    }
    let norm = q.amax();
    let is_unit = norm < 2.0 && (q.norm_squared() - 1.0).abs() <= NOT_UNIT;
    if !is_unit {
        return Some(Unreachable::NotARotation);
    }
    (p.amax() > FARTHEST_M).then(|| Unreachable::TooFar {
        missing_m: p.amax(),
    })
}

/// Columns of the rotation matrix of the normalised quaternion.
fn columns(pose: &Pose) -> [[Extended; 3]; 3] {
    let q = pose.rotation.quaternion();
    let product = Extended::product;
    let norm_squared =
        product(q.w, q.w) + product(q.i, q.i) + product(q.j, q.j) + product(q.k, q.k);
    let twice = Extended::from(2.0) / norm_squared;
    let (x, y, z) = (twice * q.i, twice * q.j, twice * q.k);
    let (xx, yy, zz) = (x * q.i, y * q.j, z * q.k);
    let (xy, xz, yz) = (x * q.j, x * q.k, y * q.k);
    let (wx, wy, wz) = (x * q.w, y * q.w, z * q.w);
    let one = Extended::from(1.0);
    [
        [one - (yy + zz), xy + wz, xz - wy],
        [xy - wz, one - (xx + zz), yz + wx],
        [xz + wy, yz - wx, one - (xx + yy)],
    ]
}

impl<'a> Solver<'a> {
    fn new(
        geometry: &'a UrGeometry,
        pose: &Pose,
        preference: Preference<'a>,
        out: &'a mut ClosedForm,
    ) -> Self {
        let [n, o, a] = columns(pose);
        let p = &pose.translation.vector;
        Self {
            geometry,
            preference,
            n,
            o,
            a,
            centre: [
                Extended::from(p.x) - a[0] * geometry.d6,
                Extended::from(p.y) - a[1] * geometry.d6,
                Extended::from(p.z) - a[2] * geometry.d6 - Extended::from(geometry.d1),
            ],
            out,
            used_extended: false,
            slack: Tolerance {
                m: ROUNDING,
                rad: ROUNDING,
            },
            touching: false,
        }
    }

    /// Equation 9: two shoulders, one where they meet, or none.
    fn shoulders(&mut self) -> [Option<Arm>; 2] {
        let d4 = self.geometry.d4;
        let [x, y, _] = self.centre;
        let rho_squared = x.squared() + y.squared();
        let root_squared = rho_squared - Extended::product(d4, d4);
        let rho = rho_squared.sqrt();
        if root_squared.rounded().abs() <= DOUBLE_DECIDES * (rho_squared.rounded() + d4 * d4) {
            self.used_extended = true;
        }
        if root_squared.is_negative() && d4.abs() - rho.rounded() > self.slack.m {
            return [None, None];
        }
        let root = root_squared.sqrt();
        let side = Extended::from(d4.signum());
        // Where the roots meet, the wrist centre lies square to the arm's plane.
        let (c1, s1) = (-(side * y) / rho, (side * x) / rho);
        let s5 = |c1: Extended, s1: Extended| {
            let along = |v: &[Extended; 3]| v[0] * s1 - v[1] * c1;
            (along(&self.n).squared() + along(&self.o).squared())
                .sqrt()
                .rounded()
        };
        // Two shoulders of a nearly singular wrist are two postures, however near the shoulders are.
        let merged = root.rounded() <= MERGED_RAD * d4.abs()
            && (root.rounded() <= 0.0 || s5(c1, s1) >= WRIST_APART);
        // The flange moves by root e + d4 e^2 / 2 when q1 turns by e.
        let slack_m = self.slack.m;
        let slack_rad = 2.0 * slack_m
            / (root.rounded() + (root.rounded().powi(2) + 2.0 * d4.abs() * slack_m).sqrt());
        let touching = root_squared.is_negative();
        let arm = |shoulder: Shoulder| {
            let (c1, s1, ahead) = if merged {
                (c1, s1, Extended::ZERO)
            } else {
                let ahead = root * shoulder.sign();
                (
                    (ahead * x - y * d4) / rho_squared,
                    (x * d4 + ahead * y) / rho_squared,
                    ahead,
                )
            };
            Some(Arm {
                shoulder,
                c1,
                s1,
                ahead,
                merged,
                touching,
                slack_rad,
            })
        };
        if merged {
            [arm(Shoulder::Right), None]
        } else {
            [arm(Shoulder::Right), arm(Shoulder::Left)]
        }
    }

    /// Equations 10 to 22 for one shoulder, but for wrists that have their rows.
    fn wrists(&mut self, arm: &Arm) {
        let has_row = |bits: u8, wrist: Wrist| {
            [Elbow::Down, Elbow::Up].into_iter().any(|elbow| {
                let configuration = Configuration {
                    shoulder: arm.shoulder,
                    elbow,
                    wrist,
                };
                (bits >> configuration.index()) & 1 == 1
            })
        };
        if has_row(self.out.free, Wrist::Fold) {
            return;
        }
        self.touching = arm.touching;
        if let Some(aligned) = self.aligned(arm) {
            self.free_wrist(&aligned);
            return;
        }
        let fold = self.fold(arm);
        for wrist in [Wrist::Fold, Wrist::Unfold] {
            self.touching = arm.touching;
            if has_row(self.out.exists, wrist) || self.elbows(arm, wrist, &fold, self.slack.m) {
                continue;
            }
            // Not reachable as the pose stands. Where the wrist or the shoulder is nearly
            // singular, another q1 or q6 may solve it as well and bring the elbow within reach.
            self.touching = true;
            if !self.turn_to_reach(arm, wrist) {
                self.swing_to_reach(arm, wrist, &fold);
            }
        }
        self.touching = false;
    }

    /// The arm with `q1` turned so that `q5` is exactly 0 or pi, if that is within rounding.
    fn aligned(&self, arm: &Arm) -> Option<Arm> {
        let a_ahead = arm.ahead_of(&self.a).rounded();
        let a_up = self.a[2].rounded();
        let free = a_up.abs() <= ROUNDING && a_ahead.abs() <= ROUNDING + arm.slack_rad;
        let turn_rad = a_ahead / arm.along(&self.a).rounded();
        free.then(|| arm.turned(&self.centre, turn_rad))
    }

    /// Equations 10 to 22 for one shoulder and the fold wrist.
    fn fold(&self, arm: &Arm) -> Fold {
        let sign = Wrist::Fold.sign(arm.shoulder);
        let (n1, o1) = (arm.along(&self.n), arm.along(&self.o));
        let s5 = (n1.squared() + o1.squared()).sqrt();
        let inverse = Extended::from(sign) / s5;
        let (c6, s6) = (n1 * inverse, -(o1 * inverse));
        Fold {
            q5: libm::atan2(sign * s5.rounded(), arm.along(&self.a).rounded()),
            q6: libm::atan2(s6.rounded(), c6.rounded()),
            s5: s5.rounded(),
            s234: -(arm.ahead_of(&self.o) * c6 + arm.ahead_of(&self.n) * s6),
            c234: self.o[2] * c6 + self.n[2] * s6,
        }
    }

    /// Wrist 1 ahead of and above the shoulder, m.
    fn wrist_1(&self, arm: &Arm, wrist: Wrist, fold: &Fold) -> (Extended, Extended) {
        let d5 = match wrist {
            Wrist::Fold => self.geometry.d5,
            Wrist::Unfold => -self.geometry.d5,
        };
        (arm.ahead - fold.s234 * d5, self.centre[2] + fold.c234 * d5)
    }

    /// Equations 24 to 38 for one shoulder and wrist; whether the elbow closes.
    fn elbows(&mut self, arm: &Arm, wrist: Wrist, fold: &Fold, allowed_m: f64) -> bool {
        let (ahead, up) = self.wrist_1(arm, wrist, fold);
        let q234 = libm::atan2(fold.s234.rounded(), fold.c234.rounded());
        // An unfolded wrist: q6 and q2 + q3 + q4 half a turn on, q5 mirrored.
        let [q234, q5, q6] = match wrist {
            Wrist::Fold => [q234, fold.q5, fold.q6],
            Wrist::Unfold => [q234 + PI, -fold.q5, fold.q6 + PI],
        };
        // Rounding of the pose turns q6, and with it wrist 1, the more the smaller s5 is.
        let amplification = 1.0 + 1.0 / fold.s5.max(ROUNDING);
        let (a2, a3) = (self.geometry.a2, self.geometry.a3);
        let Closing {
            one_minus,
            one_plus,
            reach_squared,
        } = self.closing(ahead, up);
        let closing = one_minus.min(one_plus);
        let scale = 2.0 * a2 * a3;
        if closing.abs() <= DOUBLE_DECIDES * amplification * (2.0 + reach_squared / scale.abs()) {
            self.used_extended = true;
        }
        // A squared length misses by the sum of the lengths times the miss.
        let (longest, shortest) = ((a2 + a3).abs(), (a2 - a3).abs());
        let limit = if one_minus < one_plus {
            longest
        } else {
            shortest
        };
        let missing_m = -closing * scale.abs() / (reach_squared.sqrt() + limit);
        if closing < 0.0 && missing_m > allowed_m {
            return false;
        }
        self.touching |= closing < 0.0;
        let s3 = (one_minus * one_plus).max(0.0).sqrt();
        let elbows_merge = s3 <= MERGED_RAD;
        let configuration = |elbow| Configuration {
            shoulder: arm.shoulder,
            elbow,
            wrist,
        };
        let q1 = libm::atan2(arm.s1.rounded(), arm.c1.rounded());
        let elbows: &[Elbow] = if elbows_merge {
            &[Elbow::Down]
        } else {
            &[Elbow::Down, Elbow::Up]
        };
        let c3 = if elbows_merge {
            (one_plus - one_minus).signum()
        } else {
            0.5 * (one_plus - one_minus)
        };
        for &elbow in elbows {
            let s3 = if elbows_merge {
                0.0
            } else {
                elbow.sign(arm.shoulder) * s3
            };
            let (bx, by) = (a2 + a3 * c3, a3 * s3);
            let (ahead, up) = (ahead.rounded(), up.rounded());
            let q2 = libm::atan2(up * bx - ahead * by, ahead * bx + up * by);
            let q3 = libm::atan2(s3, c3);
            let merged = arm.merged || elbows_merge;
            self.row(
                configuration(elbow),
                [q1, q2, q3, q234 - q2 - q3, q5, q6],
                merged,
                false,
            );
        }
        true
    }

    /// `1 - cos q3` and `1 + cos q3`, without cancellation at either singular elbow.
    fn closing(&self, ahead: Extended, up: Extended) -> Closing {
        let (a2, a3) = (self.geometry.a2, self.geometry.a3);
        let reach_squared = ahead.squared() + up.squared();
        let squared = |x: f64, y: f64| (Extended::from(x) + Extended::from(y)).squared();
        let scale = 2.0 * a2 * a3;
        Closing {
            one_minus: (squared(a2, a3) - reach_squared).rounded() / scale,
            one_plus: (reach_squared - squared(a2, -a3)).rounded() / scale,
            reach_squared: reach_squared.rounded(),
        }
    }

    fn row(&mut self, configuration: Configuration, joints: [f64; 6], merged: bool, free: bool) {
        let index = configuration.index();
        for (row, joint) in self.out.joints.iter_mut().zip(joints) {
            row[index] = wrap_angle(joint);
        }
        self.out.exists |= 1 << index;
        self.out.merged |= u8::from(merged) << index;
        self.out.free |= u8::from(free) << index;
        self.out.touching |= u8::from(self.touching) << index;
    }

    /// Rows of a family: the member nearest to the seed, for each elbow.
    fn free_wrist(&mut self, arm: &Arm) {
        let family = self.family(arm);
        let wanted = self.preference.seed.map_or(0.0, |seed| seed[5]);
        let wrist = Wrist::Fold;
        let mut straight = false;
        for elbow in [Elbow::Down, Elbow::Up] {
            let nearest = self
                .preference
                .limits
                .and_then(|limits| family.nearest_q6_within(elbow, wanted, limits))
                .or_else(|| family.nearest_q6(wanted));
            let Some(q6) = nearest else { return };
            let joints = family.member(elbow, q6);
            // Both elbows are one at the end of the family's interval.
            if elbow == Elbow::Up && straight && libm::sin(joints[2]).abs() <= MERGED_RAD {
                return;
            }
            straight = libm::sin(joints[2]).abs() <= MERGED_RAD;
            let configuration = Configuration {
                shoulder: arm.shoulder,
                elbow,
                wrist,
            };
            // Fold and unfold are one, since q5 is its own mirror image.
            self.row(configuration, joints.into(), true, true);
        }
    }

    fn family(&self, arm: &Arm) -> FreeWrist {
        let in_plane = |v: &[Extended; 3]| (arm.ahead_of(v).rounded(), v[2].rounded());
        FreeWrist::new(
            self.geometry,
            arm.shoulder,
            wrap_angle(libm::atan2(arm.s1.rounded(), arm.c1.rounded())),
            if arm.along(&self.a).is_negative() {
                PI
            } else {
                0.0
            },
            (arm.ahead.rounded(), self.centre[2].rounded()),
            in_plane(&self.n),
            in_plane(&self.o),
        )
    }

    /// Tries the least turn of `q1`, within its slack, that lets the elbow close.
    ///
    /// Next to a free wrist a turn changes `q6` and with it wrist 1; next to the shoulder's
    /// singularity it moves the wrist centre ahead.
    fn turn_to_reach(&mut self, arm: &Arm, wrist: Wrist) -> bool {
        let a_ahead = arm.ahead_of(&self.a).rounded();
        let s5 = libm::hypot(a_ahead, self.a[2].rounded());
        let closes = |turn_rad: f64| {
            let turned = arm.turned(&self.centre, turn_rad);
            self.closing_of(&turned, wrist, &self.fold(&turned))
        };
        // Wrist 1 moves with the turn by less than the arm's length over s5.
        let per_rad = if s5 > 4.0 * arm.slack_rad {
            let [x, y, _] = self.centre.map(Extended::rounded);
            self.closing_per_m() * (libm::hypot(x, y) + 2.0 * self.geometry.d5.abs() / s5)
        } else {
            1e3 * (1.0 + 1.0 / s5.max(arm.slack_rad))
        };
        let Some(turn_rad) = least_closing(closes, arm.slack_rad, 4.0 * s5, per_rad) else {
            return false;
        };
        let turned = arm.turned(&self.centre, turn_rad);
        let fold = self.fold(&turned);
        self.elbows(&turned, wrist, &fold, 2.0 * ROUNDING)
    }

    /// Tries the least swing of `q2 + q3 + q4` and `q6` together, which next to a free wrist turns
    /// the flange by only `s5` times as much, that lets the elbow close.
    fn swing_to_reach(&mut self, arm: &Arm, wrist: Wrist, fold: &Fold) -> bool {
        let widest = (self.slack.rad / fold.s5).min(PI);
        let closes = |swing_rad: f64| self.closing_of(arm, wrist, &fold.swung(swing_rad, 1.0));
        let per_rad = self.closing_per_m() * self.geometry.d5.abs();
        let Some(swing_rad) = least_closing(closes, widest, widest, per_rad) else {
            return false;
        };
        let turn = self.family(arm).turn;
        self.elbows(arm, wrist, &fold.swung(swing_rad, turn), 2.0 * ROUNDING)
    }

    /// By how much `1 -+ cos q3` changes as wrist 1 moves, at most, 1/m; doubled, for what a finite
    /// way adds.
    fn closing_per_m(&self) -> f64 {
        let (a2, a3) = (self.geometry.a2, self.geometry.a3);
        2.0 * (a2 + a3).abs() / (a2 * a3).abs()
    }

    fn closing_of(&self, arm: &Arm, wrist: Wrist, fold: &Fold) -> f64 {
        let (ahead, up) = self.wrist_1(arm, wrist, fold);
        let closing = self.closing(ahead, up);
        closing.one_minus.min(closing.one_plus)
    }
}

/// The least argument in `+-widest` at which `closing` is not negative, or where it is greatest.
/// Steps through `+-narrow` and `+-widest`, then bisects or climbs. `None` if `closing` cannot
/// come that far at `per_rad`.
fn least_closing(
    closing: impl Fn(f64) -> f64,
    widest: f64,
    narrow: f64,
    per_rad: f64,
) -> Option<f64> {
    const STEPS: u32 = 8;
    let now = closing(0.0);
    if -now > per_rad * widest {
        return None;
    }
    let mut missed = [0.0; 2];
    let mut best = (now, 0.0, 0.0);
    for range in [narrow.min(widest), widest] {
        let step_rad = range / f64::from(STEPS);
        for step in 1..=STEPS {
            for (side, way) in [1.0, -1.0].into_iter().enumerate() {
                let argument = way * step_rad * f64::from(step);
                let value = closing(argument);
                if value >= 0.0 {
                    return Some(bisected(closing, missed[side], argument));
                }
                if value > best.0 {
                    best = (value, argument, step_rad);
                }
                missed[side] = argument;
            }
        }
    }
    // Between steps the elbow may just touch.
    let (mut low, mut high) = (best.1 - best.2, best.1 + best.2);
    for _ in 0..40 {
        let (left, right) = (low + 0.382 * (high - low), high - 0.382 * (high - low));
        if closing(left) > closing(right) {
            high = right;
        } else {
            low = left;
        }
    }
    Some(0.5 * (low + high))
}

/// Where `closing` turns from negative to not negative, on the latter side.
fn bisected(closing: impl Fn(f64) -> f64, mut outside: f64, mut inside: f64) -> f64 {
    for _ in 0..24 {
        let middle = 0.5 * (outside + inside);
        if closing(middle) >= 0.0 {
            inside = middle;
        } else {
            outside = middle;
        }
    }
    inside
}

impl Fold {
    /// With `q2 + q3 + q4` swung, and `q6` with it in the sense `turn`.
    fn swung(&self, swing_rad: f64, turn: f64) -> Self {
        let (sine, cosine) = libm::sincos(swing_rad);
        Self {
            q6: self.q6 + turn * swing_rad,
            s234: self.s234 * cosine + self.c234 * sine,
            c234: self.c234 * cosine - self.s234 * sine,
            ..*self
        }
    }
}

impl Arm {
    fn ahead_of(&self, v: &[Extended; 3]) -> Extended {
        v[0] * self.c1 + v[1] * self.s1
    }

    /// Component along the axis of joints 2, 3 and 4.
    fn along(&self, v: &[Extended; 3]) -> Extended {
        v[0] * self.s1 - v[1] * self.c1
    }

    /// The same with `q1` turned a little.
    fn turned(&self, centre: &[Extended; 3], turn_rad: f64) -> Self {
        let (sine, cosine) = libm::sincos(turn_rad);
        let c1 = self.c1 * cosine - self.s1 * sine;
        let s1 = self.s1 * cosine + self.c1 * sine;
        Self {
            c1,
            s1,
            ahead: centre[0] * c1 + centre[1] * s1,
            ..*self
        }
    }
}
