//! All solutions of a pose on a chain that is only nearly a UR arm: a calibrated robot.
//!
//! A factory calibration moves every joint axis by fractions of a millimetre and a few milliradian.
//! The closed form does not hold any more, but its solutions are near the true ones, and Newton's
//! method takes each of them there. Next to a singularity that is not enough, since there a small
//! change of the arm moves branches far, merges or unmakes them. There the nominal arm is solved
//! for many poses about the wanted one, as far off as the calibration moves the flange, and every
//! branch of each is a start for Newton's method.

use nalgebra::{UnitQuaternion, Vector3};

use super::closed_form::{clamped, unreachable};
use super::numerical::{Refined, Target};
use super::{
    ClosedForm, Configuration, Elbow, Numerical, Preference, Unreachable, closed_form_into,
    wrap_angle,
};
use crate::geometry::{Mismatch, base_from_base_link};
use crate::random::SplitMix64;
use crate::{Chain, Joints, Pose, UrGeometry};

/// A posture with less residual solves the pose: m and rad.
const SOLVED: f64 = 1e-12;

/// Solutions nearer to one another than this, rad, are one.
const SAME_RAD: f64 = 1e-7;

/// Starts nearer to one another than this, rad, lead to the same solution.
const SAME_START_RAD: f64 = 0.1;

/// Poses tried about the wanted one near a singularity: at most, and after the last that led to a
/// new solution.
const MOST_POSES: u32 = 32;
const POSES_IN_VAIN: u32 = 8;

/// Share of the calibration's mismatch by which the poses tried are off, in turn.
const SIZES: [f64; 3] = [1.0, 3.0, 0.3];

/// A metre counts as this many radians where both are minimised together.
pub(super) const RAD_PER_M: f64 = 2.0;

/// A solution of the calibrated chain under the name of its branch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Branch {
    pub configuration: Configuration,
    /// With its joints wrapped.
    pub solution: Refined,
}

/// What a calibrated chain makes of a pose.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Branches {
    /// In the order of [`Configuration::ALL`].
    pub found: Vec<Branch>,
    /// Branches of the nominal arm that the calibrated one does not have.
    pub lost: Vec<(Configuration, Unreachable)>,
}

/// A pose to be solved on a chain near a nominal geometry.
pub(super) struct Calibrated<'a> {
    pub chain: &'a Chain,
    pub numerical: &'a Numerical,
    pub geometry: &'a UrGeometry,
    pub mismatch: Mismatch,
    /// In `base_link`.
    pub pose: &'a Pose,
    /// The same, prepared.
    pub target: Target,
}

