//! Motions and answers of others, judged.

use std::path::PathBuf;
use std::sync::Arc;

use needlebench_bench::judge::answers::{AnswersOptions, TOLERANCE, judge_answers as judge_all};
use needlebench_bench::judge::free::judge_free as judge_alone;
use needlebench_bench::judge::{JudgeError, JudgeOptions, judge as judge_motion};
use needlebench_bench::{RunOptions, Runnable, ScenarioRun};
use needlebench_input::{Finding, printable_json};
use needlebench_kinematics::Joints;
use needlebench_kinematics::trajectory::Between;
use needlebench_parallel::Control;
use needlebench_patient::ct::{LastScan, scanned};
use needlebench_recorded::{MotionFile, answers_of, motion_of_points};
use needlebench_scenario::scenario::EngineName;
use needlebench_scenario::{Overrides, ResolvedScenario};
use pyo3::prelude::*;

use crate::arrays::{Rows, postures};
use crate::background::{Task, in_background};
use crate::errors::{input_error, wrong_argument};
use crate::run::Run;
use crate::scenario::{Failure, Results, Scenario, is_mcap, threads};

/// What stands for the file's name.
const NAME: &str = "arrays";

/// A motion from arrays of Python.
fn motion(
    times_s: &Bound<'_, PyAny>,
    positions_rad: &Bound<'_, PyAny>,
    velocities_rad_s: Option<&Bound<'_, PyAny>>,
    accelerations_rad_s2: Option<&Bound<'_, PyAny>>,
) -> PyResult<MotionFile> {
    let py = times_s.py();
    let times = Rows::new(times_s, "times_s", &[&[]])?.numbers()?.to_vec();
    let rows = |given: Option<&Bound<'_, PyAny>>, name: &str| -> PyResult<Vec<Joints>> {
        let Some(given) = given else {
            return Ok(Vec::new());
        };
        let rows = Rows::new(given, name, &[&[6]])?;
        let rows: Vec<Joints> = rows
            .numbers()?
            .chunks_exact(6)
            .map(Joints::from_column_slice)
            .collect();
        if rows.len() == times.len() {
            return Ok(rows);
        }
        let message = format!("{} rows for {} times", rows.len(), times.len());
        let hint = "a row of six joints for each time";
        Err(wrong_argument(py, name, message, hint))
    };
    let values = [
        rows(Some(positions_rad), "positions_rad")?,
        rows(velocities_rad_s, "velocities_rad_s")?,
        rows(accelerations_rad_s2, "accelerations_rad_s2")?,
    ];
    motion_of_points(NAME, times, values).map_err(|findings| input_error(py, &findings))
}

fn curve(py: Python<'_>, between: Option<&str>) -> PyResult<Option<Between>> {
    Ok(match between {
        None => None,
        Some("quintics") => Some(Between::Quintics),
        Some("cubics") => Some(Between::Cubics),
        Some("lines") => Some(Between::Lines),
        Some(other) => {
            let message = format!("there is no curve `{other}`");
            let hint = "there are: quintics, cubics, lines";
            return Err(wrong_argument(py, "between", message, hint));
        }
    })
}

/// A scenario as it is run: with what its scan shows, if it begins with one.
fn as_run(runnable: &Runnable, overrides: &Overrides) -> Result<ResolvedScenario, Failure> {
    scanned(
        runnable.scenario().clone(),
        overrides,
        &mut LastScan::default(),
    )
    .map_err(Failure::Input)
}

fn failure(error: JudgeError) -> Failure {
    match error {
        JudgeError::Refused(finding) => Failure::Input(vec![*finding]),
        JudgeError::Run(error) => Failure::Environment(error.to_string()),
    }
}

