//! `needlebench roll-map`.

use crate::arguments::{PicturesArguments, RobotArguments};
use clap::{Args, ValueEnum};
use std::path::PathBuf;

use anyhow::Result;
use needlebench_clearance::ClearanceModel;
use needlebench_input::{Finding, nearest_name};
use needlebench_planning::Aim;
use needlebench_scenario::{Goal, ResolvedScenario};

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
    /// Scenario whose goals are mapped.
    #[arg(value_name = "SCENARIO")]
    pub scenario: PathBuf,
    /// Goal to map [default: all goals].
    #[arg(long, value_name = "NAME")]
    pub goal: Option<String>,
    /// Number of roll angles over 360 deg.
    #[arg(long, value_name = "N", default_value_t = 360, value_parser = clap::value_parser!(u32).range(3..=36_000))]
    pub rolls: u32,
    /// Criterion of the marked roll of each range [default: the scenario's `planning.roll_aim`]; the report has all of
    /// them.
    #[arg(long, value_enum)]
    pub aim: Option<AimArgument>,
    /// Folder for results; the scenario has a subfolder of its name.
    #[arg(long, value_name = "DIR", default_value = "out")]
    pub out: PathBuf,
    /// Print all columns at full width, with configurations that are infeasible at every roll among the rows.
    #[arg(long, conflicts_with = "json")]
    pub wide: bool,
    /// Print the roll map as one JSON document instead of the table.
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub pictures: PicturesArguments,
    /// Do not write the page.
    #[arg(long)]
    pub no_page: bool,
    /// Number of threads [default: all cores]; does not affect results.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=256))]
    pub jobs: Option<u16>,
    #[command(flatten)]
    pub robot: RobotArguments,
}

/// What a roll angle is optimised for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
#[value(rename_all = "snake_case")]
pub(crate) enum AimArgument {
    /// Soft minimum of the clearances of all classes.
    Clearance,
    /// Margin to the joint limits.
    JointMargin,
    /// Distance from singularities.
    Singularity,
    /// Least sensitivity of the needle tip to joint errors.
    TipAccuracy,
    /// Weighted mean of the utilities of all these.
    Balanced,
}

/// Computes and writes the roll map of one or all goals.
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
        let atlas = goal_atlas(&resolved, &model, goal, arguments.rolls, aim, threads).map_err(
            |error| Finding::new(&resolved.robot_description.source.file, error.to_string()),
        )?;
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
    // As `run`: a goal for which no configuration is feasible is a failure.
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
        let finding = Finding::new(&resolved.source.file, "the scenario has no goals");
        return Err(finding
            .key("goals")
            .hint("use `run` for a scenario with [iso9283]"));
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
    let finding = Finding::new(
        &resolved.source.file,
        format!("the scenario has no goal `{name}`"),
    );
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
