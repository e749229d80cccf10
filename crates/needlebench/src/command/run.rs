//! `needlebench run`.

use std::fs::OpenOptions;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Instant;

use anyhow::{Context, Result};
use needlebench_cell::{Finding, ResolvedScenario};
use needlebench_evaluation::report::{Report, Verdict};
use needlebench_evaluation::room::RoomModel;
use needlebench_planning::GoalPlan;
use serde::Serialize;

use super::{load, overrides, print_json, print_text};
use crate::atomic::write_atomically;
use crate::cli::RunArguments;
use crate::events::EventRun;
use crate::exit::ExitStatus;
use crate::iso9283;
use crate::output::findings::print_findings;
use crate::output::pictures::{Backdrop, configuration_picture, goal_camera, sheet_caption};
use crate::output::room_pictures::{RoomPictures, room_caption};
use crate::output::{
    budget_picture, junit, markdown, press_csv, press_picture, ranking_picture, recording_csv,
    report_text,
};
use crate::page::run_page;
use crate::picture::{Image, tile};
use crate::pipeline::{self, RunOptions, ScenarioRun};
use crate::progress::Progress;

#[derive(Serialize)]
struct SeveralReports<'a> {
    schema_version: u32,
    results: &'a [Report],
}

/// Runs scenarios, writes their results and prints them.
pub(crate) fn run(arguments: &RunArguments) -> Result<ExitStatus> {
    let overrides = match overrides(&arguments.robot) {
        Ok(overrides) => overrides,
        Err(finding) => {
            print_findings(&[finding]);
            return Ok(ExitStatus::BadInput);
        }
    };
    // All inputs are read before anything long starts.
    let mut scenarios = Vec::new();
    for path in &arguments.scenarios {
        scenarios.push(load(path, &overrides));
    }
    let Some(scenarios) = scenarios
        .into_iter()
        .collect::<Option<Vec<ResolvedScenario>>>()
    else {
        return Ok(ExitStatus::BadInput);
    };
    if let Some(finding) = repeated_name(&scenarios) {
        print_findings(&[finding]);
        return Ok(ExitStatus::BadInput);
    }
    let folders = match prepare_folders(arguments, &scenarios) {
        Ok(folders) => folders,
        Err(finding) => {
            print_findings(&[finding]);
            return Ok(ExitStatus::BadInput);
        }
    };
    if let Some(path) = &arguments.junit
        && let Err(finding) = probe_file(path, "--junit")
    {
        print_findings(&[finding]);
        return Ok(ExitStatus::BadInput);
    }
    let cancel = Arc::new(AtomicBool::new(false));
    let requested = Arc::clone(&cancel);
    ctrlc::set_handler(move || requested.store(true, Ordering::Relaxed))
        .context("cannot watch for interrupts")?;
    let jobs = arguments.jobs.map_or_else(
        || std::thread::available_parallelism().map_or(1, std::num::NonZero::get),
        usize::from,
    );
    let options = RunOptions {
        engines: arguments.engine,
        jobs,
        referee: arguments.referee,
    };

    let mut status = ExitStatus::Success;
    let mut reports = Vec::new();
    let outputs = Outputs {
        pictures: !arguments.no_pictures,
        page: !arguments.no_page,
        text: !arguments.json,
        quiet: arguments.quiet,
    };
    for (resolved, folder) in scenarios.iter().zip(&folders) {
        let (outcome, report) = run_into(resolved, &options, folder, outputs, &cancel)?;
        status = status.max(outcome);
        reports.push(report);
        if outcome == ExitStatus::Interrupted {
            break;
        }
    }
    if arguments.json {
        match reports.as_slice() {
            [report] if arguments.scenarios.len() == 1 => print_json(report)?,
            results => print_json(&SeveralReports {
                schema_version: 1,
                results,
            })?,
        }
    }
    let all: Vec<&Report> = reports.iter().collect();
    if let Some(path) = &arguments.junit {
        write_atomically(path, junit(&all)?.as_bytes())
            .with_context(|| format!("cannot write {}", path.display()))?;
    }
    append_to_step_summary(&all)?;
    Ok(status)
}

