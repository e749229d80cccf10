//! Equations 1 to 47, each as printed and as mended, against forward kinematics.
//!
//! Both forms are plain functions of the wanted pose and of what the paper has computed before;
//! the truth is the joint vector that made the pose. Equation numbers are those of Abdelaziz, Luo,
//! Jiang and Chen, *Multiple configurations for puncturing robot positioning*.

pub mod arm_plane;
pub mod differential;
pub mod elbow;
mod forward;
pub mod shoulder_and_wrist;
pub mod side;
pub mod wrist_sum;

use std::f64::consts::PI;

use nalgebra::{Matrix4, Vector3};
use needlebench_kinematics::ik::{Configuration, Shoulder, wrap_angle};
use needlebench_kinematics::pose_sets::PoseSet;
use needlebench_kinematics::random::SplitMix64;
use needlebench_kinematics::{Joints, UrGeometry};
use serde::Serialize;

use super::dh::{Arm, Target};
use super::{Interrupted, Watch};

/// What the error of an equation is measured in.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub enum Unit {
    #[serde(rename = "1")]
    One,
    #[serde(rename = "m")]
    Metre,
    #[serde(rename = "m^2")]
    SquareMetre,
    #[serde(rename = "rad")]
    Radian,
    /// Largest entry of a difference of pose matrices.
    #[serde(rename = "m, 1")]
    Pose,
}

impl Unit {
    pub fn symbol(self) -> &'static str {
        match self {
            Self::One => "1",
            Self::Metre => "m",
            Self::SquareMetre => "m²",
            Self::Radian => "rad",
            Self::Pose => "m, 1",
        }
    }
}

/// What is to be said of an equation as printed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    Right,
    /// Right once another equation is mended, or with a condition.
    NeedsAnother,
    Typo,
    Wrong,
}

impl Verdict {
    pub fn text(self) -> &'static str {
        match self {
            Self::Right => "right",
            Self::NeedsAnother => "right with care",
            Self::Typo => "typo",
            Self::Wrong => "wrong",
        }
    }
}

/// On which postures an equation is tried.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Sample {
    /// Every joint uniform in `(-pi, pi)`.
    Random,
    /// Those of them that are far from every singularity.
    WellConditioned,
    /// Exactly singular ones: wrist, elbow and shoulder in turn.
    Singular,
}

/// One equation, or a claim beside one.
pub struct Equation {
    pub number: &'static str,
    pub name: &'static str,
    /// In a small notation: `_x`, `^x`, `_{..}`, `^{..}`.
    pub printed_text: &'static str,
    pub mended_text: &'static str,
    /// Error at a posture; not a number where the form is undefined.
    pub printed: fn(&Posture) -> f64,
    pub mended: fn(&Posture) -> f64,
    /// Whether there is anything to compute at a posture.
    pub applies: fn(&Posture) -> bool,
    pub unit: Unit,
    /// Bound that the mended form keeps on every posture.
    pub tolerance: f64,
    /// The printed form fails at a posture where its error is larger.
    pub failure: f64,
    pub sample: Sample,
    pub verdict: Verdict,
    pub remark: &'static str,
}

impl Equation {
    /// What equations have in common that are identities and right as printed.
    const fn right(unit: Unit) -> Self {
        const fn nothing(_: &Posture) -> f64 {
            f64::NAN
        }
        const fn always(_: &Posture) -> bool {
            true
        }
        Self {
            number: "",
            name: "",
            printed_text: "",
            mended_text: "",
            printed: nothing,
            mended: nothing,
            applies: always,
            unit,
            // A few products of numbers below 1: five times the worst error seen (2e-15).
            tolerance: 1e-14,
            failure: 1e-9,
            sample: Sample::Random,
            verdict: Verdict::Right,
            remark: "",
        }
    }

