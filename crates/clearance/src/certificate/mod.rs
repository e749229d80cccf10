//! Proven lower bounds of the clearance along a whole motion.
//!
//! [`certify`] finds, for every class of pairs, the least clearance over all times of a motion,
//! from both sides: a value that is attained at a time it names, and a lower bound that holds at
//! every time, sampled or not. The two are no farther apart than a tolerance.
//!
//! # What is proved
//!
//! *Definitions.* A motion is a continuous course `q(t)` of six revolute joints. For a pair of
//! solids let `S` be the one nearer to the base along the chain (or fixed in the world) and `M` the
//! one farther out. Seen from `S`, only the joints between the two move `M`; call them
//! `first..=last`, with axes `z_k` through `o_k`, ordered outwards. For a unit vector `n` fixed to
//! `S`
//!
//! ```text
//! g_n(t) = min over x in M of n . x(t)  -  max over y in S of n . y
//! ```
//!
//! is the gap that the planes across `n` leave between the two (negative: how far they overlap
//! along `n`).
//!
//! *Planes.* For convex solids the signed distance is `d(t) = max over n of g_n(t)`: apart, by the
//! separating hyperplane; in penetration, because the depth is the shortest translation that parts
//! the two and each `n` needs one of `-g_n`. So **`d(t) >= g_n(t)` for every `n`, of either sign**.
//! A direction may come from anywhere, and a poor one costs sharpness only: that the bound holds
//! does not rest on the distance solver.
//!
//! *Chord.* Between two times let `q(t) = q_l + u (q_r - q_l) + e` with `u(t)` in `[0, 1]` and
//! `|e_k| <= E_k` ([`Motion::chord_deviation`], proven for each kind of motion). Write
//! `D = |q_r - q_l|`, and `R_k` for the largest distance of any point of `M` from axis `k` in any
//! such posture. Turning joint `k` by `a` moves a point of `M` by at most `R_k |a|`. Hence leaving
//! out `e` costs at most `sum E_k R_k`, and it remains to bound `g_n` along the straight chord.
//!
//! *Curvature.* Along the chord a point of `M` has
//! `x'' = sum over j, k of D_j D_k z_min(j,k) x (z_max(j,k) x (x - o_max(j,k)))` (signs inside), so
//!
//! ```text
//! |x''| <= K = sum over k of R_k D_k (D_k + 2 sum over first <= j < k of D_j).
//! ```
//!
//! The same with the links' angular velocities `w_i = sum over k <= i of D_k z_k` (signed) keeps
//! what joints undo of one another: `x - o_first` is the sum of the vectors `l_i` from joint to
//! joint and to the point, each fixed to a link, so `|x''| <= sum |l_i| (|w_i|^2 + |w_i'|)`, where
//! `|w_i'| <= A_i = sum over j < k <= i of D_j D_k |z_j x z_k|`, and
//! `|w_i| <= (|w_i(0)| + |w_i(1)| + A_i) / 2`. The angle of neighbouring axes is fixed by the chain,
//! and that of others is no larger than the sum of those between. `K` is the lesser of both.
//!
//! *Parabola.* A function with `|f''| <= K` stays above its chord minus `K u (1 - u) / 2`. This
//! holds for `n . x` of each point `x` of `M`, and with the ends replaced by the smaller `g_n` it
//! holds for all of them at once, so for their minimum:
//!
//! ```text
//! g_n(u) >= (1 - u) g_n(0) + u g_n(1) - K u (1 - u) / 2.
//! ```
//!
//! `d` is at least the larger of two such parabolas for two directions, and the least of that
//! over `u` is in closed form.
//!
//! *Lipschitz lemma*, for solids that are not convex. If every point of `M` moves by at most `L`
//! relative to `S`, the distance of solids that are apart changes by at most `L` (the distance of
//! each pair of points does); so does the signed distance of convex ones in penetration (every
//! `g_n` does, and so their maximum). With `L` a bound of the way from one end to the other,
//! `d >= (d_l + d_r - L) / 2` in between. `L` is the lesser of `sum R_k D_k` and
//! `(|x'(0)| + |x'(1)|) / 2 + K / 4`, each the largest over a ball around `M`.
//!
//! *Radii.* About its own joint's axis the radius of `M` is fixed. About an axis further in it
//! changes only as the joints beyond move `M`: from the outside inwards,
//! `R_j = (r_j(l) + r_j(r) + sum over k > j of R_k (D_k + 2 E_k)) / 2`, where `r_j` is the radius at
//! an end, and never more than the stretched chain allows.
//!
//! # The search
//!
//! Each interval of time carries the pairs of solids that are still open in it. A pair is closed
//! there, for good, when its bound is at least the least clearance attained so far in its class
//! minus the tolerance; the bound goes into the class's certificate. Otherwise the interval is
//! halved, the posture in its middle is looked at, and both halves carry the pair. *Invariant*: at
//! any time of the motion every pair is either in a closed interval whose bound is counted, or
//! open. When nothing is open the least counted bound holds for the class at all times, and since
//! attained clearances only fall, it is within the tolerance of the attained one. Where halving
//! no longer helps (intervals of [`LEAST_INTERVAL_S`], [`MOST_INTERVALS`]) a bound is counted as it
//! is: the certificate stays true and its width shows.
//!
//! On the cell of Table 3, to 0.1 mm, all classes: 0.6 to 0.9 ms for an approach of 60 mm (9 to 11
//! postures, 100 to 270 distances) and 1.2 to 4.2 ms for a transfer; `benches/certificate.rs`.
//!
//! # Rounding
//!
//! Every bound is lowered by [`ROUNDING_M`], 1 nm. In cells of metres and positions of less than
//! 100 rad, forward kinematics, placing and support functions round by less than 1e-14 m times a
//! few dozen operations; directions are unit vectors to 1e-15; both are below 1e-12 m together.