/// What a run leaves besides its report.
#[derive(Debug, Clone, Copy)]
#[expect(clippy::struct_excessive_bools, reason = "flags of a command line")]
pub(super) struct Outputs {
    /// Pictures, if the scenario wants any.
    pub pictures: bool,
    /// The page.
    pub page: bool,
    /// The table on standard output.
    pub text: bool,
    /// No progress.
    pub quiet: bool,
}

/// Runs one scenario and writes its results into a folder that is there.
pub(super) fn run_into(
    resolved: &ResolvedScenario,
    options: &RunOptions,
    folder: &Path,
    outputs: Outputs,
    cancel: &AtomicBool,
) -> Result<(ExitStatus, Report)> {
    let progress = Progress::new(outputs.quiet);
    // A robot that is not a UR arm was refused while the scenario was read.
    let mut finished = pipeline::run(resolved, options, cancel, &progress)?;
    let written = write_results(
        resolved,
        &mut finished,
        folder,
        outputs,
        options.jobs,
        cancel,
        &progress,
    );
    progress.finish();
    written.with_context(|| format!("cannot write the results to {}", folder.display()))?;
    if outputs.text {
        let name = &resolved.scenario.name;
        let text = report_text(&finished.report);
        print_text(&format!("{name}\n{text}results: {}", folder.display()))?;
    }
    if finished.interrupted {
        anstream::eprintln!(
            "interrupted: what was finished until then is in {}",
            folder.display()
        );
    }
    Ok((outcome(&finished), finished.report))
}

fn outcome(finished: &ScenarioRun) -> ExitStatus {
    if finished.interrupted {
        ExitStatus::Interrupted
    } else if !finished.report.engine_failures.is_empty() {
        ExitStatus::EnvironmentFailed
    } else if finished.report.verdict == Verdict::Fail {
        ExitStatus::CriterionFailed
    } else {
        ExitStatus::Success
    }
}

fn repeated_name(scenarios: &[ResolvedScenario]) -> Option<Finding> {
    scenarios.iter().enumerate().find_map(|(index, each)| {
        let name = &each.scenario.name;
        let earlier = scenarios[..index]
            .iter()
            .find(|other| other.scenario.name == *name)?;
        Some(
            Finding::new(
                &each.source.file,
                format!("`{name}` is the name of {} too", earlier.source.file),
            )
            .key("name")
            .hint("the name is that of the results folder: give each scenario its own"),
        )
    })
}

/// Makes each scenario's results folder and proves that it can be written, before a long run.
fn prepare_folders(
    arguments: &RunArguments,
    scenarios: &[ResolvedScenario],
) -> Result<Vec<PathBuf>, Finding> {
    let mut folders = Vec::new();
    for resolved in scenarios {
        let folder = arguments.out.join(&resolved.scenario.name);
        prepare_folder(&folder)?;
        folders.push(folder);
    }
    Ok(folders)
}

/// Makes a results folder and proves that it can be written.
pub(super) fn prepare_folder(folder: &Path) -> Result<(), Finding> {
    std::fs::create_dir_all(folder)
        .and_then(|()| probe_folder(folder))
        .map_err(|error| {
            Finding::new(
                folder.display().to_string(),
                format!("the results folder cannot be written: {error}"),
            )
            .key("--out")
            .hint("choose another folder with --out DIR")
        })
}

/// Proves that a file that an argument names can be written, before a long run.
pub(super) fn probe_file(path: &Path, argument: &str) -> Result<(), Finding> {
    let folder = match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    let writable = if path.is_dir() {
        Err(std::io::ErrorKind::IsADirectory.into())
    } else {
        probe_folder(folder)
    };
    writable.map_err(|error| {
        Finding::new(
            path.display().to_string(),
            format!("the file cannot be written: {error}"),
        )
        .key(argument)
        .hint("choose a file in a folder that exists and can be written")
    })
}

fn probe_folder(folder: &Path) -> std::io::Result<()> {
    let probe = folder.join(format!(".probe-{}", std::process::id()));
    std::fs::write(&probe, [])?;
    std::fs::remove_file(&probe)
}

