//! `needlebench run`.

use crate::arguments::{
    EngineArgument, EngineParser, PicturesArguments, RobotArguments, TableArguments, leave,
};
use crate::output::{complain, print_wide, shown};
use clap::{Args, ValueEnum};
use std::fs::OpenOptions;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use anyhow::{Context, Result};
use needlebench_cell::{Finding, Overrides};
use needlebench_engine::ENGINES;
use needlebench_evaluation::report::Report;
use serde::Serialize;

use super::results_folder::{ResultsFolder, prepare_folder, probe_file};
use super::{load_runnable, overrides, print_json, print_text};
use crate::exit::ExitStatus;
use crate::failure::Failure;
use crate::interrupts::{threads, watch_interrupts};
use crate::progress::TerminalProgress;
use needlebench_bench::Stop;
use needlebench_bench::accuracy::{accuracy_of_run, check_run};
use needlebench_bench::ct::{BuildFiles, imaged};
use needlebench_bench::{Control, RunOptions, Runnable, ScenarioRun};
use needlebench_report::files::{Folder, RunFiles, write_run};
use needlebench_report::{junit, markdown, report_screen, report_text, write_atomically};

#[derive(Debug, Args)]
#[expect(clippy::struct_excessive_bools, reason = "flags of a command line")]
pub(crate) struct RunArguments {
    /// Scenario files.
    #[arg(required = true, value_name = "SCENARIO")]
    pub scenarios: Vec<PathBuf>,
    /// Engines, instead of the scenario's own choice.
    #[arg(long, value_name = "ENGINE[,ENGINE]", value_parser = EngineParser)]
    pub engine: Option<EngineArgument>,
    /// Hold every simulated motion against the referee, our own dynamics integrated to rounding, at
    /// the scenario's time step, its half and its quarter; three to ten times as long.
    #[arg(long)]
    pub referee: bool,
    /// Folder for results; each scenario gets a folder of its name in it.
    #[arg(long, value_name = "DIR", default_value = "out")]
    pub out: PathBuf,
    /// Print the report as one JSON document instead of the table.
    #[arg(long)]
    pub json: bool,
    /// Write JUnit XML of all scenarios to this file besides the one in the results folder.
    #[arg(long, value_name = "FILE")]
    pub junit: Option<PathBuf>,
    /// Threads; the number of cores if left out. Results do not depend on it.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=256))]
    pub jobs: Option<u16>,
    /// Write a log of each motion by the names of UR's real-time data exchange too, as its recorder
    /// would write it of the real arm.
    #[arg(long)]
    pub rtde: bool,
    /// Write each recorded motion in another format too, beside its CSV.
    #[arg(long, value_name = "FORMAT", value_enum)]
    pub record: Option<Record>,
    #[command(flatten)]
    pub pictures: PicturesArguments,
    /// Write no report page.
    #[arg(long)]
    pub no_page: bool,
    /// Show no progress.
    #[arg(long)]
    pub quiet: bool,
    /// Print all tables, as wide as they are, instead of one screen.
    #[arg(long, conflicts_with = "json")]
    pub wide: bool,
    #[command(flatten)]
    pub table: TableArguments,
    #[command(flatten)]
    pub robot: RobotArguments,
}

/// Format of recordings.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Record {
    /// Messages of ROS 2 in an MCAP file for each goal, configuration and engine.
    Mcap,
}

#[derive(Serialize)]
struct SeveralReports<'a> {
    schema_version: u32,
    results: &'a [Report],
}

