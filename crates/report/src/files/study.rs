//! What a study leaves besides its table.

use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use needlebench_bench::study::{
    ENGINE_FAILURE, PreparedStudy, Replanned, RobustnessResult, StudyCase, robustness_of,
};
use needlebench_cell::{SCAN_ENDS, reason_in_words};
use needlebench_evaluation::report::Verdict;
use needlebench_parallel::Progress;
use needlebench_scenario::requirements::{Requirements, requirement_of};
use needlebench_show::blocks_text;
use needlebench_study::statistics::{
    CriterionResult, Summary, SummaryOptions, judge_study, summarise,
};
use needlebench_study::{ParquetResults, Results as _};
use serde::Serialize;

use super::accuracy::remove_accuracy;
use super::atomic::write_atomically;
use super::error::FilesError;
use super::folder::Folder;
use super::replan::replan;
use crate::junit::study_junit;
use crate::markdown::study::summary_markdown;
use crate::page::study::{CasePictures, StudyPage};
use crate::table::study::answer::Answer;
use crate::table::study::criteria::requirements_blocks;
use crate::table::study::document::{Document, Parts};
use crate::table::study::postures::{Postures, RouteLeftOut, postures_blocks, postures_headline};
use crate::table::study::robustness::{robustness_blocks, robustness_method};
use crate::table::verdict::capitals;

/// Name of the page in a study's folder.
const PAGE_FILE: &str = "report.html";

/// Statistics of a study, with the verdict.
#[derive(Debug, Serialize)]
pub struct StudySummary {
    /// Name of the study.
    name: String,
    /// The question of the study.
    description: String,
    /// Hash of everything that decides the results.
    study_id: String,
    /// Number of cases.
    cases: u64,
    /// What is computed of a case, unless a level of a factor says otherwise.
    mode: &'static str,
    /// Whether all cases, some of them or none are postures only, without planned motions.
    postures_only: &'static str,
    /// Whether feasibility leaves out the needle path.
    without_route: bool,
    /// Caveats: postures only, needle path not checked; none where all cases have both.
    #[serde(skip_serializing_if = "Option::is_none")]
    headline: Option<String>,
    /// The answer: a sentence with its value and confidence interval, remarks and comparisons.
    answer: Answer,
    /// Overestimate of postures only; none where all cases have motions, or none was to be planned.
    #[serde(skip_serializing_if = "Option::is_none")]
    replanned: Option<Replanned>,
    /// `pass`, `fail` or `incomplete`.
    verdict: Verdict,
    /// Criteria of the study.
    criteria: Vec<CriterionResult>,
    /// Criteria and motions that could not be evaluated, and why.
    not_judged: Vec<String>,
    /// How far the base scenario's phantom may move; none without `[robustness]`.
    #[serde(skip_serializing_if = "Option::is_none")]
    robustness: Option<Vec<RobustnessResult>>,
    /// Statistics.
    #[serde(flatten)]
    statistics: Summary,
}

/// Where results go, and which.
pub struct StudyOutput<'a> {
    /// Folder of the study's results.
    pub folder: &'a Path,
    /// Where JUnit goes, if anywhere.
    pub junit: Option<&'a Path>,
    /// How long the command took so far.
    pub elapsed: Duration,
    /// Whether the page is written.
    pub page: bool,
    /// Threads for what is computed on the way.
    pub threads: usize,
    /// Ends it where it is long.
    pub cancel: Option<&'a AtomicBool>,
}

/// What was written.
pub struct FinishedStudy {
    /// Its statistics.
    pub summary: StudySummary,
    document: Document,
    /// Whether all criteria are evaluated and met.
    pub verdict: Verdict,
}

impl FinishedStudy {
    /// The summary for a terminal: verdict, answer and the tables behind it, or `all` tables, the first screen last.
    pub fn text(&self, all: bool) -> String {
        let mut text = String::new();
        if all {
            text.push_str(&blocks_text(&self.document.more));
            text.push('\n');
        }
        text.push_str(&blocks_text(&self.document.first));
        text
    }
}

