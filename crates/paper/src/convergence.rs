//! How the numerical method does against the distance of its guess, and where it ends.

use std::collections::BTreeMap;
use std::f64::consts::PI;

use needlebench_kinematics::ik::{
    Configuration, DampedOptions, GaussNewtonOptions, Numerical, NumericalResult, closed_form,
    wrap_angle,
};
use needlebench_kinematics::pose_sets::PoseSet;
use needlebench_kinematics::random::SplitMix64;
use needlebench_kinematics::{Chain, Joints, Pose, UrGeometry};
use serde::Serialize;

use super::dh::Arm;
use super::equations::{SEED, angle_error, well_conditioned};
use super::newton::{EARLY_STEPS, Ended, gauss_newton, levenberg_marquardt, trace};
use super::solver::same_joints;
use super::{Interrupted, Watch};

/// Distances of guesses, rad: every joint is off by up to this.
pub const DISTANCES_RAD: [f64; 9] = [0.01, 0.03, 0.1, 0.2, 0.5, 1.0, 1.5, 2.0, PI];

/// Poses of each set of the convergence table.
const POSES: usize = 400;
/// Poses of the histograms of branches.
const BRANCH_POSES: usize = 1000;

/// The numerical methods that are compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// Equation 39 as printed (the rest mended).
    Equation39AsPrinted,
    /// Equations 39 and 45 mended, undamped.
    Mended,
    /// The same with Levenberg-Marquardt damping.
    LevenbergMarquardt,
    /// The library's Gauss-Newton, which stays near its guess.
    LibraryGaussNewton,
    /// The library's damped solver, which starts again from anywhere.
    LibraryDamped,
}

impl Method {
    pub const ALL: [Self; 5] = [
        Self::Equation39AsPrinted,
        Self::Mended,
        Self::LevenbergMarquardt,
        Self::LibraryGaussNewton,
        Self::LibraryDamped,
    ];

    pub fn name(self) -> &'static str {
        match self {
            Self::Equation39AsPrinted => "equation 39 as printed",
            Self::Mended => "39 and 45 mended, undamped",
            Self::LevenbergMarquardt => "the same, Levenberg-Marquardt",
            Self::LibraryGaussNewton => "library: Gauss-Newton",
            Self::LibraryDamped => "library: damped, restarted",
        }
    }

    /// Solves for the pose of `wanted`, from a guess.
    fn run(self, bench: &Bench, wanted: &Joints, guess: &[f64; 6]) -> Ended {
        let pose = UrGeometry::UR3.base_from_flange(wanted).to_homogeneous();
        match self {
            Self::Equation39AsPrinted => gauss_newton(&bench.arm, &pose, guess, true),
            Self::Mended => gauss_newton(&bench.arm, &pose, guess, false),
            Self::LevenbergMarquardt => levenberg_marquardt(&bench.arm, &pose, guess),
            Self::LibraryGaussNewton => {
                let (pose, guess) = (bench.pose(wanted), Joints::from(*guess));
                let options = GaussNewtonOptions::default();
                Ended::of(&bench.numerical.gauss_newton(&pose, &guess, &options))
            }
            Self::LibraryDamped => {
                let (pose, guess) = (bench.pose(wanted), Joints::from(*guess));
                let options = DampedOptions::default();
                Ended::of(&bench.numerical.damped(&pose, &guess, &options))
            }
        }
    }
}

impl Ended {
    fn of(found: &NumericalResult) -> Self {
        Self {
            joints: found.joints.map(wrap_angle).into(),
            iterations: found.iterations,
            converged: found.converged,
        }
    }
}

/// The arm in both notations.
struct Bench {
    arm: Arm<f64>,
    chain: Chain,
    numerical: Numerical,
}

impl Bench {
    fn pose(&self, wanted: &Joints) -> Pose {
        self.chain.base_link_from_flange(wanted)
    }
}

/// One method at one distance of the guess.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Point {
    pub distance_rad: f64,
    /// Share of guesses from which it converges, 0 to 1.
    pub converged: f64,
    /// Share of guesses from which it converges in no more than [`EARLY_STEPS`] steps, 0 to 1.
    pub converged_in_50_steps: f64,
    /// Share of guesses from which it ends in the branch that the guess was near to, 0 to 1.
    pub same_branch: f64,
    /// Mean number of steps of those that converge; null if none does.
    pub mean_iterations: f64,
}

