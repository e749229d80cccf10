//! All solutions of a flange pose on a real chain.

use super::calibrated::{Calibrated, RAD_PER_M};
use super::closed_form::clamped;
use super::numerical::Target;
use super::{
    Certificate, ClosedForm, Configuration, Numerical, Preference, Unreachable, closed_form_into,
    wrap_angle,
};
use crate::geometry::{Mismatch, base_from_base_link};
use crate::{Chain, JointLimits, Joints, NotUrGeometry, Pose, UrGeometry};

/// What a row is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SolutionKind {
    /// Reproduces the pose.
    Exact,
    /// The nearest posture that the solver found; the residuals say how far off.
    Nearest,
}

/// One posture for a pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Solution {
    /// Which of the eight it is.
    pub configuration: Configuration,
    /// Joint positions, rad, each in `[-pi, pi]`.
    pub joints: Joints,
    /// Distance of the flange from the wanted position, by forward kinematics, m.
    pub residual_m: f64,
    /// Angle of the flange from the wanted orientation, by forward kinematics, rad.
    pub residual_rad: f64,
    /// Exact or only nearest.
    pub kind: SolutionKind,
    /// Wrist 3 is free: this is one member of a family (`q5` is 0 or pi).
    pub wrist_3_is_free: bool,
    /// A root was zero: another configuration is the same posture and has no row of its own.
    pub merged: bool,
}

/// All solutions of a pose.
#[derive(Debug, Clone, PartialEq)]
pub struct Solutions {
    /// Those that exist, in the order of [`Configuration::ALL`]; a calibrated arm may have several
    /// of a name near a singularity.
    pub solutions: Vec<Solution>,
    /// Least-squares postures for a pose that no configuration reaches, nearest first. Never
    /// solutions.
    pub nearest: Vec<Solution>,
    /// Configurations that do not reach the pose, with the reason.
    pub unreachable: Vec<(Configuration, Unreachable)>,
    /// What the answer is worth.
    pub certificate: Certificate,
}

/// An arm ready for inverse kinematics.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Kinematics {
    /// The chain whose flange is placed.
    pub chain: Chain,
    /// Its nearest nominal geometry, which the closed form solves.
    pub geometry: UrGeometry,
    numerical: Numerical,
    mismatch: Mismatch,
    limits: Option<JointLimits>,
}

impl Kinematics {
    /// Prepares a chain.
    ///
    /// # Errors
    /// [`NotUrGeometry`] if it is not a UR arm.
    pub fn new(chain: Chain) -> Result<Self, NotUrGeometry> {
        let geometry = UrGeometry::of_chain(&chain)?;
        Ok(Self {
            chain,
            geometry,
            numerical: Numerical::new(&chain),
            mismatch: Mismatch::of(&chain, &geometry),
            limits: None,
        })
    }

    /// The same with joint limits, which then decide between the members of a family.
    pub fn within(self, limits: JointLimits) -> Self {
        Self {
            limits: Some(limits),
            ..self
        }
    }

    /// The chain is a nominal arm: the closed form is its exact solution, certificates included.
    pub fn is_nominal(&self) -> bool {
        self.mismatch.is_nominal()
    }

    /// Every configuration that brings the flange to a pose in `base_link`.
    ///
    /// A nominal chain is solved by the closed form. A calibrated one has every branch of the
    /// nominal arm refined, with a sweep of every shoulder that is next to a singularity; near
    /// singularities it may have more than one row of a name. Of postures of nine real calibrations,
    /// random and near each singularity, at least 99.9 % are found again
    /// (`the_posture_that_made_the_pose_is_found`). Residual of every row at most 1e-12 m and rad
    /// (`every_solution_reproduces_the_pose`).
    pub fn solve(&self, base_link_from_flange: &Pose, seed: Option<&Joints>) -> Solutions {
        let mut answer = self.branches(base_link_from_flange, seed);
        if answer.solutions.is_empty() && is_finite(base_link_from_flange) {
            // A nearest posture that solves the pose is a solution that was missed.
            (answer.solutions, answer.nearest) = self
                .nearest(base_link_from_flange, seed)
                .into_iter()
                .partition(|row| row.kind == SolutionKind::Exact);
            if answer.solutions.is_empty() {
                answer.certificate = Certificate::NearestOnly;
            } else {
                answer.nearest.clear();
                let found = &answer.solutions;
                answer
                    .unreachable
                    .retain(|(name, _)| found.iter().all(|row| row.configuration != *name));
                answer.certificate = Certificate::Refined;
            }
        }
        answer
    }

    /// [`Kinematics::solve`] without the search for nearest postures where no configuration reaches
    /// the pose, which takes a thousand times as long as all the rest.
    pub fn branches(&self, base_link_from_flange: &Pose, seed: Option<&Joints>) -> Solutions {
        let base_from_flange = base_from_base_link() * base_link_from_flange;
        let preference = Preference {
            seed,
            limits: self.limits.as_ref(),
        };
        let mut nominal = ClosedForm::BLANK;
        closed_form_into(&self.geometry, &base_from_flange, preference, &mut nominal);
        let target = self.numerical.target(base_link_from_flange);
        if self.is_nominal() || !is_finite(base_link_from_flange) {
            Solutions {
                solutions: nominal
                    .solutions()
                    .map(|row| Solution {
                        wrist_3_is_free: row.wrist_3_is_free,
                        merged: row.merged,
                        ..self.refined(&target, row.configuration, &row.joints)
                    })
                    .collect(),
                nearest: Vec::new(),
                unreachable: nominal
                    .unreachable(&self.geometry, &base_from_flange)
                    .collect(),
                certificate: nominal.certificate(),
            }
        } else {
            self.calibrated(base_link_from_flange, &nominal)
        }
    }

