//! `needlebench judge`.

use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use anyhow::{Context, Result};
use clap::{Args, ValueEnum};
use needlebench_bench::RunOptions;
use needlebench_bench::judge::answers::{AnswersOptions, TOLERANCE, judge_answers};
use needlebench_bench::judge::free::judge_free;
use needlebench_bench::judge::{JudgeOptions, JudgedRun, judge as judge_motion};
use needlebench_bench::robot::{
    InstalledTcp, RobotOptions, TIME_LIMIT_S, Until, is_program, judge_program, program_motion,
};
use needlebench_evaluation::report::Verdict;
use needlebench_input::Finding;
use needlebench_kinematics::trajectory::Between;
use needlebench_parallel::{Control, Silent};
use needlebench_patient::ct::{LastScan, scanned};
use needlebench_recorded::{MotionFile, MotionOptions, read_answers, read_motion};
use needlebench_report::table::answers::answers_text;
use needlebench_report::table::free::free_text;
use needlebench_report::{answers_junit, free_junit, write_atomically};
use needlebench_scenario::ResolvedScenario;
use serde::Serialize;

use super::results_folder::{ResultsFolder, probe_file};
use super::run::{Outputs, put, tell_pipeline};
use super::{load, overrides, print_json, print_text};
use crate::arguments::{RobotArguments, RunningArguments};
use crate::exit::ExitStatus;
use crate::failure::Failure;
use crate::interrupts::{threads, watch_interrupts};
use crate::output::print_wide;
use crate::progress::TerminalProgress;

pub(crate) const JUDGE_HELP: &str = "\
The motion is a trajectory_msgs/JointTrajectory or a RobotTrajectory of MoveIt as JSON or YAML, a table with a column \
for the time and one for each joint (what `export --as trajectory` writes in JSON, YAML and CSV comes back), a log of \
UR's RTDE recorder or of ur_rtde (its set-points), or an MCAP file. Joints are found by name, in any order; angles are \
in radians. Points without times get them from the limits of the scenario's [motion], with a stop at each.

A program in URScript (.script) runs on a virtual controller, from the scenario's start posture on, as by `robot \
--script`, which has more options; the verdict is the same.

The goal is the one at which the guide stands, within 20 mm and 5 degrees; the configuration the one of the eight whose \
solution is nearest. Several holds of one motion are judged in their order. Judged are the criteria of a run, and \
besides: guide_position, guide_angle, joint_range, joint_speed, joint_acceleration, joint_torque. Certified clearances \
are those of the course between the points.

With --answers the joint positions that a solver of inverse kinematics gave are judged against the complete set of \
solutions: how far each is off, which of the eight it is, what is missing, double or outside the joints' limits.

Results of a motion to a goal in OUT/NAME of the scenario, as of a run; with --answers or --free none are written.

Example: needlebench judge scenarios/table3.toml --motion plan.json
Example: needlebench judge cell.toml --motion moveit.yaml --goal lesion --start as-is --engine rapier
Example: needlebench judge scenarios/table3.toml --motion guide/examples/to_the_needle.script
Example: needlebench judge cell.toml --answers solver.csv --junit solver.xml";

#[derive(Debug, Args)]
pub(crate) struct JudgeArguments {
    /// Scenario with the goals.
    #[arg(value_name = "SCENARIO")]
    pub scenario: PathBuf,
    /// Motion to judge.
    #[arg(long, value_name = "FILE", required_unless_present = "answers")]
    pub motion: Option<PathBuf>,
    /// Answers of a solver of inverse kinematics to judge instead: CSV, JSON, Parquet or .npy.
    #[arg(
        long,
        value_name = "FILE",
        conflicts_with_all = ["motion", "engine", "referee", "record", "rtde", "no_page"]
    )]
    pub answers: Option<PathBuf>,
    /// Largest distance (m) and angle (rad) of a right answer [default: 1e-4].
    #[arg(long, value_name = "M_AND_RAD", conflicts_with = "motion", value_parser = tolerance)]
    pub tolerance: Option<f64>,
    /// One right answer is enough: missing ones are listed, and do not fail.
    #[arg(long, conflicts_with = "motion")]
    pub partial: bool,
    /// Judge clearances and joints alone, wherever the motion leads; nothing is simulated.
    #[arg(long, conflicts_with_all = ["goal", "answers", "engine", "referee", "record", "rtde", "no_page"])]
    pub free: bool,
    /// Goal that the motion leads to [default: those at which it stands], or that is answered.
    #[arg(long, value_name = "NAME")]
    pub goal: Option<String>,
    /// Interpolation between points [default: quintics with accelerations, cubics with velocities, else straight lines].
    #[arg(long, value_enum, value_name = "CURVE", conflicts_with = "answers")]
    pub between: Option<BetweenArgument>,
    /// Where the motion may begin.
    #[arg(
        long,
        value_enum,
        value_name = "WHERE",
        default_value = "scenario",
        conflicts_with = "answers"
    )]
    pub start: StartArgument,
    /// What the motion is compared with.
    #[arg(
        long,
        value_enum,
        value_name = "WHAT",
        default_value = "plan",
        conflicts_with = "answers"
    )]
    pub against: AgainstArgument,
    /// Which positions of a log are judged.
    #[arg(
        long,
        value_enum,
        value_name = "WHICH",
        default_value = "target",
        conflicts_with = "answers"
    )]
    pub of: OfArgument,
    /// Stretch of a log with gaps, from 1.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..), conflicts_with = "answers")]
    pub stretch: Option<u32>,
    /// Topic of the joint states in an MCAP file.
    #[arg(long, value_name = "NAME", conflicts_with = "answers")]
    pub topic: Option<String>,
    /// TCP of the controller's installation, for a program that sets none before it needs one.
    #[arg(long, value_enum, value_name = "WHERE", conflicts_with = "answers")]
    pub tcp: Option<TcpArgument>,
    #[command(flatten)]
    pub running: RunningArguments,
    #[command(flatten)]
    pub robot: RobotArguments,
}

