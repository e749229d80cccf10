//! Results of a run: its report, motions and recordings.

use std::sync::Arc;

use needlebench_bench::{EngineRun, Runnable, ScenarioRun};
use needlebench_evaluation::report::Verdict;
use needlebench_input::printable_json;
use needlebench_kinematics::Joints;
use needlebench_kinematics::trajectory::{JointState, JointTrajectory};
use needlebench_planning::ConfigurationPlan;
use pyo3::exceptions::{PyKeyError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

use crate::arrays::{Rows, array};

/// A finished run.
#[pyclass(frozen, module = "needlebench._native")]
pub(crate) struct Run {
    runnable: Arc<Runnable>,
    run: ScenarioRun,
}

impl Run {
    pub(crate) fn new(runnable: Arc<Runnable>, run: ScenarioRun) -> Self {
        Self { runnable, run }
    }

    fn goal_index(&self, goal: &str) -> PyResult<usize> {
        let goals = &self.runnable.scenario().goals;
        let found = goals.iter().position(|each| each.name == goal);
        found
            .filter(|index| *index < self.run.plans.len())
            .ok_or_else(|| PyKeyError::new_err(format!("there is no goal `{goal}`")))
    }

    fn indices(&self, goal: &str, label: &str) -> PyResult<(usize, usize)> {
        let goal = self.goal_index(goal)?;
        let plans = &self.run.plans[goal].configurations;
        let found = plans
            .iter()
            .position(|plan| plan.configuration.label() == label);
        let configuration = found
            .ok_or_else(|| PyKeyError::new_err(format!("there is no configuration `{label}`")))?;
        Ok((goal, configuration))
    }

    fn plan(&self, goal: &str, label: &str) -> PyResult<&ConfigurationPlan> {
        let (goal, configuration) = self.indices(goal, label)?;
        Ok(&self.run.plans[goal].configurations[configuration])
    }
}

#[pymethods]
impl Run {
    /// The report as `run --json` prints it.
    fn report_json(&self, py: Python<'_>) -> PyResult<String> {
        let text = py.detach(|| serde_json::to_string_pretty(&self.run.report));
        let text = text.map_err(|error| PyValueError::new_err(error.to_string()))?;
        Ok(printable_json(&text).into_owned())
    }

    /// `pass`, `fail` or `incomplete`.
    #[getter]
    fn verdict(&self) -> &'static str {
        match self.run.report.verdict {
            Verdict::Pass => "pass",
            Verdict::Fail => "fail",
            Verdict::Incomplete => "incomplete",
        }
    }

    /// Whether it was interrupted; completed results are available.
    #[getter]
    fn interrupted(&self) -> bool {
        self.run.interrupted
    }

    /// Failures of engines.
    #[getter]
    fn engine_failures(&self) -> Vec<(String, String)> {
        let failures = self.run.report.engine_failures.iter();
        failures
            .map(|failure| (failure.engine.clone(), failure.message.clone()))
            .collect()
    }

    /// Engines that have a recording of a configuration.
    fn engines(&self, goal: &str, configuration: &str) -> PyResult<Vec<&'static str>> {
        let (goal, configuration) = self.indices(goal, configuration)?;
        let runs = &self.run.runs[goal][configuration];
        Ok(runs.iter().map(|run| run.engine).collect())
    }

    /// The recording of an engine, at every step.
    fn recording<'py>(
        &self,
        py: Python<'py>,
        goal: &str,
        configuration: &str,
        engine: &str,
    ) -> PyResult<Bound<'py, PyDict>> {
        let trajectory = self.plan(goal, configuration)?.trajectory.as_ref();
        let (goal, configuration) = self.indices(goal, configuration)?;
        let runs = &self.run.runs[goal][configuration];
        let run = runs.iter().find(|run| run.engine == engine);
        let run = run.ok_or_else(|| {
            PyKeyError::new_err(format!("there is no recording of the engine `{engine}`"))
        })?;
        recording(py, run, trajectory)
    }

    /// Duration of a planned motion, s; none without a motion.
    #[pyo3(signature = (goal, configuration, *, retreat=false))]
    fn duration_s(&self, goal: &str, configuration: &str, retreat: bool) -> PyResult<Option<f64>> {
        let plan = self.plan(goal, configuration)?;
        let motion = motion_of(plan, retreat);
        Ok(motion.map(JointTrajectory::duration_s))
    }

    /// A planned motion at times (s).
    #[pyo3(signature = (goal, configuration, times_s, *, retreat=false))]
    fn motion<'py>(
        &self,
        py: Python<'py>,
        goal: &str,
        configuration: &str,
        times_s: &Bound<'py, PyAny>,
        retreat: bool,
    ) -> PyResult<Bound<'py, PyDict>> {
        let plan = self.plan(goal, configuration)?;
        let motion = motion_of(plan, retreat)
            .ok_or_else(|| PyKeyError::new_err(format!("`{configuration}` has no such motion")))?;
        let rows = Rows::new(times_s, "times_s", &[&[]])?;
        let times = rows.numbers()?;
        let states: Vec<JointState> = times.iter().map(|time_s| motion.sample(*time_s)).collect();
        let made = states_as_arrays(py, &states, "")?;
        made.set_item("time_s", array(py, times.to_vec(), &[times.len()], false)?)?;
        made.set_item("phase", phases(py, motion, times)?)?;
        Ok(made)
    }
}

