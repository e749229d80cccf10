//! `needlebench suggest`.

use std::path::{Path, PathBuf};

use anyhow::Result;
use clap::Args;
use needlebench_bench::suggest::{
    EntrySearch, PlaceSearch, at_place, plan_entry, plan_place, suggest_entries, suggest_places,
};
use needlebench_bench::{Preview, Runnable};
use needlebench_input::{Finding, nearest_name, read_text};
use needlebench_parallel::Control;
use needlebench_patient::{Stop, SuggestError};
use needlebench_report::files::{Folder, write_suggestions};
use needlebench_report::table::suggest::{entries_text, places_text};
use needlebench_report::write_atomically;
use needlebench_scenario::scenario::{GoalSection, Target};
use needlebench_scenario::{
    GoalPlacer, OpenScenario, Overrides, ResolvedScenario, ScenarioEdit, ScenarioFamily,
    load_open_scenario, resolve_scenario,
};
use serde::Serialize;

use super::record_plan::Three;
use super::results_folder::prepare_folder;
use super::{overrides, print_json, print_text};
use crate::arguments::RobotArguments;
use crate::exit::ExitStatus;
use crate::failure::Failure;
use crate::interrupts::{threads, watch_interrupts};
use crate::output::shown;
use crate::progress::TerminalProgress;

#[derive(Debug, Args)]
pub(crate) struct SuggestArguments {
    /// Scenario with patient, robot and room; its goals do not require entries.
    #[arg(value_name = "SCENARIO")]
    pub scenario: PathBuf,
    /// Goal of the scenario [default: all goals].
    #[arg(long, value_name = "NAME", conflicts_with_all = ["lesion", "target"])]
    pub goal: Option<String>,
    /// Lesion of the phantom, instead of the scenario's goals.
    #[arg(long, value_name = "NAME", conflicts_with = "target")]
    pub lesion: Option<String>,
    /// Target point in the patient, instead of the scenario's goals: left, posterior, superior from mid-chest, mm.
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true)]
    pub target: Option<Three>,
    /// Number of entries to propose per target; 0 for none.
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u8).range(0..=50))]
    pub entries: u8,
    /// Number of base placements to propose, for the first proposed entries, or with --entries 0 for those of the
    /// scenario; 0 for none.
    #[arg(long = "placements", alias = "places", value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u8).range(0..=50))]
    pub places: u8,
    /// Plan motions for the proposals and print the number of configurations that have one.
    #[arg(long)]
    pub planned: bool,
    /// Write the scenario with the first entries to a file, and with the first base placement if its own is infeasible
    /// or --entries is 0.
    #[arg(long, value_name = "FILE")]
    pub write: Option<PathBuf>,
    /// With --write: replace an existing file.
    #[arg(long, requires = "write")]
    pub force: bool,
    /// Folder for maps of skin and room, as PNG and SVG; the scenario has a subfolder of its name [default: no maps].
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Print one JSON document instead of the tables.
    #[arg(long)]
    pub json: bool,
    /// Number of threads [default: all cores]; does not affect results.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=256))]
    pub jobs: Option<u16>,
    #[command(flatten)]
    pub robot: RobotArguments,
}

#[derive(Serialize)]
struct SuggestAnswer<'a> {
    schema_version: u32,
    scenario: &'a str,
    ok: bool,
    entries: &'a [EntrySearch],
    places: Option<&'a PlaceSearch>,
    notes: &'a [String],
    written: Option<String>,
}

/// The proposals and their scenario.
struct Found {
    resolved: ResolvedScenario,
    entries: Vec<EntrySearch>,
    places: Option<PlaceSearch>,
}

impl Found {
    /// There is a proposal for every request.
    fn is_complete(&self) -> bool {
        self.entries.iter().all(|found| !found.entries.is_empty())
            && self
                .places
                .as_ref()
                .is_none_or(|found| !found.places.is_empty())
    }
}