/// One method over all distances.
#[derive(Debug, Clone, Serialize)]
pub struct Curve {
    pub method: Method,
    pub name: &'static str,
    pub well_conditioned: Vec<Point>,
    pub all: Vec<Point>,
}

/// Order of convergence of the mended method.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Order {
    /// Median of `ln(e3/e2) / ln(e2/e1)` over the last errors above rounding.
    pub median: f64,
    pub samples: usize,
    /// Median joint error after 0, 1, 2 ... steps from a guess 0.1 rad off, rad.
    pub median_error_rad: [f64; 5],
}

/// Where the mended method ends from one start over random poses.
#[derive(Debug, Clone, Serialize)]
pub struct StartReport {
    pub name: &'static str,
    pub start_rad: [f64; 6],
    pub poses: usize,
    /// Share of poses, 0 to 1, in the order of Table 2.
    pub share_by_configuration: BTreeMap<usize, f64>,
    pub not_converged: f64,
}

/// How a choice of the guess decides the branch.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct SteeringReport {
    pub guess: &'static str,
    /// Share of trials, 0 to 1; all further ones are shares of those that converge.
    pub converged: f64,
    pub wanted_shoulder: f64,
    pub wanted_elbow: f64,
    pub wanted_wrist: f64,
    pub wanted_configuration: f64,
}

/// Iterations of the mended method from guesses at one distance.
#[derive(Debug, Clone, Serialize)]
pub struct IterationHistogram {
    pub distance_rad: f64,
    /// Number of guesses by number of steps, of those that converge.
    pub count_by_iterations: BTreeMap<u32, usize>,
}

/// Everything about the numerical method.
#[derive(Debug, Clone, Serialize)]
pub struct ConvergenceReport {
    pub poses: usize,
    pub curves: Vec<Curve>,
    pub order: Order,
    pub iterations: Vec<IterationHistogram>,
    pub starts: Vec<StartReport>,
    pub steering_trials: usize,
    pub steering: Vec<SteeringReport>,
}

/// Measures all of it.
pub(super) fn evaluate(watch: &Watch<'_>) -> Result<ConvergenceReport, Interrupted> {
    let bench = Bench {
        arm: Arm::ur3(),
        chain: UrGeometry::UR3.chain(),
        numerical: Numerical::new(&UrGeometry::UR3.chain()),
    };
    let regular = postures(true, POSES, SEED + 2);
    let all = postures(false, POSES, SEED + 3);
    let mut curves = Vec::new();
    for method in Method::ALL {
        curves.push(Curve {
            method,
            name: method.name(),
            well_conditioned: curve(&bench, method, &regular, watch)?,
            all: curve(&bench, method, &all, watch)?,
        });
    }
    let mut iterations = Vec::new();
    for distance_rad in [0.1, 0.5, 1.5] {
        iterations.push(histogram(&bench, &regular, distance_rad, watch)?);
    }
    let poses = postures(false, BRANCH_POSES, SEED + 4);
    let mut starts = Vec::new();
    for (name, start_rad) in STARTS {
        starts.push(from_start(&bench, name, start_rad, &poses, watch)?);
    }
    Ok(ConvergenceReport {
        poses: POSES,
        curves,
        order: order(&bench, &regular),
        iterations,
        starts,
        steering_trials: poses.len(),
        steering: steering(&bench, &poses, watch)?,
    })
}

fn postures(regular: bool, count: usize, seed: u64) -> Vec<Joints> {
    let mut random = SplitMix64::new(seed);
    std::iter::repeat_with(|| PoseSet::Generic.sample(&UrGeometry::UR3, &mut random, 0.0))
        .filter(|q| !regular || well_conditioned(&(*q).into()))
        .take(count)
        .collect()
}

/// A guess with every joint off by up to `distance_rad`.
fn guess_near(wanted: &Joints, distance_rad: f64, random: &mut SplitMix64) -> [f64; 6] {
    std::array::from_fn(|i| wanted[i] + distance_rad * random.uniform(-1.0, 1.0))
}

