//! `needlebench atlas`.

use std::path::Path;

use anyhow::{Context, Result};
use needlebench_cell::{Finding, Goal, ResolvedScenario, nearest_name};
use needlebench_clearance::ClearanceModel;
use needlebench_planning::Aim;

use super::{load, overrides, print_json, print_text};
use crate::atlas::{AtlasReport, GoalAtlas, GoalAtlasReport, goal_atlas, picture, text};
use crate::atomic::write_atomically;
use crate::cli::{AimArgument, AtlasArguments};
use crate::exit::ExitStatus;
use crate::output::findings::print_findings;
use crate::page::atlas_page;

/// Computes and writes the atlas of one or all goals.
pub(crate) fn atlas(arguments: &AtlasArguments) -> Result<ExitStatus> {
    let refuse = |finding: Finding| {
        print_findings(&[finding]);
        Ok(ExitStatus::BadInput)
    };
    let overrides = match overrides(&arguments.robot) {
        Ok(overrides) => overrides,
        Err(finding) => return refuse(finding),
    };
    let Some(resolved) = load(&arguments.scenario, &overrides) else {
        return Ok(ExitStatus::BadInput);
    };
    let goals = match goals(&resolved, arguments.goal.as_deref()) {
        Ok(goals) => goals,
        Err(finding) => return refuse(finding),
    };
    let aim = arguments
        .aim
        .map_or(resolved.scenario.planning.roll_aim, aim_of);
    let threads = arguments.jobs.map_or_else(
        || std::thread::available_parallelism().map_or(1, usize::from),
        usize::from,
    );
    let folder = arguments.out.join(&resolved.scenario.name);
    if let Err(error) = std::fs::create_dir_all(&folder) {
        return refuse(
            Finding::new(
                folder.display().to_string(),
                format!("the results folder cannot be written: {error}"),
            )
            .key("--out")
            .hint("choose another folder with --out DIR"),
        );
    }
    let model = ClearanceModel::new(&resolved.cell);
    let mut atlases: Vec<(&Goal, GoalAtlas)> = Vec::new();
    for goal in goals {
        match goal_atlas(&resolved, &model, goal, arguments.rolls, aim, threads) {
            Ok(atlas) => atlases.push((goal, atlas)),
            Err(error) => {
                return refuse(Finding::new(
                    &resolved.cell.robot.source.file,
                    error.to_string(),
                ));
            }
        }
    }
    let reports = atlases
        .iter()
        .map(|(goal, atlas)| GoalAtlasReport::new(&resolved.cell, goal, atlas))
        .collect();
    let report = AtlasReport::new(&resolved, reports);
    write(
        &resolved,
        &folder,
        &atlases,
        &report,
        !arguments.no_pictures,
        !arguments.no_page,
    )?;
    if arguments.json {
        print_json(&report)?;
    } else {
        let tables: Vec<String> = atlases
            .iter()
            .map(|(goal, atlas)| text(&resolved.cell, goal, atlas))
            .collect();
        print_text(&format!(
            "{}\n\n{}\nresults: {}",
            resolved.scenario.name,
            tables.join("\n\n"),
            folder.display()
        ))?;
    }
    // As `run`: a goal that no configuration can serve is a failure.
    let all_work = atlases.iter().all(|(_, atlas)| atlas.works());
    Ok(if all_work {
        ExitStatus::Success
    } else {
        ExitStatus::CriterionFailed
    })
}

fn goals<'r>(resolved: &'r ResolvedScenario, name: Option<&str>) -> Result<Vec<&'r Goal>, Finding> {
    if resolved.goals.is_empty() {
        let finding = Finding::new(&resolved.source.file, "it has no goals to look at");
        return Err(finding
            .key("goals")
            .hint("a scenario with [iso9283] is for `run`"));
    }
    let Some(name) = name else {
        return Ok(resolved.goals.iter().collect());
    };
    let found: Vec<&Goal> = resolved
        .goals
        .iter()
        .filter(|goal| goal.name == name)
        .collect();
    if !found.is_empty() {
        return Ok(found);
    }
    let names: Vec<&str> = resolved.goals.iter().map(|goal| &*goal.name).collect();
    let finding = Finding::new(&resolved.source.file, format!("it has no goal `{name}`"));
    Err(
        finding.hint(match nearest_name(name, names.iter().copied()) {
            Some(near) => format!("did you mean `{near}`? Goals: {}", names.join(", ")),
            None => format!("goals: {}", names.join(", ")),
        }),
    )
}

fn aim_of(argument: AimArgument) -> Aim {
    match argument {
        AimArgument::Clearance => Aim::Clearance,
        AimArgument::JointMargin => Aim::JointMargin,
        AimArgument::Singularity => Aim::Singularity,
        AimArgument::TipAccuracy => Aim::TipAccuracy,
        AimArgument::Balanced => Aim::Balanced,
    }
}

fn write(
    resolved: &ResolvedScenario,
    folder: &Path,
    atlases: &[(&Goal, GoalAtlas)],
    report: &AtlasReport,
    pictures: bool,
    page: bool,
) -> Result<()> {
    let path = folder.join("atlas.json");
    let mut json = serde_json::to_vec(report)?;
    json.push(b'\n');
    write_atomically(&path, &json).with_context(|| format!("cannot write {}", path.display()))?;
    let path = folder.join("atlas.html");
    if page {
        let html = atlas_page(resolved, atlases, report);
        write_atomically(&path, html.as_bytes())
            .with_context(|| format!("cannot write {}", path.display()))?;
    } else if path.exists() {
        // Nobody should take an earlier atlas's for this one's.
        std::fs::remove_file(&path)?;
    }
    if pictures {
        for (goal, atlas) in atlases {
            picture(&resolved.scenario.name, goal, atlas)
                .write_png(&folder.join(format!("{}.atlas.png", goal.name)))?;
        }
    }
    Ok(())
}
