//! All solutions of a pose on a chain that is only nearly a UR arm: a calibrated robot.
//!
//! A factory calibration moves every joint axis by fractions of a millimetre and a few milliradian.
//! The closed form does not hold any more, but its solutions are near the true ones, and Newton's
//! method takes each of them there. Next to a singularity that is not enough, since there a small
//! change of the arm moves branches far, merges or unmakes them, or makes four of two: ten of
//! a pose were seen. There every solution of the shoulder is looked for ([`sweep`]).

use std::f64::consts::TAU;

mod chart;
mod names;
mod sweep;
#[cfg(test)]
mod tests;

use super::closed_form::clamped;
use super::numerical::{Refined, Target};
use super::{ClosedForm, Configuration, Elbow, Numerical, Shoulder, Unreachable, wrap_angle};
use crate::geometry::{Mismatch, base_from_base_link};
use crate::{Joints, Pose, UrGeometry};
use chart::Chart;
use names::named;
use sweep::sweep;

/// A posture with less residual solves the pose: m and rad.
const SOLVED: f64 = 1e-12;

/// Solutions nearer to one another than this, rad, are one.
const SAME_RAD: f64 = 1e-7;

/// Solutions nearer than this may be one, rad.
const NEIGHBOURS_RAD: f64 = 1e-3;

/// A solution farther from its start than this, rad, is another than the one looked for.
const STRAYED_RAD: f64 = 0.05;

/// A calibration moves a singularity by up to this many times its angle: at the folded elbow by as
/// many times as the arm is longer than what is left of it.
const TURNS: f64 = 16.0;

/// Solutions this near to one where two singularities are near belong to its cluster, rad.
const CLUSTER_RAD: f64 = 0.1;

/// A metre counts as this many radians where both are minimised together.
pub(super) const RAD_PER_M: f64 = 2.0;

/// A solution of the calibrated chain under the name of its branch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Branch {
    pub configuration: Configuration,
    /// With its joints wrapped.
    pub solution: Refined,
}

/// The singularities that are near.
#[derive(Debug, Clone, Copy)]
struct Singular {
    shoulder: bool,
    elbow: bool,
    wrist: bool,
}

impl Singular {
    fn count(self) -> u8 {
        u8::from(self.shoulder) + u8::from(self.elbow) + u8::from(self.wrist)
    }
}

/// What a calibrated chain makes of a pose.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Branches {
    /// In the order of [`Configuration::ALL`]; several of a name where there are several.
    pub found: Vec<Branch>,
    /// Branches of the nominal arm that the calibrated one does not have.
    pub lost: Vec<(Configuration, Unreachable)>,
}

/// A pose to be solved on a chain near a nominal geometry.
pub(super) struct Calibrated<'a> {
    pub numerical: &'a Numerical,
    pub geometry: &'a UrGeometry,
    pub mismatch: Mismatch,
    /// In `base_link`.
    pub pose: &'a Pose,
    /// The same, prepared.
    pub target: Target,
}

