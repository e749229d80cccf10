//! `needlebench compare`.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use needlebench_cell::{Finding, Overrides, ThresholdsFile};
use needlebench_evaluation::compare::{CompareOptions, compare as compare_reports};
use needlebench_evaluation::{StoredReport, Threshold};

use super::compare_studies::compare_if_studies;
use super::run::probe_file;
use super::{load_checked, print_json, print_text};
use crate::atomic::write_atomically;
use crate::cli::{CompareArguments, Pair};
use crate::exit::ExitStatus;
use crate::output::comparison::{comparison_junit, comparison_markdown, comparison_text};
use crate::output::findings::print_findings;
use crate::pipeline::{self, RunOptions};
use crate::progress::Progress;

/// Why there is nothing to compare.
enum Refused {
    /// The input is wrong.
    Input(Vec<Finding>),
    /// An engine failed while a scenario was run.
    Engine(String),
}

impl From<Finding> for Refused {
    fn from(finding: Finding) -> Self {
        Self::Input(vec![finding])
    }
}

/// Compares two results.
pub(crate) fn compare(arguments: &CompareArguments) -> Result<ExitStatus> {
    if let Some(status) = compare_if_studies(arguments)? {
        return Ok(status);
    }
    match compared(arguments) {
        Ok((options, a, b)) => {
            let comparison = match compare_reports(&a, &b, &options) {
                Ok(comparison) => comparison,
                Err(error) => {
                    let finding = Finding::new(b.source(), error.to_string())
                        .key("--goal")
                        .hint("name goals that changed their name with --goal A=B");
                    print_findings(&[finding]);
                    return Ok(ExitStatus::BadInput);
                }
            };
            let write = |path: &Path, text: String| {
                write_atomically(path, text.as_bytes())
                    .with_context(|| format!("cannot write {}", path.display()))
            };
            if let Some(path) = &arguments.junit {
                write(path, comparison_junit(&comparison)?)?;
            }
            if let Some(path) = &arguments.markdown {
                write(path, comparison_markdown(&comparison))?;
            }
            if arguments.json {
                print_json(&comparison)?;
            } else {
                print_text(comparison_text(&comparison, arguments.all).trim_end())?;
            }
            Ok(if comparison.pass {
                ExitStatus::Success
            } else {
                ExitStatus::CriterionFailed
            })
        }
        Err(Refused::Input(findings)) => {
            print_findings(&findings);
            Ok(ExitStatus::BadInput)
        }
        Err(Refused::Engine(message)) => {
            anstream::eprintln!("error: {message}");
            Ok(ExitStatus::EnvironmentFailed)
        }
    }
}

/// What to compare, read or run. Everything that can be wrong on the command line comes first.
fn compared(
    arguments: &CompareArguments,
) -> Result<(CompareOptions, StoredReport, StoredReport), Refused> {
    let options = options(arguments)?;
    for (path, argument) in [
        (&arguments.junit, "--junit"),
        (&arguments.markdown, "--markdown"),
    ] {
        if let Some(path) = path {
            probe_file(path, argument)?;
        }
    }
    let (a, b) = (input(&arguments.a)?, input(&arguments.b)?);
    Ok((options, a.report(arguments)?, b.report(arguments)?))
}

fn options(arguments: &CompareArguments) -> Result<CompareOptions, Refused> {
    let mut options = CompareOptions {
        renamed_goals: arguments.goal.iter().map(|pair| pair.0.clone()).collect(),
        allow_status_change: arguments.allow_status_change,
        ..CompareOptions::default()
    };
    let mut findings = Vec::new();
    if let Some(path) = &arguments.thresholds {
        let file = ThresholdsFile::load(path)?;
        options.allow_status_change |= file.allow_status_change();
        for (metric, limit) in file.max_loss() {
            match Threshold::parse(metric, limit) {
                Ok(threshold) => options.thresholds.push(threshold),
                Err(error) => {
                    findings.push(file.finding(metric, error.to_string()).hint(error.hint()));
                }
            }
        }
    }
    for Pair((metric, limit)) in &arguments.max_loss {
        match Threshold::parse(metric, limit) {
            Ok(threshold) => {
                // The command line goes before the file; of several of one metric the last counts.
                let name = threshold.metric.name;
                options.thresholds.retain(|known| known.metric.name != name);
                options.thresholds.push(threshold);
            }
            Err(error) => findings.push(
                Finding::new(format!("{metric}={limit}"), error.to_string())
                    .key("--max-loss")
                    .hint(error.hint()),
            ),
        }
    }
    if findings.is_empty() {
        Ok(options)
    } else {
        Err(Refused::Input(findings))
    }
}

/// One side of the comparison, before anything long starts.
enum Input {
    /// A report that was stored.
    Stored(StoredReport),
    /// A scenario that has to be run first.
    Scenario(PathBuf, Box<needlebench_cell::ResolvedScenario>),
}

fn input(path: &Path) -> Result<Input, Refused> {
    let name = path.display().to_string();
    if path
        .extension()
        .is_some_and(|extension| extension == "toml")
    {
        let resolved = load_checked(path, &Overrides::default()).map_err(Refused::Input)?;
        return Ok(Input::Scenario(path.to_owned(), Box::new(resolved)));
    }
    let file = if path.is_dir() {
        path.join("report.json")
    } else {
        path.to_owned()
    };
    let text = std::fs::read_to_string(&file).map_err(|error| {
        let mut finding = Finding::new(
            file.display().to_string(),
            format!("the report cannot be read: {error}"),
        );
        finding.hint = Some(match results_below(path) {
            Some(below) => format!("`{name}` has the results of several scenarios: try {below}"),
            None => "give a report.json, a results folder, or a scenario".to_owned(),
        });
        Refused::from(finding)
    })?;
    let stored = StoredReport::parse(&file.display().to_string(), &text)?;
    Ok(Input::Stored(stored))
}

/// The first results folder in a folder, if it holds such.
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
    fn report(self, arguments: &CompareArguments) -> Result<StoredReport, Refused> {
        let (path, resolved) = match self {
            Self::Stored(stored) => return Ok(stored),
            Self::Scenario(path, resolved) => (path, resolved),
        };
        let name = path.display().to_string();
        let options = RunOptions {
            engines: Some(arguments.engine),
            jobs: std::thread::available_parallelism().map_or(1, std::num::NonZero::get),
            referee: false,
        };
        let progress = Progress::new(arguments.quiet);
        let cancel = std::sync::atomic::AtomicBool::new(false);
        let finished = pipeline::run(&resolved, &options, &cancel, &progress);
        progress.finish();
        let report = finished
            .map_err(|error| Finding::new(&name, error.to_string()))?
            .report;
        if let Some(failure) = report.engine_failures.first() {
            return Err(Refused::Engine(format!(
                "{name}: engine {} failed: {}",
                failure.engine, failure.message
            )));
        }
        Ok(StoredReport::of(name, &report))
    }
}