/// Interpolation between points.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum BetweenArgument {
    /// With the positions, velocities and accelerations of both ends.
    Quintics,
    /// With the positions and velocities of both ends.
    Cubics,
    /// Straight joint-space lines at constant speed.
    Lines,
}

/// Where a motion begins.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum StartArgument {
    /// At the scenario's start posture, within 1 degree.
    Scenario,
    /// Anywhere; the way there is not evaluated.
    AsIs,
}

/// What a motion is compared with.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum AgainstArgument {
    /// Needlebench's own plans to the same goals.
    Plan,
    /// Nothing.
    None,
}

/// Positions of a log.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum OfArgument {
    /// Set-points.
    Target,
    /// What was measured.
    Actual,
}

/// Tool's point of an installation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum TcpArgument {
    /// Centre of the flange.
    Flange,
    /// Exit of the scenario's guide.
    GuideExit,
}

impl TcpArgument {
    /// The tool's point that an installation has.
    pub(super) fn installed(argument: Option<Self>) -> InstalledTcp {
        match argument {
            None => InstalledTcp::Unknown,
            Some(Self::Flange) => InstalledTcp::Flange,
            Some(Self::GuideExit) => InstalledTcp::GuideExit,
        }
    }
}

/// Refuses a flag that the motion's file makes no sense of.
fn refused(path: &Path, flag: &str, about: &str) -> Failure {
    let message = format!("{flag} is about {about}");
    let finding = Finding::new(path.display().to_string(), message).key(flag);
    Failure::from(finding.hint("leave it out"))
}

/// Reads a motion that is no program.
fn read(path: &Path, arguments: &JudgeArguments) -> Result<MotionFile, Failure> {
    if arguments.tcp.is_some() {
        return Err(refused(path, "--tcp", "programs, and this is none"));
    }
    let options = MotionOptions {
        of_actual: arguments.of == OfArgument::Actual,
        stretch: arguments.stretch.map(|number| number as usize),
        topic: arguments.topic.clone(),
    };
    Ok(read_motion(path, &options)?)
}

/// How a program is run.
fn program_options(path: &Path, arguments: &JudgeArguments) -> Result<RobotOptions, Failure> {
    for (is_given, flag, about) in [
        (arguments.of == OfArgument::Actual, "--of", "logs"),
        (arguments.stretch.is_some(), "--stretch", "logs"),
        (arguments.topic.is_some(), "--topic", "logs"),
        (arguments.between.is_some(), "--between", "points"),
    ] {
        if is_given {
            return Err(refused(
                path,
                flag,
                &format!("{about}, and this is a program"),
            ));
        }
    }
    Ok(RobotOptions {
        until: Until::Program,
        time_limit_s: TIME_LIMIT_S,
        installed: TcpArgument::installed(arguments.tcp),
        goal: arguments.goal.clone(),
        beside: arguments.against == AgainstArgument::Plan,
    })
}

