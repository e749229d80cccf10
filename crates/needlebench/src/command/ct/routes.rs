//! `needlebench ct routes`.

use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use anyhow::{Context, Result};
use clap::Args;
use nalgebra::Vector3;
use needlebench_bench::rank_route;
use needlebench_input::{Finding, read_text};
use needlebench_parallel::Control;
use needlebench_patient::ct::{BuiltFolder, OverviewRow, ROUTES_FILE, SCENARIO_FILE, unlabelled};
use needlebench_patient::routes::{
    RoutePlan, RouteTask, SOLID_DIRECTIONS, VOXEL_DIRECTIONS, VoxelsError, WithRobot, free,
    plan_routes,
};
use needlebench_patient::{Stop, SuggestError};
use needlebench_report::files::{Folder, write_route_maps};
use needlebench_report::table::overview::unlabelled_text;
use needlebench_report::table::routes::routes_text;
use needlebench_report::write_atomically;
use needlebench_scenario::scenario::{GoalSection, Target};
use needlebench_scenario::{
    OpenScenario, Overrides, ResolvedScenario, ScenarioEdit, load_open_scenario, resolve_scenario,
};
use needlebench_show::layout;
use needlebench_volume::Remark;
use serde::Serialize;

use crate::arguments::{PicturesArguments, RobotArguments};
use crate::command::record_plan::Three;
use crate::command::results_folder::prepare_folder;
use crate::command::suggest::{ChosenEntry, set_entries, unplaced, write_scenario};
use crate::command::{overrides, print_json, print_text};
use crate::exit::ExitStatus;
use crate::failure::{Failure, status_of};
use crate::interrupts::{threads, watch_interrupts};
use crate::output::shown;
use crate::progress::TerminalProgress;

/// What `ct routes --help` prints after the options.
pub(crate) const ROUTES_HELP: &str = "\
Example: needlebench ct routes out/patient --lesion nodule --write out/patient/planned.toml

DIR is a folder of `ct build`: needle paths are planned in its voxels, and with the robot if the scan is registered to
it. For a scenario they are planned among the solids of its phantom.

Rules and odds ratios are those of [goals.route], with the defaults of `needlebench schema scenario`.

Writes routes.json, with every evaluated direction and the rule that rejects it, and an entry map for each target.

Exit status: 0 every target has a needle path that is feasible in the number of configurations that the scenario
requires, one of them recommended; or, if the robot is not checked (robot_not_asked has the reason), a path admissible
for the patient alone. 1 otherwise.";

#[derive(Debug, Args)]
#[expect(
    clippy::struct_excessive_bools,
    reason = "switches that do not depend on each other"
)]
pub(crate) struct RoutesArguments {
    /// Folder written by `ct build`, or a scenario.
    #[arg(value_name = "DIR|SCENARIO")]
    path: PathBuf,
    /// Target point, mm in the scan (left, posterior, superior); for a scenario without a scan, from mid-chest.
    #[arg(
        long,
        value_name = "X,Y,Z",
        allow_hyphen_values = true,
        conflicts_with = "lesion"
    )]
    target: Option<Three>,
    /// Target lesion, by name [default without --target: all goals of the scenario].
    #[arg(long, value_name = "NAME")]
    lesion: Option<String>,
    /// Number of directions to evaluate, evenly over the sphere [default: 20 000 in voxels, 4000 among solids].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(100..=1_000_000))]
    directions: Option<u32>,
    /// Check the robot at the room's base placement although the scan is not registered to it.
    #[arg(long)]
    assume_room: bool,
    /// Do not check the robot: plan for the patient alone.
    #[arg(long, conflicts_with = "assume_room")]
    no_robot: bool,
    /// Write the scenario with the entries of the chosen paths to a file.
    #[arg(long, value_name = "FILE")]
    write: Option<PathBuf>,
    /// With --write: replace an existing file.
    #[arg(long, requires = "write")]
    force: bool,
    /// Folder for routes.json and entry maps [default: the patient's folder; none for a scenario].
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print one JSON document instead of the tables; the directions are in the file only.
    #[arg(long)]
    json: bool,
    /// Number of threads [default: all cores]; does not affect results.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=256))]
    jobs: Option<u16>,
    #[command(flatten)]
    pictures: PicturesArguments,
    #[command(flatten)]
    robot: RobotArguments,
}

