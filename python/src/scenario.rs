//! A scenario: its arm, its clearances, its runs.

use std::path::PathBuf;
use std::sync::Arc;

use needlebench::KinematicArm;
use needlebench_bench::{RunOptions, Runnable, ScenarioRun};
use needlebench_cell::Cell;
use needlebench_clearance::{CertificateOptions, ClearanceModel, PairClearance, certify};
use needlebench_engine::ENGINES;
use needlebench_input::Finding;
use needlebench_kinematics::Joints;
use needlebench_kinematics::trajectory::{JointTrajectory, Phase};
use needlebench_parallel::Control;
use needlebench_patient::Stop;
use needlebench_patient::ct::{BuildFiles, LastScan, imaged, scanned};
use needlebench_report::files::{Folder, RunFiles, write_run};
use needlebench_scenario::scenario::EngineName;
use needlebench_scenario::{Overrides, ResolvedScenario, load_scenario};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

use crate::arm::{forward, overrides};
use crate::arrays::{array, postures};
use crate::background::{Task, in_background};
use crate::errors::{environment_failed, input_error, wrong_argument};
use crate::run::Run;

/// A validated scenario.
#[pyclass(frozen, module = "needlebench._native")]
pub(crate) struct Scenario {
    pub(crate) runnable: Arc<Runnable>,
    model: Arc<ClearanceModel>,
    pub(crate) overrides: Arc<Overrides>,
}