/// Judges a motion from a file.
pub(crate) fn judge(arguments: &JudgeArguments) -> Result<ExitStatus, Failure> {
    if arguments.running.wide {
        print_wide();
    }
    let overrides = overrides(&arguments.robot)?;
    let resolved = load(&arguments.scenario, &overrides)?;
    // As a run has it: what the scan of a scenario shows.
    let resolved = scanned(resolved, &overrides, &mut LastScan::default())?;
    let Some(motion) = &arguments.motion else {
        return answers(arguments, &resolved);
    };
    if arguments.free {
        return free(arguments, &resolved, motion);
    }
    let folder = arguments.running.out.join(&resolved.scenario.name);
    let _taken = ResultsFolder::take(&folder)?;
    if let Some(path) = &arguments.running.junit {
        probe_file(path, "--junit")?;
    }
    let cancel = watch_interrupts()?;
    let options = arguments.running.options();
    let progress = TerminalProgress::new(arguments.running.quiet);
    let done = judged(arguments, (&resolved, motion), &options, &cancel, &progress);
    progress.finish();
    let done = done?;
    let (status, report) = put(
        &done.resolved,
        &done.run,
        options.jobs,
        &folder,
        Outputs::of(&arguments.running),
        &cancel,
        &progress,
    )?;
    if arguments.running.json {
        print_json(&report)?;
    }
    tell_pipeline(&[&report], arguments.running.junit.as_deref())?;
    Ok(status)
}

/// Judges a program as `robot` does, any other motion by its points.
fn judged(
    arguments: &JudgeArguments,
    (resolved, path): (&ResolvedScenario, &Path),
    options: &RunOptions,
    cancel: &AtomicBool,
    progress: &TerminalProgress,
) -> Result<JudgedRun, Failure> {
    if is_program(path) {
        let asked = program_options(path, arguments)?;
        let done = judge_program(resolved, path, &asked, options, cancel, progress);
        return Ok(done?);
    }
    let motion = read(path, arguments)?;
    let asked = JudgeOptions {
        goal: arguments.goal.clone(),
        between: between(arguments),
        any_start: arguments.start == StartArgument::AsIs,
        beside: arguments.against == AgainstArgument::Plan,
        nearest: false,
    };
    let done = judge_motion(resolved, &motion, &asked, options, cancel, progress);
    Ok(done?)
}

/// Judges clearances and joints alone.
fn free(
    arguments: &JudgeArguments,
    resolved: &ResolvedScenario,
    path: &Path,
) -> Result<ExitStatus, Failure> {
    let motion = if is_program(path) {
        let asked = program_options(path, arguments)?;
        let cancel = watch_interrupts()?;
        let options = arguments.running.options();
        program_motion(resolved, path, &asked, &options, &cancel)?
    } else {
        read(path, arguments)?
    };
    let report = judge_free(resolved, &motion, between(arguments))?;
    let junit = free_junit(&report);
    let text = free_text(&report);
    told(arguments, &report, &text, report.verdict, junit)
}

fn between(arguments: &JudgeArguments) -> Option<Between> {
    arguments.between.map(|between| match between {
        BetweenArgument::Quintics => Between::Quintics,
        BetweenArgument::Cubics => Between::Cubics,
        BetweenArgument::Lines => Between::Lines,
    })
}

/// Judges the answers of a solver.
fn answers(arguments: &JudgeArguments, resolved: &ResolvedScenario) -> Result<ExitStatus, Failure> {
    let path = arguments.answers.as_ref();
    let file = read_answers(path.expect("clap asks for a motion or answers"))?;
    let cancel = watch_interrupts()?;
    let control = Control {
        threads: threads(arguments.running.jobs),
        cancel: &cancel,
        progress: &Silent,
    };
    let options = AnswersOptions {
        goal: arguments.goal.clone(),
        tolerance: arguments.tolerance.unwrap_or(TOLERANCE),
        is_partial: arguments.partial,
    };
    let report = judge_answers(resolved, &file, &options, &control)?;
    let text = answers_text(&report, arguments.running.wide);
    let junit = answers_junit(&report);
    told(arguments, &report, &text, report.verdict, junit)
}

/// Prints a report, as JSON or as text, and writes its JUnit document.
fn told(
    arguments: &JudgeArguments,
    report: &impl Serialize,
    text: &str,
    verdict: Verdict,
    junit: Result<String, impl std::error::Error + Send + Sync + 'static>,
) -> Result<ExitStatus, Failure> {
    if let Some(path) = &arguments.running.junit {
        let junit = junit.map_err(anyhow::Error::from)?;
        write_atomically(path, junit.as_bytes())
            .with_context(|| format!("cannot write {}", path.display()))?;
    }
    if arguments.running.json {
        print_json(report)?;
    } else {
        print_text(text.trim_end())?;
    }
    Ok(ExitStatus::of(verdict))
}

fn tolerance(text: &str) -> Result<f64, String> {
    let value: f64 = text
        .parse()
        .map_err(|_| "a number in m and rad".to_owned())?;
    if value > 0.0 && value <= 1.0 {
        Ok(value)
    } else {
        Err("above 0 and at most 1, in m and rad".to_owned())
    }
}
