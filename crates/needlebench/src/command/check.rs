//! `needlebench check`.

use crate::arguments::RobotArguments;
use crate::output::shown;
use anyhow::Result;
use clap::Args;
use needlebench_bench::Preview;
use needlebench_bench::preview::BASIS;
use needlebench_cell::{UNSEEN_BODY, part_in_words, reason_in_words};
use needlebench_input::{Finding, nothing_serves};
use needlebench_report::table::{fissures_in_words, rejected_in_words, route_in_words};
use needlebench_scenario::ResolvedScenario;
use serde::Serialize;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use super::{load, overrides, print_json, print_text};

use crate::exit::ExitStatus;
use crate::failure::Failure;
use crate::host::take_findings;

#[derive(Debug, Args)]
pub(crate) struct CheckArguments {
    /// Scenario files.
    #[arg(required = true, value_name = "SCENARIO")]
    pub scenarios: Vec<PathBuf>,
    /// Print one JSON document.
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub robot: RobotArguments,
}

#[derive(Serialize)]
struct CheckAnswer {
    schema_version: u32,
    ok: bool,
    findings: Vec<Finding>,
    notes: Vec<String>,
    /// One for each file that can be read, in order.
    scenarios: Vec<CheckedScenario>,
}

#[derive(Serialize)]
struct CheckedScenario {
    file: String,
    name: String,
    #[serde(flatten)]
    preview: Preview,
}

/// Parses, resolves and validates scenarios, and prints what follows from them without a simulation.
pub(crate) fn check(arguments: &CheckArguments) -> Result<ExitStatus, Failure> {
    let mut findings = Vec::new();
    // A file is invalid, as opposed to valid with infeasible goals.
    let mut bad_input = false;
    let mut notes = Vec::new();
    let mut scenarios = Vec::new();
    match overrides(&arguments.robot) {
        Err(finding) => {
            bad_input = true;
            findings.push(finding);
        }
        Ok(overrides) => {
            for path in &arguments.scenarios {
                let resolved = match load(path, &overrides) {
                    Ok(resolved) => resolved,
                    Err(found) => {
                        bad_input |= !nothing_serves(&found);
                        findings.extend(found.into_iter().map(|finding| placed(path, finding)));
                        continue;
                    }
                };
                let (preview, found) = Preview::of(&resolved).map_err(anyhow::Error::from)?;
                if !arguments.json {
                    let is_ok = found.is_empty();
                    print_text(&in_words(path, &resolved, &preview, is_ok)?)?;
                }
                findings.extend(found.into_iter().map(|finding| placed(path, finding)));
                scenarios.push(CheckedScenario {
                    file: resolved.source.file.clone(),
                    name: resolved.scenario.name.clone(),
                    preview,
                });
                notes.extend(resolved.notes);
            }
        }
    }
    let ok = findings.is_empty();
    if !arguments.json {
        return match (ok, bad_input) {
            (true, _) => Ok(ExitStatus::Success),
            (false, true) => Err(findings.into()),
            (false, false) => Err(Failure::Missed(findings)),
        };
    }
    take_findings(&findings);
    let answer = CheckAnswer {
        schema_version: 1,
        ok,
        findings,
        notes,
        scenarios,
    };
    let refused = match (ok, bad_input) {
        (true, _) => {
            print_json(&answer)?;
            return Ok(ExitStatus::Success);
        }
        (false, true) => ExitStatus::BadInput,
        (false, false) => ExitStatus::CriterionFailed,
    };
    Err(Failure::answered(refused, &answer))
}

/// The finding with its line, if it is about a key of the scenario's file.
fn placed(path: &Path, finding: Finding) -> Finding {
    if finding.line.is_some() || finding.file != path.display().to_string() {
        return finding;
    }
    match needlebench_input::read_text(path) {
        Ok(text) => finding.placed_in(&text),
        Err(_) => finding,
    }
}

/// A number with its noun: `1 goal`, `2 goals`.
fn counted(count: usize, noun: &str) -> String {
    let plural = if count == 1 { "" } else { "s" };
    format!("{count} {noun}{plural}")
}