#[derive(Serialize)]
struct RoutesAnswer<'a> {
    schema_version: u32,
    ok: bool,
    findings: &'a [Finding],
    scenario: Option<&'a str>,
    /// Of the `report.json` of the patient's folder.
    build_sha256: Option<&'a str>,
    targets: &'a [RoutePlan],
    /// What a needle may meet that no label map shows, and what stands for it.
    unlabelled: &'a [OverviewRow],
    remarks: &'a [Remark],
    written: Option<String>,
}

struct Found {
    name: String,
    build_sha256: Option<String>,
    plans: Vec<RoutePlan>,
    unlabelled: Vec<OverviewRow>,
    remarks: Vec<Remark>,
    written: Option<PathBuf>,
}

impl Found {
    fn answer(&self) -> RoutesAnswer<'_> {
        RoutesAnswer {
            schema_version: 1,
            ok: self.is_served(),
            findings: &[],
            scenario: Some(&self.name),
            build_sha256: self.build_sha256.as_deref(),
            targets: &self.plans,
            unlabelled: &self.unlabelled,
            remarks: &self.remarks,
            written: self.written.as_deref().map(shown),
        }
    }

    /// Whether every target has a needle path.
    fn is_complete(&self) -> bool {
        self.plans.iter().all(|plan| plan.chosen.is_some())
    }

    /// Whether every target has a needle path and, if the robot was checked, a configuration for it.
    fn is_served(&self) -> bool {
        let chosen = |plan: &RoutePlan| {
            let chosen = plan.chosen.as_ref()?;
            Some(plan.robot_not_asked.is_some() || chosen.configuration.is_some())
        };
        self.plans.iter().all(|plan| chosen(plan) == Some(true))
    }
}

/// Plans needle paths.
pub(crate) fn routes(arguments: &RoutesArguments) -> Result<ExitStatus, Failure> {
    let cancel = watch_interrupts()?;
    let progress = TerminalProgress::new(arguments.json);
    let control = Control {
        threads: threads(arguments.jobs),
        cancel: &cancel,
        progress: &progress,
    };
    let found = overrides(&arguments.robot)
        .map_err(Stop::from)
        .and_then(|overrides| find(arguments, &overrides, &control));
    progress.finish();
    let mut found = match found {
        Ok(found) => found,
        Err(Stop::Refused(findings)) if arguments.json => {
            let answer = RoutesAnswer {
                schema_version: 1,
                ok: false,
                findings: &findings,
                scenario: None,
                build_sha256: None,
                targets: &[],
                unlabelled: &[],
                remarks: &[],
                written: None,
            };
            return Err(Failure::answered(status_of(&findings), &answer));
        }
        Err(stop) => return Err(Failure::of_stop(stop, "interrupted")),
    };
    let files = written_files(arguments, &found)?;
    if arguments.json {
        for plan in &mut found.plans {
            plan.map = None;
        }
        print_json(&found.answer())?;
    } else {
        print_text(&in_words(arguments, &found, files.as_deref()))?;
    }
    Ok(if found.is_served() {
        ExitStatus::Success
    } else {
        ExitStatus::CriterionFailed
    })
}

/// Writes `routes.json` and the maps; returns their folder, if there is one.
fn written_files(arguments: &RoutesArguments, found: &Found) -> Result<Option<PathBuf>, Failure> {
    let own = arguments.path.is_dir().then(|| arguments.path.clone());
    let Some(folder) = arguments.out.clone().or(own) else {
        return Ok(None);
    };
    prepare_folder(&folder)?;
    let text = serde_json::to_string(&found.answer()).map_err(anyhow::Error::from)?;
    let path = folder.join(ROUTES_FILE);
    write_atomically(&path, format!("{text}\n").as_bytes())
        .with_context(|| format!("cannot write {}", path.display()))?;
    if arguments.pictures.are_wanted(arguments.json) {
        write_route_maps(&found.name, &found.plans, Folder(&folder))
            .map_err(anyhow::Error::from)?;
    }
    Ok(Some(folder))
}

