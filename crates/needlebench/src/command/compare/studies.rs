//! `needlebench compare` of two studies.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use needlebench_evaluation::metric::resolve;
use needlebench_evaluation::{Compared, Loss, Rate, Subject, Threshold};
use needlebench_input::Finding;
use needlebench_report::table::study_comparison::{Listed, study_comparison_text};
use needlebench_report::{study_comparison_junit, study_comparison_markdown, write_atomically};
use needlebench_study::compare::{
    ComparedStudy, STUDY_RATES, StudyCompareOptions, StudyComparison, StudyLimit, StudyPair,
    StudySubject, StudyThreshold,
};
use needlebench_study::{MANIFEST_FILE, ParquetResults, RESULTS_FILE, ResultsError};

use super::super::results_folder::probe_file;
use super::super::{print_json, print_text};
use super::CompareArguments;
use super::thresholds::{Given, thresholds};
use crate::clock::elapsed;
use crate::exit::ExitStatus;
use crate::failure::Failure;
use crate::output::{print_wide, shown};

/// Whether a path is a study's folder, or its table.
pub(super) fn is_study(path: &Path) -> bool {
    let is_table = path
        .extension()
        .is_some_and(|extension| extension == "parquet");
    is_table || path.join(RESULTS_FILE).is_file() || path.join(MANIFEST_FILE).is_file()
}

/// Compares two studies; none if either is not a study.
pub(super) fn compare_if_studies(
    arguments: &CompareArguments,
) -> Result<Option<ExitStatus>, Failure> {
    let studies = [&arguments.a, &arguments.b].map(|path| is_study(path));
    if studies != [true, true] {
        return Ok(None);
    }
    if arguments.is_wide() {
        print_wide();
    }
    let prepared = prepare(arguments)?;
    let comparison = compared(arguments, &prepared).map_err(finding)?;
    let write = |path: &Path, text: String| {
        write_atomically(path, text.as_bytes())
            .with_context(|| format!("cannot write {}", path.display()))
    };
    if let Some(path) = &arguments.junit {
        let junit = study_comparison_junit(&comparison, elapsed()).map_err(anyhow::Error::from)?;
        write(path, junit)?;
    }
    if let Some(path) = &arguments.markdown {
        write(path, study_comparison_markdown(&comparison))?;
    }
    if arguments.json {
        print_json(&comparison)?;
    } else {
        let listed = match (arguments.all, arguments.is_wide()) {
            (true, _) => Listed::All,
            (false, true) => Listed::Changed,
            (false, false) => Listed::Screen,
        };
        print_text(study_comparison_text(&comparison, listed).trim_end())?;
    }
    Ok(Some(if comparison.pass {
        ExitStatus::Success
    } else {
        ExitStatus::CriterionFailed
    }))
}

struct Prepared {
    given: Given,
    results: [ParquetResults; 2],
}

/// Reads both studies and compares them.
fn compared(
    arguments: &CompareArguments,
    prepared: &Prepared,
) -> Result<StudyComparison, ResultsError> {
    let names = [&arguments.a, &arguments.b].map(|path| shown(path));
    let side = |at: usize| ComparedStudy {
        source: &names[at],
        name: prepared.results[at].study_name(),
        study_id: prepared.results[at].study_id(),
        results: &prepared.results[at],
    };
    let given = &prepared.given.thresholds;
    let quantiles: Vec<f64> = given
        .iter()
        .filter_map(|threshold| match threshold.subject {
            Subject::Metric(_, quantile) => quantile,
            Subject::Rate(_) => None,
        })
        .collect();
    let pair = StudyPair::read(side(0), side(1), &quantiles)?;
    let mut notes = Vec::new();
    let mut thresholds = Vec::new();
    for threshold in given {
        let (of_study, note) = on_columns(threshold, &pair);
        notes.extend(note);
        thresholds.push(of_study);
    }
    Ok(pair.compare(&StudyCompareOptions {
        thresholds,
        allow_status_change: prepared.given.allow_status_change,
        allow_lost: prepared.given.allow_lost,
        notes,
    }))
}

/// A threshold in the units of the studies' columns, on a metric that both have, and a note if that is not the
/// requested one.
fn on_columns(threshold: &Threshold, pair: &StudyPair<'_>) -> (StudyThreshold, Option<String>) {
    let (subject, si, note) = match &threshold.subject {
        Subject::Rate(rate) => {
            let mut rates = STUDY_RATES.into_iter();
            let rate = rates.find(|each| each.name == rate.name);
            let rate = rate.expect("only the rates of studies are known");
            (StudySubject::Rate(rate), 1.0, None)
        }
        Subject::Metric(wanted, quantile) => {
            let resolved = resolve(wanted, |key| pair.have(key)[0], |key| pair.have(key)[1]);
            let quantile = quantile.expect("thresholds of studies have one");
            let key = resolved.key.key().into_owned();
            let subject = StudySubject::Metric(key, quantile);
            (subject, resolved.key.metric().unit.si, resolved.note)
        }
    };
    let limit = match threshold.limit.in_unit(si) {
        Loss::Absolute(limit) => StudyLimit::Absolute(limit),
        Loss::Relative(share) => StudyLimit::Relative(share),
    };
    let of_study = StudyThreshold {
        subject,
        of: threshold.of.clone(),
        limit,
        key: threshold.key.clone(),
        text: threshold.text.clone(),
    };
    let note = note.map(|note| format!("threshold {}: {note}", threshold.key));
    (of_study, note)
}

/// Checks the arguments before a table is read.
fn prepare(arguments: &CompareArguments) -> Result<Prepared, Failure> {
    let given = given(arguments)?;
    for (path, argument) in [
        (&arguments.junit, "--junit"),
        (&arguments.markdown, "--markdown"),
    ] {
        if let Some(path) = path {
            probe_file(path, argument)?;
        }
    }
    let results = [open(&arguments.a)?, open(&arguments.b)?];
    Ok(Prepared { given, results })
}

/// Thresholds and other options of the comparison.
fn given(arguments: &CompareArguments) -> Result<Given, Vec<Finding>> {
    let mut findings = Vec::new();
    if arguments.case.is_some() {
        findings.push(
            Finding::new("--case", "two studies are compared in all cases")
                .hint("`--case` selects the case of a study to compare with a run"),
        );
    }
    if !arguments.goal.is_empty() {
        findings.push(
            Finding::new("--goal", "goals of studies cannot be matched manually")
                .hint("studies with different goals are compared by rates and quantiles"),
        );
    }
    let rates = STUDY_RATES.map(|rate| Rate {
        name: rate.name,
        of_configurations: rate.of_configurations,
    });
    match thresholds(arguments, Compared::Studies(&rates)) {
        Ok(given) if findings.is_empty() => Ok(given),
        Ok(_) => Err(findings),
        Err(more) => {
            findings.extend(more);
            Err(findings)
        }
    }
}

pub(super) fn open(path: &Path) -> Result<ParquetResults, Vec<Finding>> {
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

pub(super) fn finding(error: ResultsError) -> Finding {
    match error.message.split_once("\nhint: ") {
        Some((message, hint)) => Finding::new(error.file, message).hint(hint),
        None => Finding::new(error.file, error.message),
    }
}