fn motion_of(plan: &ConfigurationPlan, retreat: bool) -> Option<&JointTrajectory> {
    if retreat {
        plan.retreat.as_ref()
    } else {
        plan.trajectory.as_ref()
    }
}

fn phases<'py>(
    py: Python<'py>,
    motion: &JointTrajectory,
    times_s: &[f64],
) -> PyResult<Bound<'py, PyList>> {
    let names = times_s.iter().map(|time_s| motion.phase_at(*time_s).name());
    PyList::new(py, names)
}

fn sixes(py: Python<'_>, vectors: impl Iterator<Item = Joints>) -> PyResult<Bound<'_, PyAny>> {
    let mut values = Vec::new();
    for vector in vectors {
        values.extend_from_slice(vector.as_slice());
    }
    let rows = values.len() / 6;
    array(py, values, &[rows, 6], false)
}

fn states_as_arrays<'py>(
    py: Python<'py>,
    states: &[JointState],
    prefix: &str,
) -> PyResult<Bound<'py, PyDict>> {
    let made = PyDict::new(py);
    let key = |name: &str| format!("{prefix}{name}");
    let positions = states.iter().map(|state| state.position);
    made.set_item(key("position_rad"), sixes(py, positions)?)?;
    let velocities = states.iter().map(|state| state.velocity);
    made.set_item(key("velocity_rad_s"), sixes(py, velocities)?)?;
    let accelerations = states.iter().map(|state| state.acceleration);
    made.set_item(key("acceleration_rad_s2"), sixes(py, accelerations)?)?;
    Ok(made)
}

fn recording<'py>(
    py: Python<'py>,
    run: &EngineRun,
    trajectory: Option<&JointTrajectory>,
) -> PyResult<Bound<'py, PyDict>> {
    let recording = &run.recording;
    let count = recording.state.len();
    let made = states_as_arrays(py, &recording.reference, "reference_")?;
    made.set_item(
        "time_s",
        array(py, recording.time_s.clone(), &[count], false)?,
    )?;
    if let Some(trajectory) = trajectory {
        made.set_item("phase", phases(py, trajectory, &recording.time_s)?)?;
    }
    let states = || recording.state.iter();
    made.set_item(
        "position_rad",
        sixes(py, states().map(|state| state.position))?,
    )?;
    made.set_item(
        "velocity_rad_s",
        sixes(py, states().map(|state| state.velocity))?,
    )?;
    made.set_item("torque_nm", sixes(py, recording.torque_nm.iter().copied())?)?;
    made.set_item("drive_nm", sixes(py, recording.drive_nm.iter().copied())?)?;
    let poses: Vec<_> = states().map(|state| state.world_from_flange).collect();
    made.set_item("flange_in_world", crate::arrays::poses(py, &poses, false)?)?;
    let forces = states().map(|state| state.contact.normal_force_n).collect();
    made.set_item("contact_force_n", array(py, forces, &[count], false)?)?;
    let depths = states().map(|state| state.contact.deepest_penetration_m);
    made.set_item(
        "penetration_m",
        array(py, depths.collect(), &[count], false)?,
    )?;
    let clearance = PyDict::new(py);
    let times = run.clearance.time_s.clone();
    let samples = times.len();
    clearance.set_item("time_s", array(py, times, &[samples], false)?)?;
    for (class, series) in &run.clearance.distance_m {
        let values = array(py, series.clone(), &[samples], false)?;
        clearance.set_item(format!("{}_m", class.name()), values)?;
    }
    made.set_item("clearance", clearance)?;
    Ok(made)
}