fn in_words(arguments: &RoutesArguments, found: &Found, folder: Option<&Path>) -> String {
    let unlabelled = unlabelled_text(&found.unlabelled);
    let mut parts: Vec<String> = (!unlabelled.is_empty())
        .then_some(unlabelled)
        .into_iter()
        .collect();
    parts.extend(found.plans.iter().map(routes_text));
    let mut last: Vec<String> = found
        .remarks
        .iter()
        .map(|remark| layout::wrapped(&format!("note: {}", remark.message)))
        .collect();
    if let Some(folder) = folder {
        let maps = if arguments.pictures.are_wanted(false) {
            " and entry maps"
        } else {
            ""
        };
        last.push(format!("routes.json{maps}: {}", shown(folder)));
    }
    match (&arguments.write, &found.written) {
        (_, Some(path)) => last.push(format!(
            "written: {0}; next: needlebench run {0}",
            shown(path)
        )),
        (Some(path), None) => last.push(format!(
            "not written: {}, because not every target has a needle path",
            shown(path)
        )),
        (None, None) => {}
    }
    if !last.is_empty() {
        parts.push(last.join("\n"));
    }
    let texts: Vec<String> = parts.iter().map(|part| layout::wrapped(part)).collect();
    texts.join("\n\n")
}

/// The patient that needle paths are planned in.
struct Patient {
    scenario: PathBuf,
    resolved: ResolvedScenario,
    goals: Vec<GoalSection>,
    built: Option<BuiltFolder>,
}

impl Patient {
    fn read(
        arguments: &RoutesArguments,
        overrides: &Overrides,
        cancel: &AtomicBool,
    ) -> Result<Self, Stop> {
        let path = &arguments.path;
        let (scenario, built) = if path.is_dir() {
            let built = BuiltFolder::read(path, cancel)?;
            (path.join(SCENARIO_FILE), Some(built))
        } else {
            (path.clone(), None)
        };
        let OpenScenario { resolved, goals } = load_open_scenario(&scenario, overrides)?;
        if let Some(built) = &built {
            built.check_scenario(&resolved.source.file, &resolved.scenario)?;
        }
        Ok(Self {
            scenario,
            resolved,
            goals,
            built,
        })
    }

    /// The goals that needle paths are planned to.
    fn sections(&self, arguments: &RoutesArguments) -> Result<Vec<GoalSection>, Finding> {
        let file = &self.resolved.source.file;
        let target = match (&arguments.lesion, arguments.target) {
            (Some(name), _) => Target::Lesion(name.clone()),
            (None, Some(Three(point))) => {
                let origin_m = self
                    .built
                    .as_ref()
                    .map_or_else(Vector3::zeros, BuiltFolder::origin_in_ct_m);
                Target::Point(std::array::from_fn(|k| point[k] - origin_m[k] * 1e3))
            }
            (None, None) => {
                let with_target = self.goals.iter().filter(|goal| goal.flange_pose.is_none());
                let all: Vec<GoalSection> = with_target.cloned().collect();
                if all.is_empty() {
                    return Err(Finding::new(
                        file,
                        "the scenario has no goal to plan a needle path to",
                    )
                    .key("goals")
                    .hint("name a target with --lesion NAME or --target X,Y,Z"));
                }
                return Ok(all);
            }
        };
        if let Target::Lesion(name) = &target
            && let Some(goal) = self
                .goals
                .iter()
                .find(|goal| goal.lesion.as_ref() == Some(name))
        {
            return Ok(vec![goal.clone()]);
        }
        let mut section = GoalSection::at(target);
        if let Some(like) = self.goals.iter().find(|goal| goal.flange_pose.is_none()) {
            section.standoff_mm = like.standoff_mm;
            section.approach_mm = like.approach_mm;
            section.route.clone_from(&like.route);
        }
        Ok(vec![section])
    }