mod motion;
mod planes;
mod search;
mod sweep;

#[cfg(test)]
mod tests;

use needlebench_cell::ClearanceClass;
use needlebench_kinematics::trajectory::Phase;

use crate::model::{CLASS_COUNT, CUT_MARGIN_M, ClearanceModel, PairClearance};

pub use motion::{Motion, RecordedMotion, Span};

/// What rounding may cost, m; taken off every bound.
pub const ROUNDING_M: f64 = 1e-9;

/// Intervals that are not halved any more, s.
pub const LEAST_INTERVAL_S: f64 = 1e-9;

/// Number of intervals after which nothing is halved any more. Certificates of 0.1 mm take some
/// hundreds.
pub const MOST_INTERVALS: usize = 200_000;

/// How to certify.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CertificateOptions {
    /// Width of the certificate that is aimed at, m.
    pub tolerance_m: f64,
    /// How bounds are derived; both are proven.
    pub bound: MotionBound,
}

impl Default for CertificateOptions {
    fn default() -> Self {
        Self {
            tolerance_m: 1e-4,
            bound: MotionBound::Planes,
        }
    }
}

/// How a bound between two postures is derived.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MotionBound {
    /// By separating planes and curvature where both solids are convex: of second order.
    Planes,
    /// By the Lipschitz lemma alone: of first order, so that intervals near a minimum are many more.
    Lipschitz,
}

/// The least clearance of one class over a motion, from both sides.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClassCertificate {
    /// Proven lower bound of the clearance at every time, m.
    pub lower_bound_m: f64,
    /// Least clearance found, with its pair and witnesses.
    pub attained: PairClearance,
    /// Time at which it is attained, s.
    pub time_s: f64,
    /// Phase of that time.
    pub phase: Phase,
    /// Lower bound of the distance from where the patient's body may go on behind the cuts of its scan, at every time of
    /// the motion, m; not resolved beyond where [`is_known`](crate::is_known) holds. None where nothing is cut, or for a class that is not
    /// from the patient.
    pub behind_cuts_m: Option<f64>,
}

impl ClassCertificate {
    /// Distance between the attained clearance and the bound, m.
    pub fn width_m(&self) -> f64 {
        self.attained.separation.distance_m - self.lower_bound_m
    }
}

/// What a certificate took.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Effort {
    /// Postures whose kinematics were computed.
    pub postures: usize,
    /// Intervals that were looked at.
    pub intervals: usize,
    /// Signed distances of two solids, without those of the postures that the search starts from.
    pub distances: usize,
    /// Gaps along a fixed direction.
    pub planes: usize,
}

/// Certificates of all classes of a motion.
#[derive(Debug, Clone, PartialEq)]
pub struct MotionCertificate {
    classes: [Option<ClassCertificate>; CLASS_COUNT],
    /// What it took.
    pub effort: Effort,
}

impl MotionCertificate {
    /// Certificate of a class; `None` if the cell has no pair of that class, and for the access zone if the motion has
    /// no hold.
    pub fn get(&self, class: ClearanceClass) -> Option<&ClassCertificate> {
        self.classes[class as usize].as_ref()
    }