/// Sums up a study's table and writes what there is to write.
pub fn write_study(
    prepared: &PreparedStudy,
    results: &ParquetResults,
    output: &StudyOutput<'_>,
    progress: &dyn Progress,
) -> Result<FinishedStudy, FilesError> {
    let file = &prepared.study.file;
    remove_accuracy(Folder(output.folder))?;
    progress.message("statistics");
    let left_out = RouteLeftOut::of(prepared);
    let options = SummaryOptions {
        sampling: file.sampling.method,
        route_mm: left_out.as_ref().map(|route| route.least_mm),
        ..SummaryOptions::default()
    };
    let options = options.judged_by(&file.criteria);
    let mut statistics = summarise(results, &options)?;
    let mut criteria = judge_study(&statistics, &file.criteria);
    for each in &mut criteria {
        let found = requirement_of(&file.requirements, &each.criterion);
        each.requirement = found.map(str::to_owned);
    }
    let replanned = replan(
        prepared,
        results,
        &statistics,
        Folder(output.folder),
        output.threads,
        output.cancel,
        progress,
    )?;
    let postures = Postures::of(prepared);
    let headline = [
        postures_headline(postures, replanned.as_ref()),
        left_out.as_ref().map(RouteLeftOut::in_words),
    ];
    let headline: Vec<String> = headline.into_iter().flatten().collect();
    let headline = (!headline.is_empty()).then(|| headline.join(". "));
    let working = file
        .criteria
        .working_configurations
        .unwrap_or(1)
        .clamp(1, 8) as usize;
    let answer = Answer::new(&statistics, results.factors(), working);
    let robustness = file
        .robustness
        .as_ref()
        .map(|section| {
            let (threads, cancel) = (output.threads, output.cancel);
            let found = robustness_of(&prepared.study, section, threads, cancel, progress);
            let found = found.map_err(|findings| {
                let texts: Vec<String> = findings.iter().map(ToString::to_string).collect();
                FilesError::Robustness(texts.join("; "))
            })?;
            found.ok_or(FilesError::Interrupted)
        })
        .transpose()?;
    let of_radii = robustness.as_deref().and_then(robustness_method);
    statistics.methods.extend(of_radii);
    let not_judged = not_judged(&statistics, &criteria);
    let missed = criteria.iter().filter(|each| each.is_missed()).count();
    let verdict = Verdict::of(missed > 0, !not_judged.is_empty());
    let summary = StudySummary {
        name: file.name.clone(),
        description: file.description.clone(),
        study_id: prepared.identity.id.clone(),
        cases: prepared.design.cases(),
        mode: prepared.study.mode.name(),
        postures_only: postures.name(),
        without_route: left_out.is_some(),
        headline,
        answer,
        replanned,
        verdict,
        criteria,
        not_judged,
        robustness,
        statistics,
    };
    let folder = Folder(output.folder);
    let json = serde_json::to_string_pretty(&summary)?;
    folder.write("summary.json", json)?;
    let document = document(&summary, &file.requirements);
    let title = match postures {
        Postures::All => format!("{} (postures only)", file.name),
        Postures::Some | Postures::None => file.name.clone(),
    };
    let verdict = is_judged(&summary).then_some(summary.verdict);
    let markdown = summary_markdown(&title, verdict, &document);
    folder.write("summary.md", markdown)?;
    let headline = summary.headline.as_deref();
    if let Some(path) = output.junit {
        let document = study_junit(&file.name, headline, &summary.criteria, output.elapsed)?;
        write_atomically(path, document.as_bytes()).map_err(|source| FilesError::Write {
            path: path.to_owned(),
            source,
        })?;
    }
    if output.page {
        progress.message("writing the page");
        let scenarios = |case: u64| {
            let layout = StudyCase::new(&prepared.study, &prepared.design, case);
            layout.scenario(&prepared.study).ok()
        };
        // Its name alone: where it lies, and how it was called, is no part of the results.
        let source = Path::new(&prepared.study.source.file);
        let source = source.file_name().unwrap_or_default().to_string_lossy();
        let page = StudyPage {
            name: &file.name,
            description: &file.description,
            file: &source,
            results,
            summary: &serde_json::to_value(&summary)?,
            manifest: &serde_json::to_value(prepared.manifest(None))?,
            pictures: Some(CasePictures {
                base: prepared.study.family.base(),
                scenario_of: &scenarios,
            }),
        };
        folder.write(PAGE_FILE, page.html()?)?;
    } else {
        folder.remove(PAGE_FILE)?;
    }
    Ok(FinishedStudy {
        verdict: summary.verdict,
        summary,
        document,
    })
}