impl Calibrated<'_> {
    /// All branches, from those of the nominal arm at the same pose.
    pub(super) fn branches(&self, nominal: &ClosedForm) -> Branches {
        let mut solutions: Vec<Refined> = Vec::with_capacity(8);
        let mut names: Vec<Configuration> = Vec::with_capacity(8);
        let mut doubtful = false;
        for row in nominal.solutions() {
            doubtful |= row.merged || row.wrist_3_is_free;
            match self.newton(&row.joints) {
                Some(found) => {
                    let wrist_turns_far =
                        found.joints[4].sin().abs() < 2.5 * self.mismatch.angle_rad;
                    doubtful |= wrist_turns_far || !insert(&mut solutions, &found);
                    names.push(row.configuration);
                }
                None => doubtful = true,
            }
        }
        let base_from_flange = base_from_base_link() * self.pose;
        doubtful = doubtful
            || nominal.unreachable(self.geometry, &base_from_flange).any(
                |(configuration, reason)| {
                    configuration.elbow == Elbow::Down
                        && self.may_exist(configuration, reason.missing_m())
                },
            );
        if !doubtful {
            let pairs = names.into_iter().zip(solutions);
            return Branches {
                found: pairs
                    .map(|(configuration, solution)| Branch {
                        configuration,
                        solution,
                    })
                    .collect(),
                lost: Vec::new(),
            };
        }
        self.search(&mut solutions);
        let found = named(self.geometry, &solutions);
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

    /// By how much the calibration moves wrist 1, which `q6` swings the farther the smaller `s5`
    /// is; twice that, m.
    fn doubtful_m(&self, q: &Joints) -> f64 {
        let swing = (self.mismatch.angle_rad / q[4].sin().abs()).min(1.0);
        2.0 * (self.mismatch.position_m + self.geometry.d5.abs() * swing)
    }

    /// A branch that the nominal arm misses by so much may exist on the calibrated one.
    fn may_exist(&self, configuration: Configuration, missing_m: f64) -> bool {
        let Configuration {
            shoulder, wrist, ..
        } = configuration;
        let mut pose = base_from_base_link() * self.pose;
        let mut missing_m = missing_m;
        // The calibration's error at the branch itself leaves a smaller doubt each time.
        for share in [1.0, 0.3, 0.1] {
            let q = clamped(self.geometry, &pose, configuration, 0.0);
            if missing_m > share * self.doubtful_m(&q) {
                return false;
            }
            pose = self.corrected(&q);
            missing_m = unreachable(self.geometry, &pose, shoulder, wrist)
                .map_or(0.0, Unreachable::missing_m);
        }
        true
    }

    /// Adds every solution near the nominal branches of poses about the wanted one.
    fn search(&self, solutions: &mut Vec<Refined>) {
        let mut random = SplitMix64::new(1);
        let mut starts: Vec<Joints> = solutions.iter().map(|known| known.joints).collect();
        let mut centres: Vec<Pose> = Vec::new();
        let mut nominal = ClosedForm::BLANK;
        let mut last_new = 0;
        let mut twins_of = 0;
        for count in 0..MOST_POSES {
            if count > last_new + POSES_IN_VAIN {
                break;
            }
            while centres.len() < solutions.len() {
                centres.push(self.corrected(&solutions[centres.len()].joints));
            }
            let centre = match centres.len() {
                0 => base_from_base_link() * self.pose,
                known => centres[count as usize % known],
            };
            let size = SIZES[count as usize % SIZES.len()];
            let pose = self.nudged(&centre, size, &mut random);
            closed_form_into(self.geometry, &pose, Preference::default(), &mut nominal);
            for row in nominal.solutions() {
                if starts
                    .iter()
                    .any(|q| apart(q, &row.joints) < SAME_START_RAD)
                {
                    continue;
                }
                starts.push(row.joints);
                if let Some(q) = self.newton(&row.joints)
                    && insert(solutions, &q)
                {
                    last_new = count;
                }
            }
            // Solutions come in pairs that meet at a singularity.
            while twins_of < solutions.len() {
                if let Some(q) = self.twin(&solutions[twins_of].joints)
                    && insert(solutions, &q)
                {
                    last_new = count;
                }
                twins_of += 1;
            }
        }
    }

    /// The solution that meets the given one at a singularity not far away.
    ///
    /// Along the direction `v` that moves the flange least, by `sigma u` per radian, the error
    /// grows as `sigma t + kappa t^2 / 2`, which has a second zero at `-2 sigma / kappa`.
    fn twin(&self, q: &Joints) -> Option<Refined> {
        /// Solutions farther apart are found from a start of their own.
        const FARTHEST_RAD: f64 = 1.0;
        const STEP_RAD: f64 = 1e-4;
        /// A twin is near only where one of the singularities is: sines, and the wrist's way ahead
        /// over the arm's length.
        const NEAR: f64 = 0.35;
        let reach_m = (self.geometry.a2 + self.geometry.a3).abs();
        let ahead = self.geometry.wrist_forward_m(q).abs() / reach_m;
        if q[2].sin().abs().min(q[4].sin().abs()).min(ahead) > NEAR {
            return None;
        }
        let svd = self.chain.jacobian(q).svd(true, true);
        let (u, v) = (svd.u?.column(5).into_owned(), svd.v_t?.row(5).transpose());
        let sigma = svd.singular_values[5];
        let moved = self.chain.jacobian(&(q + v * STEP_RAD));
        let before = self.chain.jacobian(&(q - v * STEP_RAD));
        let kappa = u.dot(&((moved - before) * v)) / (2.0 * STEP_RAD);
        let way = -2.0 * sigma / kappa;
        // A quotient of zeros is not in range either.
        (-FARTHEST_RAD..=FARTHEST_RAD)
            .contains(&way)
            .then(|| self.newton(&(q + v * way)))?
    }

    fn nudged(&self, pose: &Pose, size: f64, random: &mut SplitMix64) -> Pose {
        let mut vector =
            |length: f64| Vector3::from_fn(|_, _| length * size * random.uniform(-1.0, 1.0));
        let shift = vector(self.mismatch.position_m);
        let turn = vector(self.mismatch.angle_rad);
        Pose::from_parts(
            (pose.translation.vector + shift).into(),
            UnitQuaternion::from_scaled_axis(turn) * pose.rotation,
        )
    }

    /// The pose that the nominal arm would have to reach if its error at `q` were the same
    /// everywhere, in the controller's base frame.
    fn corrected(&self, q: &Joints) -> Pose {
        let base_from_base_link = base_from_base_link();
        let actual = base_from_base_link * self.chain.base_link_from_flange(q);
        let nominal = self.geometry.base_from_flange(q);
        nominal * actual.inverse() * (base_from_base_link * self.pose)
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

/// Greatest difference of two postures in any joint, whole turns aside, rad.
fn apart(a: &Joints, b: &Joints) -> f64 {
    (a - b).map(|d| wrap_angle(d).abs()).max()
}

/// Adds a solution unless it is known.
fn insert(solutions: &mut Vec<Refined>, found: &Refined) -> bool {
    let new = solutions
        .iter()
        .all(|known| apart(&known.joints, &found.joints) >= SAME_RAD);
    if new {
        solutions.push(*found);
    }
    new
}

/// Gives each solution the name of a branch: by the signs of the nominal arm, and where two would
/// have the same, by the least change of a sine or of the wrist's way ahead that tells them apart.
fn named(geometry: &UrGeometry, solutions: &[Refined]) -> Vec<Branch> {
    let cost = |q: &Joints, configuration: Configuration| {
        let Configuration {
            shoulder,
            elbow,
            wrist,
        } = configuration;
        let against = |value: f64, sign: f64| (-value * sign).max(0.0);
        let ahead = geometry.wrist_forward_m(q) / (geometry.a2 + geometry.a3).abs();
        // Elbow and wrist are named by their sines relative to the shoulder's sign.
        against(ahead, shoulder.sign())
            + against(q[2].sin(), elbow.sign(shoulder))
            + against(q[4].sin(), wrist.sign(shoulder))
    };
    let mut pairs: Vec<(f64, usize, usize)> = solutions
        .iter()
        .enumerate()
        .flat_map(|(solution, found)| {
            Configuration::ALL
                .into_iter()
                .enumerate()
                .map(move |(name, configuration)| {
                    (cost(&found.joints, configuration), solution, name)
                })
        })
        .collect();
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
    let mut names: [Option<usize>; 8] = [None; 8];
    let mut used = vec![false; solutions.len()];
    for (_, solution, name) in pairs {
        if !used[solution] && names[name].is_none() {
            names[name] = Some(solution);
            used[solution] = true;
        }
    }
    Configuration::ALL
        .into_iter()
        .zip(names)
        .filter_map(|(configuration, solution)| {
            Some(Branch {
                configuration,
                solution: solutions[solution?],
            })
        })
        .collect()
}
