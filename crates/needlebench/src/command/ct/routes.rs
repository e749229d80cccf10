//! `needlebench ct routes`.

use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use anyhow::{Context, Result};
use clap::Args;
use nalgebra::Vector3;
use needlebench_bench::ct::{BuiltFolder, SCENARIO_FILE};
use needlebench_bench::routes::{
    RoutePlan, RouteTask, SOLID_DIRECTIONS, VOXEL_DIRECTIONS, VoxelsError, WithRobot, free,
    plan_routes,
};
use needlebench_bench::suggest::SuggestError;
use needlebench_bench::{Control, Stop};
use needlebench_cell::scenario::{GoalSection, Target};
use needlebench_cell::{
    Finding, OpenScenario, Overrides, ResolvedScenario, ScenarioEdit, load_open_scenario,
    read_text, resolve_scenario,
};
use needlebench_imaging::Remark;
use needlebench_report::files::{Folder, write_route_maps};
use needlebench_report::table::routes::routes_text;
use needlebench_report::{layout, write_atomically};
use serde::Serialize;

use crate::arguments::{PicturesArguments, RobotArguments};
use crate::command::record_plan::Three;
use crate::command::results_folder::prepare_folder;
use crate::command::suggest::{ChosenEntry, set_entries, unplaced};
use crate::command::{overrides, print_json, print_text};
use crate::exit::ExitStatus;
use crate::failure::Failure;
use crate::interrupts::{threads, watch_interrupts};
use crate::output::shown;
use crate::progress::TerminalProgress;

/// What `ct routes --help` says after the options.
pub(crate) const ROUTES_HELP: &str = "\
Example: needlebench ct routes out/patient --lesion nodule --write out/patient/planned.toml

DIR is a folder of `ct build`: routes are planned in its voxels, and with the robot if the scan was registered to it. For a
scenario they are planned among the solids of its phantom.

Rules and odds ratios are those of the goal's [goals.route], with the defaults of `needlebench schema scenario`.

Writes routes.json, with every direction that was judged and the rule that refuses it, and an entry map for each target.

Exit status: 0 there is a route for every target, served in as many configurations as the scenario wants, or, where no robot
is asked (robot_not_asked says why), free by the patient alone; 1 there is not.";

#[derive(Debug, Args)]
#[expect(
    clippy::struct_excessive_bools,
    reason = "switches that do not depend on each other"
)]
pub(crate) struct RoutesArguments {
    /// Folder that `ct build` has written, or a scenario.
    #[arg(value_name = "DIR|SCENARIO")]
    path: PathBuf,
    /// A target: mm of the scan (left, posterior, superior); of a scenario without a scan, from mid-chest.
    #[arg(
        long,
        value_name = "X,Y,Z",
        allow_negative_numbers = true,
        conflicts_with = "lesion"
    )]
    target: Option<Three>,
    /// A lesion, by name; all goals of the scenario if neither is given.
    #[arg(long, value_name = "NAME")]
    lesion: Option<String>,
    /// Directions to judge, evenly over the sphere: 20 000 in voxels and 4000 among solids if left out.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(100..=1_000_000))]
    directions: Option<u32>,
    /// Ask the robot where the room has it, although the scan is not registered to it.
    #[arg(long)]
    assume_room: bool,
    /// Ask no robot: routes by the patient alone.
    #[arg(long, conflicts_with = "assume_room")]
    no_robot: bool,
    /// Write the scenario with the chosen routes as entries to a file.
    #[arg(long, value_name = "FILE")]
    write: Option<PathBuf>,
    /// With --write: replace a file that is there.
    #[arg(long, requires = "write")]
    force: bool,
    /// Folder for routes.json and entry maps; that of the patient if left out, and for a scenario none are written.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print one JSON document instead of the tables; every direction is in the file alone.
    #[arg(long)]
    json: bool,
    /// Threads; the number of cores if left out. Results do not depend on it.
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
    targets: &'a [RoutePlan],
    remarks: &'a [Remark],
    written: Option<String>,
}

struct Found {
    name: String,
    plans: Vec<RoutePlan>,
    remarks: Vec<Remark>,
    written: Option<PathBuf>,
}

impl Found {
    fn answer(&self) -> RoutesAnswer<'_> {
        RoutesAnswer {
            schema_version: 1,
            ok: self.is_complete(),
            findings: &[],
            scenario: Some(&self.name),
            targets: &self.plans,
            remarks: &self.remarks,
            written: self.written.as_deref().map(shown),
        }
    }

    fn is_complete(&self) -> bool {
        self.plans.iter().all(|plan| plan.chosen.is_some())
    }
}