/// Proposes entries and base placements for a scenario.
pub(crate) fn suggest(arguments: &SuggestArguments) -> Result<ExitStatus, Failure> {
    let cancel = watch_interrupts()?;
    let progress = TerminalProgress::new(false);
    let control = Control {
        threads: threads(arguments.jobs),
        cancel: &cancel,
        progress: &progress,
    };
    let answer = overrides(&arguments.robot)
        .map_err(Stop::from)
        .and_then(|overrides| {
            let found = find(arguments, &overrides, &control)?;
            let written = written(arguments, &found, &overrides)?;
            Ok((found, written))
        });
    progress.finish();
    let (found, written) = answer.map_err(|stop| Failure::of_stop(stop, "interrupted"))?;
    let name = &found.resolved.scenario.name;
    if let Some(out) = &arguments.out {
        let folder = out.join(name);
        prepare_folder(&folder)?;
        let places = found.places.as_ref();
        write_suggestions(&found.resolved, &found.entries, places, Folder(&folder))
            .map_err(anyhow::Error::from)?;
    }
    if arguments.json {
        print_json(&SuggestAnswer {
            schema_version: 1,
            scenario: name,
            ok: found.is_complete(),
            entries: &found.entries,
            places: found.places.as_ref(),
            notes: &found.resolved.notes,
            written: written.as_deref().map(shown),
        })?;
    } else {
        print_text(&in_words(arguments, &found, written.as_deref()))?;
    }
    Ok(if found.is_complete() {
        ExitStatus::Success
    } else {
        ExitStatus::CriterionFailed
    })
}

fn in_words(arguments: &SuggestArguments, found: &Found, written: Option<&Path>) -> String {
    let mut parts: Vec<String> = found.entries.iter().map(entries_text).collect();
    parts.extend(found.places.as_ref().map(places_text));
    let notes = found.resolved.notes.iter();
    let assumed = notes.filter(|note| note.starts_with("assumed, since"));
    let mut last: Vec<String> = assumed.map(|note| format!("note: {note}")).collect();
    if let Some(out) = &arguments.out {
        let folder = out.join(&found.resolved.scenario.name);
        last.push(format!("maps: {}", shown(&folder)));
    }
    if let (Some(path), None) = (&arguments.write, written) {
        last.push(format!(
            "not written: {}, because not every request has a proposal",
            shown(path)
        ));
    }
    if let Some(path) = written {
        last.push(format!(
            "written: {0}; next: needlebench run {0}",
            shown(path)
        ));
    }
    if !last.is_empty() {
        parts.push(last.join("\n"));
    }
    parts.join("\n\n")
}

fn find(
    arguments: &SuggestArguments,
    overrides: &Overrides,
    control: &Control<'_>,
) -> Result<Found, Stop> {
    let OpenScenario {
        mut resolved,
        goals,
    } = load_open_scenario(&arguments.scenario, overrides)?;
    let file = resolved.source.file.clone();
    let stop = |error: SuggestError| error.in_file(&file);
    let mut sections = sections(arguments, &file, goals.clone())?;
    // The written scenario must be feasible for its other goals too.
    let rest: Vec<GoalSection> = goals
        .into_iter()
        .filter(|goal| arguments.write.is_some() && has_entry(goal))
        .filter(|goal| sections.iter().all(|each| each.name != goal.name))
        .collect();
    let (mut entries, mut best) = (Vec::new(), Vec::new());
    for section in &sections {
        // Base placements require an entry too.
        let is_needed = arguments.entries > 0 || !has_entry(section);
        if !is_needed {
            best.push(None);
            continue;
        }
        let count = usize::from(arguments.entries.max(1));
        let mut found = suggest_entries(&resolved, section, count, control).map_err(stop)?;
        let first = found.entries.first().map(|entry| entry.direction_deg);
        best.push(first.or(found.best_route_deg));
        if arguments.planned {
            for entry in &mut found.entries {
                plan_entry(&resolved, section, entry).map_err(stop)?;
            }
        }
        if arguments.entries > 0 {
            entries.push(found);
        }
    }
    let mut places = None;
    if arguments.places > 0 {
        for (section, best) in sections.iter_mut().zip(best) {
            // The first proposal, or without proposals the best needle path.
            if best.is_some() {
                section.entry_mm = None;
                section.entry_direction_deg = best;
            }
        }
        sections.extend(rest);
        let placer = GoalPlacer::new(&resolved);
        let placed = sections.iter().map(|section| placer.place(section));
        let placed: Result<Vec<_>, Finding> = placed.collect();
        let (goals, names) = match placed {
            Ok(goals) => {
                let names: Vec<String> = goals.iter().map(|goal| goal.name.clone()).collect();
                (goals, names)
            }
            // Without an entry there is no base placement.
            Err(_) if entries.iter().any(|found| found.allowed == 0) => {
                return Ok(Found {
                    resolved,
                    entries,
                    places,
                });
            }
            Err(finding) => return Err(finding.into()),
        };
        resolved.goals = goals;
        resolved.scenario.goals = sections;
        let folder = arguments.scenario.parent().unwrap_or(Path::new(""));
        let family = ScenarioFamily::of(resolved.clone(), folder, overrides)?;
        let count = usize::from(arguments.places);
        let mut found = suggest_places(&family, &names, count, control).map_err(stop)?;
        if arguments.planned {
            for place in &mut found.places {
                plan_place(&family, place).map_err(stop)?;
            }
        }
        // From an infeasible base placement, the entries are those for the first proposed one.
        if let Some(first) = found.places.first() {
            for each in entries.iter_mut().filter(|each| each.entries.is_empty()) {
                let moved = at_place(&family, &each.goal, first).map_err(stop)?;
                let section = &moved.scenario.goals[0];
                let count = usize::from(arguments.entries);
                *each = suggest_entries(&moved, section, count, control).map_err(stop)?;
            }
        }
        places = Some(found);
    }
    Ok(Found {
        resolved,
        entries,
        places,
    })
}

