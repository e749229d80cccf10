//! `needlebench ik` and `needlebench fk`.

mod answer;
mod arm;
mod target;

use crate::arguments::{ArmArguments, PoseMatrix, Six};
use clap::{Args, ValueEnum};
use std::path::PathBuf;
use std::time::Duration;

use anyhow::Result;
use needlebench_input::Finding;
use needlebench_kinematics::ik::{
    Configuration, DampedOptions, GaussNewtonOptions, Kinematics, Solution, SolutionKind,
    Tolerance, WrapSearch, wrap_angle,
};
use needlebench_kinematics::{Joints, Pose};

use self::answer::{ArmAnswer, FkAnswer, IkAnswer, SolutionAnswer, UnreachableAnswer, kind_name};
pub use self::arm::KinematicArm;
use self::target::{target, tolerance};
use super::{print_json, print_text};

use crate::exit::ExitStatus;
use crate::failure::Failure;

/// Methods of inverse kinematics.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum IkMethod {
    /// All solutions, in closed form.
    ClosedForm,
    /// One solution, near the seed.
    GaussNewton,
    /// One solution from any seed: damped, with restarts until it converges.
    Damped,
}

#[derive(Debug, Args)]
pub(crate) struct IkArguments {
    /// Scenario with the `--goal` to solve.
    #[arg(
        value_name = "SCENARIO",
        conflicts_with_all = ["pose", "matrix", "arm"],
        requires = "goal"
    )]
    pub scenario: Option<PathBuf>,
    /// Goal of the scenario.
    #[arg(long, requires = "scenario")]
    pub goal: Option<String>,
    /// Pose of the flange in the controller's base frame: x,y,z (m) and rotation vector (rad).
    #[arg(
        long,
        value_name = "x,y,z,rx,ry,rz",
        allow_hyphen_values = true,
        required_unless_present_any = ["scenario", "matrix"]
    )]
    pub pose: Option<Six>,
    /// The same as a matrix: 12 or 16 numbers, row by row, rotation and position (m).
    #[arg(
        long,
        value_name = "NUMBERS",
        allow_hyphen_values = true,
        conflicts_with = "pose"
    )]
    pub matrix: Option<PoseMatrix>,
    /// Use the rotation nearest to the matrix, e.g. if its digits are rounded.
    #[arg(long, requires = "matrix")]
    pub nearest_rotation: bool,
    /// Method.
    #[arg(long, value_enum, default_value = "closed-form")]
    pub method: IkMethod,
    /// Joint positions, rad: initial guess of a numerical method; in closed form the reference to which free joints and
    /// 2 pi equivalents are nearest.
    #[arg(long, value_name = "q1,..,q6", allow_hyphen_values = true)]
    pub seed: Option<Six>,
    /// Iteration limit of a numerical method.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub max_iterations: Option<u32>,
    /// Time limit of a numerical method, ms; the result depends on the machine.
    #[arg(long, value_name = "MS", value_parser = clap::value_parser!(u32).range(1..))]
    pub time_limit_ms: Option<u32>,
    /// Pose tolerance (m and rad) for boundary solutions [default: resolution of the given digits, at least 1e-7].
    #[arg(long, value_name = "M_AND_RAD")]
    pub tolerance: Option<f64>,
    /// Also list 2 pi equivalents within the joint limits, nearest to the seed (or zero) first; at most one turn either
    /// way for joints without limits.
    #[arg(long)]
    pub wraps: bool,
    /// Print one JSON document.
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub arm: ArmArguments,
}

#[derive(Debug, Args)]
pub(crate) struct FkArguments {
    /// Joint positions, shoulder pan to wrist 3, rad.
    #[arg(long, value_name = "q1,..,q6", allow_hyphen_values = true)]
    pub joints: Six,
    /// Print one JSON document.
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub arm: ArmArguments,
}

/// Solves the inverse kinematics of a pose or a goal.
pub(crate) fn ik(arguments: &IkArguments) -> Result<ExitStatus, Failure> {
    let answer = solve(arguments)?;
    if arguments.json {
        print_json(&answer)?;
    } else {
        print_text(&answer.text())?;
    }
    // A pose without a solution is a failure.
    Ok(match answer.count {
        0 => ExitStatus::CriterionFailed,
        _ => ExitStatus::Success,
    })
}

fn solve(arguments: &IkArguments) -> Result<IkAnswer, Failure> {
    if arguments.method != IkMethod::ClosedForm && arguments.wraps {
        return Err(
            Finding::new("--wraps", "a numerical method finds one solution only")
                .hint("2 pi equivalents require the closed form: remove --method")
                .into(),
        );
    }
    if arguments.method == IkMethod::ClosedForm {
        let given = [
            ("--max-iterations", arguments.max_iterations),
            ("--time-limit-ms", arguments.time_limit_ms),
        ];
        if let Some((option, _)) = given.iter().find(|(_, value)| value.is_some()) {
            return Err(Finding::new(*option, "the closed form does not iterate")
                .hint("choose a numerical method, such as --method gauss-newton")
                .into());
        }
    }
    if arguments.method != IkMethod::ClosedForm && arguments.tolerance.is_some() {
        return Err(
            Finding::new("--tolerance", "a numerical method iterates to rounding")
                .hint("the tolerance requires the closed form: remove --method")
                .into(),
        );
    }
    let tolerance = tolerance(arguments)?;
    let (arm, base_link_from_flange) = target(arguments)?;
    let kinematics = Kinematics::new(arm.chain)
        .map_err(|error| Finding::new(&arm.file, error.to_string()))?
        .within(arm.limits)
        .touching_within(tolerance);
    Ok(match arguments.method {
        IkMethod::ClosedForm => closed_form(
            arguments,
            &arm,
            &kinematics,
            &base_link_from_flange,
            tolerance,
        ),
        IkMethod::GaussNewton | IkMethod::Damped => {
            numerical(arguments, &arm, &kinematics, &base_link_from_flange)
        }
    })
}

