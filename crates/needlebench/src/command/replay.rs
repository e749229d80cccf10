//! `needlebench replay`.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::{Context, Result};
use clap::{Args, ValueEnum};
use needlebench_bench::RunOptions;
use needlebench_bench::replay::{ReplayError, arm_files, named_by, replay as replay_run};
use needlebench_input::{FileKind, Finding, or_wrong_kind};
use needlebench_recorded::{
    AngleUnit, EffortMeaning, ReadOptions, RecordedRun, TimeUnit, arm_fits, read_log,
};
use needlebench_report::files::{CALIBRATION_FILE, Folder, write_replay};
use needlebench_report::table::replay::text;
use needlebench_robot::Arm;
use needlebench_scenario::scenario::ReplaySection;
use needlebench_scenario::{
    LogColumns, Overrides, ResolvedScenario, load_scenario, resolve_scenario,
};

use super::results_folder::ResultsFolder;
use super::{overrides, print_json, print_text};
use crate::arguments::{EngineArgument, EngineParser, PicturesArguments, RobotArguments};
use crate::clock::elapsed;
use crate::exit::ExitStatus;
use crate::failure::Failure;
use crate::output::{complain, shown};
use crate::progress::TerminalProgress;

pub(crate) const REPLAY_HELP: &str = "\
The log is a file of UR's RTDE recorder or of ur_rtde (timestamp, target_q_0 to _5, actual_q_0 ...; separated by \
commas, semicolons, tabs or blanks), an MCAP file with sensor_msgs/JointState, or any table described by --columns:

  time = { column = \"t_ms\", unit = \"ms\" }
  actual_q = { columns = [\"q1\", \"q2\", \"q3\", \"q4\", \"q5\", \"q6\"], unit = \"deg\" }
  # target_q, target_qd, target_qdd, target_moment, target_current, actual_qd, actual_current,
  # actual_torque, tcp_position, tcp_rotation, payload, payload_cog, robot_mode likewise

Units, clock, gaps, modes and the arm are checked; errors and irregularities are reported, and nothing is guessed. \
Results in OUT/NAME: replay.json, replay.txt, replay.html, junit.xml, a chart, the trajectory of each engine, and \
arm.toml with calibration.yaml for scenarios: [robot] arm = \"OUT/NAME/arm.toml\".

Example: needlebench replay models/ur3e/recorded/ur3e_rad_20211005.csv
Example: needlebench replay log.csv --arm ur3e --max-tracking 0.5 --engine rapier
Example: needlebench replay run.mcap --arm ur5e --effort current";

#[derive(Debug, Args)]
pub(crate) struct ReplayArguments {
    /// Log of the run: CSV or MCAP.
    #[arg(value_name = "LOG")]
    pub log: PathBuf,
    /// Scenario with cell, arm, engine settings and [replay] [default: the arm alone on its base].
    #[arg(long, value_name = "SCENARIO")]
    pub scenario: Option<PathBuf>,
    /// Description of the columns of the log, with their units.
    #[arg(long, value_name = "TOML")]
    pub columns: Option<PathBuf>,
    /// Meaning of `effort` in joint states; drivers of UR arms have used all three.
    #[arg(long, value_enum)]
    pub effort: Option<EffortArgument>,
    /// Unit of the angles.
    #[arg(long, value_enum, value_name = "UNIT")]
    pub angle_unit: Option<AngleArgument>,
    /// Unit of the clock.
    #[arg(long, value_enum, value_name = "UNIT")]
    pub time_unit: Option<TimeArgument>,
    /// Column with the clock.
    #[arg(long, value_name = "NAME", conflicts_with = "columns")]
    pub time_column: Option<String>,
    /// Rows per second, instead of the log's clock.
    #[arg(long, value_name = "HZ", value_parser = positive)]
    pub rate: Option<f64>,
    /// Topic of the joint states in an MCAP file.
    #[arg(long, value_name = "NAME")]
    pub topic: Option<String>,
    /// Physics engines [default: those of the scenario, or all default engines].
    #[arg(long, value_name = "ENGINE[,ENGINE]", value_parser = EngineParser)]
    pub engine: Option<EngineArgument>,
    /// Limit of the RMS residual of a joint's target_moment on held-out data, N m.
    #[arg(long, value_name = "NM", value_parser = not_negative)]
    pub max_moment_rms: Option<f64>,
    /// Limit of the distance between simulated and real tip, mm.
    #[arg(long, value_name = "MM", value_parser = not_negative)]
    pub max_tracking: Option<f64>,
    /// Limit of the RMS difference between simulated and measured current of a joint, A.
    #[arg(long, value_name = "A", value_parser = not_negative)]
    pub max_current_rms: Option<f64>,
    /// Limit of the RMS error of the calibration on held-out poses, mm.
    #[arg(long, value_name = "MM", value_parser = not_negative)]
    pub max_calibration: Option<f64>,
    /// Folder for results; the log has a subfolder of its name.
    #[arg(long, value_name = "DIR", default_value = "out")]
    pub out: PathBuf,
    /// Print one JSON document instead of the tables.
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub pictures: PicturesArguments,
    /// Do not write the page.
    #[arg(long)]
    pub no_page: bool,
    /// Do not show progress.
    #[arg(long)]
    pub quiet: bool,
    #[command(flatten)]
    pub robot: RobotArguments,
}

/// Meaning of `effort`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum EffortArgument {
    /// Motor currents, A.
    Current,
    /// Torques at the joints, N m.
    Torque,
    /// Torques at the joints, compensated for gravity of arm and load, N m.
    Compensated,
}

/// Unit of angles.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum AngleArgument {
    /// Radians.
    Rad,
    /// Degrees.
    Deg,
}

/// Unit of a clock.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum TimeArgument {
    /// Seconds.
    S,
    /// Milliseconds.
    Ms,
    /// Microseconds.
    Us,
    /// Nanoseconds.
    Ns,
}

