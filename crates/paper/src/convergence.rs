//! Convergence of the numerical method by the distance of its guess, and the branch in which it ends.

use std::collections::BTreeMap;
use std::f64::consts::PI;

use needlebench_kinematics::ik::{
    ClosedFormSolution, Configuration, DampedOptions, GaussNewtonOptions, Numerical, closed_form,
    wrap_angle,
};
use needlebench_kinematics::pose_sets::PoseSet;
use needlebench_kinematics::{Chain, Joints, UrGeometry};
use needlebench_numerics::order::upper_median;
use needlebench_numerics::random::SplitMix64;
use serde::Serialize;

use super::Watch;
use super::dh::Arm;
use super::equations::{SEED, angle_error, well_conditioned};
use super::numerical::{
    CONTENT, Ended, gauss_newton, jacobian, jacobian_printed, levenberg_marquardt,
};
use super::solver::same_joints;

/// Distances of guesses, rad: every joint is off by up to this.
const DISTANCES_RAD: [f64; 9] = [0.01, 0.03, 0.1, 0.2, 0.5, 1.0, 1.5, 2.0, PI];
/// An early step limit: with it the undamped method appears worse than it is.
const EARLY_STEPS: u32 = 50;
/// Poses of each set of the convergence table.
const POSES: usize = 400;
/// Poses of the histograms of branches.
const BRANCH_POSES: usize = 1000;

/// The compared numerical methods.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// Equation 39 as printed (the rest corrected).
    Equation39AsPrinted,
    /// Equations 39 and 45 corrected, undamped.
    Mended,
    /// The same with Levenberg-Marquardt damping.
    LevenbergMarquardt,
    /// The library's Gauss-Newton, which stays near its guess.
    LibraryGaussNewton,
    /// The library's damped solver, with restarts from anywhere.
    LibraryDamped,
}

const METHODS: [(Method, &str); 5] = [
    (Method::Equation39AsPrinted, "equation 39 as printed"),
    (Method::Mended, "39 and 45 corrected, undamped"),
    (Method::LevenbergMarquardt, "the same, Levenberg-Marquardt"),
    (Method::LibraryGaussNewton, "library: Gauss-Newton"),
    (Method::LibraryDamped, "library: damped, with restarts"),
];

/// The arm in both notations.
struct Bench<'a> {
    arm: Arm<f64>,
    chain: Chain,
    numerical: Numerical,
    watch: &'a Watch<'a>,
}

impl Bench<'_> {
    /// Solves for the pose of `wanted`, from a guess.
    fn solve(&self, method: Method, wanted: &Joints, guess: &[f64; 6]) -> Option<Ended> {
        let plain = |jacobian| {
            let pose = UrGeometry::UR3.base_from_flange(wanted).to_homogeneous();
            gauss_newton(&self.arm, &pose, guess, jacobian, CONTENT, |_| {})
        };
        let (pose, start) = (
            self.chain.base_link_from_flange(wanted),
            Joints::from(*guess),
        );
        let found = match method {
            Method::Equation39AsPrinted => return plain(jacobian_printed),
            Method::Mended => return plain(jacobian),
            Method::LevenbergMarquardt => {
                let pose = UrGeometry::UR3.base_from_flange(wanted).to_homogeneous();
                return levenberg_marquardt(&self.arm, &pose, guess);
            }
            Method::LibraryGaussNewton => {
                self.numerical
                    .gauss_newton(&pose, &start, &GaussNewtonOptions::default())
            }
            Method::LibraryDamped => {
                self.numerical
                    .damped(&pose, &start, &DampedOptions::default())
            }
        };
        found.converged.then(|| Ended {
            joints: found.joints.map(wrap_angle).into(),
            steps: found.iterations,
        })
    }

    /// Where a method ends for each posture's pose, from a guess for each.
    fn ends(
        &self,
        method: Method,
        postures: &[Joints],
        mut guess: impl FnMut(&Joints) -> [f64; 6],
    ) -> Vec<Option<Ended>> {
        let postures = self.watch.each(postures);
        postures
            .map(|wanted| self.solve(method, wanted, &guess(wanted)))
            .collect()
    }

    /// The same from guesses off by up to `distance_rad`, the same for every method.
    fn ends_from(
        &self,
        method: Method,
        postures: &[Joints],
        distance_rad: f64,
    ) -> Vec<Option<Ended>> {
        let mut random = SplitMix64::new(SEED + 5);
        self.ends(method, postures, |wanted| {
            guess_near(wanted, distance_rad, &mut random)
        })
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
    /// Share of guesses from which it ends in the branch nearest to the guess, 0 to 1.
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

/// Order of convergence of the corrected method.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Order {
    /// Median of `ln(e3/e2) / ln(e2/e1)` over the last errors above rounding.
    pub median: f64,
    pub samples: usize,
    /// Median joint error after 0, 1, 2 ... steps from a guess 0.1 rad off, rad.
    pub median_error_rad: [f64; 5],
}

