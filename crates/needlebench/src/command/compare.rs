//! `needlebench compare`.

mod case;
mod help;
mod studies;
mod thresholds;

pub(crate) use help::compare_help;

use crate::arguments::{EngineArgument, EngineParser};
use crate::output::print_wide;
use clap::Args;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use needlebench_engine::{ENGINES, engine_names};
use needlebench_evaluation::compare::{CompareOptions, compare as compare_reports};
use needlebench_evaluation::{Compared, StoredReport};
use needlebench_input::{FileKind, Finding, or_wrong_kind, read_data_text};
use needlebench_scenario::Overrides;

use super::results_folder::probe_file;
use super::{load_runnable, print_json, print_text};
use case::case_of_study;
use studies::{compare_if_studies, is_study};
use thresholds::thresholds;

use crate::clock::elapsed;
use crate::exit::ExitStatus;
use crate::failure::Failure;
use crate::progress::TerminalProgress;
use needlebench_bench::{RunOptions, Runnable};
use needlebench_report::table::comparison::{comparison_screen, comparison_text};
use needlebench_report::{comparison_junit, comparison_markdown, write_atomically};

#[derive(Debug, Args)]
#[expect(clippy::struct_excessive_bools, reason = "flags of a command line")]
pub(crate) struct CompareArguments {
    /// First result: a report.json, a results folder, or a scenario (run first); or a study's folder or
    /// results.parquet, with --case if the other is a run.
    #[arg(value_name = "A")]
    pub a: PathBuf,
    /// Second result, of the same kinds.
    #[arg(value_name = "B")]
    pub b: PathBuf,
    /// Physics engine for scenarios that are run first.
    #[arg(
        long,
        value_name = "ENGINE[,ENGINE]",
        value_parser = EngineParser,
        default_value = "rapier"
    )]
    pub engine: EngineArgument,
    /// Case of the study to compare with the run.
    #[arg(long, value_name = "ID")]
    pub case: Option<u64>,
    /// Goal that has another name in B; repeatable.
    #[arg(long, value_name = "A=B")]
    pub goal: Vec<Pair>,
    /// Largest permitted loss of a metric, with its unit, e.g. clearance=0.5mm or tip_error=5%; repeatable. `--help`
    /// lists the metrics. 0, with or without a unit, permits no loss, not even rounding.
    #[arg(long, value_name = "METRIC=VALUE")]
    pub max_loss: Vec<Pair>,
    /// TOML file with such losses under [max_loss]; command-line values take precedence.
    #[arg(long, value_name = "TOML")]
    pub thresholds: Option<PathBuf>,
    /// Do not fail if a configuration is no longer feasible.
    #[arg(long)]
    pub allow_status_change: bool,
    /// Do not fail if a goal, a configuration, a metric or cases of A are missing in B.
    #[arg(long)]
    pub allow_lost: bool,
    /// Print a row for each configuration and metric at full width instead of one screen.
    #[arg(long, conflicts_with = "json")]
    pub wide: bool,
    /// List unchanged values too; implies --wide.
    #[arg(long)]
    pub all: bool,
    /// Print one JSON document.
    #[arg(long)]
    pub json: bool,
    /// Write JUnit XML to this file.
    #[arg(long, value_name = "FILE")]
    pub junit: Option<PathBuf>,
    /// Write a Markdown summary to this file.
    #[arg(long, value_name = "FILE")]
    pub markdown: Option<PathBuf>,
    /// Do not show progress.
    #[arg(long)]
    pub quiet: bool,
}

/// Two texts with `=` between.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Pair(pub (String, String));

impl std::str::FromStr for Pair {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        match text.split_once('=') {
            Some((a, b)) if !a.trim().is_empty() && !b.trim().is_empty() => {
                Ok(Self((a.trim().to_owned(), b.trim().to_owned())))
            }
            _ => Err("expected NAME=VALUE".to_owned()),
        }
    }
}

impl CompareArguments {
    fn is_wide(&self) -> bool {
        self.wide || self.all
    }
}

/// Compares two results.
pub(crate) fn compare(arguments: &CompareArguments) -> Result<ExitStatus, Failure> {
    if arguments.is_wide() {
        print_wide();
    }
    if let Some(status) = compare_if_studies(arguments)? {
        return Ok(status);
    }
    let (options, a, b) = compared(arguments)?;
    let comparison = compare_reports(&a, &b, &options).map_err(|error| {
        Finding::new(b.source(), error.to_string())
            .key("--goal")
            .hint("match renamed goals with --goal A=B")
    })?;
    let write = |path: &Path, text: String| {
        write_atomically(path, text.as_bytes())
            .with_context(|| format!("cannot write {}", path.display()))
    };
    if let Some(path) = &arguments.junit {
        let junit = comparison_junit(&comparison, elapsed()).map_err(anyhow::Error::from)?;
        write(path, junit)?;
    }
    if let Some(path) = &arguments.markdown {
        write(path, comparison_markdown(&comparison))?;
    }
    if arguments.json {
        print_json(&comparison)?;
    } else {
        let text = if arguments.is_wide() {
            comparison_text(&comparison, arguments.all)
        } else {
            comparison_screen(&comparison)
        };
        print_text(text.trim_end())?;
    }
    Ok(ExitStatus::of(comparison.verdict))
}

