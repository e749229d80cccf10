//! All solutions of a flange pose on a real chain.

use super::calibrated::{Calibrated, RAD_PER_M};
use super::closed_form::{clamped, defect};
use super::numerical::Target;
use super::{
    Certificate, ClosedForm, ClosedFormSolution, Configuration, Elbow, Numerical, Preference,
    Tolerance, Unreachable, closed_form_batch_within, closed_form_within, wrap_angle,
};
use nalgebra::UnitQuaternion;

use crate::geometry::{Mismatch, base_from_base_link};
use crate::{Chain, JointLimits, Joints, NotUrGeometry, Pose, UrGeometry};

/// Kind of a solution.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SolutionKind {
    /// Reproduces the pose.
    Exact,
    /// Reproduces the pose within the tolerance.
    Touching,
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
    /// Distance of the flange from the requested position, by forward kinematics, m.
    pub residual_m: f64,
    /// Angle of the flange from the requested orientation, by forward kinematics, rad.
    pub residual_rad: f64,
    /// Exact or only nearest.
    pub kind: SolutionKind,
    /// Wrist 3 is free: this is one member of a family (`q5` is 0 or pi).
    pub wrist_3_is_free: bool,
    /// Coincident: a root was zero, and another configuration is the same posture without a separate solution.
    pub merged: bool,
    /// Boundary solution: it exists only within the rounding of the pose, or within the tolerance. The
    /// residuals give the distance.
    pub touching: bool,
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
    /// The certificate of the answer.
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
    tolerance: Tolerance,
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
            tolerance: Tolerance::default(),
        })
    }

    /// The same with another tolerance of boundary solutions, which are flagged as touching. The default
    /// is [`Tolerance::default`].
    pub fn touching_within(self, tolerance: Tolerance) -> Self {
        Self { tolerance, ..self }
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
    /// singularities it may have more than one solution of a name. Of postures of nine real calibrations,
    /// random and near each singularity, at least 99.9 % are found again
    /// (`the_posture_that_made_the_pose_is_found`). Residual of every solution at most 1e-12 m and rad
    /// (`every_solution_reproduces_the_pose`).
    pub fn solve(&self, base_link_from_flange: &Pose, seed: Option<&Joints>) -> Solutions {
        let mut answer = self.branches(base_link_from_flange, seed);
        if answer.certificate == Certificate::NotAPose {
            return answer;
        }
        let pose = normalised(base_link_from_flange);
        if !self.is_nominal() {
            self.add_touching(&pose, &mut answer);
        }
        if answer.solutions.is_empty() {
            // A nearest posture that solves the pose is a solution that was missed.
            (answer.solutions, answer.nearest) = self
                .nearest(&pose, seed)
                .into_iter()
                .partition(|row| row.kind != SolutionKind::Nearest);
            if answer.solutions.is_empty() {
                answer.certificate = Certificate::NearestOnly;
            } else {
                answer.nearest.clear();
                answer.certificate = Certificate::Refined;
            }
        }
        let found = &answer.solutions;
        answer
            .unreachable
            .retain(|(name, _)| found.iter().all(|row| row.configuration != *name));
        answer
    }

    /// [`Kinematics::solve`] without the search for nearest postures where no configuration reaches
    /// the pose, which takes a thousand times as long as all the rest.
    pub fn branches(&self, base_link_from_flange: &Pose, seed: Option<&Joints>) -> Solutions {
        if let Some(defect) = defect(base_link_from_flange) {
            return Solutions {
                solutions: Vec::new(),
                nearest: Vec::new(),
                unreachable: Configuration::ALL.map(|name| (name, defect)).into(),
                certificate: Certificate::NotAPose,
            };
        }
        let pose = normalised(base_link_from_flange);
        let mut nominal = ClosedForm::BLANK;
        // As its numbers stand: how far off a unit quaternion is tells how far they are rounded, and with that which
        // branches exist within their rounding.
        let base_from_flange = base_from_base_link() * base_link_from_flange;
        self.closed_form(&base_from_flange, seed, &mut nominal);
        if !self.is_nominal() {
            return self.calibrated(&pose, &nominal);
        }
        let target = self.numerical.target(&pose);
        Solutions {
            solutions: nominal
                .solutions()
                .map(|row| self.refined_row(&target, &row))
                .collect(),
            nearest: Vec::new(),
            unreachable: nominal
                .unreachable(&self.geometry, &base_from_flange)
                .collect(),
            certificate: nominal.certificate(),
        }
    }

    /// One configuration of [`Kinematics::branches`], with the same bits; none if it has no solution there. On
    /// a nominal chain the others are not refined.
    pub fn branch(
        &self,
        base_link_from_flange: &Pose,
        seed: Option<&Joints>,
        configuration: Configuration,
    ) -> Option<Solution> {
        if !self.is_nominal() {
            let found = self.branches(base_link_from_flange, seed).solutions;
            let mut rows = found.into_iter();
            return rows.find(|row| row.configuration == configuration);
        }
        if defect(base_link_from_flange).is_some() {
            return None;
        }
        let pose = normalised(base_link_from_flange);
        let mut nominal = ClosedForm::BLANK;
        let as_it_stands = base_from_base_link() * base_link_from_flange;
        self.closed_form(&as_it_stands, seed, &mut nominal);
        let row = nominal.solution(configuration)?;
        let target = self.numerical.target(&pose);
        Some(self.refined_row(&target, &row))
    }

    fn refined_row(&self, target: &Target, row: &ClosedFormSolution) -> Solution {
        Solution {
            wrist_3_is_free: row.wrist_3_is_free,
            merged: row.merged,
            ..self.refined(target, row.configuration, &row.joints, row.touching)
        }
    }

    /// All solutions of a pose in `base_link`, into existing memory: [`Kinematics::branches`] without
    /// residuals and reasons.
    ///
    /// On a nominal chain nothing is allocated, and solutions are as the closed form gives them: a chain
    /// whose file prints its angles to ten digits is off by up to 1e-8, which
    /// [`Kinematics::branches`] takes off.
    pub fn rows_into(&self, base_link_from_flange: &Pose, seed: Option<&Joints>, out: &mut Rows) {
        let base_from_flange = base_from_base_link() * base_link_from_flange;
        self.closed_form(&base_from_flange, seed, &mut out.closed);
        self.finish(base_link_from_flange, out);
    }

    /// [`Kinematics::rows_into`] of many poses, which on a nominal chain takes half as long a pose.
    ///
    /// # Panics
    /// If there are not as many answers as poses.
    pub fn rows_batch(
        &self,
        base_link_from_flange: &[Pose],
        seed: Option<&Joints>,
        out: &mut [Rows],
    ) {
        const BLOCK: usize = 32;
        assert_eq!(
            base_link_from_flange.len(),
            out.len(),
            "one answer for each pose"
        );
        let turn = base_from_base_link();
        let mut poses = [Pose::identity(); BLOCK];
        let mut closed = [ClosedForm::BLANK; BLOCK];
        for (given, out) in base_link_from_flange
            .chunks(BLOCK)
            .zip(out.chunks_mut(BLOCK))
        {
            for (pose, given) in poses.iter_mut().zip(given) {
                *pose = turn * given;
            }
            let count = given.len();
            closed_form_batch_within(
                &self.geometry,
                &poses[..count],
                self.preference(seed),
                self.tolerance,
                &mut closed[..count],
            );
            for ((given, closed), out) in given.iter().zip(&closed).zip(out) {
                out.closed = *closed;
                self.finish(given, out);
            }
        }
    }

    /// Refines the rows of a calibrated chain.
    #[inline]
    fn finish(&self, base_link_from_flange: &Pose, out: &mut Rows) {
        out.is_closed = self.is_nominal() || out.closed.certificate() == Certificate::NotAPose;
        out.refined.clear();
        if out.is_closed {
            return;
        }
        let pose = normalised(base_link_from_flange);
        let branches = self.near_nominal(&pose).branches(&out.closed);
        out.refined
            .extend(branches.found.iter().map(|branch| ClosedFormSolution {
                configuration: branch.configuration,
                joints: branch.solution.joints,
                wrist_3_is_free: false,
                merged: false,
                touching: false,
            }));
    }

    fn preference<'a>(&'a self, seed: Option<&'a Joints>) -> Preference<'a> {
        Preference {
            seed,
            limits: self.limits.as_ref(),
        }
    }

    #[inline]
    fn closed_form(&self, base_from_flange: &Pose, seed: Option<&Joints>, out: &mut ClosedForm) {
        let preference = self.preference(seed);
        closed_form_within(
            &self.geometry,
            base_from_flange,
            preference,
            self.tolerance,
            out,
        );
    }

    /// Pose of the flange in `base_link`.
    pub fn base_link_from_flange(&self, q: &Joints) -> Pose {
        self.chain.base_link_from_flange(q)
    }

    /// Numerical solvers on the same chain.
    pub fn numerical(&self) -> &Numerical {
        &self.numerical
    }

    /// Rows of a calibrated chain for names that it misses by no more than the tolerance.
    fn add_touching(&self, pose: &Pose, answer: &mut Solutions) {
        /// What the nominal arm misses by more than this, m, the calibrated one does too.
        const FAR_M: f64 = 0.02;
        let base_from_flange = base_from_base_link() * pose;
        let target = self.numerical.target(pose);
        for (name, reason) in &answer.unreachable {
            if name.elbow == Elbow::Up || reason.missing_m() > FAR_M {
                continue;
            }
            let start = clamped(&self.geometry, &base_from_flange, *name, 0.0);
            let found = self.numerical.nearest(pose, &start, RAD_PER_M);
            let row = self.row(&target, *name, found.joints.map(wrap_angle));
            let known = answer.solutions.iter().any(|other| {
                (other.joints - row.joints)
                    .map(|d| wrap_angle(d).abs())
                    .max()
                    < SAME_POSTURE_RAD
            });
            if row.kind != SolutionKind::Nearest && !known {
                answer.solutions.push(row);
            }
        }
        answer
            .solutions
            .sort_by_key(|row| row.configuration.index());
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
                self.judged(branch.configuration, found.joints, residuals)
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
        self.judged(
            configuration,
            joints,
            self.numerical.residuals(target, &joints),
        )
    }

    /// A row that is what its residuals make of it.
    fn judged(
        &self,
        configuration: Configuration,
        joints: Joints,
        (residual_m, residual_rad): (f64, f64),
    ) -> Solution {
        let kind = if residual_m.max(residual_rad) <= EXACT {
            SolutionKind::Exact
        } else if residual_m <= self.tolerance.m && residual_rad <= self.tolerance.rad {
            SolutionKind::Touching
        } else {
            SolutionKind::Nearest
        };
        Solution {
            configuration,
            joints,
            residual_m,
            residual_rad,
            kind,
            wrist_3_is_free: false,
            merged: false,
            touching: kind == SolutionKind::Touching,
        }
    }

    /// A row of the closed form, with a step or two of Newton's method where the chain's origins
    /// were printed to a few digits.
    fn refined(
        &self,
        target: &Target,
        configuration: Configuration,
        start: &Joints,
        touching: bool,
    ) -> Solution {
        let closed = self.row(target, configuration, *start);
        if touching {
            // Where shoulder and elbow both touch, each by the tolerance, their sum is a little more.
            let kind = match closed.kind {
                SolutionKind::Exact => SolutionKind::Exact,
                SolutionKind::Touching | SolutionKind::Nearest => SolutionKind::Touching,
            };
            return Solution {
                kind,
                touching,
                ..closed
            };
        }
        if closed.residual_m.max(closed.residual_rad) <= CLOSED_FORM_SUFFICES {
            return closed;
        }
        let Some(found) = self.numerical.refined(target, start) else {
            return closed;
        };
        let residuals = (found.residual_m, found.residual_rad);
        let refined = self.judged(configuration, found.joints.map(wrap_angle), residuals);
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

/// The solutions of a pose, in reusable memory.
#[derive(Debug, Clone)]
pub struct Rows {
    closed: ClosedForm,
    /// Rows of a calibrated chain.
    refined: Vec<ClosedFormSolution>,
    is_closed: bool,
}

impl Rows {
    /// To be written over.
    pub const fn new() -> Self {
        Self {
            closed: ClosedForm::BLANK,
            refined: Vec::new(),
            is_closed: true,
        }
    }

    /// Postures, in the order of [`Configuration::ALL`]; a calibrated arm may have several of a name.
    pub fn iter(&self) -> impl Iterator<Item = ClosedFormSolution> {
        let closed = self.is_closed.then(|| self.closed.solutions());
        let refined = self.refined.iter().copied();
        closed.into_iter().flatten().chain(refined)
    }

    /// Number of solutions.
    pub fn count(&self) -> usize {
        if self.is_closed {
            self.closed.count() as usize
        } else {
            self.refined.len()
        }
    }

    /// The certificate of the answer.
    pub fn certificate(&self) -> Certificate {
        if self.is_closed {
            self.closed.certificate()
        } else {
            Certificate::Refined
        }
    }
}

impl Default for Rows {
    fn default() -> Self {
        Self::new()
    }
}

/// The pose with a quaternion of norm one.
fn normalised(pose: &Pose) -> Pose {
    Pose::from_parts(
        pose.translation,
        UnitQuaternion::new_normalize(pose.rotation.into_inner()),
    )
}

/// A row is exact below this: m and rad.
const EXACT: f64 = 1e-9;

/// Good enough to leave a row as the closed form gives it, m and rad.
const CLOSED_FORM_SUFFICES: f64 = 1e-13;

/// Nearest postures nearer to one another than this, rad, are one.
const SAME_POSTURE_RAD: f64 = 1e-4;

/// What the search for the nearest posture minimises, rad.
fn cost(row: &Solution) -> f64 {
    libm::hypot(RAD_PER_M * row.residual_m, row.residual_rad)
}
