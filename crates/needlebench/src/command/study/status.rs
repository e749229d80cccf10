//! `needlebench study --status`: progress of the shards of a study.

use std::collections::BTreeMap;

use anyhow::Result;
use needlebench_bench::study::{PreparedStudy, SHARDS_VARIABLE, shards_of};
use needlebench_input::Finding;
use needlebench_study::{Shard, ShardState, Survey, ranges, survey};
use serde::Serialize;

use super::super::{print_json, print_text};
use super::{StudyArguments, variable};
use crate::exit::ExitStatus;
use crate::failure::Failure;
use crate::interrupts::threads;
use crate::output::{complain, shown};

#[derive(Serialize)]
struct StatusAnswer<'a> {
    schema_version: u32,
    name: &'a str,
    study_id: &'a str,
    /// Whether all cases are complete.
    complete: bool,
    cases: u64,
    /// Cases that some shard contains.
    done: u64,
    /// Largest number of shards of the study.
    blocks: u64,
    /// Number of parts that `missing` and `running` refer to; null if unknown.
    shards: Option<u32>,
    /// Other numbers of parts, with the number of folders of each.
    mixed: &'a BTreeMap<u32, usize>,
    /// Parts to start or restart.
    missing: &'a [u32],
    /// Parts that are being computed.
    running: &'a [u32],
    folders: Vec<FolderAnswer>,
}

#[derive(Serialize)]
struct FolderAnswer {
    folder: String,
    /// K/N; null for the whole study.
    shard: Option<String>,
    state: &'static str,
    done: u64,
    cases: u64,
}

fn word(state: ShardState) -> &'static str {
    match state {
        ShardState::Done => "done",
        ShardState::Running => "running",
        ShardState::Stopped => "stopped",
    }
}

/// Prints the progress of the shards; exit status 0 if all cases are complete.
pub(super) fn status(
    arguments: &StudyArguments,
    prepared: &PreparedStudy,
) -> Result<ExitStatus, Failure> {
    let manifest = prepared.manifest(None);
    let parts = shards_of(&variable)?;
    let threads = threads(arguments.results.jobs);
    let found = survey(&manifest, &arguments.status, parts, threads)?;
    let end = if found.is_complete() {
        ExitStatus::Success
    } else {
        ExitStatus::CriterionFailed
    };
    for line in remarks(&found) {
        complain(&line);
    }
    if arguments.missing {
        if found.parts.is_none() && !found.is_complete() {
            return Err(nobody_says(arguments).into());
        }
        if !found.running.is_empty() {
            complain(&format!(
                "not listed, because they are running: {}",
                ranges(found.running.iter().copied())
            ));
        }
        if !found.missing.is_empty() {
            print_text(&ranges(found.missing.iter().copied()))?;
        }
        return Ok(end);
    }
    if arguments.results.json {
        let folders = found.shards.iter();
        print_json(&StatusAnswer {
            schema_version: 1,
            name: &manifest.name,
            study_id: &manifest.study_id,
            complete: found.is_complete(),
            cases: found.cases,
            done: found.done,
            blocks: found.blocks,
            shards: found.parts,
            mixed: &found.mixed,
            missing: &found.missing,
            running: &found.running,
            folders: folders
                .map(|each| FolderAnswer {
                    folder: each.folder.display().to_string(),
                    shard: each.shard.map(|shard| shard.to_string()),
                    state: word(each.state),
                    done: each.done,
                    cases: each.cases,
                })
                .collect(),
        })?;
    } else {
        print_text(&text(&manifest.name, &found))?;
    }
    Ok(end)
}

fn nobody_says(arguments: &StudyArguments) -> Finding {
    Finding::new(
        shown(&arguments.status[0]),
        "no shard exists yet, so the number of shards is unknown",
    )
    .key("--missing")
    .hint(format!("set {SHARDS_VARIABLE} to the number of shards"))
}

/// Irregularities of the folders.
fn remarks(found: &Survey) -> Vec<String> {
    let mut lines = Vec::new();
    if let Some(first) = found.others.first() {
        lines.push(format!(
            "ignored, because they belong to other studies: {} folders, e.g. {}",
            found.others.len(),
            shown(first)
        ));
    }
    if let (Some(parts), false) = (found.parts, found.mixed.is_empty()) {
        let mixed = found.mixed.iter();
        let mixed: Vec<String> = mixed
            .map(|(parts, count)| format!("{count} of shards of {parts}"))
            .collect();
        lines.push(format!(
            "mixed shards: besides those of {parts} there are {}; their cases count, the numbers below refer to {parts}",
            mixed.join(", ")
        ));
    }
    lines
}

fn text(name: &str, found: &Survey) -> String {
    let of = found
        .parts
        .map_or(String::new(), |parts| format!(", in shards of {parts}"));
    let mut lines = vec![format!(
        "{name}: {} of {} cases complete{of}",
        found.done, found.cases
    )];
    for state in [ShardState::Done, ShardState::Running, ShardState::Stopped] {
        let count = found.count(state);
        let numbers: std::collections::BTreeSet<u32> = found
            .shards
            .iter()
            .filter(|each| each.state == state)
            .filter_map(|each| each.shard)
            .filter(|shard| Some(shard.parts()) == found.parts)
            .map(Shard::part)
            .collect();
        lines.push(line(word(state), count, &ranges(numbers)));
    }
    let begun = |part: &&u32| {
        let mut shards = found.shards.iter().filter_map(|each| each.shard);
        !shards.any(|shard| Some(shard.parts()) == found.parts && shard.part() == **part)
    };
    let begun: Vec<u32> = found.missing.iter().filter(begun).copied().collect();
    lines.push(line("missing", begun.len(), &ranges(begun)));
    if !found.missing.is_empty() {
        lines.push(format!(
            "to start or restart: {}",
            ranges(found.missing.iter().copied())
        ));
    }
    lines.join("\n")
}

fn line(word: &str, count: usize, numbers: &str) -> String {
    format!("{word:<8} {count:>5}  {numbers}")
        .trim_end()
        .to_owned()
}