fn curve(
    bench: &Bench,
    method: Method,
    postures: &[Joints],
    watch: &Watch<'_>,
) -> Result<Vec<Point>, Interrupted> {
    let mut points = Vec::new();
    for distance_rad in DISTANCES_RAD {
        // The same guesses for every method.
        let mut random = SplitMix64::new(SEED + 5);
        let (mut converged, mut early, mut same, mut iterations) =
            (0_usize, 0_usize, 0_usize, 0_u32);
        for wanted in postures {
            watch.check()?;
            let guess = guess_near(wanted, distance_rad, &mut random);
            let ended = method.run(bench, wanted, &guess);
            if ended.converged {
                converged += 1;
                early += usize::from(ended.iterations <= EARLY_STEPS);
                iterations += ended.iterations;
                same += usize::from(same_joints(&ended.joints, wanted));
            }
        }
        let share = |part: usize| part as f64 / postures.len() as f64;
        points.push(Point {
            distance_rad,
            converged: share(converged),
            converged_in_50_steps: share(early),
            same_branch: share(same),
            mean_iterations: f64::from(iterations) / converged as f64,
        });
    }
    Ok(points)
}

fn histogram(
    bench: &Bench,
    postures: &[Joints],
    distance_rad: f64,
    watch: &Watch<'_>,
) -> Result<IterationHistogram, Interrupted> {
    let mut random = SplitMix64::new(SEED + 5);
    let mut count_by_iterations = BTreeMap::new();
    for wanted in postures {
        watch.check()?;
        let guess = guess_near(wanted, distance_rad, &mut random);
        let ended = Method::Mended.run(bench, wanted, &guess);
        if ended.converged {
            *count_by_iterations.entry(ended.iterations).or_default() += 1;
        }
    }
    Ok(IterationHistogram {
        distance_rad,
        count_by_iterations,
    })
}

/// Joint errors below this are rounding, rad.
const ROUNDING_RAD: f64 = 1e-13;

fn order(bench: &Bench, postures: &[Joints]) -> Order {
    let mut random = SplitMix64::new(SEED + 6);
    let mut orders = Vec::new();
    let mut errors_by_step: [Vec<f64>; 5] = Default::default();
    for wanted in postures {
        let guess = guess_near(wanted, 0.1, &mut random);
        let pose = UrGeometry::UR3.base_from_flange(wanted).to_homogeneous();
        let mut errors: Vec<f64> = Vec::new();
        let ended = trace(&bench.arm, &pose, &guess, false, ROUNDING_RAD, |joints| {
            let differences = joints.iter().zip(wanted.iter());
            errors.push(
                differences
                    .map(|(a, b)| angle_error(*a, *b))
                    .fold(0.0, f64::max),
            );
        });
        if !(ended.converged && same_joints(&ended.joints, wanted)) {
            continue;
        }
        for (step, of_step) in errors_by_step.iter_mut().enumerate() {
            // An iteration that has ended stays where it is.
            of_step.extend(errors.get(step).or(errors.last()));
        }
        let above: Vec<f64> = errors
            .iter()
            .copied()
            .take_while(|error| *error > ROUNDING_RAD)
            .collect();
        if let [.., first, second, third] = above[..] {
            orders.push(libm::log(third / second) / libm::log(second / first));
        }
    }
    Order {
        samples: orders.len(),
        median: median(&mut orders),
        median_error_rad: errors_by_step.map(|mut errors| median(&mut errors)),
    }
}

/// Middle value; not a number for none.
pub fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

/// A start away from every singularity, as the command `ik` takes it.
const REGULAR_START: [f64; 6] = [0.1, -1.2, -1.2, -1.0, 1.2, 0.1];

/// The first two are singular at elbow and wrist, as starts that people take often are.
const STARTS: [(&str, [f64; 6]); 3] = [
    ("zeros", [0.0; 6]),
    ("upright home", [0.0, -0.5 * PI, 0.0, -0.5 * PI, 0.0, 0.0]),
    ("regular", REGULAR_START),
];

