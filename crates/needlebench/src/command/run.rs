//! `needlebench run`.

use crate::arguments::{Record, RobotArguments, RunningArguments, TableArguments, leave};
use crate::output::{complain, print_wide, shown};
use clap::Args;
use std::fs::OpenOptions;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use anyhow::{Context, Result};
use needlebench_bench::accuracy::{accuracy_of_run, check_run};
use needlebench_bench::{RunOptions, Runnable, ScenarioRun};
use needlebench_engine::ENGINES;
use needlebench_evaluation::report::Report;
use needlebench_input::Finding;
use needlebench_parallel::Control;
use needlebench_patient::Stop;
use needlebench_patient::ct::{BuildFiles, imaged};
use needlebench_report::files::{Folder, RunFiles, write_run};
use needlebench_report::{junit, markdown, report_screen, report_text, write_atomically};
use needlebench_scenario::{Overrides, ResolvedScenario};
use serde::Serialize;

use super::results_folder::{ResultsFolder, prepare_folder, probe_file};
use super::{load_runnable, overrides, print_json, print_text};
use crate::exit::ExitStatus;
use crate::failure::Failure;
use crate::interrupts::watch_interrupts;
use crate::progress::TerminalProgress;

#[derive(Debug, Args)]
pub(crate) struct RunArguments {
    /// Scenario files.
    #[arg(required = true, value_name = "SCENARIO")]
    pub scenarios: Vec<PathBuf>,
    #[command(flatten)]
    pub running: RunningArguments,
    #[command(flatten)]
    pub table: TableArguments,
    #[command(flatten)]
    pub robot: RobotArguments,
}

#[derive(Serialize)]
struct SeveralReports<'a> {
    schema_version: u32,
    results: &'a [Report],
}

/// Runs scenarios, writes and prints their results.
pub(crate) fn run(arguments: &RunArguments) -> Result<ExitStatus, Failure> {
    if arguments.running.wide {
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
    if let Some(path) = &arguments.running.junit {
        probe_file(path, "--junit")?;
    }
    let cancel = watch_interrupts()?;
    let options = arguments.running.options();

    let mut status = ExitStatus::Success;
    let mut reports = Vec::new();
    let outputs = Outputs::of(&arguments.running);
    for (scenario, folder) in scenarios.iter().zip(&folders) {
        let scan = Scan {
            folder,
            overrides: &overrides,
            jobs: options.jobs,
            quiet: outputs.quiet,
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
        // An interrupted run is not a sample of anything.
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
    if arguments.running.json {
        match reports.as_slice() {
            [report] if arguments.scenarios.len() == 1 => print_json(report)?,
            results => print_json(&SeveralReports {
                schema_version: 1,
                results,
            })?,
        }
    }
    let all: Vec<&Report> = reports.iter().collect();
    tell_pipeline(&all, arguments.running.junit.as_deref())?;
    Ok(status)
}

/// Writes JUnit XML of reports, where it is asked for, and their summaries to the page of a step.
pub(super) fn tell_pipeline(reports: &[&Report], junit_file: Option<&Path>) -> Result<()> {
    if let Some(path) = junit_file {
        let junit = junit(reports).map_err(anyhow::Error::from)?;
        write_atomically(path, junit.as_bytes())
            .with_context(|| format!("cannot write {}", path.display()))?;
    }
    append_to_step_summary(reports)
}

/// How a scan is computed.
struct Scan<'s> {
    /// The scenario's results folder.
    folder: &'s Path,
    overrides: &'s Overrides,
    jobs: usize,
    quiet: bool,
}

/// The scenario built from a scenario's scan; none if it has no section `[ct]`.
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
        ..BuildFiles::default()
    };
    let made = imaged(
        scenario.scenario(),
        &folder,
        scan.overrides,
        &files,
        None,
        &control,
    );
    progress.finish();
    let checked = made.and_then(|made| {
        let runnable = Runnable::checked(made.scenario);
        runnable.map_err(|finding| Stop::Refused(vec![finding]))
    });
    checked.map(Some).map_err(|stop| {
        Failure::of_stop(stop, "interrupted while the scan was computed: no results")
    })
}

/// What a run writes besides its report.
#[derive(Debug, Clone, Copy)]
#[expect(clippy::struct_excessive_bools, reason = "flags of a command line")]
pub(super) struct Outputs {
    /// RTDE logs, whatever the scenario's own setting.
    pub rtde: bool,
    /// Recordings as ROS 2 messages.
    pub mcap: bool,
    /// Images, if the scenario has any.
    pub pictures: bool,
    /// The page.
    pub page: bool,
    /// What is printed to standard output.
    pub text: Printed,
    /// No progress.
    pub quiet: bool,
}

impl Outputs {
    /// Those that the command line asks for.
    pub fn of(arguments: &RunningArguments) -> Self {
        Self {
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
        }
    }
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

/// Runs one scenario and writes its results into an existing folder.
pub(super) fn run_into(
    runnable: &Runnable,
    options: &RunOptions,
    folder: &Path,
    outputs: Outputs,
    cancel: &AtomicBool,
) -> Result<(ExitStatus, Report)> {
    let progress = TerminalProgress::new(outputs.quiet);
    // A robot that is not a UR arm was rejected while the scenario was read.
    let finished = needlebench_bench::run(runnable, options, cancel, &progress)?;
    put(
        runnable.scenario(),
        &finished,
        options.jobs,
        folder,
        outputs,
        cancel,
        &progress,
    )
}

/// Writes the results of a run into an existing folder, and prints them.
pub(super) fn put(
    resolved: &ResolvedScenario,
    finished: &ScenarioRun,
    jobs: usize,
    folder: &Path,
    outputs: Outputs,
    cancel: &AtomicBool,
    progress: &TerminalProgress,
) -> Result<(ExitStatus, Report)> {
    let files = RunFiles {
        rtde: outputs.rtde,
        mcap: outputs.mcap,
        pictures: outputs.pictures,
        page: outputs.page,
        jobs,
        cancel,
        engines: ENGINES,
    };
    let written = write_run(resolved, finished, Folder(folder), files, progress);
    progress.finish();
    let report =
        written.with_context(|| format!("cannot write the results to {}", folder.display()))?;
    match outputs.text {
        Printed::Nothing => {}
        Printed::Screen => {
            let text = report_screen(&report, ENGINES);
            let results = if outputs.page {
                shown(&folder.join("report.html"))
            } else {
                shown(folder)
            };
            print_text(&format!("{text}results: {results}"))?;
        }
        Printed::All => {
            let name = &resolved.scenario.name;
            let text = report_text(&report, ENGINES);
            print_text(&format!("{name}\n{text}results: {}", shown(folder)))?;
        }
    }
    if finished.interrupted {
        complain(&format!(
            "interrupted: completed results are in {}",
            shown(folder)
        ));
    }
    Ok((outcome(finished), report))
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
                format!("{} has the same name, `{name}`", earlier.source.file),
            )
            .key("name")
            .hint("the results folder has this name: give each scenario a unique name"),
        )
    })
}

/// Locks each scenario's results folder before a long run.
fn take_folders(
    arguments: &RunArguments,
    scenarios: &[Runnable],
) -> Result<(Vec<PathBuf>, Vec<ResultsFolder>), Failure> {
    let folders: Vec<PathBuf> = scenarios
        .iter()
        .map(|runnable| {
            arguments
                .running
                .out
                .join(&runnable.scenario().scenario.name)
        })
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
