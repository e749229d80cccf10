//! All solutions of a flange pose on a real chain: closed form, then refined.

use super::gauss_newton::pose_error;
use super::{
    Certificate, ClosedFormSolution, Configuration, GaussNewtonOptions, Unreachable, closed_form,
    gauss_newton,
};
use crate::geometry::base_from_base_link;
use crate::{Chain, Joints, NotUrGeometry, Pose, UrGeometry};

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
    /// Joint positions, rad, each in `(-pi, pi]`.
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
    /// Those that exist, in the order of [`Configuration::ALL`].
    pub solutions: Vec<Solution>,
    /// Least-squares postures for a pose that no configuration reaches, nearest first. Never
    /// solutions.
    pub nearest: Vec<Solution>,
    /// Configurations that do not reach the pose, with the reason.
    pub unreachable: Vec<(Configuration, Unreachable)>,
    /// What the answer is worth.
    pub certificate: Certificate,
}

/// A row is exact below this: m and rad.
const EXACT: f64 = 1e-9;

/// An arm ready for inverse kinematics.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Kinematics {
    /// The chain whose flange is placed.
    pub chain: Chain,
    /// Its nearest nominal geometry, which the closed form solves.
    pub geometry: UrGeometry,
}

impl Kinematics {
    /// Prepares a chain.
    ///
    /// # Errors
    /// [`NotUrGeometry`] if it is not a UR arm.
    pub fn new(chain: Chain) -> Result<Self, NotUrGeometry> {
        Ok(Self {
            chain,
            geometry: UrGeometry::of_chain(&chain)?,
        })
    }

    /// Every configuration that brings the flange to a pose in `base_link`.
    ///
    /// The closed form of the nominal arm, each row then refined on the chain itself, which costs
    /// nothing for a nominal chain and makes rows of a calibrated one exact. Residual on random
    /// poses: at most 1e-12 m and rad (`every_solution_reproduces_the_pose`).
    pub fn solve(&self, base_link_from_flange: &Pose, seed: Option<&Joints>) -> Solutions {
        let base_from_flange = base_from_base_link() * base_link_from_flange;
        let found = closed_form(&self.geometry, &base_from_flange, seed);
        Solutions {
            solutions: found
                .solutions()
                .map(|solution| self.refined(base_link_from_flange, &solution))
                .collect(),
            nearest: Vec::new(),
            unreachable: found
                .unreachable(&self.geometry, &base_from_flange)
                .collect(),
            certificate: found.certificate(),
        }
    }

    /// Pose of the flange in `base_link`.
    pub fn base_link_from_flange(&self, q: &Joints) -> Pose {
        self.chain.base_link_from_flange(q)
    }

    fn refined(&self, target: &Pose, solution: &ClosedFormSolution) -> Solution {
        /// Good enough to leave a row as the closed form gives it.
        const CLOSED_FORM_SUFFICES: f64 = 1e-13;
        let residuals = |q: &Joints| {
            let error = pose_error(target, &self.chain.base_link_from_flange(q));
            (
                error.fixed_rows::<3>(0).norm(),
                error.fixed_rows::<3>(3).norm(),
            )
        };
        let mut joints = solution.joints;
        let (mut residual_m, mut residual_rad) = residuals(&joints);
        if residual_m.max(residual_rad) > CLOSED_FORM_SUFFICES {
            let options = GaussNewtonOptions {
                max_iterations: 10,
                ..Default::default()
            };
            let refined = gauss_newton(&self.chain, target, &joints, &options);
            let wrapped = refined.joints.map(super::wrap_angle);
            let (refined_m, refined_rad) = residuals(&wrapped);
            // A step that jumps to another branch would give the row a wrong name.
            let same_branch = (refined.joints - solution.joints).amax() < 0.1;
            if same_branch && refined_m.max(refined_rad) < residual_m.max(residual_rad) {
                (joints, residual_m, residual_rad) = (wrapped, refined_m, refined_rad);
            }
        }
        let exact = residual_m.max(residual_rad) <= EXACT;
        Solution {
            configuration: solution.configuration,
            joints,
            residual_m,
            residual_rad,
            kind: if exact {
                SolutionKind::Exact
            } else {
                SolutionKind::Nearest
            },
            wrist_3_is_free: solution.wrist_3_is_free,
            merged: solution.merged,
        }
    }
}