fn positive(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(value) if value > 0.0 && f64::is_finite(value) => Ok(value),
        _ => Err("give a positive number".to_owned()),
    }
}

fn not_negative(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(value) if value >= 0.0 && f64::is_finite(value) => Ok(value),
        _ => Err("give a number that is not negative".to_owned()),
    }
}

/// Reads a log, identifies the arm from it, and replays it.
pub(crate) fn replay(arguments: &ReplayArguments) -> Result<ExitStatus, Failure> {
    let (run, resolved, found, folder) = prepared(arguments)?;
    replayed(arguments, run, &resolved, &found, &folder)
}

type Prepared = (RecordedRun, ResolvedScenario, String, PathBuf);

fn prepared(arguments: &ReplayArguments) -> Result<Prepared, Failure> {
    let options = ReadOptions {
        time: arguments.time_unit.map(|unit| match unit {
            TimeArgument::S => TimeUnit::Seconds,
            TimeArgument::Ms => TimeUnit::Milliseconds,
            TimeArgument::Us => TimeUnit::Microseconds,
            TimeArgument::Ns => TimeUnit::Nanoseconds,
        }),
        angle: arguments.angle_unit.map(|unit| match unit {
            AngleArgument::Rad => AngleUnit::Radians,
            AngleArgument::Deg => AngleUnit::Degrees,
        }),
        effort: arguments.effort.map(|meaning| match meaning {
            EffortArgument::Current => EffortMeaning::Current,
            EffortArgument::Torque => EffortMeaning::Torque,
            EffortArgument::Compensated => EffortMeaning::Compensated,
        }),
        rate_hz: arguments.rate,
        time_column: arguments.time_column.clone(),
        topic: arguments.topic.clone(),
        columns: arguments
            .columns
            .as_deref()
            .map(LogColumns::load)
            .transpose()?,
    };
    let overrides = overrides(&arguments.robot)?;
    // Errors of the scenario are found before a long log is read.
    let of_scenario = match &arguments.scenario {
        Some(path) => Some(load_scenario(path, &overrides)?),
        None => None,
    };
    let name = file_name(&arguments.log);
    let folder = arguments.out.join(name);
    let _taken = ResultsFolder::take(&folder)?;
    let run = read_log(&arguments.log, &options).map_err(|findings| {
        match FileKind::of(&arguments.log) {
            Some(FileKind::Mcap) => findings,
            _ => or_wrong_kind(&arguments.log, FileKind::Table, findings),
        }
    })?;
    let (resolved, found) = match of_scenario {
        Some(resolved) => (resolved, "the scenario's".to_owned()),
        None => arm_alone(&run, overrides)?,
    };
    Ok((run, resolved, found, folder))
}

/// Name of the results' folder.
fn file_name(log: &Path) -> String {
    log.file_stem().map_or_else(
        || "log".to_owned(),
        |stem| stem.to_string_lossy().into_owned(),
    )
}