/// Reads or runs what to compare. Errors of the command line are found first.
fn compared(
    arguments: &CompareArguments,
) -> Result<(CompareOptions, StoredReport, StoredReport), Failure> {
    let options = options(arguments)?;
    for (path, argument) in [
        (&arguments.junit, "--junit"),
        (&arguments.markdown, "--markdown"),
    ] {
        if let Some(path) = path {
            probe_file(path, argument)?;
        }
    }
    let [of_a, of_b] = [&arguments.a, &arguments.b].map(|path| is_study(path));
    if arguments.case.is_some() && !of_a && !of_b {
        return Err(Finding::new("--case", "neither A nor B is a study")
            .hint("--case selects the case of a study to compare with a run")
            .into());
    }
    let read = |path| input(path, arguments.case);
    let (a, b) = (read(&arguments.a)?, read(&arguments.b)?);
    let (mut a, mut b) = (a.report(arguments)?, b.report(arguments)?);
    if of_a {
        b.as_case(&a);
    }
    if of_b {
        a.as_case(&b);
    }
    Ok((options, a, b))
}

fn options(arguments: &CompareArguments) -> Result<CompareOptions, Vec<Finding>> {
    let given = thresholds(arguments, Compared::Runs)?;
    Ok(CompareOptions {
        renamed_goals: arguments.goal.iter().map(|pair| pair.0.clone()).collect(),
        thresholds: given.thresholds,
        allow_status_change: given.allow_status_change,
        allow_lost: given.allow_lost,
    })
}

/// One side of the comparison, before anything long starts.
enum Input {
    /// A report that was stored.
    Stored(StoredReport),
    /// A scenario to run first.
    Scenario(PathBuf, Box<Runnable>),
}

fn input(path: &Path, case: Option<u64>) -> Result<Input, Failure> {
    if is_study(path) {
        return Ok(Input::Stored(case_of_study(path, case)?));
    }
    let name = path.display().to_string();
    if path
        .extension()
        .is_some_and(|extension| extension == "toml")
    {
        let overrides = Overrides {
            engines: engine_names(ENGINES),
            ..Overrides::default()
        };
        let runnable = load_runnable(path, &overrides)?;
        return Ok(Input::Scenario(path.to_owned(), Box::new(runnable)));
    }
    let file = if path.is_dir() {
        path.join("report.json")
    } else {
        path.to_owned()
    };
    let text = read_data_text(&file).map_err(|error| {
        let mut finding = Finding::new(
            file.display().to_string(),
            format!("the report cannot be read: {error}"),
        );
        let hint = error.hint("give a report.json, a results folder, or a scenario");
        finding.hint = Some(results_below(path).map_or_else(
            || hint.to_owned(),
            |below| format!("`{name}` contains the results of several scenarios, e.g. {below}"),
        ));
        finding
    })?;
    let stored = StoredReport::parse(&file.display().to_string(), &text)
        .map_err(|finding| or_wrong_kind(&file, FileKind::Report, vec![finding]))?;
    Ok(Input::Stored(stored))
}

/// The first results folder in a folder, if it contains any.
fn results_below(folder: &Path) -> Option<String> {
    let entries = std::fs::read_dir(folder).ok()?;
    let mut found: Vec<PathBuf> = entries
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| path.join("report.json").is_file())
        .collect();
    found.sort();
    Some(found.first()?.display().to_string())
}

impl Input {
    fn report(self, arguments: &CompareArguments) -> Result<StoredReport, Failure> {
        let (path, runnable) = match self {
            Self::Stored(stored) => return Ok(stored),
            Self::Scenario(path, runnable) => (path, runnable),
        };
        let name = path.display().to_string();
        let options = RunOptions {
            engines: Some(arguments.engine.names()),
            jobs: std::thread::available_parallelism().map_or(1, std::num::NonZero::get),
            ..RunOptions::default()
        };
        let progress = TerminalProgress::new(arguments.quiet);
        let cancel = std::sync::atomic::AtomicBool::new(false);
        let finished = needlebench_bench::run(&runnable, &options, &cancel, &progress);
        progress.finish();
        let report = finished
            .map_err(|error| Finding::new(&name, error.to_string()))?
            .report;
        if let Some(failure) = report.engine_failures.first() {
            return Err(Failure::Environment(anyhow::anyhow!(
                "{name}: engine {} failed: {}",
                failure.engine,
                failure.message
            )));
        }
        Ok(StoredReport::of(name, &report))
    }
}