fn write_results(
    resolved: &ResolvedScenario,
    finished: &mut ScenarioRun,
    folder: &Path,
    outputs: Outputs,
    jobs: usize,
    cancel: &AtomicBool,
    progress: &Progress,
) -> Result<()> {
    let started = Instant::now();
    let pictures = resolved.scenario.recording.pictures && outputs.pictures;
    let mut files: Vec<Vec<Vec<String>>> = Vec::new();
    let period_s = resolved.scenario.recording.period_ms * 1e-3;
    for ((goal, plan), runs) in resolved
        .goals
        .iter()
        .zip(&finished.plans)
        .zip(&finished.runs)
    {
        let goal_folder = folder.join(&goal.name);
        std::fs::create_dir_all(&goal_folder)?;
        let mut of_goal = Vec::new();
        for (plan, runs) in plan.configurations.iter().zip(runs) {
            let mut names = Vec::new();
            for run in runs {
                let name = format!("{}.{}.csv", plan.configuration, run.engine.name());
                let trajectory = plan.trajectory.as_ref().context("a run has a trajectory")?;
                let csv = recording_csv(run, trajectory, period_s);
                write_atomically(&goal_folder.join(&name), csv.as_bytes())?;
                names.push(format!("{}/{name}", goal.name));
            }
            of_goal.push(names);
        }
        files.push(of_goal);
    }
    for stopped in &finished.stopped {
        let (goal, run) = (&resolved.goals[stopped.goal], &stopped.run);
        let plan = &finished.plans[stopped.goal].configurations[stopped.configuration];
        let trajectory = plan.trajectory.as_ref().context("a run has a trajectory")?;
        let name = format!(
            "{}/{}.{}.stopped.csv",
            goal.name,
            plan.configuration,
            run.engine.name()
        );
        let csv = recording_csv(run, trajectory, period_s);
        write_atomically(&folder.join(&name), csv.as_bytes())?;
        files[stopped.goal][stopped.configuration].push(name);
    }
    for run in &finished.events {
        let names = write_events(resolved, run, &finished.plans, folder, pictures)?;
        files[run.goal][run.configuration].extend(names);
    }
    if pictures && !cancel.load(Ordering::Relaxed) {
        progress.message("drawing");
        write_pictures(resolved, &finished.report, folder, jobs, &mut files)?;
    }
    for (goal, names) in resolved.goals.iter().zip(&files) {
        remove_stale(folder, &goal.name, &names.concat())?;
    }
    for (goal, names) in finished.report.goals.iter_mut().zip(files) {
        for (configuration, names) in goal.configurations.iter_mut().zip(names) {
            configuration.files = names;
        }
    }
    if let (Some(run), Some(report)) = (&finished.iso9283, &mut finished.report.iso9283) {
        let name = &resolved.scenario.name;
        report.files = iso9283::write_results(name, report, run, folder, pictures)?;
    }
    let page_path = folder.join("report.html");
    if outputs.page {
        progress.message("writing the page");
        write_atomically(&page_path, run_page(resolved, finished).as_bytes())?;
    } else if page_path.exists() {
        // Nobody should take an earlier run's for this one's.
        std::fs::remove_file(&page_path)?;
    }
    finished
        .report
        .timings
        .insert("writing_s".to_owned(), started.elapsed().as_secs_f64());
    let report = &finished.report;
    let mut json = serde_json::to_vec_pretty(report)?;
    json.push(b'\n');
    write_atomically(&folder.join("report.json"), &json)?;
    write_atomically(&folder.join("junit.xml"), junit(&[report])?.as_bytes())?;
    write_atomically(&folder.join("summary.md"), markdown(report).as_bytes())?;
    Ok(())
}

/// Recordings of the contacts that were asked for, and a picture of each.
fn write_events(
    resolved: &ResolvedScenario,
    run: &EventRun,
    plans: &[GoalPlan],
    folder: &Path,
    pictures: bool,
) -> Result<Vec<String>> {
    let goal = &resolved.goals[run.goal];
    let label = plans[run.goal].configurations[run.configuration].configuration;
    let mut names = Vec::new();
    for (index, press) in run.press.iter().enumerate() {
        let Ok(press) = press else { continue };
        let number = index + 1;
        for (engine, events) in &run.engines {
            let Some(Some(recording)) = events.press.get(index) else {
                continue;
            };
            let name = format!("{}/{label}.press-{number}.{}.csv", goal.name, engine.name());
            let csv = press_csv(goal, press, recording);
            write_atomically(&folder.join(&name), csv.as_bytes())?;
            names.push(name);
        }
        if pictures {
            let name = format!("{}/{label}.press-{number}.png", goal.name);
            let title = format!("{}, {label}", goal.name);
            let png = press_picture(&title, press, run, index).to_png()?;
            write_atomically(&folder.join(&name), &png)?;
            names.push(name);
        }
    }
    Ok(names)
}

