//! Files of a scenario's run.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use needlebench_bench::{EngineRun, EventRun, ScenarioRun};
use needlebench_engine::Engine;
use needlebench_evaluation::report::Report;
use needlebench_export::{Motion, mcap};
use needlebench_parallel::Progress;
use needlebench_planning::GoalPlan;
use needlebench_scenario::ResolvedScenario;

use super::accuracy::remove_accuracy;
use super::error::FilesError;
use super::excitation::write_logs;
use super::folder::Folder;
use super::iso9283::write_test;
use super::pictures::{Pictures, remove_pictures};
use crate::chart::press::press_chart;
use crate::csv::{events_csv, press_csv, recording_csv, recording_name, rtde_csv};
use crate::junit::junit;
use crate::markdown::markdown;
use crate::page::run_page;

/// Which files a run leaves besides its report, and how they are made.
#[derive(Debug, Clone, Copy)]
#[expect(clippy::struct_excessive_bools, reason = "switches of a run")]
pub struct RunFiles<'a> {
    /// A log of each recording by the names of UR's real-time data exchange, whatever the scenario wants.
    pub rtde: bool,
    /// An MCAP file of each recording.
    pub mcap: bool,
    /// Pictures and charts, if the scenario wants any.
    pub pictures: bool,
    /// The page.
    pub page: bool,
    /// Threads that render.
    pub jobs: usize,
    /// Rendering is not begun once this is set by a request to stop.
    pub cancel: &'a AtomicBool,
    /// Engines that there are, with their titles.
    pub engines: &'a [&'static dyn Engine],
}

/// Names of files, by goal and configuration.
type Names = Vec<Vec<Vec<String>>>;

/// Writes everything that a run leaves; gives its report as it stands in the folder: with the names of the files, and
/// how long they took.
///
/// # Errors
/// [`FilesError`]. What was written until then stays.
pub fn write_run(
    resolved: &ResolvedScenario,
    finished: &ScenarioRun,
    folder: Folder<'_>,
    wanted: RunFiles<'_>,
    progress: &dyn Progress,
) -> Result<Report, FilesError> {
    let started = Instant::now();
    remove_accuracy(folder)?;
    let pictures = resolved.scenario.recording.pictures && wanted.pictures;
    let mut names = write_recordings(resolved, finished, folder)?;
    if wanted.rtde || resolved.scenario.recording.rtde {
        write_rtde(resolved, finished, folder, &mut names)?;
    }
    if wanted.mcap {
        write_mcap(resolved, finished, folder, &mut names)?;
    }
    for run in &finished.events {
        let of_run = write_events(resolved, run, &finished.plans, folder, pictures)?;
        names[run.goal][run.configuration].extend(of_run);
    }
    if pictures && !wanted.cancel.load(Ordering::Relaxed) {
        progress.message("drawing");
        let drawing = Pictures::new(resolved, folder, wanted.jobs);
        for (index, names) in names.iter_mut().enumerate() {
            drawing.write(index, &finished.report, names)?;
        }
    } else {
        for goal in &resolved.goals {
            remove_pictures(folder, &goal.name)?;
        }
    }
    for (goal, names) in resolved.goals.iter().zip(&names) {
        folder.remove_others(&goal.name, &names.concat())?;
    }
    let mut report = finished.report.clone();
    for (goal, names) in report.goals.iter_mut().zip(names) {
        for (configuration, names) in goal.configurations.iter_mut().zip(names) {
            configuration.files = names;
        }
    }
    if let (Some(run), Some(test)) = (&finished.iso9283, &mut report.iso9283) {
        let name = &resolved.scenario.name;
        test.files = write_test(name, test, run, folder, pictures)?;
    }
    if let (Some(run), Some(test)) = (&finished.excitation, &mut report.excitation) {
        test.files = write_logs(run, folder)?;
    }
    match report
        .judged
        .as_ref()
        .and_then(|each| each.program.as_ref())
    {
        Some(program) => folder.write("events.csv", events_csv(program))?,
        None => folder.remove("events.csv")?,
    }
    if wanted.page {
        progress.message("writing the page");
        folder.write("report.html", run_page(resolved, finished, &report))?;
    } else {
        folder.remove("report.html")?;
    }
    let writing_s = started.elapsed().as_secs_f64();
    report.timings.insert("writing_s".to_owned(), writing_s);
    folder.write_json("report.json", &report)?;
    folder.write("junit.xml", junit(&[&report])?)?;
    folder.write("summary.md", markdown(&report, wanted.engines))?;
    Ok(report)
}

