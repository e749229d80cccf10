//! Closed form for a nominal UR arm: all eight configurations of a flange pose.
//!
//! Poses away from singularities are solved in vectors ([`lanes`]), the others with care in
//! extended precision ([`careful`]). Which it is to be, the vectors themselves decide.

mod atan2;
mod careful;
mod clamped;
mod extended;
mod family;
mod lanes;
mod memory;

use std::sync::LazyLock;

use bytemuck::{CheckedBitPattern, NoUninit};
use fearless_simd::prelude::*;
use fearless_simd::{Level, Simd, dispatch};

pub(super) use atan2::TWICE_ATAN;
pub(super) use careful::defect;
pub(super) use clamped::clamped;
pub use family::FreeWrist;
use lanes::Bounds;

use super::{Configuration, Shoulder};
use crate::{JointLimits, Joints, Pose, UrGeometry};

/// One solution of the closed form.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClosedFormSolution {
    /// Which of the eight it is.
    pub configuration: Configuration,
    /// Joint positions, rad, each in `[-pi, pi]`.
    pub joints: Joints,
    /// Wrist 3 may take other values: at `q5 = 0` or `pi` only `q6` plus or minus `q2 + q3 + q4`
    /// is determined, and this is one member of a family ([`ClosedForm::free_wrist`]).
    pub wrist_3_is_free: bool,
    /// Coincident: another configuration is the same posture within rounding, without a separate solution.
    pub merged: bool,
    /// Boundary solution: it exists only within the rounding of the pose, or within the given tolerance.
    pub touching: bool,
}

/// Tolerance of boundary solutions, which are flagged as touching.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tolerance {
    /// Of the position, m.
    pub m: f64,
    /// Of the orientation, rad.
    pub rad: f64,
}

impl Tolerance {
    /// The rounding of doubles only.
    pub const ROUNDING: Self = Self { m: 0.0, rad: 0.0 };
}

/// A tenth of a micrometre and of a microradian: a pose in single precision is off by less.
impl Default for Tolerance {
    fn default() -> Self {
        Self { m: 1e-7, rad: 1e-7 }
    }
}

/// Why a configuration has no solution at a pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Unreachable {
    /// The wrist centre is nearer to the shoulder axis than `d4`.
    WristTooNear {
        /// By how much, m.
        missing_m: f64,
    },
    /// Wrist 1 is farther from the shoulder than upper arm and forearm reach.
    ElbowTooShort {
        /// By how much, m.
        missing_m: f64,
    },
    /// Wrist 1 is nearer to the shoulder than the difference of upper arm and forearm.
    ElbowTooLong {
        /// By how much, m.
        missing_m: f64,
    },
    /// The nominal arm reaches the pose, the calibrated one does not.
    NoCounterpart {
        /// Position error left, m.
        missing_m: f64,
        /// Orientation error left, rad.
        missing_rad: f64,
    },
    /// The pose has a number that is not finite.
    NotFinite,
    /// The quaternion's norm is off one by more than 1e-6, which no rounding explains.
    NotARotation,
    /// The position is farther away than 1000 km.
    TooFar {
        /// By how much, m.
        missing_m: f64,
    },
}

impl Unreachable {
    /// Distance by which the pose misses, m.
    pub fn missing_m(self) -> f64 {
        match self {
            Self::WristTooNear { missing_m }
            | Self::ElbowTooShort { missing_m }
            | Self::ElbowTooLong { missing_m }
            | Self::NoCounterpart { missing_m, .. }
            | Self::TooFar { missing_m } => missing_m,
            Self::NotFinite | Self::NotARotation => f64::INFINITY,
        }
    }
}

/// Certificate of an answer of the closed form. Its number, from 0 in this order, is that in memory.
///
/// The pose is what its doubles say, exactly. Its branches depend on three signs, of
/// `rho^2 - d4^2`, `s5^2` and `1 -+ cos q3`, and on nothing else. A boundary solution, which exists only
/// within rounding or a tolerance, is flagged ([`ClosedFormSolution::touching`]).
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, NoUninit, CheckedBitPattern)]
#[repr(u8)]
pub enum Certificate {
    /// Every sign was beyond the error bound of double precision: no branch is missing, and none but
    /// boundary solutions is superfluous.
    Complete,
    /// As [`Certificate::Complete`], but a sign needed extended precision.
    DecidedInExtendedPrecision,
    /// Two or more configurations coincide within the rounding of the pose, and have one solution;
    /// every other branch has its own.
    MergedBranches,
    /// Wrist 3 is free within the rounding of the pose: a solution represents a family.
    FreeJoint,
    /// Solutions of a calibrated chain, refined numerically from the nominal arm's: each is valid, but
    /// completeness is only measured, not certain ([`super::Kinematics::solve`]).
    Refined,
    /// No configuration reaches the pose; there is only a nearest posture.
    NearestOnly,
    /// The numbers are not a pose: see [`ClosedForm::unreachable`].
    NotAPose,
}