    /// Groups in the paper's order.
    fn all() -> impl Iterator<Item = &'static Self> {
        [
            forward::EQUATIONS,
            shoulder_and_wrist::EQUATIONS,
            wrist_sum::EQUATIONS,
            arm_plane::EQUATIONS,
            elbow::EQUATIONS,
            differential::EQUATIONS,
        ]
        .into_iter()
        .flatten()
    }
}

/// A joint vector with everything that forward kinematics says of it.
pub struct Posture {
    pub arm: Arm<f64>,
    /// Joint positions, rad.
    pub q: [f64; 6],
    /// Frame `i` in frame `i - 1`.
    pub links: [Matrix4<f64>; 6],
    /// Frames 0 to 6 in the base frame.
    pub frames: [Matrix4<f64>; 7],
    /// The wanted pose: the library's forward kinematics, by quaternions.
    pub pose: Matrix4<f64>,
    pub target: Target<f64>,
    pub shoulder: Shoulder,
    /// A direction in joint space, each entry uniform in (-1, 1).
    pub step: [f64; 6],
    /// A rotation vector: uniform axis, angle uniform in (0, pi), rad.
    pub turn: Vector3<f64>,
}

impl Posture {
    pub fn new(joints: &Joints, random: &mut SplitMix64) -> Self {
        let geometry = UrGeometry::UR3;
        let arm = Arm::of(&geometry);
        let q: [f64; 6] = (*joints).into();
        let pose = geometry.base_from_flange(joints).to_homogeneous();
        Self {
            arm,
            q,
            links: arm.links(&q),
            frames: arm.frames(&q),
            pose,
            target: Target::of(&pose),
            shoulder: Configuration::of(&geometry, joints).shoulder,
            step: std::array::from_fn(|_| random.uniform(-1.0, 1.0)),
            turn: random_axis(random) * random.uniform(0.0, PI),
        }
    }

    /// `q2 + q3 + q4`, rad.
    pub fn q234(&self) -> f64 {
        self.q[1] + self.q[2] + self.q[3]
    }

    /// See [`well_conditioned`].
    fn is_well_conditioned(&self) -> bool {
        well_conditioned(&self.q)
    }
}

/// A unit vector, uniform on the sphere: Archimedes' cylinder.
fn random_axis(random: &mut SplitMix64) -> Vector3<f64> {
    let z = random.uniform(-1.0, 1.0);
    let (sine, cosine) = libm::sincos(random.uniform(-PI, PI));
    let radius = (1.0 - z * z).sqrt();
    Vector3::new(radius * cosine, radius * sine, z)
}

/// Least `|sin q5|` and `|sin q3|` of a well-conditioned posture.
pub const WELL_CONDITIONED_SINE: f64 = 0.3;
/// Least distance from the shoulder's singularity of a well-conditioned posture, m.
pub const WELL_CONDITIONED_M: f64 = 0.08;

/// Far from the wrist's, the elbow's and the shoulder's singularity.
pub fn well_conditioned(q: &[f64; 6]) -> bool {
    let forward_m = UrGeometry::UR3.wrist_forward_m(&Joints::from(*q));
    libm::sin(q[2]).abs() >= WELL_CONDITIONED_SINE
        && libm::sin(q[4]).abs() >= WELL_CONDITIONED_SINE
        && forward_m.abs() >= WELL_CONDITIONED_M
}

/// Difference of two angles on the circle, rad, in `[0, pi]`.
pub fn angle_error(a: f64, b: f64) -> f64 {
    wrap_angle(a - b).abs()
}

/// The smaller error of the two signs of a root.
fn either_sign(error: impl Fn(f64) -> f64) -> f64 {
    let (positive, negative) = (error(1.0), error(-1.0));
    // Not `min`, which drops a NaN.
    if positive <= negative {
        positive
    } else {
        negative
    }
}

/// Errors of one form of an equation over all postures.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Errors {
    /// Largest error; null where the form is undefined at some posture.
    pub max: f64,
    pub rms: f64,
    /// Share of postures at which the error is above the failure bound or undefined, 0 to 1.
    pub failing: f64,
    /// Share of postures at which the form has no value, 0 to 1.
    pub undefined: f64,
}