/// The arm that the command line names, or the log itself, on its base and with nothing around it.
fn arm_alone(
    run: &RecordedRun,
    mut overrides: Overrides,
) -> Result<(ResolvedScenario, String), Vec<Finding>> {
    let mut found = "as the command line names it";
    if overrides.arm.is_none() && overrides.robot_urdf.is_none() {
        let refuse = |message: String, hint: String| {
            Err(vec![
                Finding::new(&run.source.file, message)
                    .key("--arm")
                    .hint(hint),
            ])
        };
        let names: Vec<&str> = Arm::shipped_names().collect();
        let Some(name) = named_by(run) else {
            if let Some(best) = arm_fits(run).first() {
                let message = format!(
                    "the log's poses match no known arm: the best fit, {}, has an error of {:.1} mm RMS",
                    best.arm,
                    best.rms_m * 1e3
                );
                let hint = "check the units of angles and positions (--angle-unit), and whether the tool centre \
                            point was constant";
                return refuse(message, hint.to_owned());
            }
            return refuse(
                "the log does not identify its arm".to_owned(),
                format!(
                    "name it: --arm {}; a log with actual_TCP_pose identifies it",
                    names.join(", --arm ")
                ),
            );
        };
        let key = name.to_lowercase();
        if !names.contains(&key.as_str()) {
            return refuse(
                format!("the log is of a {name}, for which there are no bundled data"),
                "give its URDF: --robot URDF, or its data: --arm my_arm.toml".to_owned(),
            );
        }
        found = "by the poses in the log";
        overrides.arm = Some(key);
    }
    // A placeholder: a replay has no goal.
    let text = "name = \"replay\"\n[[goals]]\nname = \"none\"\ninsertion_length_mm = 100\n\
                [goals.flange_pose]\nposition_mm = [200, -300, 200]\nrotation_vector_rad = [0, 3.14, 0]\n\
                [robot]\nbase_position_mm = [0, 0, 1000]\nbase_rpy_deg = [0, 0, 0]\n";
    let mut resolved = resolve_scenario("the arm alone", text, Path::new(""), &overrides)?;
    // Only notes about the arm apply.
    resolved
        .notes
        .retain(|note| note.starts_with("arm data") || note.contains("servo of"));
    Ok((resolved, found.to_owned()))
}

fn replayed(
    arguments: &ReplayArguments,
    run: RecordedRun,
    resolved: &ResolvedScenario,
    found: &str,
    folder: &Path,
) -> Result<ExitStatus, Failure> {
    let cancel = Arc::new(AtomicBool::new(false));
    let requested = Arc::clone(&cancel);
    // Without a handler an interruption still ends the program.
    let _ = ctrlc::set_handler(move || requested.store(true, Ordering::Relaxed));
    let progress = TerminalProgress::new(arguments.quiet);
    let options = RunOptions {
        engines: arguments.engine.as_ref().map(EngineArgument::names),
        ..RunOptions::default()
    };
    let engines = options
        .chosen_engines(resolved)
        .map_err(anyhow::Error::from)?;
    let own = &resolved.scenario.replay;
    let criteria = ReplaySection {
        max_moment_rms_nm: arguments.max_moment_rms.or(own.max_moment_rms_nm),
        max_tracking_mm: arguments.max_tracking.or(own.max_tracking_mm),
        max_current_rms_a: arguments.max_current_rms.or(own.max_current_rms_a),
        max_calibration_mm: arguments.max_calibration.or(own.max_calibration_mm),
    };
    let control = needlebench_parallel::Control {
        threads: 1,
        cancel: &cancel,
        progress: &progress,
    };
    let done = replay_run(run, resolved, found, &criteria, &engines, &control);
    progress.finish();
    let done = done.map_err(|ReplayError::Arm(finding)| *finding)?;
    let arm = arm_files(&done.report, &resolved.robot_description, CALIBRATION_FILE);
    write_replay(
        &done,
        arm.as_ref(),
        Folder(folder),
        [
            arguments.pictures.are_wanted(arguments.quiet),
            !arguments.no_page,
        ],
        elapsed(),
    )
    .with_context(|| format!("cannot write the results to {}", shown(folder)))?;
    if arguments.json {
        print_json(&done.report)?;
    } else {
        print_text(&format!(
            "{}\nresults: {}",
            text(&done.report),
            shown(folder)
        ))?;
    }
    if done.interrupted {
        complain("interrupted: completed results are written");
        return Ok(ExitStatus::Interrupted);
    }
    let failed = !done.report.engine_failures.is_empty();
    Ok(match ExitStatus::of(done.report.verdict) {
        ExitStatus::CriterionFailed
            if failed && done.report.criteria.iter().all(|each| each.pass) =>
        {
            ExitStatus::EnvironmentFailed
        }
        status => status,
    })
}