/// Runs scenarios, writes their results and prints them.
pub(crate) fn run(arguments: &RunArguments) -> Result<ExitStatus, Failure> {
    if arguments.wide {
        print_wide();
    }
    let overrides = overrides(&arguments.robot)?;
    // All inputs are read before anything long starts.
    let mut scenarios = Vec::new();
    let mut wrong = Vec::new();
    for path in &arguments.scenarios {
        match load_runnable(path, &overrides) {
            Ok(scenario) => scenarios.push(scenario),
            Err(findings) => wrong.extend(findings),
        }
    }
    if !wrong.is_empty() {
        return Err(wrong.into());
    }
    if let Some(finding) = repeated_name(&scenarios) {
        return Err(finding.into());
    }
    let table = arguments.table.request();
    if let Some(request) = &table {
        let all = scenarios.iter();
        let wrong = all.filter_map(|each| check_run(request, each.scenario()).err());
        let wrong: Vec<Finding> = wrong.collect();
        if !wrong.is_empty() {
            return Err(wrong.into());
        }
    }
    let (folders, _taken) = take_folders(arguments, &scenarios)?;
    if let Some(path) = &arguments.junit {
        probe_file(path, "--junit")?;
    }
    let cancel = watch_interrupts()?;
    let jobs = threads(arguments.jobs);
    let options = RunOptions {
        engines: arguments.engine.as_ref().map(EngineArgument::names),
        jobs,
        referee: arguments.referee,
        ..RunOptions::default()
    };

    let mut status = ExitStatus::Success;
    let mut reports = Vec::new();
    let outputs = Outputs {
        rtde: arguments.rtde,
        mcap: arguments.record == Some(Record::Mcap),
        pictures: arguments.pictures.are_wanted(arguments.quiet),
        page: !arguments.no_page,
        text: match (arguments.json, arguments.wide) {
            (true, _) => Printed::Nothing,
            (false, false) => Printed::Screen,
            (false, true) => Printed::All,
        },
        quiet: arguments.quiet,
    };
    for (scenario, folder) in scenarios.iter().zip(&folders) {
        let scan = Scan {
            folder,
            overrides: &overrides,
            jobs,
            quiet: arguments.quiet,
        };
        let scanned = match scanned(scenario, &scan, &cancel) {
            Ok(scanned) => scanned,
            Err(failure) => {
                let outcome = failure.tell();
                status = status.max(outcome);
                if outcome == ExitStatus::Interrupted {
                    break;
                }
                continue;
            }
        };
        let runnable = scanned.as_ref().unwrap_or(scenario);
        let (outcome, report) = run_into(runnable, &options, folder, outputs, &cancel)?;
        status = status.max(outcome);
        // What was interrupted is no sample of anything.
        if let Some(request) = table
            .as_ref()
            .filter(|_| outcome != ExitStatus::Interrupted)
        {
            let table = accuracy_of_run(&report, runnable.scenario(), request);
            leave(&table, folder, outputs.text != Printed::Nothing)?;
        }
        reports.push(report);
        if outcome == ExitStatus::Interrupted {
            break;
        }
    }
    if arguments.json {
        match reports.as_slice() {
            [report] if arguments.scenarios.len() == 1 => print_json(report)?,
            results => print_json(&SeveralReports {
                schema_version: 1,
                results,
            })?,
        }
    }
    let all: Vec<&Report> = reports.iter().collect();
    if let Some(path) = &arguments.junit {
        let junit = junit(&all).map_err(anyhow::Error::from)?;
        write_atomically(path, junit.as_bytes())
            .with_context(|| format!("cannot write {}", path.display()))?;
    }
    append_to_step_summary(&all)?;
    Ok(status)
}

/// How a scan is made.
struct Scan<'s> {
    /// The scenario's results folder.
    folder: &'s Path,
    overrides: &'s Overrides,
    jobs: usize,
    quiet: bool,
}

/// The scenario of what is seen in the scan that a scenario begins with; none if it begins with none.
fn scanned(
    scenario: &Runnable,
    scan: &Scan<'_>,
    cancel: &AtomicBool,
) -> Result<Option<Runnable>, Failure> {
    if scenario.scenario().scenario.ct.is_none() {
        return Ok(None);
    }
    let folder = scan.folder.join("ct");
    prepare_folder(&folder)?;
    let progress = TerminalProgress::new(scan.quiet);
    let control = Control {
        threads: scan.jobs,
        cancel,
        progress: &progress,
    };
    let files = BuildFiles {
        labels: true,
        volume: false,
    };
    let made = imaged(
        scenario.scenario(),
        &folder,
        scan.overrides,
        files,
        None,
        &control,
    );
    progress.finish();
    let checked = made.and_then(|made| {
        let runnable = Runnable::checked(made.scenario);
        runnable.map_err(|finding| Stop::Refused(vec![finding]))
    });
    checked.map(Some).map_err(|stop| {
        Failure::of_stop(
            stop,
            "interrupted while the scan was made: there are no results",
        )
    })
}

