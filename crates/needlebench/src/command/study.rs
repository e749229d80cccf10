//! `needlebench study` and `needlebench merge`.

mod arguments;
mod launch;
mod status;

use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use anyhow::{Context, Result};
use needlebench_bench::accuracy::{AccuracyError, accuracy_of_study, check_study};
use needlebench_bench::study::{
    Assignment, PreparedStudy, StudyCase, StudyEvaluator, assignment, in_words, time_per_case,
};
use needlebench_bench::{RunOptions, Runnable};
use needlebench_input::{Finding, nothing_serves};
use needlebench_parallel::Progress as _;
use needlebench_patient::ct::{LastScan, scanned};
use needlebench_report::files::{FilesError, StudyOutput, write_study};
use needlebench_report::table::study::{CaseReport, case_text};
use needlebench_scenario::study::load_study;
use needlebench_study::{
    CSV_FILE, CaseEvaluator, FactorKind, ParquetResults, Progress as Event, Role, RunEnd, Shard,
    StudyError, StudyRun, merge as merge_shards, write_csv,
};

use super::results_folder::{prepare_folder, probe_file};
use super::run::{Outputs, Printed, run_into};
use super::{overrides, print_json, print_text};
use crate::arguments::{RobotArguments, leave};
use crate::clock::elapsed;
use crate::exit::ExitStatus;
use crate::failure::Failure;
use crate::findings::print_findings;
use crate::interrupts::{threads, watch_interrupts};
use crate::output::{complain, print_wide, shown};
use crate::progress::TerminalProgress;
pub(super) use arguments::ShardArgument;
use arguments::StudyResultArguments;
pub(crate) use arguments::{MergeArguments, STUDY_HELP, StudyArguments};

/// Longest expected time of a study that starts without `--yes`.
const WITHOUT_ASKING: Duration = Duration::from_mins(20);
/// Number of cases up to which the time is not estimated in advance.
const FEW_CASES: u64 = 200;

/// Computes a study, or some of its cases.
pub(crate) fn study(arguments: &StudyArguments) -> Result<ExitStatus, Failure> {
    let prepared = prepare(&arguments.study, &arguments.robot)?;
    if !arguments.case.is_empty() {
        return cases(arguments, &prepared);
    }
    if !arguments.status.is_empty() {
        return status::status(arguments, &prepared);
    }
    if let Some(request) = arguments.launch {
        return launch::launch(arguments, &prepared, request);
    }
    let (shard, out) = asked_shard(arguments)?;
    if let Some(note) = choice_with_range(&prepared) {
        complain(&note);
    }
    let folder = out.join(&prepared.study.file.name);
    prepare_outputs(&folder, &prepared, &arguments.results)?;
    let evaluator = StudyEvaluator::new(&prepared.study, &prepared.design, &prepared.columns);
    let threads = threads(arguments.results.jobs);
    let manifest = prepared.manifest(shard);
    if !arguments.yes && !arguments.resume {
        refuse_if_long(&prepared, &evaluator, manifest.own_cases(), threads)?;
    }
    let cancel = watch_interrupts()?;
    let progress = TerminalProgress::new(arguments.results.quiet);
    let run = StudyRun {
        design: &prepared.design,
        manifest,
        evaluator: &evaluator,
        threads,
        resume: arguments.resume,
    };
    let end = run.run(&folder, &cancel, &|event| show(&progress, event));
    progress.finish();
    match end? {
        RunEnd::Partial { done, total } => Err(Failure::interrupted(format!(
            "interrupted: {done} of {total} cases are in {}; --resume continues",
            shown(&folder)
        ))),
        RunEnd::Finished {
            cases,
            results: None,
        } => {
            print_text(&format!(
                "{cases} of {} cases are in {}; `needlebench merge` joins all shards",
                prepared.design.cases(),
                shown(&folder)
            ))?;
            Ok(ExitStatus::Success)
        }
        RunEnd::Finished {
            results: Some(results),
            ..
        } => finish(
            &prepared,
            &folder,
            &results,
            &arguments.results,
            Some(&cancel),
        ),
    }
}

/// A note on a control factor with a range: every sampled value occurs once, so nothing can be compared.
fn choice_with_range(prepared: &PreparedStudy) -> Option<String> {
    let mut factors = prepared.design.factors().iter();
    let factor = factors.find(|factor| {
        factor.role == Role::Control && matches!(factor.kind, FactorKind::Continuous { .. })
    })?;
    Some(format!(
        "note: control factor `{}` has a range: a study compares bins of it, under different noise factors\n\
         hint: `needlebench search` optimises over a range; a `grid` is compared pairwise",
        factor.name
    ))
}

