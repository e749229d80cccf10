//! Time of both methods on this machine, compared with the paper and published solvers.

use std::hint::black_box;
use std::time::Instant;

use needlebench_kinematics::ik::{
    ClosedForm, DampedOptions, GaussNewtonOptions, Numerical, Preference, closed_form,
    closed_form_batch,
};
use needlebench_kinematics::pose_sets::PoseSet;
use needlebench_kinematics::{Joints, Pose, UrGeometry};
use needlebench_numerics::order::upper_median;
use needlebench_numerics::random::SplitMix64;
use serde::Serialize;

use super::closed_form::{Mended, solve};
use super::dh::{Arm, Target};
use super::equations::SEED;
use super::numerical::levenberg_marquardt;
use super::{Watch, printed};

/// Source of a time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Source {
    Paper,
    ThisRun,
    /// Recorded once, on another machine: a constant, not of this run.
    Peer,
}

#[derive(Debug, Clone, Serialize)]
pub struct TimeRow {
    pub name: &'static str,
    pub source: Source,
    /// All configurations, or one from a guess.
    pub numerical: bool,
    /// Time for one pose, s: a median, or the lower end of a stated range.
    pub time_s: f64,
    /// Upper end of a stated range, s.
    pub up_to_s: Option<f64>,
    /// Least and 90th percentile over the repetitions of this run, s.
    pub least_s: Option<f64>,
    pub p90_s: Option<f64>,
    pub repetitions: Option<usize>,
    pub poses_per_repetition: Option<usize>,
}

/// The only results that differ between two runs.
#[derive(Debug, Clone, Serialize)]
pub struct Timings {
    pub cpu: Option<String>,
    pub optimised_build: bool,
    pub rows: Vec<TimeRow>,
    /// Wall-clock time of the whole run without writing, s.
    pub run_s: f64,
}

/// Other solvers: 100 000 random UR3 poses, every solution, native loops, one core of one machine;
/// numerical ones from random starts to 1e-6.
const PEERS: [(&str, bool, f64); 8] = [
    ("ur_kinematics (C++), recorded", false, 1186e-9),
    ("ik-geo 0.1.2 (Rust), recorded", false, 1647e-9),
    ("ur-analytic-ik (C++), recorded", false, 2839e-9),
    ("EAIK (C++), recorded", false, 3009e-9),
    ("Robotics Toolbox LM (C++), recorded", true, 60e-6),
    ("optik (Rust), recorded", true, 92e-6),
    ("KDL LMA (C++), recorded", true, 140e-6),
    ("TRAC-IK (C++), recorded", true, 226e-6),
];

fn stated(name: &'static str, source: Source, numerical: bool, time_s: f64) -> TimeRow {
    TimeRow {
        name,
        source,
        numerical,
        time_s,
        up_to_s: None,
        least_s: None,
        p90_s: None,
        repetitions: None,
        poses_per_repetition: None,
    }
}

const POSES: usize = 200;
/// Number of runs over all poses; the median of their means is reported.
const REPETITIONS: usize = 60;

/// One pose, in the formats of the methods.
struct Case {
    base_from_flange: Pose,
    base_link_from_flange: Pose,
    target: Target<f64>,
    matrix: nalgebra::Matrix4<f64>,
    guess: Joints,
    anywhere: Joints,
}

/// Measures the methods of this program, and adds the others.
pub fn measure(watch: &Watch<'_>) -> Vec<TimeRow> {
    let (geometry, arm) = (UrGeometry::UR3, Arm::<f64>::ur3());
    let chain = geometry.chain();
    let mut random = SplitMix64::new(SEED + 10);
    let cases: [Case; POSES] = std::array::from_fn(|_| {
        let q = PoseSet::Generic.sample(&geometry, &mut random, 0.0);
        let base_from_flange = geometry.base_from_flange(&q);
        let matrix = base_from_flange.to_homogeneous();
        Case {
            base_from_flange,
            base_link_from_flange: chain.base_link_from_flange(&q),
            target: Target::of(&matrix),
            matrix,
            guess: Joints::from_fn(|i, _| q[i] + 0.1 * random.uniform(-1.0, 1.0)),
            anywhere: PoseSet::Generic.sample(&geometry, &mut random, 0.0),
        }
    });
    let numerical = Numerical::new(&chain);
    let poses = cases.each_ref().map(|case| case.base_from_flange);
    let mut answers = vec![ClosedForm::BLANK; POSES];
    let paper = |name, numerical, [from, to]: [f64; 2]| TimeRow {
        up_to_s: Some(to),
        ..stated(name, Source::Paper, numerical, from)
    };
    let mut rows = vec![
        paper("paper: closed form", false, printed::CLOSED_FORM_TIME_S),
        paper("paper: numerical", true, printed::NUMERICAL_TIME_S),
        run(watch, "library: closed form, all solutions", false, || {
            for pose in &poses {
                black_box(closed_form(&geometry, black_box(pose), None));
            }
        }),
        run(watch, "library: closed form, in a batch", false, || {
            closed_form_batch(
                &geometry,
                black_box(&poses),
                Preference::default(),
                &mut answers,
            );
            black_box(&answers);
        }),
        run(watch, "equations 9 to 38 corrected, plain", false, || {
            for case in &cases {
                black_box(solve(&arm, black_box(&case.target), Mended::ALL));
            }
        }),
        run(watch, "library: Gauss-Newton within 0.1 rad", true, || {
            let options = GaussNewtonOptions::default();
            for case in &cases {
                let pose = black_box(&case.base_link_from_flange);
                black_box(numerical.gauss_newton(pose, &case.guess, &options));
            }
        }),
        run(watch, "library: damped, from a random start", true, || {
            for case in &cases {
                let pose = black_box(&case.base_link_from_flange);
                black_box(numerical.damped(pose, &case.anywhere, &DampedOptions::default()));
            }
        }),
        run(
            watch,
            "Levenberg-Marquardt within 0.1 rad, plain",
            true,
            || {
                for case in &cases {
                    let pose = black_box(&case.matrix);
                    black_box(levenberg_marquardt(&arm, pose, &case.guess.into()));
                }
            },
        ),
    ];
    rows.extend(
        PEERS.map(|(name, numerical, time_s)| stated(name, Source::Peer, numerical, time_s)),
    );
    rows
}

/// Measures the time of a solver for all poses.
fn run(watch: &Watch<'_>, name: &'static str, numerical: bool, mut solve: impl FnMut()) -> TimeRow {
    let mut times_s = Vec::with_capacity(REPETITIONS);
    for _ in watch.each(0..REPETITIONS) {
        let started = Instant::now();
        solve();
        times_s.push(started.elapsed().as_secs_f64() / POSES as f64);
    }
    let middle_s = upper_median(&mut times_s);
    TimeRow {
        least_s: times_s.first().copied(),
        p90_s: times_s.get(REPETITIONS * 9 / 10).copied(),
        repetitions: Some(REPETITIONS),
        poses_per_repetition: Some(POSES),
        ..stated(name, Source::ThisRun, numerical, middle_s)
    }
}

/// Name of the processor, if the system provides it.
pub fn cpu_name() -> Option<String> {
    let text = std::fs::read_to_string("/proc/cpuinfo").ok()?;
    let line = text.lines().find(|line| line.starts_with("model name"))?;
    Some(line.split_once(':')?.1.trim().to_owned())
}
