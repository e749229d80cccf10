//! `needlebench judge`.

use std::path::PathBuf;

use anyhow::Result;
use clap::{Args, ValueEnum};
use needlebench_bench::RunOptions;
use needlebench_bench::judge::{
    InstalledTcp, JudgeError, JudgeOptions, is_program, judge as judge_motion, read_program,
};
use needlebench_input::Finding;
use needlebench_kinematics::trajectory::Between;
use needlebench_recorded::{MotionFile, MotionOptions, read_motion};
use needlebench_scenario::ResolvedScenario;

use super::results_folder::{ResultsFolder, probe_file};
use super::run::{Outputs, Printed, put, tell_pipeline};
use super::{load, overrides, print_json};
use crate::arguments::{EngineArgument, EngineParser, PicturesArguments, RobotArguments};
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

A program in URScript (.script) begins at the scenario's start posture. Its moves with fixed arguments are judged: \
movej, movel, movep, servoj, with the controller's ramps and blends as assumed in the report's notes. What depends on \
the arm's measured state, inputs, sockets or threads is refused with its line.

The goal is the one at which the guide stands, within 20 mm and 5 degrees; the configuration the one of the eight whose \
solution is nearest. Several holds of one motion are judged in their order. Judged are the criteria of a run, and \
besides: guide_position, guide_angle, joint_range, joint_speed, joint_acceleration, joint_torque. Certified clearances are those of the course \
between the points.

Results in OUT/NAME of the scenario, as of a run.

Example: needlebench judge scenarios/table3.toml --motion plan.json
Example: needlebench judge cell.toml --motion moveit.yaml --goal lesion --start as-is --engine rapier
Example: needlebench judge scenarios/table3.toml --motion guide/examples/to_the_needle.script";

#[derive(Debug, Args)]
#[expect(clippy::struct_excessive_bools, reason = "flags of a command line")]
pub(crate) struct JudgeArguments {
    /// Scenario with the goals.
    #[arg(value_name = "SCENARIO")]
    pub scenario: PathBuf,
    /// Motion to judge.
    #[arg(long, value_name = "FILE")]
    pub motion: PathBuf,
    /// Goal that the motion leads to [default: those at which it stands].
    #[arg(long, value_name = "NAME")]
    pub goal: Option<String>,
    /// What joins the points [default: quintics with accelerations, cubics with velocities, else straight lines].
    #[arg(long, value_enum, value_name = "CURVE")]
    pub between: Option<BetweenArgument>,
    /// Where the motion may begin.
    #[arg(long, value_enum, value_name = "WHERE", default_value = "scenario")]
    pub start: StartArgument,
    /// What the motion is compared with.
    #[arg(long, value_enum, value_name = "WHAT", default_value = "plan")]
    pub against: AgainstArgument,
    /// Which positions of a log are judged.
    #[arg(long, value_enum, value_name = "WHICH", default_value = "target")]
    pub of: OfArgument,
    /// Stretch of a log with gaps, from 1.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub stretch: Option<u32>,
    /// Topic of the joint states in an MCAP file.
    #[arg(long, value_name = "NAME")]
    pub topic: Option<String>,
    /// TCP of the controller's installation, for a program that sets none before it needs one.
    #[arg(long, value_enum, value_name = "WHERE")]
    pub tcp: Option<TcpArgument>,
    /// Physics engines [default: those of the scenario].
    #[arg(long, value_name = "ENGINE[,ENGINE]", value_parser = EngineParser)]
    pub engine: Option<EngineArgument>,
    /// Verify every motion against the reference integrator at steps h, h/2 and h/4 (3 to 10 times slower).
    #[arg(long = "reference")]
    pub referee: bool,
    /// Folder for results; the scenario has a subfolder of its name.
    #[arg(long, value_name = "DIR", default_value = "out")]
    pub out: PathBuf,
    /// Print the report as one JSON document instead of the table.
    #[arg(long)]
    pub json: bool,
    /// Also write JUnit XML to this file.
    #[arg(long, value_name = "FILE")]
    pub junit: Option<PathBuf>,
    /// Number of threads [default: all cores]; does not affect results.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=256))]
    pub jobs: Option<u16>,
    #[command(flatten)]
    pub pictures: PicturesArguments,
    /// Do not write the report page.
    #[arg(long)]
    pub no_page: bool,
    /// Do not show progress.
    #[arg(long)]
    pub quiet: bool,
    /// Print all tables at full width instead of one screen.
    #[arg(long, conflicts_with = "json")]
    pub wide: bool,
    #[command(flatten)]
    pub robot: RobotArguments,
}