#[pymethods]
impl Scenario {
    /// Reads a scenario.
    #[staticmethod]
    #[expect(
        clippy::needless_pass_by_value,
        clippy::too_many_arguments,
        reason = "what Python hands over"
    )]
    #[pyo3(signature = (path, *, robot=None, arm=None, prefix=None, calibration=None, packages=None, missing_inertia=None))]
    fn load(
        py: Python<'_>,
        path: PathBuf,
        robot: Option<PathBuf>,
        arm: Option<String>,
        prefix: Option<String>,
        calibration: Option<PathBuf>,
        packages: Option<Vec<String>>,
        missing_inertia: Option<&str>,
    ) -> PyResult<Self> {
        let overrides = overrides(
            py,
            robot,
            arm,
            prefix,
            calibration,
            packages,
            missing_inertia,
        )?;
        let read = py.detach(|| {
            let resolved = load_scenario(&path, &overrides)?;
            let model = ClearanceModel::new(&resolved.cell);
            let runnable = Runnable::checked(resolved).map_err(|finding| vec![finding])?;
            Ok::<_, Vec<Finding>>((runnable, model))
        });
        let (runnable, model) = read.map_err(|findings| input_error(py, &findings))?;
        Ok(Self {
            runnable: Arc::new(runnable),
            model: Arc::new(model),
            overrides: Arc::new(overrides),
        })
    }

    #[getter]
    fn name(&self) -> &str {
        &self.runnable.scenario().scenario.name
    }

    #[getter]
    fn description(&self) -> &str {
        &self.runnable.scenario().scenario.description
    }

    #[getter]
    fn file(&self) -> &str {
        &self.runnable.scenario().source.file
    }

    #[getter]
    fn sha256(&self) -> &str {
        &self.runnable.scenario().source.sha256
    }

    #[getter]
    fn arm(&self) -> String {
        self.runnable.scenario().robot_description.arm_name.clone()
    }

    #[getter]
    fn goals(&self) -> Vec<String> {
        let goals = &self.runnable.scenario().goals;
        goals.iter().map(|goal| goal.name.clone()).collect()
    }

    #[getter]
    fn notes(&self) -> Vec<String> {
        self.runnable.scenario().notes.clone()
    }

    #[getter]
    fn start_rad<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let start = &self.runnable.scenario().start;
        array(py, start.as_slice().to_vec(), &[6], false)
    }

    fn __repr__(&self) -> String {
        let goals = self.goals().join(", ");
        format!("Scenario({}: {goals})", self.name())
    }

    fn fk<'py>(&self, py: Python<'py>, joints: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyDict>> {
        let arm = {
            let scenario = self.runnable.scenario();
            KinematicArm::of_robot(&scenario.cell.robot, &scenario.robot_description)
        };
        forward(py, &arm, joints)
    }

    /// Minimum clearances by class, for every posture; all pairs on request.
    #[pyo3(signature = (joints, *, pairs=false))]
    fn clearance<'py>(
        &self,
        py: Python<'py>,
        joints: &Bound<'py, PyAny>,
        pairs: bool,
    ) -> PyResult<Bound<'py, PyDict>> {
        let (postures, is_single) = postures(joints, "joints")?;
        let model = &self.model;
        let cell = &self.runnable.scenario().cell;
        let (minima, all) = py.detach(|| {
            let minima = postures.iter().map(|q| {
                let minima = model.minimum_per_class(q);
                minima.iter().copied().collect::<Vec<_>>()
            });
            let minima: Vec<Vec<PairClearance>> = minima.collect();
            let all = postures.iter().filter(|_| pairs);
            let all: Vec<Vec<PairClearance>> = all.map(|q| model.all_pairs(q)).collect();
            (minima, all)
        });
        let by_class = PyDict::new(py);
        let classes = minima.first().map_or(0, Vec::len);
        for class in 0..classes {
            let found: Vec<&PairClearance> = minima.iter().map(|each| &each[class]).collect();
            let name = found[0].class.name();
            by_class.set_item(name, series(py, cell, &found, is_single)?)?;
        }
        let answer = PyDict::new(py);
        answer.set_item("classes", by_class)?;
        if pairs {
            answer.set_item("pairs", all_pairs(py, cell, &all, is_single)?)?;
        }
        Ok(answer)
    }

    /// Certified clearances of joint-space lines through postures, with the scenario's speeds.
    #[pyo3(signature = (joints, *, tolerance_m=1e-4))]
    fn certify<'py>(
        &self,
        py: Python<'py>,
        joints: &Bound<'py, PyAny>,
        tolerance_m: f64,
    ) -> PyResult<Bound<'py, PyDict>> {
        if !(1e-9..=0.1).contains(&tolerance_m) {
            return Err(wrong_argument(
                py,
                "tolerance_m",
                format!("{tolerance_m:?} is outside 1e-9 to 0.1 m"),
                "it is the largest gap between certified bound and attained minimum, in metres",
            ));
        }
        let (postures, _) = postures(joints, "joints")?;
        let Some((first, others)) = postures.split_first().filter(|(_, rest)| !rest.is_empty())
        else {
            return Err(wrong_argument(
                py,
                "joints",
                "a motion requires two postures or more",
                "give an array of shape (n, 6)",
            ));
        };
        let resolved = self.runnable.scenario();
        let motion = others
            .iter()
            .fold(JointTrajectory::starting_at(*first), |motion, q| {
                motion.then_straight_to(Phase::Transfer, *q, &resolved.motion)
            });
        let options = CertificateOptions {
            tolerance_m,
            ..CertificateOptions::default()
        };
        let certificate = py.detach(|| certify(&self.model, &motion, &options));
        let by_class = PyDict::new(py);
        for (class, found) in certificate.iter() {
            let one = [&found.attained];
            let row = series(py, &resolved.cell, &one, true)?;
            row.set_item("certified_lower_bound_m", found.lower_bound_m)?;
            row.set_item("time_s", found.time_s)?;
            let at: Joints = motion.sample(found.time_s).position;
            row.set_item(
                "joints_rad",
                array(py, at.as_slice().to_vec(), &[6], false)?,
            )?;
            by_class.set_item(class.name(), row)?;
        }
        let answer = PyDict::new(py);
        answer.set_item("classes", by_class)?;
        answer.set_item("duration_s", motion.duration_s())?;
        Ok(answer)
    }

    /// Plans, simulates and measures; writes to `out/NAME` if `out` is given.
    #[pyo3(signature = (*, engines=None, jobs=None, reference=false, out=None, pictures=true, page=true, record=None, progress=None))]
    #[expect(clippy::too_many_arguments, reason = "keywords of Python")]
    fn run<'py>(
        &self,
        py: Python<'py>,
        engines: Option<Vec<String>>,
        jobs: Option<usize>,
        reference: bool,
        out: Option<PathBuf>,
        pictures: bool,
        page: bool,
        record: Option<&str>,
        progress: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<(Run, Option<Py<PyAny>>)> {
        let engines = engines.map(|names| names.into_iter().map(EngineName).collect());
        let options = RunOptions {
            engines,
            jobs: threads(jobs),
            referee: reference,
            ..RunOptions::default()
        };
        options
            .chosen_engines(self.runnable.scenario())
            .map_err(|error| {
                wrong_argument(py, "engines", error.to_string(), "give names in a list")
            })?;
        let job = Job {
            runnable: Arc::clone(&self.runnable),
            overrides: Arc::clone(&self.overrides),
            results: Results {
                mcap: is_mcap(py, record, out.is_some())?,
                folder: out.map(|out| out.join(self.name())),
                pictures,
                page,
            },
            options,
        };
        let done = in_background(py, progress, move |task| job.run(task))?;
        match done.value {
            Ok((runnable, finished)) => {
                let interrupted = done
                    .interrupted
                    .map(|error| error.into_value(py).into_any());
                Ok((Run::new(runnable, finished), interrupted))
            }
            Err(failure) => Err(done
                .interrupted
                .unwrap_or_else(|| failure.into_exception(py))),
        }
    }
}