/// Whether it determines the guide's pose.
fn has_entry(goal: &GoalSection) -> bool {
    goal.entry_mm.is_some() || goal.entry_direction_deg.is_some() || goal.flange_pose.is_some()
}

/// The goals to reach.
fn sections(
    arguments: &SuggestArguments,
    file: &str,
    goals: Vec<GoalSection>,
) -> Result<Vec<GoalSection>, Finding> {
    let target = match (&arguments.lesion, arguments.target) {
        (Some(name), _) => Some(Target::Lesion(name.clone())),
        (None, Some(Three(point))) => Some(Target::Point(point)),
        (None, None) => None,
    };
    if let Some(target) = target {
        // With the stand-off of the scenario's first goal, if it has one.
        let like = goals.first();
        let mut section = GoalSection::at(target);
        if let Some(like) = like.filter(|goal| goal.flange_pose.is_none()) {
            section.standoff_mm = like.standoff_mm;
            section.approach_mm = like.approach_mm;
        }
        return Ok(vec![section]);
    }
    if goals.is_empty() {
        return Err(
            Finding::new(file, "the scenario has no goal to propose entries for")
                .key("goals")
                .hint("name a target with --lesion NAME or --target X,Y,Z"),
        );
    }
    let Some(name) = &arguments.goal else {
        return Ok(goals);
    };
    let names: Vec<String> = goals.iter().map(|goal| goal.name.clone()).collect();
    let found: Vec<GoalSection> = goals
        .into_iter()
        .filter(|goal| goal.name == *name)
        .collect();
    if !found.is_empty() {
        return Ok(found);
    }
    let near = nearest_name(name, names.iter().map(String::as_str));
    let finding = Finding::new(file, format!("the scenario has no goal `{name}`")).key("--goal");
    Err(finding.hint(match near {
        Some(near) => format!("did you mean `{near}`?"),
        None => format!("goals: {}", names.join(", ")),
    }))
}

