//! `needlebench robot`.

use std::path::PathBuf;

use clap::Args;
use needlebench_bench::robot::{RobotOptions, TIME_LIMIT_S, Until, judge_program};
use needlebench_patient::ct::{LastScan, scanned};

use super::judge::{AgainstArgument, TcpArgument};
use super::results_folder::{ResultsFolder, probe_file};
use super::run::{Outputs, put, tell_pipeline};
use super::{load, overrides, print_json, print_text};
use crate::arguments::{RobotArguments, RunningArguments};
use crate::exit::ExitStatus;
use crate::failure::Failure;
use crate::interrupts::watch_interrupts;
use crate::output::{complain, print_wide};
use crate::progress::TerminalProgress;

pub(crate) const ROBOT_HELP: &str = "\
The program runs cycle by cycle on a virtual controller, from the scenario's start posture on, while the arm in the first \
engine follows. It reads that arm's measured joints, threads and inverse kinematics work, popups are answered at once. \
Nothing is connected: no clock but the simulated one, no network, no real arm. Sockets do not open, inputs are zero, \
forces read zero.

The set-points of all cycles are then judged as `judge` judges a motion: certified clearances, every engine, the joints' \
limits, the needle's tip, the criteria. A program that stands at no goal is judged by the nearest one. Besides, the \
criterion program_end fails with line and column where a runtime exception or a protective stop ends the program; where \
it has not ended after --time-limit, it is not evaluated, and the verdict is incomplete at best.

Tool and payload of the arm are the scenario's. What the program sets is what its controller believes: differences are \
notes of the report. Events (messages, outputs, contacts, stops, reduced speeds) are in the report and in events.csv.

Results in OUT/NAME of the scenario, as of a run.

Example: needlebench robot scenarios/robot/biopsy.toml --script scenarios/robot/biopsy.script
Example: needlebench robot cell.toml --script my.script --until hold --engine rapier --junit robot.xml";

#[derive(Debug, Args)]
pub(crate) struct RobotCommandArguments {
    /// Scenario with the goals.
    #[arg(value_name = "SCENARIO")]
    pub scenario: PathBuf,
    /// Program in URScript.
    #[arg(long, value_name = "FILE")]
    pub script: PathBuf,
    /// When the run ends: with the program, once the arm has held at a goal, or after a simulated time, s.
    #[arg(long, value_name = "program|hold|SECONDS", default_value = "program", value_parser = until)]
    pub until: Until,
    /// Longest simulated time of a program, s.
    #[arg(long, value_name = "SECONDS", default_value_t = TIME_LIMIT_S, value_parser = seconds)]
    pub time_limit: f64,
    /// Goal that the program leads to [default: those at which the arm stands, else the nearest].
    #[arg(long, value_name = "NAME")]
    pub goal: Option<String>,
    /// What the motion is compared with.
    #[arg(long, value_enum, value_name = "WHAT", default_value = "plan")]
    pub against: AgainstArgument,
    /// TCP of the controller's installation, for a program that sets none before it needs one.
    #[arg(long, value_enum, value_name = "WHERE")]
    pub tcp: Option<TcpArgument>,
    #[command(flatten)]
    pub running: RunningArguments,
    #[command(flatten)]
    pub robot: RobotArguments,
}

/// Said before anything else.
const SIMULATED: &str = "simulation: nothing real moves, no robot is connected";

/// Runs a program on the virtual controller, and judges what it did.
pub(crate) fn robot(arguments: &RobotCommandArguments) -> Result<ExitStatus, Failure> {
    let running = &arguments.running;
    if running.wide {
        print_wide();
    }
    if running.json {
        complain(SIMULATED);
    } else {
        print_text(SIMULATED)?;
    }
    let overrides = overrides(&arguments.robot)?;
    let resolved = load(&arguments.scenario, &overrides)?;
    let resolved = scanned(resolved, &overrides, &mut LastScan::default())?;
    let folder = running.out.join(&resolved.scenario.name);
    let _taken = ResultsFolder::take(&folder)?;
    if let Some(path) = &running.junit {
        probe_file(path, "--junit")?;
    }
    let cancel = watch_interrupts()?;
    let options = running.options();
    let asked = RobotOptions {
        until: arguments.until,
        time_limit_s: arguments.time_limit,
        installed: TcpArgument::installed(arguments.tcp),
        goal: arguments.goal.clone(),
        beside: arguments.against == AgainstArgument::Plan,
    };
    let progress = TerminalProgress::new(running.quiet);
    let script = &arguments.script;
    let done = judge_program(&resolved, script, &asked, &options, &cancel, &progress);
    progress.finish();
    let done = done?;
    let (status, report) = put(
        &done.resolved,
        &done.run,
        options.jobs,
        &folder,
        Outputs::of(running),
        &cancel,
        &progress,
    )?;
    if running.json {
        print_json(&report)?;
    }
    tell_pipeline(&[&report], running.junit.as_deref())?;
    Ok(status)
}

fn until(text: &str) -> Result<Until, String> {
    match text {
        "program" => Ok(Until::Program),
        "hold" => Ok(Until::Hold),
        _ => seconds(text)
            .map(Until::Seconds)
            .map_err(|_| "`program`, `hold` or a time in s".to_owned()),
    }
}

/// Simulated time of a run, s.
fn seconds(text: &str) -> Result<f64, String> {
    const MOST_S: f64 = 1800.0;
    let time_s: f64 = text.parse().map_err(|_| "a time in s".to_owned())?;
    if time_s > 0.0 && time_s <= MOST_S {
        Ok(time_s)
    } else {
        Err(format!("above 0 and at most {MOST_S}, in s"))
    }
}