/// Where the corrected method ends from one start over random poses.
#[derive(Debug, Clone, Serialize)]
pub struct StartReport {
    pub name: &'static str,
    pub start_rad: [f64; 6],
    pub poses: usize,
    /// Share of poses, 0 to 1, in the order of Table 2.
    pub share_by_configuration: BTreeMap<usize, f64>,
    pub not_converged: f64,
}

/// Effect of the guess on the branch.
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

/// Iterations of the corrected method from guesses at one distance.
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

/// A start away from every singularity, as in the command `ik`.
const REGULAR_START: [f64; 6] = [0.1, -1.2, -1.2, -1.0, 1.2, 0.1];

/// The first two are singular at elbow and wrist, like many common starts.
const STARTS: [(&str, [f64; 6]); 3] = [
    ("zeros", [0.0; 6]),
    ("upright home", [0.0, -0.5 * PI, 0.0, -0.5 * PI, 0.0, 0.0]),
    ("regular", REGULAR_START),
];

/// Measures everything.
pub fn evaluate(watch: &Watch<'_>) -> ConvergenceReport {
    let chain = UrGeometry::UR3.chain();
    let bench = Bench {
        arm: Arm::ur3(),
        numerical: Numerical::new(&chain),
        chain,
        watch,
    };
    let regular = postures(true, POSES, SEED + 2);
    let all = postures(false, POSES, SEED + 3);
    let poses = postures(false, BRANCH_POSES, SEED + 4);
    let curve = |(method, name)| Curve {
        method,
        name,
        well_conditioned: points(&bench, method, &regular),
        all: points(&bench, method, &all),
    };
    let histogram = |distance_rad| {
        let mut count_by_iterations = BTreeMap::new();
        for ended in bench
            .ends_from(Method::Mended, &regular, distance_rad)
            .iter()
            .flatten()
        {
            *count_by_iterations.entry(ended.steps).or_default() += 1;
        }
        IterationHistogram {
            distance_rad,
            count_by_iterations,
        }
    };
    ConvergenceReport {
        poses: POSES,
        curves: METHODS.map(curve).into(),
        order: order(&bench, &regular),
        iterations: [0.1, 0.5, 1.5].map(histogram).into(),
        starts: STARTS
            .map(|(name, start)| from_start(&bench, name, start, &poses))
            .into(),
        steering_trials: poses.len(),
        steering: steering(&bench, &poses),
    }
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

/// One method at all distances.
fn points(bench: &Bench<'_>, method: Method, set: &[Joints]) -> Vec<Point> {
    let point = |distance_rad| {
        let ends = bench.ends_from(method, set, distance_rad);
        let share = |counts: &dyn Fn(&Ended, &Joints) -> bool| {
            let pairs = ends.iter().zip(set);
            let part =
                pairs.filter(|(ended, wanted)| ended.is_some_and(|ended| counts(&ended, wanted)));
            part.count() as f64 / set.len() as f64
        };
        let steps = || ends.iter().flatten().map(|ended| f64::from(ended.steps));
        Point {
            distance_rad,
            converged: share(&|_, _| true),
            converged_in_50_steps: share(&|ended, _| ended.steps <= EARLY_STEPS),
            same_branch: share(&|ended, wanted| same_joints(&ended.joints, wanted)),
            mean_iterations: steps().sum::<f64>() / steps().count() as f64,
        }
    };
    DISTANCES_RAD.map(point).into()
}

/// Joint errors below this are rounding, rad.
const ROUNDING_RAD: f64 = 1e-13;

fn order(bench: &Bench<'_>, postures: &[Joints]) -> Order {
    let mut random = SplitMix64::new(SEED + 6);
    let mut orders = Vec::new();
    let mut errors_by_step: [Vec<f64>; 5] = Default::default();
    for wanted in postures {
        let guess = guess_near(wanted, 0.1, &mut random);
        let pose = UrGeometry::UR3.base_from_flange(wanted).to_homogeneous();
        let mut errors: Vec<f64> = Vec::new();
        let ended = gauss_newton(
            &bench.arm,
            &pose,
            &guess,
            jacobian,
            ROUNDING_RAD,
            |joints| {
                let differences = joints.iter().zip(wanted.iter());
                let differences = differences.map(|(a, b)| angle_error(*a, *b));
                errors.push(differences.fold(0.0, f64::max));
            },
        );
        if !ended.is_some_and(|ended| same_joints(&ended.joints, wanted)) {
            continue;
        }
        for (step, of_step) in errors_by_step.iter_mut().enumerate() {
            // An iteration that has ended stays where it is.
            of_step.extend(errors.get(step).or(errors.last()));
        }
        let rounding = errors.iter().position(|error| *error <= ROUNDING_RAD);
        if let [.., first, second, third] = errors[..rounding.unwrap_or(errors.len())] {
            orders.push(libm::log(third / second) / libm::log(second / first));
        }
    }
    Order {
        samples: orders.len(),
        median: upper_median(&mut orders),
        median_error_rad: errors_by_step.map(|mut errors| upper_median(&mut errors)),
    }
}

fn from_start(
    bench: &Bench<'_>,
    name: &'static str,
    start_rad: [f64; 6],
    poses: &[Joints],
) -> StartReport {
    let ends = bench.ends(Method::Mended, poses, |_| start_rad);
    let found: Vec<usize> = ends
        .iter()
        .flatten()
        .map(|ended| configuration(ended).index())
        .collect();
    let share = |part: usize| part as f64 / poses.len() as f64;
    let of = |index: usize| share(found.iter().filter(|each| **each == index).count());
    StartReport {
        name,
        start_rad,
        poses: poses.len(),
        share_by_configuration: (0..8).map(|index| (index, of(index))).collect(),
        not_converged: share(poses.len() - found.len()),
    }
}

fn configuration(ended: &Ended) -> Configuration {
    Configuration::of(&UrGeometry::UR3, &Joints::from(ended.joints))
}

/// Which joints of the guess are those of the target solution; the others are the regular start's.
const STEERING: [(&str, &[usize]); 5] = [
    ("regular start", &[]),
    ("q1 as wanted", &[0]),
    ("q2 as wanted", &[1]),
    ("q1 and q2 as wanted", &[0, 1]),
    ("q1, q2 and q3 as wanted", &[0, 1, 2]),
];

/// The last row of the steering table: every joint within this of the target one, rad.
const NEAR_RAD: f64 = 0.5;

fn steering(bench: &Bench<'_>, poses: &[Joints]) -> Vec<SteeringReport> {
    // The target solution: any of the pose's, sampled uniformly.
    let mut random = SplitMix64::new(SEED + 7);
    let drawn = poses.iter().filter_map(|made_of| {
        let pose = UrGeometry::UR3.base_from_flange(made_of);
        let answers = closed_form(&UrGeometry::UR3, &pose, None);
        let bound = Some(answers.count()).filter(|bound| *bound > 0)?;
        answers.solutions().nth(random.below(bound) as usize)
    });
    let wanted: Vec<ClosedFormSolution> = drawn.collect();
    let joints: Vec<Joints> = wanted.iter().map(|each| each.joints).collect();
    let steer = |guess_name, guess: &mut dyn FnMut(&Joints) -> [f64; 6]| {
        let ends = bench.ends(Method::Mended, &joints, guess);
        let pairs = ends.iter().zip(&wanted);
        let pairs = pairs.filter_map(|(ended, wanted)| {
            Some([configuration(ended.as_ref()?), wanted.configuration])
        });
        let pairs: Vec<[Configuration; 2]> = pairs.collect();
        let share = |same: fn(&[Configuration; 2]) -> bool| {
            pairs.iter().filter(|pair| same(pair)).count() as f64 / pairs.len() as f64
        };
        SteeringReport {
            guess: guess_name,
            converged: pairs.len() as f64 / joints.len() as f64,
            wanted_shoulder: share(|[found, wanted]| found.shoulder == wanted.shoulder),
            wanted_elbow: share(|[found, wanted]| found.elbow == wanted.elbow),
            wanted_wrist: share(|[found, wanted]| found.wrist == wanted.wrist),
            wanted_configuration: share(|[found, wanted]| found == wanted),
        }
    };
    let given = STEERING.map(|(name, given)| {
        let of = |wanted: &Joints, i| {
            if given.contains(&i) {
                wanted[i]
            } else {
                REGULAR_START[i]
            }
        };
        steer(name, &mut |wanted| std::array::from_fn(|i| of(wanted, i)))
    });
    let mut random = SplitMix64::new(SEED + 8);
    let near = steer("all six within 0.5 rad", &mut |wanted| {
        guess_near(wanted, NEAR_RAD, &mut random)
    });
    given.into_iter().chain([near]).collect()
}
