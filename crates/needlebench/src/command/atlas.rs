//! `needlebench atlas`.

use crate::arguments::{PicturesArguments, RobotArguments};
use clap::{Args, ValueEnum};
use std::path::PathBuf;

use anyhow::Result;
use needlebench_cell::{Finding, Goal, ResolvedScenario, nearest_name};
use needlebench_clearance::ClearanceModel;
use needlebench_planning::Aim;

use super::results_folder::ResultsFolder;
use super::{load, overrides, print_json, print_text};
use crate::output::{print_wide, shown};

use crate::exit::ExitStatus;
use crate::failure::Failure;
use needlebench_bench::atlas::{AtlasReport, GoalAtlas, GoalAtlasReport, goal_atlas};
use needlebench_report::files::{Folder, write_atlas};
use needlebench_report::table::atlas::text;

#[derive(Debug, Args)]
pub(crate) struct AtlasArguments {
    /// Scenario whose goals are looked at.
    #[arg(value_name = "SCENARIO")]
    pub scenario: PathBuf,
    /// One goal; all of them if left out.
    #[arg(long, value_name = "NAME")]
    pub goal: Option<String>,
    /// Rolls all round.
    #[arg(long, value_name = "N", default_value_t = 360, value_parser = clap::value_parser!(u32).range(3..=36_000))]
    pub rolls: u32,
    /// What the marked roll of each range is best at; the scenario's `planning.roll_aim` if left out.
    /// The report has all aims.
    #[arg(long, value_enum)]
    pub aim: Option<AimArgument>,
    /// Folder for results; the scenario gets a folder of its name in it.
    #[arg(long, value_name = "DIR", default_value = "out")]
    pub out: PathBuf,
    /// Print all columns, as wide as they are, and what works nowhere among the rows.
    #[arg(long, conflicts_with = "json")]
    pub wide: bool,
    /// Print the atlas as one JSON document instead of the table.
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub pictures: PicturesArguments,
    /// Write no page.
    #[arg(long)]
    pub no_page: bool,
    /// Threads; the number of cores if left out. Results do not depend on it.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=256))]
    pub jobs: Option<u16>,
    #[command(flatten)]
    pub robot: RobotArguments,
}

/// What a roll is best at.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
#[value(rename_all = "snake_case")]
pub(crate) enum AimArgument {
    /// Soft least clearance over all classes.
    Clearance,
    /// Margin to the joint limits.
    JointMargin,
    /// Distance from singularities.
    Singularity,
    /// Least motion of the needle's tip under errors of the joints.
    TipAccuracy,
    /// Weighted mean of the utilities of all these.
    Balanced,
}

/// Computes and writes the atlas of one or all goals.
pub(crate) fn atlas(arguments: &AtlasArguments) -> Result<ExitStatus, Failure> {
    if arguments.wide {
        print_wide();
    }
    let overrides = overrides(&arguments.robot)?;
    let resolved = load(&arguments.scenario, &overrides)?;
    let goals = goals(&resolved, arguments.goal.as_deref())?;
    let aim = arguments
        .aim
        .map_or(resolved.scenario.planning.roll_aim, aim_of);
    let threads = arguments.jobs.map_or_else(
        || std::thread::available_parallelism().map_or(1, usize::from),
        usize::from,
    );
    let folder = arguments.out.join(&resolved.scenario.name);
    let _taken = ResultsFolder::take(&folder)?;
    let model = ClearanceModel::new(&resolved.cell);
    let mut atlases: Vec<(&Goal, GoalAtlas)> = Vec::new();
    for goal in goals {
        let atlas = goal_atlas(&resolved, &model, goal, arguments.rolls, aim, threads)
            .map_err(|error| Finding::new(&resolved.cell.robot.source.file, error.to_string()))?;
        atlases.push((goal, atlas));
    }
    let reports = atlases
        .iter()
        .map(|(goal, atlas)| GoalAtlasReport::new(&resolved.cell, goal, atlas))
        .collect();
    let report = AtlasReport::new(&resolved, reports);
    write_atlas(
        &resolved,
        &atlases,
        &report,
        Folder(&folder),
        [arguments.pictures.are_wanted(false), !arguments.no_page],
    )
    .map_err(anyhow::Error::from)?;
    if arguments.json {
        print_json(&report)?;
    } else {
        let tables: Vec<String> = atlases
            .iter()
            .map(|(goal, atlas)| text(&resolved.cell, goal, atlas, arguments.wide))
            .collect();
        print_text(&format!(
            "{}\n\n{}\nresults: {}",
            resolved.scenario.name,
            tables.join("\n\n"),
            shown(&folder)
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

/// The goals of a scenario, or the one of a name.
pub(super) fn goals<'r>(
    resolved: &'r ResolvedScenario,
    name: Option<&str>,
) -> Result<Vec<&'r Goal>, Finding> {
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