/// Curves between points.
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

/// Reads the motion: a program by its name, else points.
fn motion(
    resolved: &ResolvedScenario,
    arguments: &JudgeArguments,
) -> Result<MotionFile, Vec<Finding>> {
    let path = &arguments.motion;
    let refuse = |flag: &str, about: &str| {
        let message = format!("{flag} is about {about}");
        let finding = Finding::new(path.display().to_string(), message).key(flag);
        Err(vec![finding.hint("leave it out")])
    };
    if !is_program(path) {
        if arguments.tcp.is_some() {
            return refuse("--tcp", "programs, and this is none");
        }
        let options = MotionOptions {
            of_actual: arguments.of == OfArgument::Actual,
            stretch: arguments.stretch.map(|number| number as usize),
            topic: arguments.topic.clone(),
        };
        return read_motion(path, &options);
    }
    for (is_given, flag) in [
        (arguments.of == OfArgument::Actual, "--of"),
        (arguments.stretch.is_some(), "--stretch"),
        (arguments.topic.is_some(), "--topic"),
    ] {
        if is_given {
            return refuse(flag, "logs, and this is a program");
        }
    }
    let installed = match arguments.tcp {
        None => InstalledTcp::Unknown,
        Some(TcpArgument::Flange) => InstalledTcp::Flange,
        Some(TcpArgument::GuideExit) => InstalledTcp::GuideExit,
    };
    read_program(resolved, path, installed)
}

/// Judges a motion from a file.
pub(crate) fn judge(arguments: &JudgeArguments) -> Result<ExitStatus, Failure> {
    if arguments.wide {
        print_wide();
    }
    let resolved = load(&arguments.scenario, &overrides(&arguments.robot)?)?;
    let motion = motion(&resolved, arguments)?;
    let folder = arguments.out.join(&resolved.scenario.name);
    let _taken = ResultsFolder::take(&folder)?;
    if let Some(path) = &arguments.junit {
        probe_file(path, "--junit")?;
    }
    let cancel = watch_interrupts()?;
    let options = RunOptions {
        engines: arguments.engine.as_ref().map(EngineArgument::names),
        jobs: threads(arguments.jobs),
        referee: arguments.referee,
        ..RunOptions::default()
    };
    let asked = JudgeOptions {
        goal: arguments.goal.clone(),
        between: arguments.between.map(|between| match between {
            BetweenArgument::Quintics => Between::Quintics,
            BetweenArgument::Cubics => Between::Cubics,
            BetweenArgument::Lines => Between::Lines,
        }),
        any_start: arguments.start == StartArgument::AsIs,
        beside: arguments.against == AgainstArgument::Plan,
    };
    let progress = TerminalProgress::new(arguments.quiet);
    let done = judge_motion(&resolved, &motion, &asked, &options, &cancel, &progress);
    progress.finish();
    let done = done.map_err(|error| match error {
        JudgeError::Refused(finding) => Failure::from(*finding),
        JudgeError::Run(error) => anyhow::Error::from(error).into(),
    })?;
    let outputs = Outputs {
        rtde: false,
        mcap: false,
        pictures: arguments.pictures.are_wanted(arguments.quiet),
        page: !arguments.no_page,
        text: Printed::of(arguments.json, arguments.wide),
        quiet: arguments.quiet,
    };
    let (status, report) = put(
        &done.resolved,
        &done.run,
        options.jobs,
        &folder,
        outputs,
        &cancel,
        &progress,
    )?;
    if arguments.json {
        print_json(&report)?;
    }
    tell_pipeline(&[&report], arguments.junit.as_deref())?;
    Ok(status)
}