fn from_start(
    bench: &Bench,
    name: &'static str,
    start_rad: [f64; 6],
    poses: &[Joints],
    watch: &Watch<'_>,
) -> Result<StartReport, Interrupted> {
    let mut counts = [0_usize; 8];
    let mut failed = 0_usize;
    for wanted in poses {
        watch.check()?;
        let ended = Method::Mended.run(bench, wanted, &start_rad);
        if ended.converged {
            let joints = Joints::from(ended.joints);
            counts[Configuration::of(&UrGeometry::UR3, &joints).index()] += 1;
        } else {
            failed += 1;
        }
    }
    let share = |count: usize| count as f64 / poses.len() as f64;
    Ok(StartReport {
        name,
        start_rad,
        poses: poses.len(),
        share_by_configuration: counts.into_iter().map(share).enumerate().collect(),
        not_converged: share(failed),
    })
}

/// Which joints of the guess are those of the wanted solution; the others are the regular start's.
const STEERING: [(&str, &[usize]); 5] = [
    ("regular start", &[]),
    ("q1 as wanted", &[0]),
    ("q2 as wanted", &[1]),
    ("q1 and q2 as wanted", &[0, 1]),
    ("q1, q2 and q3 as wanted", &[0, 1, 2]),
];

/// The last row of the steering table: every joint within this of the wanted one, rad.
const NEAR_RAD: f64 = 0.5;

fn steering(
    bench: &Bench,
    poses: &[Joints],
    watch: &Watch<'_>,
) -> Result<Vec<SteeringReport>, Interrupted> {
    // The wanted solution: any of the pose's, drawn evenly.
    let mut random = SplitMix64::new(SEED + 7);
    let wanted: Vec<(Joints, Configuration)> = poses
        .iter()
        .filter_map(|made_of| {
            let pose = UrGeometry::UR3.base_from_flange(made_of);
            let answers: Vec<_> = closed_form(&UrGeometry::UR3, &pose, None)
                .solutions()
                .collect();
            let bound = u32::try_from(answers.len())
                .ok()
                .filter(|bound| *bound > 0)?;
            let chosen = answers.get(random.below(bound) as usize)?;
            Some((chosen.joints, chosen.configuration))
        })
        .collect();
    let mut rows = Vec::new();
    for (name, given) in STEERING {
        let guess = |wanted: &Joints, _: &mut SplitMix64| {
            std::array::from_fn(|i| {
                if given.contains(&i) {
                    wanted[i]
                } else {
                    REGULAR_START[i]
                }
            })
        };
        rows.push(steer(bench, name, &wanted, guess, watch)?);
    }
    rows.push(steer(
        bench,
        "all six within 0.5 rad",
        &wanted,
        |wanted, random| guess_near(wanted, NEAR_RAD, random),
        watch,
    )?);
    Ok(rows)
}

fn steer(
    bench: &Bench,
    name: &'static str,
    wanted: &[(Joints, Configuration)],
    guess: impl Fn(&Joints, &mut SplitMix64) -> [f64; 6],
    watch: &Watch<'_>,
) -> Result<SteeringReport, Interrupted> {
    let mut random = SplitMix64::new(SEED + 8);
    let mut converged = 0_usize;
    let mut hits = [0_usize; 4];
    for (joints, configuration) in wanted {
        watch.check()?;
        let ended = Method::Mended.run(bench, joints, &guess(joints, &mut random));
        if !ended.converged {
            continue;
        }
        converged += 1;
        let found = Configuration::of(&UrGeometry::UR3, &Joints::from(ended.joints));
        let same = [
            found.shoulder == configuration.shoulder,
            found.elbow == configuration.elbow,
            found.wrist == configuration.wrist,
            found == *configuration,
        ];
        for (hit, same) in hits.iter_mut().zip(same) {
            *hit += usize::from(same);
        }
    }
    let of_converged = |count: usize| count as f64 / converged as f64;
    Ok(SteeringReport {
        guess: name,
        converged: converged as f64 / wanted.len() as f64,
        wanted_shoulder: of_converged(hits[0]),
        wanted_elbow: of_converged(hits[1]),
        wanted_wrist: of_converged(hits[2]),
        wanted_configuration: of_converged(hits[3]),
    })
}