/// The seed of the arguments.
fn seed(arguments: &IkArguments) -> Option<Joints> {
    arguments.seed.map(|six| Joints::from_column_slice(&six.0))
}

fn closed_form(
    arguments: &IkArguments,
    arm: &KinematicArm,
    kinematics: &Kinematics,
    base_link_from_flange: &Pose,
    tolerance: Tolerance,
) -> IkAnswer {
    let seed = seed(arguments);
    let found = kinematics.solve(base_link_from_flange, seed.as_ref());
    let row = |solution: &Solution, joints: Joints| SolutionAnswer {
        label: solution.configuration.label(),
        joints_rad: joints.into(),
        residual_m: solution.residual_m,
        residual_rad: solution.residual_rad,
        within_limits: arm.allows(&joints),
        free_joint: solution.wrist_3_is_free.then_some("wrist_3"),
        kind: kind_name(solution.kind),
        merged: solution.merged,
        touching: solution.touching,
        iterations: None,
    };
    let (exact, nearest): (Vec<Solution>, Vec<Solution>) = found
        .solutions
        .iter()
        .chain(&found.nearest)
        .partition(|solution| solution.kind != SolutionKind::Nearest);
    let solutions: Vec<SolutionAnswer> = if arguments.wraps {
        WrapSearch::new(&arm.limits, &seed.unwrap_or_else(Joints::zeros))
            .at_most_turns(1)
            .wraps_of_all(exact.iter().map(|solution| solution.joints))
            .map(|wrap| row(&exact[wrap.posture], wrap.joints))
            .collect()
    } else {
        exact.iter().map(|each| row(each, each.joints)).collect()
    };
    IkAnswer {
        schema_version: 1,
        arm: ArmAnswer::of(arm),
        method: "closed-form",
        tolerance_m: Some(tolerance.m),
        tolerance_rad: Some(tolerance.rad),
        count: solutions.len(),
        solutions,
        nearest: nearest.iter().map(|each| row(each, each.joints)).collect(),
        unreachable: found
            .unreachable
            .iter()
            .map(|(configuration, reason)| UnreachableAnswer {
                label: configuration.label(),
                missing_m: reason.missing_m(),
            })
            .collect(),
        certificate: found.certificate.name(),
    }
}

/// One solution, by iteration from a guess.
fn numerical(
    arguments: &IkArguments,
    arm: &KinematicArm,
    kinematics: &Kinematics,
    base_link_from_flange: &Pose,
) -> IkAnswer {
    // Away from every singularity, so that the first step is well-conditioned.
    let guess = seed(arguments)
        .unwrap_or_else(|| Joints::from_column_slice(&[0.1, -1.2, -1.2, -1.0, 1.2, 0.1]));
    let max_time = arguments
        .time_limit_ms
        .map(|limit| Duration::from_millis(u64::from(limit)));
    let solver = kinematics.numerical();
    let (method, found) = if arguments.method == IkMethod::Damped {
        let defaults = DampedOptions::default();
        let options = DampedOptions {
            max_iterations: arguments.max_iterations.unwrap_or(defaults.max_iterations),
            max_time,
            ..defaults
        };
        let found = solver.damped(base_link_from_flange, &guess, &options);
        ("damped", found)
    } else {
        let defaults = GaussNewtonOptions::default();
        let options = GaussNewtonOptions {
            max_iterations: arguments.max_iterations.unwrap_or(defaults.max_iterations),
            max_time,
            ..defaults
        };
        let found = solver.gauss_newton(base_link_from_flange, &guess, &options);
        ("gauss-newton", found)
    };
    let joints = found.joints.map(wrap_angle);
    let kind = if found.converged {
        SolutionKind::Exact
    } else {
        SolutionKind::Nearest
    };
    let row = SolutionAnswer {
        label: Configuration::of(&kinematics.geometry, &joints).label(),
        joints_rad: joints.into(),
        residual_m: found.residual_m,
        residual_rad: found.residual_rad,
        within_limits: arm.allows(&joints),
        free_joint: None,
        kind: kind_name(kind),
        merged: false,
        touching: false,
        iterations: Some(found.iterations),
    };
    let (solutions, nearest) = match kind {
        SolutionKind::Exact | SolutionKind::Touching => (vec![row], Vec::new()),
        SolutionKind::Nearest => (Vec::new(), vec![row]),
    };
    IkAnswer {
        schema_version: 1,
        arm: ArmAnswer::of(arm),
        method,
        tolerance_m: None,
        tolerance_rad: None,
        count: solutions.len(),
        solutions,
        nearest,
        unreachable: Vec::new(),
        // A numerical method finds one solution, without information on the others.
        certificate: match kind {
            SolutionKind::Exact | SolutionKind::Touching => "one_of_several",
            SolutionKind::Nearest => "not_converged",
        },
    }
}

/// Prints forward kinematics.
pub(crate) fn fk(arguments: &FkArguments) -> Result<ExitStatus, Failure> {
    let arm = KinematicArm::new(&arguments.arm)?;
    arguments.joints.doubt_degrees();
    let answer = FkAnswer::new(&arm, &Joints::from_column_slice(&arguments.joints.0));
    if arguments.json {
        print_json(&answer)?;
    } else {
        print_text(&answer.text())?;
    }
    Ok(ExitStatus::Success)
}