/// What a run leaves besides its report.
#[derive(Debug, Clone, Copy)]
#[expect(clippy::struct_excessive_bools, reason = "flags of a command line")]
pub(super) struct Outputs {
    /// Logs as a controller writes them, whatever the scenario wants.
    pub rtde: bool,
    /// Recordings as messages of ROS 2.
    pub mcap: bool,
    /// Pictures, if the scenario wants any.
    pub pictures: bool,
    /// The page.
    pub page: bool,
    /// What is on standard output.
    pub text: Printed,
    /// No progress.
    pub quiet: bool,
}

/// What a run prints.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Printed {
    /// Nothing: its JSON document is printed elsewhere.
    Nothing,
    /// One screen.
    Screen,
    /// All tables.
    All,
}

/// Runs one scenario and writes its results into a folder that is there.
pub(super) fn run_into(
    runnable: &Runnable,
    options: &RunOptions,
    folder: &Path,
    outputs: Outputs,
    cancel: &AtomicBool,
) -> Result<(ExitStatus, Report)> {
    let progress = TerminalProgress::new(outputs.quiet);
    // A robot that is not a UR arm was refused while the scenario was read.
    let mut finished = needlebench_bench::run(runnable, options, cancel, &progress)?;
    let resolved = runnable.scenario();
    let files = RunFiles {
        rtde: outputs.rtde,
        mcap: outputs.mcap,
        pictures: outputs.pictures,
        page: outputs.page,
        jobs: options.jobs,
        cancel,
        engines: ENGINES,
    };
    let written = write_run(resolved, &mut finished, Folder(folder), files, &progress);
    progress.finish();
    written.with_context(|| format!("cannot write the results to {}", folder.display()))?;
    match outputs.text {
        Printed::Nothing => {}
        Printed::Screen => {
            let text = report_screen(&finished.report, ENGINES);
            let page = if outputs.page {
                ", to look at: report.html"
            } else {
                ""
            };
            print_text(&format!("{text}results: {}{page}", shown(folder)))?;
        }
        Printed::All => {
            let name = &resolved.scenario.name;
            let text = report_text(&finished.report, ENGINES);
            print_text(&format!("{name}\n{text}results: {}", shown(folder)))?;
        }
    }
    if finished.interrupted {
        complain(&format!(
            "interrupted: what was finished until then is in {}",
            shown(folder)
        ));
    }
    Ok((outcome(&finished), finished.report))
}

fn outcome(finished: &ScenarioRun) -> ExitStatus {
    if finished.interrupted {
        ExitStatus::Interrupted
    } else if !finished.report.engine_failures.is_empty() {
        ExitStatus::EnvironmentFailed
    } else {
        ExitStatus::of(finished.report.verdict)
    }
}

fn repeated_name(scenarios: &[Runnable]) -> Option<Finding> {
    scenarios.iter().enumerate().find_map(|(index, each)| {
        let each = each.scenario();
        let name = &each.scenario.name;
        let mut others = scenarios[..index].iter().map(Runnable::scenario);
        let earlier = others.find(|other| other.scenario.name == *name)?;
        Some(
            Finding::new(
                &each.source.file,
                format!("`{name}` is the name of {} too", earlier.source.file),
            )
            .key("name")
            .hint("the name is that of the results folder: give each scenario its own"),
        )
    })
}

/// Takes each scenario's results folder before a long run.
fn take_folders(
    arguments: &RunArguments,
    scenarios: &[Runnable],
) -> Result<(Vec<PathBuf>, Vec<ResultsFolder>), Failure> {
    let folders: Vec<PathBuf> = scenarios
        .iter()
        .map(|runnable| arguments.out.join(&runnable.scenario().scenario.name))
        .collect();
    let taken = folders.iter().map(|folder| ResultsFolder::take(folder));
    let taken = taken.collect::<Result<_, _>>()?;
    Ok((folders, taken))
}

/// Adds the summaries to the page that GitHub Actions shows for a step.
fn append_to_step_summary(reports: &[&Report]) -> Result<()> {
    let Some(path) = std::env::var_os("GITHUB_STEP_SUMMARY") else {
        return Ok(());
    };
    let mut file = OpenOptions::new()
        .create(true)
        .append(true)
        .open(&path)
        .with_context(|| format!("cannot write {}", Path::new(&path).display()))?;
    for report in reports {
        writeln!(file, "{}", markdown(report, ENGINES))?;
    }
    Ok(())
}