impl Calibrated<'_> {
    /// All branches: those of the nominal arm at the same pose refined, and a sweep of each shoulder
    /// that is near a singularity.
    pub(super) fn branches(&self, nominal: &ClosedForm) -> Branches {
        let mut solutions: Vec<Refined> = Vec::with_capacity(16);
        let doubtful = self.refine_nominal(nominal, &mut solutions);
        if doubtful != [false; 2] {
            self.search(doubtful, &mut solutions);
        }
        let found = named(self.geometry, &solutions, TURNS * self.mismatch.angle_rad);
        let lost = nominal
            .solutions()
            .filter(|row| {
                let name = row.configuration;
                found.iter().all(|branch| branch.configuration != name)
            })
            .filter_map(|row| {
                let nearest = self.numerical.nearest(self.pose, &row.joints, RAD_PER_M);
                let (missing_m, missing_rad) = (nearest.residual_m, nearest.residual_rad);
                let reason = Unreachable::NoCounterpart {
                    missing_m,
                    missing_rad,
                };
                // One that ends on a solution has become one with another branch.
                (missing_m.max(missing_rad) > SOLVED).then_some((row.configuration, reason))
            })
            .collect();
        Branches { found, lost }
    }

    /// Refines every branch of the nominal arm; tells of which shoulders, right and left, there may
    /// be more to find.
    fn refine_nominal(&self, nominal: &ClosedForm, solutions: &mut Vec<Refined>) -> [bool; 2] {
        let mut doubtful = [false; 2];
        let side = |shoulder: Shoulder| usize::from(shoulder == Shoulder::Left);
        for row in nominal.solutions() {
            let doubt = &mut doubtful[side(row.configuration.shoulder)];
            *doubt |= row.merged || row.wrist_3_is_free;
            let Some(found) = self.newton(&row.joints) else {
                *doubt = true;
                continue;
            };
            let singular = self.singular(&found.joints);
            *doubt |= singular.elbow || singular.wrist;
            *doubt |= apart(&found.joints, &row.joints) > STRAYED_RAD;
            *doubt |= !self.insert(solutions, &found);
            if row.merged || singular.shoulder {
                doubtful = [true; 2];
            }
        }
        let base_from_flange = base_from_base_link() * self.pose;
        for (configuration, reason) in nominal.unreachable(self.geometry, &base_from_flange) {
            let index = side(configuration.shoulder);
            if configuration.elbow == Elbow::Down && !doubtful[index] {
                let q = clamped(self.geometry, &base_from_flange, configuration, 0.0);
                let singular = self.singular(&q);
                doubtful[index] =
                    singular.shoulder || singular.wrist || reason.missing_m() < self.doubtful_m(&q);
            }
        }
        doubtful
    }

    /// Which singularities are near a posture, as seen from a calibration.
    fn singular(&self, q: &Joints) -> Singular {
        /// As sines, and as the wrist's way ahead over the arm's length.
        const NEAR: f64 = 0.06;
        let reach_m = (self.geometry.a2 + self.geometry.a3).abs();
        let ahead = self.geometry.wrist_forward_m(q).abs() / reach_m;
        Singular {
            shoulder: ahead < NEAR.max(TURNS * self.mismatch.angle_rad),
            elbow: libm::sin(q[2]).abs() < NEAR,
            wrist: libm::sin(q[4]).abs() < NEAR.max(TURNS * self.mismatch.angle_rad),
        }
    }

    /// By how much the calibration moves wrist 1, which `q6` swings the farther the smaller `s5`
    /// is; four times that, m.
    fn doubtful_m(&self, q: &Joints) -> f64 {
        let swing = (self.mismatch.angle_rad / libm::sin(q[4]).abs()).min(1.0);
        4.0 * (self.mismatch.position_m + self.geometry.d5.abs() * swing)
    }

    /// Adds every solution of the doubtful shoulders.
    fn search(&self, doubtful: [bool; 2], solutions: &mut Vec<Refined>) {
        let base_from_flange = base_from_base_link() * self.pose;
        let margin_m = 2.0 * self.mismatch.position_m;
        for (shoulder, _) in [1.0, -1.0]
            .into_iter()
            .zip(doubtful)
            .filter(|(_, doubt)| *doubt)
        {
            let chart = Chart::new(self.numerical, self.geometry, &base_from_flange, shoulder);
            sweep(&chart, self.geometry, margin_m, |start| {
                match self.newton(start) {
                    Some(found) => {
                        self.insert(solutions, &found);
                        if apart(&found.joints, start) > STRAYED_RAD {
                            self.pair(start, false, solutions);
                        }
                    }
                    None => self.pair(start, false, solutions),
                }
            });
        }
        // Solutions come in pairs that meet at a singularity, and in clusters about several.
        let mut centres: Vec<Joints> = Vec::new();
        for index in 0..solutions.len() {
            let joints = solutions[index].joints;
            let count = self.singular(&joints).count();
            if count > 0 {
                self.pair(&joints, true, solutions);
            }
            if count > 1 && centres.iter().all(|q| apart(q, &joints) > CLUSTER_RAD) {
                self.cluster(&joints, solutions);
                centres.push(joints);
            }
        }
    }

    /// Adds the solutions around one where two singularities are near.
    fn cluster(&self, centre: &Joints, solutions: &mut Vec<Refined>) {
        const RADII_RAD: [f64; 2] = [0.02, 0.08];
        const DIRECTIONS: u32 = 8;
        let Some([first, second]) = self.numerical.flattest_plane(centre) else {
            return;
        };
        for radius_rad in RADII_RAD {
            for step in 0..DIRECTIONS {
                let angle = TAU * f64::from(step) / f64::from(DIRECTIONS);
                let (sine, cosine) = libm::sincos(angle);
                let start = centre + (first * cosine + second * sine) * radius_rad;
                if let Some(found) = self.newton(&start) {
                    self.insert(solutions, &found);
                }
            }
        }
    }

    /// Adds the two solutions that meet at a singularity near a posture, or the other one if the
    /// posture is one of them.
    fn pair(&self, near: &Joints, is_one: bool, solutions: &mut Vec<Refined>) {
        let Some(starts) = self.numerical.fold(&self.target, near) else {
            return;
        };
        let known = |start: &Joints| apart(start, near);
        let (a, b) = (known(&starts[0]), known(&starts[1]));
        for (start, known) in starts.iter().zip([a < 0.2 * b, b < 0.2 * a]) {
            if is_one && known {
                continue;
            }
            if let Some(found) = self.newton(start) {
                self.insert(solutions, &found);
            }
        }
    }

    /// Adds a solution unless it is known. Two are one where the posture between them solves the
    /// pose as well: next to a double root, Newton's method ends a little off on either side.
    fn insert(&self, solutions: &mut Vec<Refined>, found: &Refined) -> bool {
        let same = |known: &Refined| {
            let distance = apart(&known.joints, &found.joints);
            if distance >= NEIGHBOURS_RAD {
                return false;
            }
            let half = (found.joints - known.joints).map(wrap_angle) * 0.5;
            let (m, rad) = self
                .numerical
                .residuals(&self.target, &(known.joints + half));
            distance < SAME_RAD || m.max(rad) < SOLVED
        };
        let new = !solutions.iter().any(same);
        if new {
            solutions.push(*found);
        }
        new
    }

    /// The solution that Newton's method finds from a start.
    fn newton(&self, start: &Joints) -> Option<Refined> {
        let found = self.numerical.refined(&self.target, start)?;
        (found.residual_m.max(found.residual_rad) < SOLVED).then(|| Refined {
            joints: found.joints.map(wrap_angle),
            ..found
        })
    }
}

/// Greatest difference of two postures in any joint, rad; 2π equivalents differ by 0.
fn apart(a: &Joints, b: &Joints) -> f64 {
    (a - b).map(|d| wrap_angle(d).abs()).max()
}
