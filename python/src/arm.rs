//! An arm: forward kinematics and joint limits.

use std::path::PathBuf;
use std::sync::Arc;

use needlebench::KinematicArm;
use needlebench_bench::EntryFinder;
use needlebench_cell::Robot;
use needlebench_engine::{ENGINES, engine_names};
use needlebench_input::PackagePaths;
use needlebench_kinematics::{Joints, Pose, UrModel};
use needlebench_scenario::{EntryChooser, Overrides, load_robot};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{array, poses, postures};
use crate::errors::{input_error, wrong_argument};

/// The arm with a name.
pub(crate) fn model_named(py: Python<'_>, name: &str) -> PyResult<UrModel> {
    name.parse()
        .map_err(|error: needlebench_kinematics::UnknownUrModel| {
            wrong_argument(
                py,
                "arm",
                error.to_string(),
                "Arm(robot=...) reads the URDF of another arm",
            )
        })
}

/// Files and packages that override parts of a scenario or an arm.
pub(crate) fn overrides(
    py: Python<'_>,
    robot: Option<PathBuf>,
    arm: Option<String>,
    prefix: Option<String>,
    calibration: Option<PathBuf>,
    packages: Option<Vec<String>>,
    missing_inertia: Option<&str>,
) -> PyResult<Overrides> {
    let packages = PackagePaths::from_arguments(&packages.unwrap_or_default())
        .map_err(|finding| input_error(py, &[finding]))?;
    let missing_inertia = missing_inertia
        .map(|text| {
            text.parse().map_err(|error: String| {
                let hint = "give a policy for links without inertia";
                wrong_argument(py, "missing_inertia", error, hint)
            })
        })
        .transpose()?;
    Ok(Overrides {
        robot_urdf: robot,
        expanded: None,
        arm,
        prefix,
        packages,
        calibration,
        engines: engine_names(ENGINES),
        missing_inertia,
        choose_entry: Some(EntryChooser(Arc::new(EntryFinder::default()))),
    })
}

/// An arm: a model by its name, or a URDF.
#[pyclass(frozen, module = "needlebench._native")]
pub(crate) struct Arm {
    arm: KinematicArm,
}

#[pymethods]
impl Arm {
    #[new]
    #[pyo3(signature = (arm=None, *, robot=None, prefix=None, calibration=None, packages=None))]
    fn new(
        py: Python<'_>,
        arm: Option<&str>,
        robot: Option<PathBuf>,
        prefix: Option<String>,
        calibration: Option<PathBuf>,
        packages: Option<Vec<String>>,
    ) -> PyResult<Self> {
        if let Some(name) = arm {
            if robot.is_some() {
                return Err(wrong_argument(
                    py,
                    "arm",
                    "both a model and a URDF are given",
                    "give one of `arm` and `robot`",
                ));
            }
            let model = model_named(py, name)?;
            let arm = KinematicArm::of_model(model, calibration.as_deref());
            let arm = arm.map_err(|finding| input_error(py, &[finding]))?;
            return Ok(Self { arm });
        }
        let overrides = overrides(py, robot, None, prefix, calibration, packages, None)?;
        let robot = load_robot(&overrides).map_err(|finding| input_error(py, &[finding]))?;
        Ok(Self {
            arm: KinematicArm::of_robot(&robot.robot, &robot.description),
        })
    }

    /// The manufacturer's name if it is a known arm.
    #[getter]
    fn name(&self) -> &str {
        &self.arm.name
    }

    fn __repr__(&self) -> String {
        format!("Arm({})", self.arm.name)
    }

    /// Lower and upper joint limits, rad: two arrays of six; infinite for joints without limits.
    #[getter]
    fn limits_rad<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        let limits = &self.arm.limits;
        let lower = limits.0.map(|limit| limit.lower_rad);
        let upper = limits.0.map(|limit| limit.upper_rad);
        Ok((
            array(py, lower.to_vec(), &[6], false)?,
            array(py, upper.to_vec(), &[6], false)?,
        ))
    }

    /// Poses of flange and links.
    fn fk<'py>(&self, py: Python<'py>, joints: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyDict>> {
        forward(py, &self.arm, joints)
    }
}

/// Poses of flange and links of an arm of this name.
#[pyfunction]
#[pyo3(signature = (joints, arm="UR3"))]
pub(crate) fn fk<'py>(
    py: Python<'py>,
    joints: &Bound<'py, PyAny>,
    arm: &str,
) -> PyResult<Bound<'py, PyDict>> {
    let model = model_named(py, arm)?;
    let arm = KinematicArm::of_model(model, None).map_err(|finding| input_error(py, &[finding]))?;
    forward(py, &arm, joints)
}

/// The answer of the command `fk`, for every posture.
pub(crate) fn forward<'py>(
    py: Python<'py>,
    arm: &KinematicArm,
    joints: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyDict>> {
    let (postures, is_single) = postures(joints, "joints")?;
    let turn = Robot::base_link_from_base().inverse();
    let flange = |q: &Joints| arm.chain.base_link_from_flange(q);
    let in_base_link: Vec<Pose> = postures.iter().map(flange).collect();
    let in_base: Vec<Pose> = in_base_link.iter().map(|pose| turn * pose).collect();
    let links: Vec<[Pose; 6]> = postures.iter().map(|q| arm.chain.link_poses(q)).collect();
    let made = PyDict::new(py);
    made.set_item("flange_in_base", poses(py, &in_base, is_single)?)?;
    made.set_item("flange_in_base_link", poses(py, &in_base_link, is_single)?)?;
    let by_link = PyDict::new(py);
    for (link, name) in arm.links.iter().enumerate() {
        let of_link: Vec<Pose> = links.iter().map(|poses| poses[link]).collect();
        by_link.set_item(format!("{name}_link"), poses(py, &of_link, is_single)?)?;
    }
    made.set_item("links", by_link)?;
    Ok(made)
}