    /// What no label map shows, as the rules of all goals take it.
    fn unlabelled(&self, arguments: &RoutesArguments) -> Result<Vec<OverviewRow>, Finding> {
        let Some(built) = &self.built else {
            return Ok(Vec::new());
        };
        let sections = self.sections(arguments)?;
        let routes: Vec<_> = sections
            .iter()
            .map(|goal| goal.route.clone().unwrap_or_default())
            .collect();
        let off = &self.resolved.scenario.planning.needle_route.off;
        let overview = &built.facts().overview;
        Ok(unlabelled(overview, &routes, off))
    }

    fn with_robot(&self, arguments: &RoutesArguments) -> WithRobot {
        if arguments.no_robot {
            return WithRobot::No("by --no-robot".to_owned());
        }
        match self.built.as_ref().and_then(BuiltFolder::not_registered) {
            Some(why) if !arguments.assume_room => WithRobot::No(format!(
                "{why}; --assume-room checks the robot at the room's base placement"
            )),
            _ => WithRobot::Yes,
        }
    }
}

fn find(
    arguments: &RoutesArguments,
    overrides: &Overrides,
    control: &Control<'_>,
) -> Result<Found, Stop> {
    refuse_existing(arguments)?;
    control.progress.message("reading");
    let patient = Patient::read(arguments, overrides, control.cancel)?;
    let file = patient.resolved.source.file.clone();
    let stop = |error: SuggestError| error.in_file(&file);
    let folder = patient.scenario.parent().unwrap_or(Path::new(""));
    let (mut plans, mut remarks, mut volume) = (Vec::new(), Vec::new(), None);
    for section in patient.sections(arguments)? {
        let rules = section.route.clone().unwrap_or_default();
        let in_voxels = patient.built.is_some();
        let usual = if in_voxels {
            VOXEL_DIRECTIONS
        } else {
            SOLID_DIRECTIONS
        };
        let task = RouteTask {
            resolved: &patient.resolved,
            section: &section,
            rules: &rules,
            robot: patient.with_robot(arguments),
            directions: arguments.directions.map_or(usual, |count| count as usize),
        };
        let mut plan = if let Some(built) = &patient.built {
            control.progress.message("distances");
            if task.route_rules().needle.is_some() && volume.is_none() {
                volume = built.volume_if_any(control.cancel)?;
            }
            let hu = volume.as_ref().map(|volume| volume.hu.as_slice());
            let anatomy = task
                .voxels(built, hu, control)
                .map_err(|error| match error {
                    VoxelsError::Scan(error) => Stop::of_scan(&patient.scenario, error),
                    VoxelsError::Target(finding) => finding.into(),
                })?;
            for remark in anatomy.remarks() {
                if !remarks.contains(remark) {
                    remarks.push(remark.clone());
                }
            }
            let mut plan = plan_routes(&task, &anatomy, control).map_err(stop)?;
            plan.phantom_origin_in_ct_m = Some(built.origin_in_ct_m().into());
            plan
        } else {
            let anatomy = task.solids().map_err(stop)?;
            plan_routes(&task, &anatomy, control).map_err(stop)?
        };
        free(&task, &mut plan, folder, overrides, control).map_err(stop)?;
        plans.push(plan);
    }
    let mut found = Found {
        unlabelled: patient.unlabelled(arguments)?,
        name: patient.resolved.scenario.name.clone(),
        build_sha256: patient
            .built
            .as_ref()
            .map(|built| built.sha256().to_owned()),
        plans,
        remarks,
        written: None,
    };
    let is_asked = found
        .plans
        .iter()
        .any(|plan| plan.robot_not_asked.is_none());
    if !is_asked && arguments.write.is_none() {
        return Ok(found);
    }
    match planned(arguments, &patient, &found, overrides) {
        Ok((edit, resolved)) => {
            rank_by_runs(&resolved, &mut found, control)?;
            if let Some(path) = arguments.write.as_ref().filter(|_| found.is_complete()) {
                write_scenario(path, &edit)?;
                found.written = Some(path.clone());
            }
        }
        Err(findings) if arguments.write.is_some() && found.is_complete() => {
            return Err(findings.into());
        }
        Err(findings) => {
            let why = findings.first().map_or("", |first| &first.message);
            for plan in &mut found.plans {
                not_ranked(plan, why);
            }
        }
    }
    Ok(found)
}