/// The summary of a scenario.
fn in_words(
    path: &Path,
    resolved: &ResolvedScenario,
    preview: &Preview,
    is_ok: bool,
) -> Result<String> {
    let mut text = String::new();
    let purpose = match (&resolved.iso9283, &resolved.excitation) {
        (Some(_), _) => "test by ISO 9283".to_owned(),
        (None, Some(run)) => format!(
            "excitation run, {}, {}",
            counted(run.postures.len(), "posture"),
            counted(run.loads.len(), "payload")
        ),
        (None, None) => counted(resolved.goals.len(), "goal"),
    };
    write!(
        text,
        "{}: {} ({purpose}, {} bodies, {} collision pairs)",
        shown(path),
        if is_ok { "ok" } else { "not ok" },
        resolved.cell.bodies.len(),
        resolved.cell.pairs.len()
    )?;
    if let (Some(least_m), Some([a, b])) = (preview.start.least_clearance_m, &preview.start.pair)
        && resolved.iso9283.is_none()
    {
        write!(
            text,
            "\n  start posture: within the joint limits; smallest clearance {2:.1} mm ({0} to {1})",
            part_in_words(a),
            part_in_words(b),
            least_m * 1e3
        )?;
    }
    for goal in &preview.goals {
        write!(
            text,
            "\n  goal {}: {} of 8 configurations feasible ({BASIS})",
            goal.name, goal.working
        )?;
        let rejected = goal.configurations.iter().filter(|each| !each.works);
        let by_rules = rejected.clone();
        let by_rules = by_rules.filter_map(|each| Some((each.label, each.rejections.first()?)));
        for reason in rejected_in_words(by_rules) {
            write!(text, "\n    {reason}")?;
        }
        let by_criteria = rejected.filter(|each| each.rejections.is_empty());
        let mut missed: Vec<(&str, Vec<&str>)> = Vec::new();
        let mut open = Vec::new();
        for each in by_criteria {
            if each.not_judged.is_some() {
                open.push(each.label);
                continue;
            }
            let criterion = each.missed.unwrap_or("a criterion failed");
            match missed.iter_mut().find(|(known, _)| *known == criterion) {
                Some((_, labels)) => labels.push(each.label),
                None => missed.push((criterion, vec![each.label])),
            }
        }
        for (criterion, labels) in missed {
            let reason = reason_in_words(criterion);
            write!(text, "\n    {reason} ({criterion}): {}", labels.join(", "))?;
        }
        if !open.is_empty() {
            write!(
                text,
                "\n    not evaluated: {UNSEEN_BODY}: {}",
                open.join(", ")
            )?;
        }
        if let Some(route) = &goal.needle_route {
            let wanted_mm = resolved.scenario.criteria.min_clearance_mm.needle_route;
            let wanted_m = wanted_mm.map(|mm| mm * 1e-3);
            write!(text, "\n    {}", route_in_words(route, wanted_m))?;
        }
        if let Some(words) = fissures_in_words(&goal.fissures_crossed) {
            write!(text, "\n    {words}")?;
        }
        let target = &goal.target;
        let lesion = target.lesion.as_ref().map(|name| format!("lesion {name}"));
        let organ = target
            .organ
            .as_ref()
            .map(|name| format!("in {}", part_in_words(name)));
        let holds: Vec<String> = lesion.into_iter().chain(organ).collect();
        if let Some(beyond_m) = target.beyond_lesion_m {
            write!(
                text,
                "\n    target: {:.1} mm outside its lesion",
                beyond_m * 1e3
            )?;
        } else if !holds.is_empty() {
            write!(text, "\n    target: {}", holds.join(" "))?;
        } else if resolved.phantom.is_some() {
            write!(
                text,
                "\n    target: outside all lesions and organs of the phantom"
            )?;
        }
    }
    for note in &resolved.notes {
        write!(text, "\n  note: {note}")?;
    }
    Ok(text)
}
