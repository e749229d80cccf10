//! Accuracy of both methods, compared with the values of the paper and the limits of rounding.

use nalgebra::Matrix4;
use needlebench_kinematics::ik::{GaussNewtonOptions, Numerical, closed_form};
use needlebench_kinematics::pose_sets::PoseSet;
use needlebench_kinematics::{Joints, UrGeometry, base_from_base_link};
use needlebench_numerics::order::upper_median;
use needlebench_numerics::random::SplitMix64;
use serde::Serialize;

use super::closed_form::{Mended, solve};
use super::dh::{Arm, Target, origin, rotation};
use super::equations::SEED;
use super::{Watch, printed};

/// Source of a value.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Source {
    Paper,
    ThisRun,
    /// Rounding limit of any method in its precision.
    Limit,
    /// The machine.
    Robot,
}

/// Largest absolute entry of the pose error, as the paper measures it.
#[derive(Debug, Clone, Serialize)]
pub struct AccuracyRow {
    pub name: &'static str,
    pub source: Source,
    /// Number of joint vectors; null for values of others.
    pub samples: Option<usize>,
    /// Median and largest position error, m; null where not measured or not stated.
    pub position_median_m: Option<f64>,
    pub position_max_m: Option<f64>,
    /// Median and largest error of the rotation matrix's entries, 1.
    pub orientation_median: Option<f64>,
    pub orientation_max: Option<f64>,
    /// A stated value: position or orientation or both; the paper does not specify.
    pub stated: Option<f64>,
    pub remark: &'static str,
}

/// Position errors, m, and orientation errors of poses that should be equal.
#[derive(Default)]
struct Tally([Vec<f64>; 2]);

impl Tally {
    fn add(&mut self, reached: &Matrix4<f64>, wanted: &Matrix4<f64>) {
        self.0[0].push((origin(reached) - origin(wanted)).amax());
        self.0[1].push((rotation(reached) - rotation(wanted)).amax());
    }

    fn row(self, name: &'static str, source: Source, remark: &'static str) -> AccuracyRow {
        let samples = self.0[0].len();
        let [position, orientation] = self.0.map(|mut errors| (upper_median(&mut errors), errors));
        AccuracyRow {
            samples: Some(samples),
            position_median_m: Some(position.0),
            position_max_m: position.1.last().copied(),
            orientation_median: Some(orientation.0),
            orientation_max: orientation.1.last().copied(),
            stated: None,
            ..stated(name, source, f64::NAN, remark)
        }
    }
}

fn stated(name: &'static str, source: Source, value: f64, remark: &'static str) -> AccuracyRow {
    AccuracyRow {
        name,
        source,
        samples: None,
        position_median_m: None,
        position_max_m: None,
        orientation_median: None,
        orientation_max: None,
        stated: Some(value),
        remark,
    }
}

/// Distance of the numerical method's guesses, rad: "good estimate of the initial condition".
const GUESS_RAD: f64 = 0.05;

/// Position repeatability of the UR3, m: the value usually quoted.
const REPEATABILITY_M: f64 = 1e-4;

#[expect(clippy::cast_possible_truncation, reason = "rounding is the purpose")]
fn to_single(number: f64) -> f32 {
    number as f32
}

/// Measures `count` random poses.
pub fn evaluate(count: usize, watch: &Watch<'_>) -> Vec<AccuracyRow> {
    let geometry = UrGeometry::UR3;
    let numerical = Numerical::new(&geometry.chain());
    let (arm, arm_single) = (Arm::<f64>::ur3(), Arm::<f32>::ur3());
    let mut random = SplitMix64::new(SEED + 9);
    let mut tallies: [Tally; 6] = Default::default();
    let [library, mended, newton, floor, single, single_floor] = &mut tallies;
    for _ in watch.each(0..count) {
        let made_of = PoseSet::Generic.sample(&geometry, &mut random, 0.0);
        let pose = geometry.base_from_flange(&made_of);
        let wanted = pose.to_homogeneous();
        for solution in closed_form(&geometry, &pose, None).solutions() {
            library.add(&arm.base_from_flange(&solution.joints.into()), &wanted);
        }
        for joints in solve(&arm, &Target::of(&wanted), Mended::ALL)
            .iter()
            .flatten()
        {
            mended.add(&arm.base_from_flange(joints), &wanted);
        }
        let guess = Joints::from_fn(|i, _| made_of[i] + GUESS_RAD * random.uniform(-1.0, 1.0));
        let in_base_link = base_from_base_link() * pose;
        let found = numerical.gauss_newton(&in_base_link, &guess, &GaussNewtonOptions::default());
        if found.converged {
            newton.add(&arm.base_from_flange(&found.joints.into()), &wanted);
        }
        let made_of: [f64; 6] = made_of.into();
        floor.add(&arm.base_from_flange(&made_of), &wanted);
        let target = Target::of(&wanted.map(to_single));
        for joints in solve(&arm_single, &target, Mended::ALL).iter().flatten() {
            single.add(&arm.base_from_flange(&joints.map(f64::from)), &wanted);
        }
        let rounded = made_of.map(to_single);
        single_floor.add(
            &arm_single.base_from_flange(&rounded).map(f64::from),
            &arm.base_from_flange(&rounded.map(f64::from)),
        );
    }
    let [library, mended, newton, floor, single, single_floor] = tallies;
    let unstated = "unit not stated";
    vec![
        stated(
            "paper: closed form",
            Source::Paper,
            printed::CLOSED_FORM_ERROR,
            unstated,
        ),
        stated(
            "paper: numerical",
            Source::Paper,
            printed::NUMERICAL_ERROR,
            unstated,
        ),
        library.row("library: closed form", Source::ThisRun, "all solutions"),
        mended.row(
            "equations 9 to 38, corrected",
            Source::ThisRun,
            "all solutions; the largest near singularities, which it does not handle",
        ),
        newton.row(
            "library: Gauss-Newton",
            Source::ThisRun,
            "guesses within 0.05 rad, where it converges",
        ),
        floor.row(
            "forward kinematics in double precision",
            Source::Limit,
            "the same joints by matrices and by quaternions: rounding only",
        ),
        single.row(
            "equations 9 to 38, corrected, single precision",
            Source::ThisRun,
            "all solutions; its median is comparable to the values of the paper",
        ),
        single_floor.row(
            "forward kinematics in single precision",
            Source::Limit,
            "compared with double precision at the same joints: rounding only",
        ),
        stated(
            "pose printed with four decimals",
            Source::Limit,
            0.5e-4,
            "half of the last digit of T_desired, in m and 1",
        ),
        stated(
            "UR3 repeatability",
            Source::Robot,
            REPEATABILITY_M,
            "usually quoted, ±0.1 mm: larger than all differences above",
        ),
    ]
}