/// What could not be evaluated: criteria without values, and motions that engines could not execute.
fn not_judged(statistics: &Summary, criteria: &[CriterionResult]) -> Vec<String> {
    let open = criteria.iter().filter(|each| !each.is_judged());
    let mut reasons: Vec<String> = open
        .map(|each| {
            let of = each
                .of
                .as_ref()
                .map_or(String::new(), |of| format!(" {of}"));
            format!("{}{of}: {}", each.criterion, each.detail)
        })
        .collect();
    let open = statistics.overall.not_judged();
    let (failures, criteria): (Vec<_>, Vec<_>) = open
        .into_iter()
        .partition(|(detail, _)| detail.starts_with(ENGINE_FAILURE));
    reasons.extend(failures.into_iter().map(|(detail, count)| {
        let engine = detail.trim_start_matches(ENGINE_FAILURE).trim();
        format!("{engine} could not execute {count} motions (no measurements)")
    }));
    reasons.extend(criteria.into_iter().map(|(criterion, count)| {
        if criterion.starts_with(SCAN_ENDS) {
            return format!("{} for {count} configurations", reason_in_words(criterion));
        }
        format!("scenario criterion {criterion} not evaluated for {count} configurations")
    }));
    reasons
}

/// Whether there is anything to evaluate.
fn is_judged(summary: &StudySummary) -> bool {
    !summary.criteria.is_empty() || !summary.not_judged.is_empty()
}

/// The summary for people.
fn document(summary: &StudySummary, requirements: &Requirements) -> Document {
    let verdict = verdict_line(summary);
    let parts = Parts {
        summary: &summary.statistics,
        answer: &summary.answer,
        criteria: &summary.criteria,
        verdict: &verdict,
        headline: summary.headline.as_deref(),
    };
    let mut document = Document::new(&parts);
    document
        .more
        .extend(postures_blocks(summary.replanned.as_ref()));
    let radii = summary.robustness.as_ref();
    document
        .more
        .extend(radii.map_or_else(Vec::new, |results| robustness_blocks(results)));
    document
        .more
        .extend(requirements_blocks(requirements, &summary.criteria));
    document.finish(&parts)
}

/// The verdict with its counts.
fn verdict_line(summary: &StudySummary) -> String {
    let total = summary.criteria.len();
    let judged = summary
        .criteria
        .iter()
        .filter(|each| each.is_judged())
        .count();
    let met = summary.criteria.iter().filter(|each| each.pass).count();
    let open = [
        (summary.postures_only == "all").then_some("postures only"),
        summary.without_route.then_some("needle path not checked"),
    ];
    let open: Vec<&str> = open.into_iter().flatten().collect();
    let open = if open.is_empty() {
        String::new()
    } else {
        format!(" ({})", open.join(", "))
    };
    let name = format!("{}, {} cases{open}", summary.name, summary.cases);
    let verdict = capitals(summary.verdict);
    if !is_judged(summary) {
        return format!("{name}: no verdict, no study criteria defined");
    }
    if summary.not_judged.is_empty() {
        return format!("{name}: {verdict}: {met} of {total} criteria met");
    }
    let why = summary.not_judged.join("; ");
    if total == 0 {
        return format!("{name}: {verdict}: not evaluated: {why}");
    }
    let met = if met == judged {
        "all met".to_owned()
    } else {
        format!("{met} of them met")
    };
    format!(
        "{name}: {verdict}: {judged} of {total} criteria evaluated, {met}; not evaluated: {why}"
    )
}