    /// The same of a motion that begins later.
    #[must_use]
    pub fn later_by(mut self, delay_s: f64) -> Self {
        for class in self.classes.iter_mut().flatten() {
            class.time_s += delay_s;
        }
        self
    }

    /// Of two motions together: the nearer of what is attained, the lesser bound.
    #[must_use]
    pub fn and(mut self, other: &Self) -> Self {
        for (mine, other) in self.classes.iter_mut().zip(&other.classes) {
            let (Some(one), Some(two)) = (*mine, other) else {
                *mine = mine.or(*other);
                continue;
            };
            let nearer = if two.attained.separation.distance_m < one.attained.separation.distance_m
            {
                *two
            } else {
                one
            };
            *mine = Some(ClassCertificate {
                lower_bound_m: one.lower_bound_m.min(two.lower_bound_m),
                behind_cuts_m: match (one.behind_cuts_m, two.behind_cuts_m) {
                    (Some(one), Some(two)) => Some(one.min(two)),
                    (one, two) => one.or(two),
                },
                ..nearer
            });
        }
        self.effort.postures += other.effort.postures;
        self.effort.intervals += other.effort.intervals;
        self.effort.distances += other.effort.distances;
        self.effort.planes += other.effort.planes;
        self
    }

    /// All classes, in the order of [`ClearanceClass`].
    pub fn iter(&self) -> impl Iterator<Item = (ClearanceClass, &ClassCertificate)> {
        let found = self.classes.iter().flatten();
        found.map(|each| (each.attained.class, each))
    }
}

/// Certifies the clearance of every class over all spans of a motion.
///
/// The access zone counts only during the hold phase, when needle and hand are there. A motion with joint positions
/// that are not finite gets the lower bound negative infinity. Deterministic; time and memory are bounded by
/// [`MOST_INTERVALS`].
pub fn certify(
    model: &ClearanceModel,
    motion: &impl Motion,
    options: &CertificateOptions,
) -> MotionCertificate {
    let all = [f64::INFINITY; CLASS_COUNT];
    let found = search::certify(model, motion, options, &[], all, 1.0);
    with_behind_cuts(found, model, motion, options)
}

/// The same with the distances from what may be behind the cuts of the patient's scan, as far as they matter.
fn with_behind_cuts(
    mut certificate: MotionCertificate,
    model: &ClearanceModel,
    motion: &impl Motion,
    options: &CertificateOptions,
) -> MotionCertificate {
    let Some(behind_cuts) = &model.behind_cuts else {
        return certificate;
    };
    let enough_m = certificate.classes.map(|class| {
        class.map_or(f64::NEG_INFINITY, |class| {
            let attained_m = class.attained.separation.distance_m.max(0.0);
            // Bounds of what is enough may be less by the tolerance and rounding.
            attained_m + CUT_MARGIN_M + options.tolerance_m + ROUNDING_M
        })
    });
    let found = search::certify(behind_cuts, motion, options, &[], enough_m, 1.0);
    for (class, found) in certificate.classes.iter_mut().zip(&found.classes) {
        if let (Some(class), Some(found)) = (class, found) {
            class.behind_cuts_m = Some(found.lower_bound_m);
        }
    }
    certificate
}

/// [`certify`] as far as it matters: a class is known to the tolerance where it comes nearer than
/// `enough_m` of it, and else its lower bound is at least that less the tolerance. Much of the work is
/// left out where little is enough; nothing is asked of a class with negative infinity.
pub fn certify_enough(
    model: &ClearanceModel,
    motion: &impl Motion,
    options: &CertificateOptions,
    enough_m: impl Fn(ClearanceClass) -> f64,
) -> MotionCertificate {
    let enough_m = ClearanceClass::ALL.map(enough_m);
    search::certify(model, motion, options, &[], enough_m, 1.0)
}

/// [`certify`], whose attained clearances are at most those at any of the given times (s, in
/// ascending order): the least of a whole series without making the series.
///
/// A couple is looked at only at those times at which its proven bound leaves it open whether it is
/// the nearest of its class. The bounds are those of [`certify`].
pub fn certify_sampled(
    model: &ClearanceModel,
    motion: &impl Motion,
    options: &CertificateOptions,
    samples_s: &[f64],
) -> MotionCertificate {
    let all = [f64::INFINITY; CLASS_COUNT];
    let found = search::certify(model, motion, options, samples_s, all, 1.0);
    with_behind_cuts(found, model, motion, options)
}