/// Writes the scenario with the first proposals, if requested and if they pass `check`.
fn written(
    arguments: &SuggestArguments,
    found: &Found,
    overrides: &Overrides,
) -> Result<Option<PathBuf>, Stop> {
    let Some(path) = &arguments.write else {
        return Ok(None);
    };
    let to = path.display().to_string();
    if !found.is_complete() {
        return Ok(None);
    }
    if path.exists() && !arguments.force {
        return Err(Finding::new(&to, "the file exists already")
            .key("--write")
            .hint("choose another name, or add --force")
            .into());
    }
    let file = &found.resolved.source.file;
    let text =
        read_text(&arguments.scenario).map_err(|error| Finding::new(file, error.to_string()))?;
    let mut edit = ScenarioEdit::new(file, &text)?;
    let own = load_open_scenario(&arguments.scenario, overrides)?.goals;
    let chosen = found.entries.iter().map(|search| ChosenEntry {
        goal: &search.goal,
        lesion: search.lesion.as_deref(),
        target_in_phantom_m: search.target_in_phantom_m,
        direction_deg: search.entries[0].direction_deg,
    });
    set_entries(&mut edit, &own, chosen, "suggest")?;
    // A feasible base placement is kept, unless only placements were requested.
    let place = found
        .places
        .as_ref()
        .filter(|found| found.present.is_none() || arguments.entries == 0);
    if let Some(place) = place.and_then(|found| found.places.first()) {
        for line in place.toml.lines() {
            if let Some((key, value)) = line.split_once(" = ") {
                edit.set("robot", key, value)?;
            }
        }
    }
    edit.name_after(path)?;
    let folder = path.parent().unwrap_or(Path::new(""));
    let resolved = resolve_scenario(&to, edit.text(), folder, overrides).map_err(unplaced)?;
    let runnable = Runnable::checked(resolved)?;
    let (_, findings) =
        Preview::of(runnable.scenario()).map_err(|error| Finding::new(&to, error.to_string()))?;
    if let Some(first) = findings.into_iter().next() {
        let message = format!(
            "the proposal fails together with the rest of the scenario: {}",
            first.message
        );
        let hint = "other goals may require another base placement: propose for all of them, without --goal, --lesion and --target";
        return Err(Finding { message, ..first }.hint(hint).into());
    }
    write_scenario(path, &edit)?;
    Ok(Some(path.clone()))
}

/// Writes an edited scenario to the file of `--write`.
pub(super) fn write_scenario(path: &Path, edit: &ScenarioEdit) -> Result<(), Finding> {
    write_atomically(path, edit.text().as_bytes()).map_err(|error| {
        let to = path.display().to_string();
        Finding::new(to, format!("cannot be written: {error}")).key("--write")
    })
}

/// The chosen entry for a target.
pub(super) struct ChosenEntry<'a> {
    pub goal: &'a str,
    pub lesion: Option<&'a str>,
    pub target_in_phantom_m: [f64; 3],
    pub direction_deg: [f64; 2],
}

/// Sets the entries of goals of a scenario, and adds missing goals with their targets.
pub(super) fn set_entries<'a>(
    edit: &mut ScenarioEdit,
    own: &[GoalSection],
    chosen: impl Iterator<Item = ChosenEntry<'a>>,
    by: &str,
) -> Result<(), Finding> {
    let mut next = own.len();
    for entry in chosen {
        let index = own.iter().position(|goal| goal.name == entry.goal);
        let section = format!("goals[{}]", index.unwrap_or(next));
        if index.is_none() {
            next += 1;
            edit.set(&section, "name", &format!("\"{}\"", entry.goal))?;
            let [x, y, z] = entry.target_in_phantom_m.map(|m| (m * 1e4).round() / 10.0);
            match entry.lesion {
                Some(lesion) => edit.set(&section, "lesion", &format!("\"{lesion}\""))?,
                None => edit.set(&section, "target_mm", &format!("[{x}, {y}, {z}]"))?,
            }
            // It was evaluated with these.
            if let Some(like) = own.first().filter(|goal| goal.flange_pose.is_none()) {
                edit.set(&section, "standoff_mm", &format!("{}", like.standoff_mm))?;
                edit.set(&section, "approach_mm", &format!("{}", like.approach_mm))?;
            }
        }
        let [azimuth, elevation] = entry.direction_deg;
        // Comments on the lines of the former entry are removed with it; others cannot be identified.
        let length = edit.text().len();
        edit.remove(&section, "entry_mm")?;
        edit.remove(&section, "entry_direction_deg")?;
        edit.remove(&section, "route")?;
        let former = if edit.text().len() < length {
            "; comments here may refer to the former entry"
        } else {
            ""
        };
        let value = format!("[{azimuth}, {elevation}] # proposed by {by}{former}");
        edit.set(&section, "entry_direction_deg", &value)?;
    }
    Ok(())
}

/// Removes line numbers: they refer to a file that does not exist.
pub(super) fn unplaced(findings: Vec<Finding>) -> Vec<Finding> {
    let findings = findings.into_iter();
    findings
        .map(|finding| Finding {
            line: None,
            span: None,
            ..finding
        })
        .collect()
}
