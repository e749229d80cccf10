//! Time of both methods on this machine, beside the paper's figures and published solvers'.

use std::hint::black_box;
use std::time::Instant;

use needlebench_kinematics::ik::{
    ClosedForm, DampedOptions, GaussNewtonOptions, Numerical, Preference, closed_form,
    closed_form_batch,
};
use needlebench_kinematics::pose_sets::PoseSet;
use needlebench_kinematics::random::SplitMix64;
use needlebench_kinematics::{Joints, Pose, UrGeometry};
use serde::Serialize;

use super::convergence::median;
use super::dh::{Arm, Target};
use super::equations::SEED;
use super::equations::side::Mended;
use super::newton::levenberg_marquardt;
use super::solver::solve;
use super::{Interrupted, Watch};

/// Whose figure a time is.
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

impl TimeRow {
    /// Makes the time of a call for many poses that of one.
    fn share(&mut self, poses: usize) {
        let count = poses as f64;
        self.time_s /= count;
        self.least_s = self.least_s.map(|time| time / count);
        self.p90_s = self.p90_s.map(|time| time / count);
        self.poses_per_repetition = Some(poses);
    }
}

/// The only part of the results that differs between two runs.
#[derive(Debug, Clone, Serialize)]
pub struct Timings {
    pub cpu: Option<String>,
    pub optimised_build: bool,
    pub rows: Vec<TimeRow>,
    /// Wall-clock time of the whole run but for writing, s.
    pub run_s: f64,
}

const fn peer(name: &'static str, numerical: bool, time_s: f64, up_to_s: Option<f64>) -> TimeRow {
    TimeRow {
        name,
        source: Source::Peer,
        numerical,
        time_s,
        up_to_s,
        least_s: None,
        p90_s: None,
        repetitions: None,
        poses_per_repetition: None,
    }
}

/// Other solvers: 100 000 random UR3 poses, every solution, native loops, one core of one machine;
/// numerical ones from random starts to 1e-6.
const PEERS: [TimeRow; 8] = [
    peer("ur_kinematics (C++), recorded", false, 1186e-9, None),
    peer("ik-geo 0.1.2 (Rust), recorded", false, 1647e-9, None),
    peer("ur-analytic-ik (C++), recorded", false, 2839e-9, None),
    peer("EAIK (C++), recorded", false, 3009e-9, None),
    peer("Robotics Toolbox LM (C++), recorded", true, 60e-6, None),
    peer("optik (Rust), recorded", true, 92e-6, None),
    peer("KDL LMA (C++), recorded", true, 140e-6, None),
    peer("TRAC-IK (C++), recorded", true, 226e-6, None),
];

const POSES: usize = 200;
/// Runs over all poses; the median of their means is reported.
const REPETITIONS: usize = 60;

/// One pose, in the forms that the methods take.
struct Case {
    base_from_flange: Pose,
    base_link_from_flange: Pose,
    target: Target<f64>,
    matrix: nalgebra::Matrix4<f64>,
    guess: Joints,
    anywhere: Joints,
}

/// Measures our own methods and puts them beside the others.
pub(super) fn measure(watch: &Watch<'_>) -> Result<Vec<TimeRow>, Interrupted> {
    let geometry = UrGeometry::UR3;
    let chain = geometry.chain();
    let arm = Arm::<f64>::of(&geometry);
    let mut random = SplitMix64::new(SEED + 10);
    let cases: Vec<Case> = (0..POSES)
        .map(|_| {
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
        })
        .collect();
    let options = GaussNewtonOptions::default();
    let numerical = Numerical::new(&chain);
    let mut rows = vec![
        time("paper: closed form", false),
        time("paper: numerical", true),
    ];
    for (row, [from, to]) in rows.iter_mut().zip([
        super::printed::CLOSED_FORM_TIME_S,
        super::printed::NUMERICAL_TIME_S,
    ]) {
        (row.source, row.time_s, row.up_to_s) = (Source::Paper, from, Some(to));
    }
    rows.push(run(
        watch,
        "library: closed form, all solutions",
        false,
        &cases,
        |case| {
            black_box(closed_form(
                &geometry,
                black_box(&case.base_from_flange),
                None,
            ));
        },
    )?);
    // Poses per call, so that the time of a call over their number is that of one.
    let poses: Vec<Pose> = cases.iter().map(|case| case.base_from_flange).collect();
    let mut answers = vec![ClosedForm::BLANK; poses.len()];
    let mut batch = run(
        watch,
        "library: closed form, in a batch",
        false,
        &[()],
        |()| {
            let preference = Preference::default();
            closed_form_batch(&geometry, black_box(&poses), preference, &mut answers);
            black_box(&answers);
        },
    )?;
    batch.share(poses.len());
    rows.push(batch);
    rows.push(run(
        watch,
        "equations 9 to 38 mended, plain",
        false,
        &cases,
        |case| {
            black_box(solve(&arm, black_box(&case.target), Mended::ALL));
        },
    )?);
    rows.push(run(
        watch,
        "library: Gauss-Newton within 0.1 rad",
        true,
        &cases,
        |case| {
            let pose = black_box(&case.base_link_from_flange);
            black_box(numerical.gauss_newton(pose, &case.guess, &options));
        },
    )?);
    rows.push(run(
        watch,
        "library: damped, from a random start",
        true,
        &cases,
        |case| {
            let pose = black_box(&case.base_link_from_flange);
            black_box(numerical.damped(pose, &case.anywhere, &DampedOptions::default()));
        },
    )?);
    rows.push(run(
        watch,
        "Levenberg-Marquardt within 0.1 rad, plain",
        true,
        &cases,
        |case| {
            black_box(levenberg_marquardt(
                &arm,
                black_box(&case.matrix),
                &case.guess.into(),
            ));
        },
    )?);
    rows.extend(PEERS);
    Ok(rows)
}

fn time(name: &'static str, numerical: bool) -> TimeRow {
    TimeRow {
        source: Source::ThisRun,
        ..peer(name, numerical, f64::NAN, None)
    }
}

fn run<T>(
    watch: &Watch<'_>,
    name: &'static str,
    numerical: bool,
    cases: &[T],
    mut solve: impl FnMut(&T),
) -> Result<TimeRow, Interrupted> {
    let mut times_s = Vec::with_capacity(REPETITIONS);
    for _ in 0..REPETITIONS {
        watch.check()?;
        let started = Instant::now();
        for case in cases {
            solve(case);
        }
        times_s.push(started.elapsed().as_secs_f64() / cases.len() as f64);
    }
    let middle = median(&mut times_s);
    Ok(TimeRow {
        time_s: middle,
        least_s: times_s.first().copied(),
        p90_s: times_s.get(REPETITIONS * 9 / 10).copied(),
        repetitions: Some(REPETITIONS),
        poses_per_repetition: Some(cases.len()),
        ..time(name, numerical)
    })
}

/// Name of the processor, where the system tells.
pub fn cpu_name() -> Option<String> {
    let text = std::fs::read_to_string("/proc/cpuinfo").ok()?;
    let line = text.lines().find(|line| line.starts_with("model name"))?;
    Some(line.split_once(':')?.1.trim().to_owned())
}