/// Judges a motion as a run judges its own; writes to `out/NAME` if `out` is given.
#[pyfunction]
#[pyo3(signature = (scenario, times_s, positions_rad, velocities_rad_s=None, accelerations_rad_s2=None, *, goal=None, between=None, any_start=false, beside=true, engines=None, jobs=None, reference=false, out=None, pictures=true, page=true, record=None, progress=None))]
#[expect(
    clippy::too_many_arguments,
    clippy::fn_params_excessive_bools,
    reason = "keywords of Python"
)]
pub(crate) fn judge(
    py: Python<'_>,
    scenario: &Scenario,
    times_s: &Bound<'_, PyAny>,
    positions_rad: &Bound<'_, PyAny>,
    velocities_rad_s: Option<&Bound<'_, PyAny>>,
    accelerations_rad_s2: Option<&Bound<'_, PyAny>>,
    goal: Option<String>,
    between: Option<&str>,
    any_start: bool,
    beside: bool,
    engines: Option<Vec<String>>,
    jobs: Option<usize>,
    reference: bool,
    out: Option<PathBuf>,
    pictures: bool,
    page: bool,
    record: Option<&str>,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<(Run, Option<Py<PyAny>>)> {
    let motion = motion(
        times_s,
        positions_rad,
        velocities_rad_s,
        accelerations_rad_s2,
    )?;
    let engines = engines.map(|names| names.into_iter().map(EngineName).collect());
    let options = RunOptions {
        engines,
        jobs: threads(jobs),
        referee: reference,
        ..RunOptions::default()
    };
    let resolved = scenario.runnable.scenario();
    options.chosen_engines(resolved).map_err(|error| {
        wrong_argument(py, "engines", error.to_string(), "give names in a list")
    })?;
    let job = Job {
        runnable: Arc::clone(&scenario.runnable),
        overrides: Arc::clone(&scenario.overrides),
        motion,
        asked: JudgeOptions {
            goal,
            between: curve(py, between)?,
            any_start,
            beside,
            nearest: false,
        },
        results: Results {
            mcap: is_mcap(py, record, out.is_some())?,
            folder: out.map(|out| out.join(&resolved.scenario.name)),
            pictures,
            page,
        },
        options,
    };
    let done = in_background(py, progress, move |task| job.run(task))?;
    match done.value {
        Ok((runnable, finished)) => {
            let interrupted = done.interrupted;
            let interrupted = interrupted.map(|error| error.into_value(py).into_any());
            Ok((Run::new(runnable, finished), interrupted))
        }
        Err(failure) => Err(done
            .interrupted
            .unwrap_or_else(|| failure.into_exception(py))),
    }
}

/// A judgement, on its own thread.
struct Job {
    runnable: Arc<Runnable>,
    overrides: Arc<Overrides>,
    motion: MotionFile,
    asked: JudgeOptions,
    results: Results,
    options: RunOptions,
}

impl Job {
    fn run(self, task: &Task) -> Result<(Arc<Runnable>, ScenarioRun), Failure> {
        self.results.prepare()?;
        let resolved = as_run(&self.runnable, &self.overrides)?;
        let done = judge_motion(
            &resolved,
            &self.motion,
            &self.asked,
            &self.options,
            &task.cancel,
            task.progress.as_ref(),
        )
        .map_err(failure)?;
        let mut finished = done.run;
        self.results
            .write(&done.resolved, &mut finished, self.options.jobs, task)?;
        let runnable = Runnable::checked(done.resolved);
        let runnable = runnable.map_err(|finding| Failure::Input(vec![finding]))?;
        Ok((Arc::new(runnable), finished))
    }
}

/// The document of `judge --free --json`.
#[pyfunction]
#[pyo3(signature = (scenario, times_s, positions_rad, velocities_rad_s=None, accelerations_rad_s2=None, *, between=None))]
pub(crate) fn judge_free(
    py: Python<'_>,
    scenario: &Scenario,
    times_s: &Bound<'_, PyAny>,
    positions_rad: &Bound<'_, PyAny>,
    velocities_rad_s: Option<&Bound<'_, PyAny>>,
    accelerations_rad_s2: Option<&Bound<'_, PyAny>>,
    between: Option<&str>,
) -> PyResult<String> {
    let motion = motion(
        times_s,
        positions_rad,
        velocities_rad_s,
        accelerations_rad_s2,
    )?;
    let between = curve(py, between)?;
    let made = py.detach(|| {
        let resolved = as_run(&scenario.runnable, &scenario.overrides)?;
        let report = judge_alone(&resolved, &motion, between).map_err(failure)?;
        json(&report)
    });
    made.map_err(|failure| failure.into_exception(py))
}

/// The document of `judge --answers --json`.
#[pyfunction]
#[pyo3(signature = (scenario, joints_rad, *, goal=None, tolerance=None, partial=false, jobs=None, progress=None))]
#[expect(clippy::too_many_arguments, reason = "keywords of Python")]
pub(crate) fn judge_answers(
    py: Python<'_>,
    scenario: &Scenario,
    joints_rad: &Bound<'_, PyAny>,
    goal: Option<String>,
    tolerance: Option<f64>,
    partial: bool,
    jobs: Option<usize>,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<String> {
    let (joints, _) = postures(joints_rad, "joints_rad")?;
    let file = answers_of("array", &joints).map_err(|finding| input_error(py, &[finding]))?;
    let tolerance = tolerance.unwrap_or(TOLERANCE);
    if !(tolerance > 0.0 && tolerance <= 1.0) {
        let message = format!("{tolerance} is no tolerance");
        return Err(wrong_argument(
            py,
            "tolerance",
            message,
            "above 0 and at most 1, in m and rad",
        ));
    }
    let asked = AnswersOptions {
        goal,
        tolerance,
        is_partial: partial,
    };
    let runnable = Arc::clone(&scenario.runnable);
    let overrides = Arc::clone(&scenario.overrides);
    let done = in_background(py, progress, move |task| {
        let resolved = as_run(&runnable, &overrides)?;
        let control = Control {
            threads: threads(jobs),
            cancel: &task.cancel,
            progress: task.progress.as_ref(),
        };
        let report = judge_all(&resolved, &file, &asked, &control).map_err(failure)?;
        json(&report)
    })?;
    match (done.interrupted, done.value) {
        (Some(error), _) => Err(error),
        (None, made) => made.map_err(|failure| failure.into_exception(py)),
    }
}

fn json(report: &impl serde::Serialize) -> Result<String, Failure> {
    let text = serde_json::to_string_pretty(report);
    let text = text.map_err(|error| {
        let finding = Finding::new("report", error.to_string());
        Failure::Input(vec![finding])
    })?;
    Ok(printable_json(&text).into_owned())
}