/// Plans routes.
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
            print_json(&RoutesAnswer {
                schema_version: 1,
                ok: false,
                findings: &findings,
                scenario: None,
                targets: &[],
                remarks: &[],
                written: None,
            })?;
            return Ok(ExitStatus::BadInput);
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
    Ok(if found.is_complete() {
        ExitStatus::Success
    } else {
        ExitStatus::CriterionFailed
    })
}

/// Writes `routes.json` and the maps; the folder that they are in, if they are wanted.
fn written_files(arguments: &RoutesArguments, found: &Found) -> Result<Option<PathBuf>, Failure> {
    let own = arguments.path.is_dir().then(|| arguments.path.clone());
    let Some(folder) = arguments.out.clone().or(own) else {
        return Ok(None);
    };
    prepare_folder(&folder)?;
    let text = serde_json::to_string(&found.answer()).map_err(anyhow::Error::from)?;
    let path = folder.join("routes.json");
    write_atomically(&path, format!("{text}\n").as_bytes())
        .with_context(|| format!("cannot write {}", path.display()))?;
    if arguments.pictures.are_wanted(arguments.json) {
        write_route_maps(&found.name, &found.plans, Folder(&folder))
            .map_err(anyhow::Error::from)?;
    }
    Ok(Some(folder))
}

fn in_words(arguments: &RoutesArguments, found: &Found, folder: Option<&Path>) -> String {
    let mut parts: Vec<String> = found.plans.iter().map(routes_text).collect();
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
            "not written: {}, since not every target has a route",
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

/// What routes are planned in.
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

    /// What routes are planned to.
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
                    return Err(Finding::new(file, "it has no goal to plan a route to")
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

    fn with_robot(&self, arguments: &RoutesArguments) -> WithRobot {
        if arguments.no_robot {
            return WithRobot::No("by --no-robot".to_owned());
        }
        match self.built.as_ref().and_then(BuiltFolder::not_registered) {
            Some(why) if !arguments.assume_room => WithRobot::No(format!(
                "{why}; --assume-room asks the robot where the room has it"
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
    let (mut plans, mut remarks) = (Vec::new(), Vec::new());
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
            let anatomy = task.voxels(built, control).map_err(|error| match error {
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
        name: patient.resolved.scenario.name.clone(),
        plans,
        remarks,
        written: None,
    };
    found.written = written(arguments, &patient, &found, overrides)?;
    Ok(found)
}

fn refuse_existing(arguments: &RoutesArguments) -> Result<(), Finding> {
    match &arguments.write {
        Some(path) if path.exists() && !arguments.force => Err(Finding::new(
            path.display().to_string(),
            "there is such a file already",
        )
        .key("--write")
        .hint("choose another name, or replace it with --force")),
        Some(path) => same_folder(&arguments.path, path),
        None => Ok(()),
    }
}

/// Refuses to write a scenario elsewhere than beside the one that it is made of: its paths are relative to that.
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
        "it has to be beside the scenario, whose paths are relative to it",
    )
    .key("--write")
    .hint(format!("write {}", shown(&beside))))
}

/// Writes the scenario with the chosen routes, if that is wanted and all targets have one.
fn written(
    arguments: &RoutesArguments,
    patient: &Patient,
    found: &Found,
    overrides: &Overrides,
) -> Result<Option<PathBuf>, Stop> {
    let Some(path) = arguments.write.as_ref().filter(|_| found.is_complete()) else {
        return Ok(None);
    };
    let to = path.display().to_string();
    let file = &patient.resolved.source.file;
    let text =
        read_text(&patient.scenario).map_err(|error| Finding::new(file, error.to_string()))?;
    let mut edit = ScenarioEdit::new(file, &text)?;
    let chosen = found.plans.iter().filter_map(|plan| {
        Some(ChosenEntry {
            goal: &plan.goal,
            lesion: plan.lesion.as_deref(),
            target_in_phantom_m: plan.target_in_phantom_m,
            direction_deg: plan.routes[plan.chosen.as_ref()?.route].direction_deg,
        })
    });
    set_entries(&mut edit, &patient.goals, chosen, "ct routes")?;
    edit.name_after(path)?;
    let folder = path.parent().unwrap_or(Path::new(""));
    resolve_scenario(&to, edit.text(), folder, overrides).map_err(unplaced)?;
    write_atomically(path, edit.text().as_bytes())
        .map_err(|error| Finding::new(&to, format!("cannot be written: {error}")).key("--write"))?;
    Ok(Some(path.clone()))
}