/// Joins the shards of a study.
pub(crate) fn merge(arguments: &MergeArguments) -> Result<ExitStatus, Failure> {
    let prepared = prepare(&arguments.study, &arguments.robot)?;
    let folder = arguments.out.join(&prepared.study.file.name);
    prepare_outputs(&folder, &prepared, &arguments.results)?;
    let threads = threads(arguments.results.jobs);
    let progress = TerminalProgress::new(arguments.results.quiet);
    let end = merge_shards(
        &folder,
        Some(&prepared.manifest(None)),
        &arguments.shards,
        threads,
        true,
        &|event| match event {
            Event::Space { .. } if arguments.results.quiet => {}
            event => show(&progress, event),
        },
    );
    progress.finish();
    match end? {
        RunEnd::Finished {
            results: Some(results),
            ..
        } => finish(&prepared, &folder, &results, &arguments.results, None),
        _ => unreachable!("a merge writes a table or fails"),
    }
}

/// The requested shard, if any, and the folder for results.
fn asked_shard(arguments: &StudyArguments) -> Result<(Option<Shard>, PathBuf), Finding> {
    Ok(match arguments.shard {
        None => (None, arguments.out.clone()),
        Some(ShardArgument::This(shard)) => (Some(shard), arguments.out.clone()),
        Some(asked @ ShardArgument::Auto) => {
            let shard = shard_of(asked)?;
            // All tasks have the same command line, but need different folders.
            (Some(shard), arguments.out.join(shard.part().to_string()))
        }
    })
}

/// The requested shard, or that of the environment, which is printed.
pub(super) fn shard_of(asked: ShardArgument) -> Result<Shard, Finding> {
    match asked {
        ShardArgument::This(shard) => Ok(shard),
        ShardArgument::Auto => {
            let Assignment { shard, by, from } = assignment(&variable)?;
            complain(&format!("shard {shard}, by {by} ({from})"));
            Ok(shard)
        }
    }
}

/// An environment variable that is set to something.
fn variable(name: &str) -> Option<String> {
    std::env::var(name).ok().filter(|value| !value.is_empty())
}

/// Reads a study.
fn prepare(path: &Path, robot: &RobotArguments) -> Result<PreparedStudy, Failure> {
    let overrides = overrides(robot)?;
    let study = load_study(path, &overrides)?;
    for note in &study.notes {
        complain(&format!("note: {note}"));
    }
    Ok(PreparedStudy::new(study)?)
}

fn prepare_outputs(
    folder: &Path,
    prepared: &PreparedStudy,
    wanted: &StudyResultArguments,
) -> Result<(), Failure> {
    if let Some(request) = wanted.table.request() {
        check_study(&request, prepared)?;
    }
    prepare_folder(folder)?;
    let junit = wanted.junit.as_deref();
    junit.map_or(Ok(()), |path| probe_file(path, "--junit"))?;
    Ok(())
}

/// Rejects a study that will take long, and one whose cases cannot be computed.
fn refuse_if_long(
    prepared: &PreparedStudy,
    evaluator: &dyn CaseEvaluator,
    cases: u64,
    threads: usize,
) -> Result<(), Failure> {
    if cases <= FEW_CASES {
        return Ok(());
    }
    let each = time_per_case(evaluator, prepared.design.cases()).map_err(anyhow::Error::from)?;
    let time = each.mul_f64(cases as f64 / threads as f64);
    if time <= WITHOUT_ASKING {
        return Ok(());
    }
    let finding = Finding::new(
        &prepared.study.source.file,
        format!(
            "{cases} cases ({}) take about {} on {threads} threads",
            prepared.product(),
            in_words(time)
        ),
    );
    Err(finding
        .key("factors")
        .hint(
            "start it with --yes, compute a part with --shard K/N, or use fewer levels or samples",
        )
        .into())
}

pub(super) fn show(progress: &TerminalProgress, event: Event<'_>) {
    match event {
        Event::CutOff { .. }
        | Event::Damage { .. }
        | Event::Unsound { .. }
        | Event::OtherStudies { .. }
        | Event::Space { .. } => {
            complain(&event.to_string());
        }
        Event::Begin { kept, total } => {
            if kept > 0 {
                complain(&event.to_string());
            }
            progress.message("cases");
            progress.at(kept, total);
        }
        Event::Shards { done, total } => {
            progress.message("shards");
            progress.at(done, total);
        }
        Event::Cases { done, total } => progress.at(done, total),
        Event::Table { done, total } => {
            progress.message("table");
            progress.at(done, total);
        }
    }
}