fn not_ranked(plan: &mut RoutePlan, why: &str) {
    if let Some(chosen) = &mut plan.chosen
        && plan.robot_not_asked.is_none()
    {
        chosen.leave_open(format!("the plan cannot be run: {why}"));
    }
}

/// Adds what `run` recommends on the chosen paths, if the robot was checked. A plan that cannot be run keeps its paths.
fn rank_by_runs(
    resolved: &ResolvedScenario,
    found: &mut Found,
    control: &Control<'_>,
) -> Result<(), Stop> {
    for plan in &mut found.plans {
        if plan.robot_not_asked.is_some() {
            continue;
        }
        match rank_route(resolved, plan, control) {
            Ok(()) => {}
            Err(SuggestError::Interrupted) => return Err(Stop::Interrupted),
            Err(error) => not_ranked(plan, &error.to_string()),
        }
    }
    Ok(())
}

fn refuse_existing(arguments: &RoutesArguments) -> Result<(), Finding> {
    match &arguments.write {
        Some(path) if path.exists() && !arguments.force => Err(Finding::new(
            path.display().to_string(),
            "the file exists already",
        )
        .key("--write")
        .hint("choose another name, or add --force")),
        Some(path) => same_folder(&arguments.path, path),
        None => Ok(()),
    }
}

/// Rejects a file that is not in the folder of the source scenario: its paths are relative to that folder.
fn same_folder(from: &Path, to: &Path) -> Result<(), Finding> {
    let own = if from.is_dir() {
        Some(from)
    } else {
        from.parent()
    };
    let real = |folder: Option<&Path>| {
        let folder = folder.filter(|each| !each.as_os_str().is_empty());
        folder.unwrap_or(Path::new(".")).canonicalize().ok()
    };
    if real(own) == real(to.parent()) {
        return Ok(());
    }
    let beside = own.unwrap_or(Path::new("")).join("planned.toml");
    Err(Finding::new(
        to.display().to_string(),
        "the file must be in the scenario's folder: paths are relative to it",
    )
    .key("--write")
    .hint(format!("write {}", shown(&beside))))
}

/// The scenario with the chosen needle paths, as text and resolved.
fn planned(
    arguments: &RoutesArguments,
    patient: &Patient,
    found: &Found,
    overrides: &Overrides,
) -> Result<(ScenarioEdit, ResolvedScenario), Vec<Finding>> {
    let file = &patient.resolved.source.file;
    let text = read_text(&patient.scenario)
        .map_err(|error| vec![Finding::new(file, error.to_string())])?;
    let mut edit = ScenarioEdit::new(file, &text).map_err(|finding| vec![finding])?;
    let chosen = found.plans.iter().filter_map(|plan| {
        Some(ChosenEntry {
            goal: &plan.goal,
            lesion: plan.lesion.as_deref(),
            target_in_phantom_m: plan.target_in_phantom_m,
            direction_deg: plan.routes[plan.chosen.as_ref()?.route].direction_deg,
        })
    });
    let set = set_entries(&mut edit, &patient.goals, chosen, "ct routes");
    set.map_err(|finding| vec![finding])?;
    let path = arguments.write.as_deref().unwrap_or(&patient.scenario);
    if arguments.write.is_some() {
        edit.name_after(path).map_err(|finding| vec![finding])?;
    }
    let (to, folder) = (path.display().to_string(), path.parent());
    let resolved = resolve_scenario(&to, edit.text(), folder.unwrap_or(Path::new("")), overrides);
    Ok((edit, resolved.map_err(unplaced)?))
}