/// What was found of one equation.
#[derive(Debug, Clone, Serialize)]
pub struct EquationReport {
    pub number: &'static str,
    pub name: &'static str,
    pub as_printed: &'static str,
    pub as_corrected: &'static str,
    pub verdict: Verdict,
    pub remark: &'static str,
    pub unit: Unit,
    pub sample: Sample,
    /// Postures at which the equation applies.
    pub postures: usize,
    pub printed: Errors,
    pub corrected: Errors,
    /// Bound on the corrected form.
    pub tolerance: f64,
    /// Bound above which the printed form fails.
    pub failure_bound: f64,
    /// The corrected form keeps its bound at every posture.
    pub holds: bool,
}

/// Sum of errors while they come in.
#[derive(Default)]
struct Tally {
    count: usize,
    defined: usize,
    max: f64,
    squares: f64,
    failing: usize,
}

impl Tally {
    fn add(&mut self, error: f64, failure: f64) {
        self.count += 1;
        if error.is_finite() {
            self.defined += 1;
            self.max = self.max.max(error);
            self.squares += error * error;
        }
        let holds = error <= failure; // not of a NaN
        self.failing += usize::from(!holds);
    }

    fn errors(&self) -> Errors {
        let share = |part: usize| part as f64 / self.count.max(1) as f64;
        Errors {
            max: if self.defined == 0 {
                f64::NAN
            } else {
                self.max
            },
            rms: (self.squares / self.defined as f64).sqrt(),
            failing: share(self.failing),
            undefined: share(self.count - self.defined),
        }
    }
}

/// Singular postures are fewer: each needs a singular value decomposition or two.
const SINGULAR_SHARE: usize = 10;

/// Seed of the random postures.
pub const SEED: u64 = 20260101;

/// Tries every equation on `count` random postures.
pub(super) fn evaluate(
    count: usize,
    watch: &Watch<'_>,
) -> Result<Vec<EquationReport>, Interrupted> {
    let equations: Vec<&Equation> = Equation::all().collect();
    let mut tallies: Vec<[Tally; 2]> = equations.iter().map(|_| Default::default()).collect();
    let mut random = SplitMix64::new(SEED);
    let mut add = |posture: &Posture, singular: bool| {
        let regular = posture.is_well_conditioned();
        for (equation, [printed, mended]) in equations.iter().zip(&mut tallies) {
            let wanted = match equation.sample {
                Sample::Random => !singular,
                Sample::WellConditioned => !singular && regular,
                Sample::Singular => singular,
            };
            if wanted && (equation.applies)(posture) {
                printed.add((equation.printed)(posture), equation.failure);
                mended.add((equation.mended)(posture), equation.tolerance);
            }
        }
    };
    for _ in 0..count {
        watch.check()?;
        let q = PoseSet::Generic.sample(&UrGeometry::UR3, &mut random, 0.0);
        let posture = Posture::new(&q, &mut random);
        add(&posture, false);
    }
    let sets = [PoseSet::Wrist, PoseSet::Elbow, PoseSet::Shoulder];
    for index in 0..count / SINGULAR_SHARE {
        watch.check()?;
        let q = sets[index % sets.len()].sample(&UrGeometry::UR3, &mut random, 0.0);
        let posture = Posture::new(&q, &mut random);
        add(&posture, true);
    }
    Ok(equations
        .iter()
        .zip(&tallies)
        .map(|(equation, [printed, mended])| {
            let corrected = mended.errors();
            EquationReport {
                number: equation.number,
                name: equation.name,
                as_printed: equation.printed_text,
                as_corrected: equation.mended_text,
                verdict: equation.verdict,
                remark: equation.remark,
                unit: equation.unit,
                sample: equation.sample,
                postures: printed.count,
                printed: printed.errors(),
                corrected,
                tolerance: equation.tolerance,
                failure_bound: equation.failure,
                holds: mended.count > 0 && corrected.failing == 0.0,
            }
        })
        .collect())
}
