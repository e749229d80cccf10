//! What a study leaves besides its table.

use std::path::Path;

use anyhow::{Context, Result};
use needlebench_study::ParquetResults;
use needlebench_study::statistics::{
    CriterionResult, Summary, SummaryOptions, judge_study, summarise,
};
use serde::Serialize;

use super::case::StudyCase;
use super::markdown::summary_markdown;
use super::prepare::PreparedStudy;
use super::robust::{RobustnessResult, robustness_of, robustness_parts};
use super::tables::parts;
use super::text::summary_text;
use crate::atomic::write_atomically;
use crate::output::study_junit;
use crate::page::study::{CasePlaces, StudyPage};
use crate::progress::Progress;

/// Name of the page in a study's folder.
const PAGE_FILE: &str = "report.html";

/// Statistics of a study, with the verdict.
#[derive(Debug, Serialize)]
pub(crate) struct StudySummary {
    /// Name of the study.
    name: String,
    /// The question that it answers.
    description: String,
    /// Hash of everything that decides the results.
    study_id: String,
    /// Number of cases.
    cases: u64,
    /// `pass` if all criteria are met.
    verdict: &'static str,
    /// Criteria of the study.
    criteria: Vec<CriterionResult>,
    /// How far the base scenario's phantom may move; none unless the study asks for it.
    #[serde(skip_serializing_if = "Option::is_none")]
    robustness: Option<Vec<RobustnessResult>>,
    /// Statistics.
    #[serde(flatten)]
    statistics: Summary,
}

/// Where results go, and which.
pub(crate) struct StudyOutput<'a> {
    pub folder: &'a Path,
    pub junit: Option<&'a Path>,
    pub page: bool,
    pub threads: usize,
}

/// What was written.
pub(crate) struct FinishedStudy {
    pub summary: StudySummary,
    /// The summary for a terminal.
    pub text: String,
    /// All criteria are met.
    pub passed: bool,
}

/// Sums up a study's table and writes what there is to write.
pub(crate) fn write_study(
    prepared: &PreparedStudy,
    results: &ParquetResults,
    output: &StudyOutput<'_>,
    progress: &Progress,
) -> Result<FinishedStudy> {
    let file = &prepared.study.file;
    progress.message("statistics");
    let options = SummaryOptions {
        sampling: file.sampling.method,
        working_configurations: file.criteria.working_configurations.unwrap_or(2) as usize,
        more_quantiles: file
            .criteria
            .quantiles()
            .iter()
            .map(|each| each.quantile)
            .collect(),
        factors: true,
    };
    let statistics = summarise(results, &options)?;
    let criteria = judge_study(&statistics, &file.criteria);
    let robustness = file
        .robustness
        .as_ref()
        .map(|section| robustness_of(&prepared.study, section, output.threads, progress))
        .transpose()
        .map_err(|findings| {
            let texts: Vec<String> = findings.iter().map(ToString::to_string).collect();
            anyhow::anyhow!("robustness: {}", texts.join("; "))
        })?;
    let passed = criteria.iter().all(|criterion| criterion.pass);
    let summary = StudySummary {
        name: file.name.clone(),
        description: file.description.clone(),
        study_id: prepared.identity.id.clone(),
        cases: prepared.design.cases(),
        verdict: if passed { "pass" } else { "fail" },
        criteria,
        robustness,
        statistics,
    };
    let write = |name: &str, text: &str| {
        let path = output.folder.join(name);
        write_atomically(&path, text.as_bytes())
            .with_context(|| format!("cannot write {}", path.display()))
    };
    write("summary.json", &serde_json::to_string_pretty(&summary)?)?;
    let more = file
        .robustness
        .as_ref()
        .zip(summary.robustness.as_ref())
        .map_or_else(Vec::new, |(section, results)| {
            robustness_parts(section, results)
        });
    let parts = parts(&summary.statistics, &summary.criteria, more);
    write(
        "summary.md",
        &summary_markdown(&file.name, &summary.criteria, &parts),
    )?;
    let text = summary_text(&parts);
    if let Some(path) = output.junit {
        let document = study_junit(&file.name, &summary.criteria)?;
        write_atomically(path, document.as_bytes())
            .with_context(|| format!("cannot write {}", path.display()))?;
    }
    if output.page {
        progress.message("writing the page");
        let places = |case: u64| {
            let layout = StudyCase::new(&prepared.study, &prepared.design, case);
            let resolved = layout.scenario(&prepared.study).ok()?;
            Some(CasePlaces {
                world_from_base_link: resolved.cell.robot.world_from_base_link,
                world_from_phantom: resolved.phantom.map(|placed| placed.world_from_phantom),
            })
        };
        let page = StudyPage {
            name: &file.name,
            description: &file.description,
            file: &prepared.study.source.file,
            results,
            summary: &serde_json::to_value(&summary)?,
            manifest: &serde_json::to_value(prepared.manifest(None))?,
            base: Some(prepared.study.family.base()),
            places: Some(&places),
        };
        write(PAGE_FILE, &page.html()?)?;
    } else {
        remove_stale(&output.folder.join(PAGE_FILE))?;
    }
    Ok(FinishedStudy {
        summary,
        text,
        passed,
    })
}

/// Removes an earlier file that nobody should take for this study's.
fn remove_stale(path: &Path) -> std::io::Result<()> {
    match std::fs::remove_file(path) {
        Err(error) if error.kind() != std::io::ErrorKind::NotFound => Err(error),
        _ => Ok(()),
    }
}