/// Removes recordings and pictures that an earlier run left in a goal's folder: nobody should
/// take them for results of this one.
fn remove_stale(folder: &Path, goal: &str, written: &[String]) -> Result<()> {
    for entry in std::fs::read_dir(folder.join(goal))? {
        let path = entry?.path();
        let ours = path
            .extension()
            .is_some_and(|extension| extension == "csv" || extension == "png");
        let current = written.iter().any(|name| folder.join(name) == path);
        if ours && !current {
            std::fs::remove_file(&path)?;
        }
    }
    Ok(())
}

/// What is added to the names of pictures: those of the posture, those of the room.
const PICTURE_KINDS: [&str; 2] = ["", ".room"];

fn write_pictures(
    resolved: &ResolvedScenario,
    report: &Report,
    folder: &Path,
    jobs: usize,
    files: &mut [Vec<Vec<String>>],
) -> Result<()> {
    let backdrop = Backdrop::new(resolved);
    let room = RoomModel::new(resolved);
    for (index, (goal, goal_report)) in resolved.goals.iter().zip(&report.goals).enumerate() {
        let camera = goal_camera(resolved, goal);
        let room_pictures = RoomPictures::new(resolved, &backdrop, &room, index);
        let next = AtomicUsize::new(0);
        let drawn: Mutex<Vec<(usize, [Option<Image>; 2])>> = Mutex::new(Vec::new());
        std::thread::scope(|scope| {
            for _ in 0..jobs.clamp(1, goal_report.configurations.len()) {
                scope.spawn(|| {
                    loop {
                        let at = next.fetch_add(1, Ordering::Relaxed);
                        let Some(configuration) = goal_report.configurations.get(at) else {
                            break;
                        };
                        let pictures = [
                            configuration_picture(
                                resolved,
                                &backdrop,
                                &camera,
                                goal,
                                configuration,
                            ),
                            room_pictures.draw(configuration),
                        ];
                        drawn.lock().expect("no thread panics").push((at, pictures));
                    }
                });
            }
        });
        let mut drawn = drawn.into_inner().expect("no thread panics");
        drawn.sort_by_key(|(at, _)| *at);
        let mut sheets = [Vec::new(), Vec::new()];
        for (at, pictures) in drawn {
            let configuration = &goal_report.configurations[at];
            let captions = [
                sheet_caption(goal_report, configuration),
                room_caption(goal_report, configuration),
            ];
            let kinds = PICTURE_KINDS.iter().zip(&mut sheets).zip(captions);
            for (picture, ((kind, sheet), caption)) in pictures.into_iter().zip(kinds) {
                let Some(image) = picture else { continue };
                let name = format!("{}/{}{kind}.png", goal.name, configuration.label);
                image.write_png(&folder.join(&name))?;
                files[index][at].push(name);
                sheet.push((image, caption));
            }
        }
        for (kind, sheet) in PICTURE_KINDS.iter().zip(&sheets) {
            if !sheet.is_empty() {
                let name = format!("{}{kind}.png", goal.name);
                tile(sheet, 4).write_png(&folder.join(name))?;
            }
        }
        for (kind, picture) in [
            ("ranking", ranking_picture(goal_report)),
            ("budget", budget_picture(goal_report)),
        ] {
            let path = folder.join(format!("{}.{kind}.png", goal.name));
            match picture {
                Some(image) => image.write_png(&path)?,
                // Nobody should take an earlier run's for this one's.
                None if path.exists() => std::fs::remove_file(&path)?,
                None => {}
            }
        }
    }
    Ok(())
}

/// Adds the summaries to the page that GitHub Actions shows for a step.
fn append_to_step_summary(reports: &[&Report]) -> Result<()> {
    let Some(path) = std::env::var_os("GITHUB_STEP_SUMMARY") else {
        return Ok(());
    };
    let mut file = OpenOptions::new()
        .create(true)
        .append(true)
        .open(&path)
        .with_context(|| format!("cannot write {}", Path::new(&path).display()))?;
    for report in reports {
        writeln!(file, "{}", markdown(report))?;
    }
    Ok(())
}