/// Threads of a call: as many as asked for, else all.
pub(crate) fn threads(jobs: Option<usize>) -> usize {
    let all = || std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    jobs.unwrap_or_else(all).max(1)
}

/// A run, on its own thread.
struct Job {
    runnable: Arc<Runnable>,
    overrides: Arc<Overrides>,
    results: Results,
    options: RunOptions,
}

/// Where results are written, and which; nowhere without a folder.
pub(crate) struct Results {
    pub folder: Option<PathBuf>,
    pub pictures: bool,
    pub page: bool,
    pub mcap: bool,
}

/// Whether recordings are to be written as MCAP files, into a folder that there is.
pub(crate) fn is_mcap(py: Python<'_>, record: Option<&str>, has_folder: bool) -> PyResult<bool> {
    match record {
        None => Ok(false),
        Some("mcap") if has_folder => Ok(true),
        Some(format) => {
            let message = format!("recordings as `{format}` cannot be written");
            let hint = "record=\"mcap\" writes them into the folder that `out` names";
            Err(wrong_argument(py, "record", message, hint))
        }
    }
}

impl Results {
    /// Makes the folder, before anything long starts.
    pub(crate) fn prepare(&self) -> Result<(), Failure> {
        let Some(folder) = &self.folder else {
            return Ok(());
        };
        std::fs::create_dir_all(folder).map_err(|error| {
            let message = format!("the results folder cannot be written: {error}");
            let finding = Finding::new(folder.display().to_string(), message);
            Failure::Input(vec![finding.key("out").hint("choose another folder")])
        })
    }

    /// Writes the results of a run, whose report then names the files.
    pub(crate) fn write(
        &self,
        resolved: &ResolvedScenario,
        finished: &mut ScenarioRun,
        jobs: usize,
        task: &Task,
    ) -> Result<(), Failure> {
        let Some(folder) = &self.folder else {
            return Ok(());
        };
        let files = RunFiles {
            rtde: false,
            mcap: self.mcap,
            pictures: self.pictures,
            page: self.page,
            jobs,
            cancel: &task.cancel,
            engines: ENGINES,
        };
        let progress = task.progress.as_ref();
        finished.report =
            write_run(resolved, finished, Folder(folder), files, progress).map_err(|error| {
                let folder = folder.display();
                Failure::Environment(format!("cannot write the results to {folder}: {error}"))
            })?;
        Ok(())
    }
}

/// Failures of a run.
pub(crate) enum Failure {
    Input(Vec<Finding>),
    Environment(String),
    Interrupted,
}

impl Failure {
    pub(crate) fn into_exception(self, py: Python<'_>) -> PyErr {
        match self {
            Self::Input(findings) => input_error(py, &findings),
            Self::Environment(message) => environment_failed(py, &message),
            Self::Interrupted => pyo3::exceptions::PyKeyboardInterrupt::new_err(()),
        }
    }
}

impl Job {
    fn run(self, task: &Task) -> Result<(Arc<Runnable>, ScenarioRun), Failure> {
        self.results.prepare()?;
        let runnable = self.scanned(task)?;
        let mut finished = needlebench_bench::run(
            &runnable,
            &self.options,
            &task.cancel,
            task.progress.as_ref(),
        )
        .map_err(|error| Failure::Environment(error.to_string()))?;
        self.results
            .write(runnable.scenario(), &mut finished, self.options.jobs, task)?;
        Ok((runnable, finished))
    }