    /// Pose of the flange in `base_link`.
    pub fn base_link_from_flange(&self, q: &Joints) -> Pose {
        self.chain.base_link_from_flange(q)
    }

    /// Numerical solvers on the same chain.
    pub fn numerical(&self) -> &Numerical {
        &self.numerical
    }

    fn near_nominal<'a>(&'a self, pose: &'a Pose) -> Calibrated<'a> {
        Calibrated {
            numerical: &self.numerical,
            geometry: &self.geometry,
            mismatch: self.mismatch,
            pose,
            target: self.numerical.target(pose),
        }
    }

    fn calibrated(&self, target: &Pose, nominal: &ClosedForm) -> Solutions {
        let branches = self.near_nominal(target).branches(nominal);
        let solutions: Vec<Solution> = branches
            .found
            .iter()
            .map(|branch| {
                let found = branch.solution;
                let residuals = (found.residual_m, found.residual_rad);
                row(branch.configuration, found.joints, residuals)
            })
            .collect();
        let mut unreachable = branches.lost;
        let base_from_flange = base_from_base_link() * target;
        unreachable.extend(
            nominal
                .unreachable(&self.geometry, &base_from_flange)
                .filter(|(name, _)| solutions.iter().all(|row| row.configuration != *name)),
        );
        unreachable.sort_by_key(|(configuration, _)| configuration.index());
        Solutions {
            solutions,
            nearest: Vec::new(),
            unreachable,
            certificate: Certificate::Refined,
        }
    }

    /// Least-squares postures near every configuration, best first.
    fn nearest(&self, target: &Pose, seed: Option<&Joints>) -> Vec<Solution> {
        let base_from_flange = base_from_base_link() * target;
        let mut rows: Vec<Solution> = Vec::new();
        for configuration in Configuration::ALL {
            let seed_6_rad = seed.map_or(0.0, |seed| seed[5]);
            let start = clamped(&self.geometry, &base_from_flange, configuration, seed_6_rad);
            let found = self.numerical.nearest(target, &start, RAD_PER_M);
            let q = found.joints.map(wrap_angle);
            let row = self.row(
                &self.numerical.target(target),
                Configuration::of(&self.geometry, &q),
                q,
            );
            let known = rows.iter().any(|other| {
                (other.joints - q).map(|d| wrap_angle(d).abs()).max() < SAME_POSTURE_RAD
            });
            if !known {
                rows.push(row);
            }
        }
        rows.sort_by(|a, b| cost(a).total_cmp(&cost(b)));
        rows
    }

    fn row(&self, target: &Target, configuration: Configuration, joints: Joints) -> Solution {
        row(
            configuration,
            joints,
            self.numerical.residuals(target, &joints),
        )
    }

    /// A row of the closed form, with a step or two of Newton's method where the chain's origins
    /// were printed to a few digits.
    fn refined(&self, target: &Target, configuration: Configuration, start: &Joints) -> Solution {
        let closed = self.row(target, configuration, *start);
        if closed.residual_m.max(closed.residual_rad) <= CLOSED_FORM_SUFFICES {
            return closed;
        }
        let Some(found) = self.numerical.refined(target, start) else {
            return closed;
        };
        let residuals = (found.residual_m, found.residual_rad);
        let refined = row(configuration, found.joints.map(wrap_angle), residuals);
        // A step that jumps to another branch would give the row a wrong name.
        let same_branch = (found.joints - start).amax() < 0.1;
        let better = residuals.0.max(residuals.1) < closed.residual_m.max(closed.residual_rad);
        if same_branch && better {
            refined
        } else {
            closed
        }
    }
}

fn row(
    configuration: Configuration,
    joints: Joints,
    (residual_m, residual_rad): (f64, f64),
) -> Solution {
    let exact = residual_m.max(residual_rad) <= EXACT;
    Solution {
        configuration,
        joints,
        residual_m,
        residual_rad,
        kind: if exact {
            SolutionKind::Exact
        } else {
            SolutionKind::Nearest
        },
        wrist_3_is_free: false,
        merged: false,
    }
}

/// A row is exact below this: m and rad.
const EXACT: f64 = 1e-9;

/// Good enough to leave a row as the closed form gives it, m and rad.
const CLOSED_FORM_SUFFICES: f64 = 1e-13;

/// Nearest postures nearer to one another than this, rad, are one.
const SAME_POSTURE_RAD: f64 = 1e-4;

/// What the search for the nearest posture minimises, rad.
fn cost(row: &Solution) -> f64 {
    (RAD_PER_M * row.residual_m).hypot(row.residual_rad)
}

fn is_finite(pose: &Pose) -> bool {
    let mut numbers = pose.translation.vector.iter().chain(&pose.rotation.coords);
    numbers.all(|value| value.is_finite())
}