/// Recordings of all motions, those that ended early among them.
fn write_recordings(
    resolved: &ResolvedScenario,
    finished: &ScenarioRun,
    folder: Folder<'_>,
) -> Result<Names, FilesError> {
    let period_s = resolved.scenario.recording.period_ms * 1e-3;
    let write = |goal: usize, configuration: usize, run: &EngineRun, stopped: bool| {
        let plan = &finished.plans[goal].configurations[configuration];
        let trajectory = plan.trajectory.as_ref().expect("what ran has a trajectory");
        let engine = if stopped {
            format!("{}.stopped", run.engine)
        } else {
            run.engine.to_owned()
        };
        let file = recording_name(plan.configuration, &engine);
        let name = format!("{}/{file}", resolved.goals[goal].name);
        folder.write(&name, recording_csv(run, trajectory, period_s))?;
        Ok::<String, FilesError>(name)
    };
    let mut names: Names = Vec::new();
    for (goal, runs) in finished.runs.iter().enumerate() {
        folder.make(&resolved.goals[goal].name)?;
        let mut of_goal = Vec::new();
        for (configuration, runs) in runs.iter().enumerate() {
            let written = runs
                .iter()
                .map(|run| write(goal, configuration, run, false));
            of_goal.push(written.collect::<Result<Vec<String>, FilesError>>()?);
        }
        names.push(of_goal);
    }
    for stopped in &finished.stopped {
        let (goal, configuration) = (stopped.goal, stopped.configuration);
        let name = write(goal, configuration, &stopped.run, true)?;
        names[goal][configuration].push(name);
    }
    Ok(names)
}

/// Logs of all motions that came to their end, as the controller of a UR arm would write them.
fn write_rtde(
    resolved: &ResolvedScenario,
    finished: &ScenarioRun,
    folder: Folder<'_>,
    names: &mut Names,
) -> Result<(), FilesError> {
    let Some(source) = &finished.rtde else {
        return Ok(());
    };
    let period_s = resolved.scenario.recording.period_ms * 1e-3;
    for (goal, runs) in finished.runs.iter().enumerate() {
        for (configuration, runs) in runs.iter().enumerate() {
            let plan = &finished.plans[goal].configurations[configuration];
            let Some(trajectory) = &plan.trajectory else {
                continue;
            };
            for run in runs {
                let log = source.log(&run.recording, trajectory, period_s);
                let label = plan.configuration;
                let name = format!(
                    "{}/{label}.{}.rtde.csv",
                    resolved.goals[goal].name, run.engine
                );
                folder.write(&name, rtde_csv(&log))?;
                names[goal][configuration].push(name);
            }
        }
    }
    Ok(())
}

/// Recordings of all motions that came to their end as messages of ROS 2.
fn write_mcap(
    resolved: &ResolvedScenario,
    finished: &ScenarioRun,
    folder: Folder<'_>,
    names: &mut Names,
) -> Result<(), FilesError> {
    for (goal, runs) in finished.runs.iter().enumerate() {
        for (configuration, runs) in runs.iter().enumerate() {
            for run in runs {
                let place = [goal, configuration];
                let Some(motion) = Motion::in_run(resolved, finished, place, run) else {
                    continue;
                };
                let label = motion.configuration;
                let name = format!("{}/{label}.{}.mcap", motion.goal.name, run.engine);
                folder.write(&name, mcap(&motion, &name)?.bytes)?;
                names[goal][configuration].push(name);
            }
        }
    }
    Ok(())
}

/// Recordings of the prescribed contacts, and a chart of each.
fn write_events(
    resolved: &ResolvedScenario,
    run: &EventRun,
    plans: &[GoalPlan],
    folder: Folder<'_>,
    pictures: bool,
) -> Result<Vec<String>, FilesError> {
    let goal = &resolved.goals[run.goal];
    let label = plans[run.goal].configurations[run.configuration].configuration;
    let mut names = Vec::new();
    for (index, press) in run.press.iter().enumerate() {
        let Ok(press) = press else { continue };
        let stem = format!("{}/{label}.press-{}", goal.name, index + 1);
        for (engine, events) in &run.engines {
            let Some(Some(recording)) = events.press.get(index) else {
                continue;
            };
            let name = format!("{stem}.{engine}.csv");
            folder.write(&name, press_csv(goal, press, recording))?;
            names.push(name);
        }
        if pictures {
            let title = format!("{}, {label}", goal.name);
            let chart = press_chart(&title, press, run, index);
            names.extend(folder.write_chart(&stem, &chart)?);
        }
    }
    Ok(names)
}