    /// The scenario to run: that built from its scan, if it has a section `[ct]`.
    fn scanned(&self, task: &Task) -> Result<Arc<Runnable>, Failure> {
        let resolved = self.runnable.scenario();
        if resolved.scenario.ct.is_none() {
            return Ok(Arc::clone(&self.runnable));
        }
        let refused = Failure::Input;
        let resolved = match &self.results.folder {
            None => scanned(resolved.clone(), &self.overrides, &mut LastScan::default())
                .map_err(refused)?,
            Some(folder) => {
                let control = Control {
                    threads: self.options.jobs,
                    cancel: &task.cancel,
                    progress: task.progress.as_ref(),
                };
                let files = BuildFiles {
                    labels: true,
                    ..BuildFiles::default()
                };
                let folder = folder.join("ct");
                let made = std::fs::create_dir_all(&folder)
                    .map_err(|error| Failure::Environment(error.to_string()));
                made?;
                imaged(resolved, &folder, &self.overrides, &files, None, &control)
                    .map_err(|stop| match stop {
                        Stop::Interrupted => Failure::Interrupted,
                        Stop::Refused(findings) => Failure::Input(findings),
                    })?
                    .scenario
            }
        };
        let runnable = Runnable::checked(resolved).map_err(|finding| refused(vec![finding]))?;
        Ok(Arc::new(runnable))
    }
}

/// The two solids of a pair.
fn solids(cell: &Cell, pair: &PairClearance) -> (String, String) {
    let (a, b) = pair.solid_names(cell);
    (a.to_owned(), b.to_owned())
}

fn witnesses(pair: &PairClearance) -> [f64; 6] {
    let (a, b) = (pair.separation.point_on_a, pair.separation.point_on_b);
    [a.x, a.y, a.z, b.x, b.y, b.z]
}

/// The clearances of one class, for each posture.
fn series<'py>(
    py: Python<'py>,
    cell: &Cell,
    found: &[&PairClearance],
    is_single: bool,
) -> PyResult<Bound<'py, PyDict>> {
    let count = found.len();
    let distances = found
        .iter()
        .map(|pair| pair.separation.distance_m)
        .collect();
    let points = found.iter().flat_map(|pair| witnesses(pair)).collect();
    let made = PyDict::new(py);
    made.set_item("minimum_m", array(py, distances, &[count], is_single)?)?;
    let pairs = PyList::new(py, found.iter().map(|pair| solids(cell, pair)))?;
    if is_single {
        made.set_item("pair", pairs.get_item(0)?)?;
    } else {
        made.set_item("pair", pairs)?;
    }
    let shape = [count, 2, 3];
    made.set_item("witness_points_m", array(py, points, &shape, is_single)?)?;
    Ok(made)
}

/// All pairs of bodies, the same for each posture.
fn all_pairs<'py>(
    py: Python<'py>,
    cell: &Cell,
    all: &[Vec<PairClearance>],
    is_single: bool,
) -> PyResult<Bound<'py, PyDict>> {
    let made = PyDict::new(py);
    let (count, pairs) = (all.len(), all.first().map_or(0, Vec::len));
    let names = all.iter().take(1).flatten().map(|found| {
        let bodies = cell.pairs[found.pair];
        let name = |body: usize| cell.bodies[body].name.clone();
        (name(bodies.a), name(bodies.b))
    });
    made.set_item("pair", PyList::new(py, names)?)?;
    let classes = all.iter().take(1).flatten().map(|found| found.class.name());
    made.set_item("class", PyList::new(py, classes)?)?;
    let flat = all.iter().flatten();
    let distances = flat
        .clone()
        .map(|pair| pair.separation.distance_m)
        .collect();
    made.set_item(
        "distance_m",
        array(py, distances, &[count, pairs], is_single)?,
    )?;
    let points = flat.flat_map(witnesses).collect();
    let shape = [count, pairs, 2, 3];
    made.set_item("witness_points_m", array(py, points, &shape, is_single)?)?;
    let of_posture =
        |found: &Vec<PairClearance>| PyList::new(py, found.iter().map(|pair| solids(cell, pair)));
    let solids = PyList::new(
        py,
        all.iter().map(of_posture).collect::<PyResult<Vec<_>>>()?,
    )?;
    if is_single {
        made.set_item("solids", solids.get_item(0)?)?;
    } else {
        made.set_item("solids", solids)?;
    }
    Ok(made)
}
