//! `needlebench compare` of two studies.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use needlebench_cell::{Finding, ThresholdsFile};
use needlebench_study::compare::{
    ComparedStudy, StudyCompareOptions, StudyThreshold, compare_studies,
};
use needlebench_study::{MANIFEST_FILE, ParquetResults, RESULTS_FILE, ResultsError};

use super::run::probe_file;
use super::{print_json, print_text};
use crate::atomic::write_atomically;
use crate::cli::{CompareArguments, Pair};
use crate::exit::ExitStatus;
use crate::output::findings::print_findings;
use crate::output::study_comparison::{
    study_comparison_junit, study_comparison_markdown, study_comparison_text,
};

/// Whether a path is a study's folder, or its table.
fn is_study(path: &Path) -> bool {
    let is_table = path
        .extension()
        .is_some_and(|extension| extension == "parquet");
    is_table || path.join(RESULTS_FILE).is_file() || path.join(MANIFEST_FILE).is_file()
}

/// Compares two studies; none if neither is one.
pub(super) fn compare_if_studies(arguments: &CompareArguments) -> Result<Option<ExitStatus>> {
    let studies = [&arguments.a, &arguments.b].map(|path| is_study(path));
    if studies == [false, false] {
        return Ok(None);
    }
    let prepared = match prepare(arguments, studies) {
        Ok(prepared) => prepared,
        Err(findings) => {
            print_findings(&findings);
            return Ok(Some(ExitStatus::BadInput));
        }
    };
    let names = [&arguments.a, &arguments.b].map(|path| path.display().to_string());
    let side = |at: usize| ComparedStudy {
        source: &names[at],
        name: prepared.results[at].study_name(),
        study_id: prepared.results[at].study_id(),
        results: &prepared.results[at],
    };
    let comparison = match compare_studies(side(0), side(1), &prepared.options) {
        Ok(comparison) => comparison,
        Err(error) => {
            print_findings(&[finding(error)]);
            return Ok(Some(ExitStatus::BadInput));
        }
    };
    let write = |path: &Path, text: String| {
        write_atomically(path, text.as_bytes())
            .with_context(|| format!("cannot write {}", path.display()))
    };
    if let Some(path) = &arguments.junit {
        write(path, study_comparison_junit(&comparison)?)?;
    }
    if let Some(path) = &arguments.markdown {
        write(path, study_comparison_markdown(&comparison))?;
    }
    if arguments.json {
        print_json(&comparison)?;
    } else {
        print_text(study_comparison_text(&comparison, arguments.all).trim_end())?;
    }
    Ok(Some(if comparison.pass {
        ExitStatus::Success
    } else {
        ExitStatus::CriterionFailed
    }))
}

struct Prepared {
    options: StudyCompareOptions,
    results: [ParquetResults; 2],
}

/// Everything that can be wrong before a table is read.
fn prepare(arguments: &CompareArguments, studies: [bool; 2]) -> Result<Prepared, Vec<Finding>> {
    let options = options(arguments)?;
    for (path, argument) in [
        (&arguments.junit, "--junit"),
        (&arguments.markdown, "--markdown"),
    ] {
        if let Some(path) = path {
            probe_file(path, argument).map_err(|finding| vec![finding])?;
        }
    }
    for (path, other, is_study) in [
        (&arguments.a, &arguments.b, studies[0]),
        (&arguments.b, &arguments.a, studies[1]),
    ] {
        if !is_study {
            let finding = Finding::new(
                path.display().to_string(),
                format!("this is no study, but {} is one", other.display()),
            );
            return Err(vec![finding.hint(
                "compare two studies: folders with results.parquet, or such tables",
            )]);
        }
    }
    let results = [open(&arguments.a)?, open(&arguments.b)?];
    Ok(Prepared { options, results })
}

fn options(arguments: &CompareArguments) -> Result<StudyCompareOptions, Vec<Finding>> {
    let mut options = StudyCompareOptions {
        thresholds: Vec::new(),
        allow_status_change: arguments.allow_status_change,
    };
    let mut findings = Vec::new();
    if !arguments.goal.is_empty() {
        findings.push(
            Finding::new("--goal", "goals of studies cannot be matched by hand")
                .hint("studies with other goals are compared by their rates and quantiles"),
        );
    }
    if let Some(path) = &arguments.thresholds {
        let file = ThresholdsFile::load(path).map_err(|finding| vec![finding])?;
        options.allow_status_change |= file.allow_status_change();
        for (key, limit) in file.max_loss() {
            match StudyThreshold::parse(key, limit) {
                Ok(threshold) => options.thresholds.push(threshold),
                Err(error) => findings.push(file.finding(key, error.message).hint(error.hint)),
            }
        }
    }
    for Pair((key, limit)) in &arguments.max_loss {
        match StudyThreshold::parse(key, limit) {
            Ok(threshold) => {
                // The command line goes before the file; of several of one number the last counts.
                options.thresholds.retain(|known| {
                    (known.metric, known.quantile, &known.of)
                        != (threshold.metric, threshold.quantile, &threshold.of)
                });
                options.thresholds.push(threshold);
            }
            Err(error) => findings.push(
                Finding::new(format!("{key}={limit}"), error.message)
                    .key("--max-loss")
                    .hint(error.hint),
            ),
        }
    }
    if findings.is_empty() {
        Ok(options)
    } else {
        Err(findings)
    }
}

fn open(path: &Path) -> Result<ParquetResults, Vec<Finding>> {
    let table: PathBuf = if path.is_dir() {
        path.join(RESULTS_FILE)
    } else {
        path.to_owned()
    };
    if path.is_dir() && !table.is_file() {
        let finding = Finding::new(
            path.display().to_string(),
            format!("the study is not complete: it has no {RESULTS_FILE}"),
        );
        return Err(vec![finding.hint(
            "finish it with `needlebench study STUDY --resume`, or `needlebench merge` its shards",
        )]);
    }
    ParquetResults::open(&table).map_err(|error| vec![finding(error)])
}

fn finding(error: ResultsError) -> Finding {
    match error.message.split_once("\nhint: ") {
        Some((message, hint)) => Finding::new(error.file, message).hint(hint),
        None => Finding::new(error.file, error.message),
    }
}