/// Statistics, page and verdict of a complete table.
fn finish(
    prepared: &PreparedStudy,
    folder: &Path,
    results: &Path,
    arguments: &StudyResultArguments,
    cancel: Option<&AtomicBool>,
) -> Result<ExitStatus, Failure> {
    let threads = threads(arguments.jobs);
    let progress = TerminalProgress::new(arguments.quiet);
    let results = ParquetResults::open(results).map_err(StudyError::from)?;
    if arguments.csv {
        progress.message("csv");
        write_csv(&results, &folder.join(CSV_FILE), threads)?;
    }
    let output = StudyOutput {
        folder,
        junit: arguments.junit.as_deref(),
        elapsed: elapsed(),
        page: !arguments.no_page,
        threads,
        cancel,
    };
    let written = write_study(prepared, &results, &output, &progress);
    progress.finish();
    if matches!(written, Err(FilesError::Interrupted)) {
        return Err(Failure::interrupted(format!(
            "interrupted: all cases are in {}, without summary; --resume continues",
            shown(folder)
        )));
    }
    let finished =
        written.with_context(|| format!("cannot write the results to {}", folder.display()))?;
    if arguments.json {
        print_json(&finished.summary)?;
    } else {
        if arguments.wide {
            print_wide();
        }
        let text = finished.text(arguments.wide);
        let more = if arguments.wide {
            ""
        } else {
            " (--wide prints all tables)"
        };
        print_text(&format!("{text}results: {}{more}", shown(folder)))?;
    }
    if let Some(request) = arguments.table.request() {
        let table =
            accuracy_of_study(prepared, &results, &request).map_err(|error| match error {
                AccuracyError::Results(error) => Failure::from(StudyError::from(error)),
                AccuracyError::Request(finding) => Failure::from(finding),
            })?;
        leave(&table, folder, !arguments.json)?;
    }
    Ok(ExitStatus::of(finished.verdict))
}

/// Computes single cases.
fn cases(arguments: &StudyArguments, prepared: &PreparedStudy) -> Result<ExitStatus, Failure> {
    let total = prepared.design.cases();
    if let Some(case) = arguments.case.iter().find(|&&case| case >= total) {
        let finding = Finding::new(
            &prepared.study.source.file,
            format!("there is no case {case}"),
        )
        .key("--case")
        .hint(format!(
            "the study has {total} cases, 0 to {}: {}",
            total - 1,
            prepared.product()
        ));
        return Err(finding.into());
    }
    if arguments.run {
        return run_cases(arguments, prepared);
    }
    let evaluator = StudyEvaluator::new(&prepared.study, &prepared.design, &prepared.columns);
    let mut worker = evaluator.worker();
    let mut reports = Vec::new();
    for &number in &arguments.case {
        let layout = StudyCase::new(&prepared.study, &prepared.design, number);
        let result = worker.evaluate(number).map_err(anyhow::Error::from)?;
        if arguments.results.json {
            reports.push(CaseReport::new(
                &prepared.design,
                &prepared.columns,
                &layout,
                &result,
            ));
            continue;
        }
        print_text(&case_text(
            &prepared.design,
            &prepared.columns,
            &layout,
            &result,
        ))?;
        if let Err(findings) = layout.scenario(&prepared.study) {
            print_findings(&findings);
        }
    }
    if arguments.results.json {
        match reports.as_slice() {
            [report] => print_json(report)?,
            reports => print_json(&reports)?,
        }
    }
    Ok(ExitStatus::Success)
}

/// Runs cases like `run`.
fn run_cases(arguments: &StudyArguments, prepared: &PreparedStudy) -> Result<ExitStatus, Failure> {
    let mut runs: Vec<(Runnable, PathBuf, RunOptions)> = Vec::new();
    let folder = arguments.out.join(&prepared.study.file.name).join("cases");
    let mut last = LastScan::default();
    for &number in &arguments.case {
        let layout = StudyCase::new(&prepared.study, &prepared.design, number);
        let scenario = layout
            .scenario(&prepared.study)
            .and_then(|resolved| scanned(resolved, prepared.study.family.overrides(), &mut last));
        match scenario {
            Ok(mut resolved) => {
                resolved.scenario.name = format!("case_{number}");
                resolved.scenario.description =
                    format!("Case {number} of the study {}.", prepared.study.file.name);
                if let Some(engines) = layout.engines {
                    resolved.scenario.engines.run = Some(engines);
                }
                let options = RunOptions {
                    jobs: threads(arguments.results.jobs),
                    ..RunOptions::default()
                };
                let runnable = Runnable::new(resolved);
                runs.push((runnable, folder.join(number.to_string()), options));
            }
            Err(findings) => {
                complain(&if nothing_serves(&findings) {
                    format!("case {number} cannot be run, no configuration is feasible:")
                } else {
                    format!("case {number} is an invalid layout:")
                });
                return Err(findings.into());
            }
        }
    }
    let cancel = watch_interrupts()?;
    let mut status = ExitStatus::Success;
    let mut reports = Vec::new();
    let outputs = Outputs {
        rtde: false,
        mcap: false,
        pictures: arguments.pictures.are_wanted(arguments.results.quiet),
        page: !arguments.results.no_page,
        text: if arguments.results.json {
            Printed::Nothing
        } else {
            Printed::Screen
        },
        quiet: arguments.results.quiet,
    };
    for (runnable, folder, options) in &runs {
        prepare_folder(folder)?;
        let (outcome, report) = run_into(runnable, options, folder, outputs, &cancel)?;
        status = status.max(outcome);
        reports.push(report);
    }
    if arguments.results.json {
        print_json(&reports)?;
    }
    Ok(status)
}