/// What decides between the members of a family.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Preference<'a> {
    /// Joint positions to be close to, rad [default: zeros].
    pub seed: Option<&'a Joints>,
    /// Joint limits; one 2π equivalent within them is enough.
    pub limits: Option<&'a JointLimits>,
}

/// All configurations of one pose.
///
/// Its memory may be looked at from other languages: see [`ClosedForm::DOUBLES`].
#[derive(Debug, Clone, Copy, NoUninit, CheckedBitPattern)]
#[repr(C)]
pub struct ClosedForm {
    /// By joint, then by the index of a configuration in [`Configuration::ALL`], rad.
    joints: [[f64; 8]; 6],
    /// Bits of configurations.
    exists: u8,
    merged: u8,
    free: u8,
    touching: u8,
    certificate: Certificate,
    /// Up to whole doubles.
    rest: [u8; 3],
}

impl ClosedForm {
    /// To be written over.
    pub const BLANK: Self = Self {
        joints: [[0.0; 8]; 6],
        exists: 0,
        merged: 0,
        free: 0,
        touching: 0,
        certificate: Certificate::NearestOnly,
        rest: [0; 3],
    };

    /// The certificate of the answer.
    pub fn certificate(&self) -> Certificate {
        self.certificate
    }

    /// Number of solutions.
    pub fn count(&self) -> u32 {
        self.exists.count_ones()
    }

    /// Configurations that exist, in the order of [`Configuration::ALL`].
    pub fn solutions(&self) -> impl Iterator<Item = ClosedFormSolution> {
        Configuration::ALL
            .into_iter()
            .filter_map(|configuration| self.solution(configuration))
    }

    /// One configuration, if it exists and is not the same posture as an earlier one.
    pub fn solution(&self, configuration: Configuration) -> Option<ClosedFormSolution> {
        let index = configuration.index();
        let bit = |bits: u8| (bits >> index) & 1 == 1;
        bit(self.exists).then(|| ClosedFormSolution {
            configuration,
            joints: Joints::from_fn(|joint, _| self.joints[joint][index]),
            wrist_3_is_free: bit(self.free),
            merged: bit(self.merged),
            touching: bit(self.touching),
        })
    }

    /// Configurations that do not reach the pose, and why, in the order of [`Configuration::ALL`].
    /// Coincident ones are not among them. `geometry` and
    /// `base_from_flange` are those that were solved.
    pub fn unreachable(
        &self,
        geometry: &UrGeometry,
        base_from_flange: &Pose,
    ) -> impl Iterator<Item = (Configuration, Unreachable)> {
        Configuration::ALL
            .into_iter()
            .filter(|configuration| (self.exists >> configuration.index()) & 1 == 0)
            .filter(|configuration| !self.wrist_is_free(configuration.shoulder))
            .filter_map(move |configuration| {
                let Configuration {
                    shoulder, wrist, ..
                } = configuration;
                let reason = careful::unreachable(geometry, base_from_flange, shoulder, wrist)?;
                Some((configuration, reason))
            })
    }

    /// The family that the solutions of a shoulder with a free wrist 3 represent. `geometry` and
    /// `base_from_flange` are those that were solved.
    pub fn free_wrist(
        &self,
        geometry: &UrGeometry,
        base_from_flange: &Pose,
        shoulder: Shoulder,
    ) -> Option<FreeWrist> {
        self.wrist_is_free(shoulder)
            .then(|| careful::free_wrist(geometry, base_from_flange, shoulder))?
    }

    fn wrist_is_free(&self, shoulder: Shoulder) -> bool {
        let rows = match shoulder {
            Shoulder::Right => 0x0F,
            Shoulder::Left => 0xF0,
        };
        self.free & rows != 0
    }
}

impl PartialEq for ClosedForm {
    fn eq(&self, other: &Self) -> bool {
        self.certificate == other.certificate && self.solutions().eq(other.solutions())
    }
}

/// Vector instructions of this machine, found once.
static LEVEL: LazyLock<Level> = LazyLock::new(Level::new);

/// Solves `base_from_flange(q) = pose` for a nominal arm; `pose` is in the controller's base frame.
///
/// Equations 9 to 38 with equation 11's sign, equation 24's sign of `r1` and equation 36's indices
/// corrected. Where wrist 3 is free, the member nearest to `seed` (or to zero) is taken that keeps
/// the elbow reachable.
#[inline]
pub fn closed_form(
    geometry: &UrGeometry,
    base_from_flange: &Pose,
    seed: Option<&Joints>,
) -> ClosedForm {
    let mut out = ClosedForm::BLANK;
    let preference = Preference { seed, limits: None };
    closed_form_into(geometry, base_from_flange, preference, &mut out);
    out
}

/// [`closed_form`] into existing memory, with joint limits for the members of a family.
#[inline]
pub fn closed_form_into(
    geometry: &UrGeometry,
    base_from_flange: &Pose,
    preference: Preference<'_>,
    out: &mut ClosedForm,
) {
    closed_form_within(
        geometry,
        base_from_flange,
        preference,
        Tolerance::ROUNDING,
        out,
    );
}

/// [`closed_form_into`] with boundary solutions within a tolerance: that of a pose in few digits, or in
/// single precision.
#[inline]
pub fn closed_form_within(
    geometry: &UrGeometry,
    base_from_flange: &Pose,
    preference: Preference<'_>,
    tolerance: Tolerance,
    out: &mut ClosedForm,
) {
    let asked = Asked {
        geometry,
        preference,
        tolerance,
    };
    solve_at(*LEVEL, &asked, base_from_flange, out);
}

/// What is asked of every pose.
struct Asked<'a> {
    geometry: &'a UrGeometry,
    preference: Preference<'a>,
    tolerance: Tolerance,
}

fn solve_at(level: Level, asked: &Asked<'_>, pose: &Pose, out: &mut ClosedForm) {
    let bounds = Bounds::new(asked.geometry, asked.tolerance);
    let certain = one_pose_at(level, asked.geometry, &bounds, pose, out);
    out.finish(asked, pose, certain);
}

/// The vectors' answer, if every sign in it is certain. Compiled once: a kernel for each kind of processor in every
/// caller, other crates among them, took minutes.
#[inline(never)]
fn one_pose_at(
    level: Level,
    geometry: &UrGeometry,
    bounds: &Bounds,
    pose: &Pose,
    out: &mut ClosedForm,
) -> bool {
    dispatch!(level, simd => lanes::one_pose(simd, geometry, bounds, pose, out))
}

impl ClosedForm {
    /// Fills in what the vectors leave, or solves anew with care.
    #[inline(always)]
    fn finish(&mut self, asked: &Asked<'_>, pose: &Pose, certain: bool) {
        if certain {
            self.merged = 0;
            self.free = 0;
            self.touching = 0;
            self.certificate = if self.exists == 0 {
                Certificate::NearestOnly
            } else {
                Certificate::Complete
            };
        } else {
            careful::solve(
                asked.geometry,
                pose,
                asked.preference,
                asked.tolerance,
                self,
            );
        }
    }
}

/// [`closed_form`] of many poses, poses across the lanes of vectors.
///
/// # Panics
/// If there are not as many answers as poses.
pub fn closed_form_batch(
    geometry: &UrGeometry,
    base_from_flange: &[Pose],
    preference: Preference<'_>,
    out: &mut [ClosedForm],
) {
    closed_form_batch_within(
        geometry,
        base_from_flange,
        preference,
        Tolerance::ROUNDING,
        out,
    );
}

/// [`closed_form_within`] of many poses.
///
/// # Panics
/// If there are not as many answers as poses.
pub fn closed_form_batch_within(
    geometry: &UrGeometry,
    base_from_flange: &[Pose],
    preference: Preference<'_>,
    tolerance: Tolerance,
    out: &mut [ClosedForm],
) {
    let asked = Asked {
        geometry,
        preference,
        tolerance,
    };
    batch_at(*LEVEL, &asked, base_from_flange, out);
}

fn batch_at(level: Level, asked: &Asked<'_>, poses: &[Pose], out: &mut [ClosedForm]) {
    assert_eq!(poses.len(), out.len(), "one answer for each pose");
    dispatch!(level, simd => batch(simd, asked, poses, out));
}

#[inline(always)]
fn batch<S: Simd>(simd: S, asked: &Asked<'_>, poses: &[Pose], out: &mut [ClosedForm]) {
    let geometry = asked.geometry;
    let bounds = Bounds::new(geometry, asked.tolerance);
    let lanes = S::f64s::LEN;
    let mut pose_blocks = poses.chunks_exact(lanes);
    let mut out_blocks = out.chunks_exact_mut(lanes);
    for (poses, out) in (&mut pose_blocks).zip(&mut out_blocks) {
        let certain = lanes::many_poses(simd, geometry, &bounds, poses, out);
        for (lane, (pose, out)) in poses.iter().zip(out).enumerate() {
            out.finish(asked, pose, (certain >> lane) & 1 == 1);
        }
    }
    let rest = pose_blocks.remainder().iter();
    for (pose, out) in rest.zip(out_blocks.into_remainder()) {
        let certain = one_pose_at(simd.level(), geometry, &bounds, pose, out);
        out.finish(asked, pose, certain);
    }
}

#[cfg(test)]
mod tests;
