//! Arrays in and out.

use std::f64::consts::TAU;
use std::ffi::CString;

use needlebench_kinematics::{JOINT_COUNT, Joints, Pose, rotation_vector};
use numpy::{
    IntoPyArray, PyArray1, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArrayMethods,
};
use pyo3::IntoPyObjectExt;
use pyo3::exceptions::PyUserWarning;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::errors::wrong_argument;

/// Doubles in rows of a NumPy array.
pub(crate) struct Rows<'py> {
    array: PyReadonlyArrayDyn<'py, f64>,
    /// Shape of one row.
    pub row: Vec<usize>,
    /// Number of rows.
    pub count: usize,
    /// It is a single row, not an array of rows.
    pub is_single: bool,
}

impl<'py> Rows<'py> {
    /// Reads anything that NumPy converts to an array: one row, or several, of one of the given shapes.
    pub fn new(given: &Bound<'py, PyAny>, name: &str, shapes: &[&[usize]]) -> PyResult<Self> {
        let py = given.py();
        let array = match given.cast::<PyArrayDyn<f64>>() {
            Ok(array) if array.is_c_contiguous() => array.clone(),
            _ => converted(given, name)?,
        };
        let shape = array.shape();
        let matching = |shape: &[usize]| shapes.iter().find(|row| **row == shape);
        let found = match matching(shape) {
            Some(row) => Some((row, 1, true)),
            None => shape
                .split_first()
                .and_then(|(&count, rest)| matching(rest).map(|row| (row, count, false))),
        };
        let Some((row, count, is_single)) = found else {
            return Err(wrong_argument(
                py,
                name,
                format!("it has the shape {}", in_words(shape)),
                format!(
                    "one row has the shape {}; several are an array of rows",
                    options(shapes)
                ),
            ));
        };
        Ok(Self {
            array: array.try_readonly()?,
            row: row.to_vec(),
            count,
            is_single,
        })
    }

    /// All numbers, row after row.
    pub fn numbers(&self) -> PyResult<&[f64]> {
        Ok(self.array.as_slice()?)
    }
}

fn converted<'py>(given: &Bound<'py, PyAny>, name: &str) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
    let py = given.py();
    let options = PyDict::new(py);
    options.set_item("dtype", "float64")?;
    options.set_item("order", "C")?;
    let array = py
        .import("numpy")?
        .call_method("asarray", (given,), Some(&options))
        .map_err(|error| {
            let message = format!("not an array of numbers: {}", error.value(py));
            wrong_argument(
                py,
                name,
                message,
                "give a list of numbers, or a NumPy array",
            )
        })?;
    Ok(array.cast_into()?)
}

fn in_words(shape: &[usize]) -> String {
    let sizes: Vec<String> = shape.iter().map(usize::to_string).collect();
    match sizes.as_slice() {
        [one] => format!("({one},)"),
        several => format!("({})", several.join(", ")),
    }
}

fn options(shapes: &[&[usize]]) -> String {
    let shapes: Vec<String> = shapes.iter().map(|shape| in_words(shape)).collect();
    shapes.join(" or ")
}

/// Joint positions of one posture or several, rad; rejects numbers that are not finite.
pub(crate) fn postures(given: &Bound<'_, PyAny>, name: &str) -> PyResult<(Vec<Joints>, bool)> {
    let rows = Rows::new(given, name, &[&[JOINT_COUNT]])?;
    let numbers = rows.numbers()?;
    if let Some(at) = numbers.iter().position(|value| !value.is_finite()) {
        let message = format!(
            "joint {} of posture {} is {}",
            at % JOINT_COUNT + 1,
            at / JOINT_COUNT,
            numbers[at]
        );
        return Err(wrong_argument(
            given.py(),
            name,
            message,
            "joint positions are numbers in rad",
        ));
    }
    // As on the command line: no arm has joint positions of more than two turns.
    if let Some(most) = numbers.iter().find(|value| value.abs() > 2.0 * TAU) {
        let text = format!(
            "joint positions are in rad, and {most} rad are {:.1} turns; {most} deg would be {:.4} rad",
            most / TAU,
            most.to_radians()
        );
        let text = CString::new(text)?;
        let category = given.py().get_type::<PyUserWarning>();
        PyErr::warn(given.py(), &category, &text, 2)?;
    }
    let postures = numbers.chunks_exact(JOINT_COUNT);
    Ok((
        postures.map(Joints::from_column_slice).collect(),
        rows.is_single,
    ))
}

/// A NumPy array of doubles in the given shape; without its first axis for a single item.
pub(crate) fn array<'py>(
    py: Python<'py>,
    values: Vec<f64>,
    shape: &[usize],
    is_single: bool,
) -> PyResult<Bound<'py, PyAny>> {
    let shape = if is_single { &shape[1..] } else { shape };
    if shape.is_empty() {
        return values[0].into_bound_py_any(py);
    }
    let array = values.into_pyarray(py);
    array.call_method1("reshape", (shape.to_vec(),))
}

/// Poses as arrays: positions (m), quaternions (w first), rotation vectors (rad), 4 x 4 matrices.
pub(crate) fn poses<'py>(
    py: Python<'py>,
    poses: &[Pose],
    is_single: bool,
) -> PyResult<Bound<'py, PyDict>> {
    let count = poses.len();
    let (mut positions, mut quaternions) = (Vec::new(), Vec::new());
    let (mut vectors, mut matrices) = (Vec::new(), Vec::new());
    for pose in poses {
        let q = pose.rotation;
        positions.extend_from_slice(pose.translation.vector.as_slice());
        quaternions.extend([q.w, q.i, q.j, q.k]);
        vectors.extend_from_slice(rotation_vector(&q).as_slice());
        // NumPy's rows are nalgebra's columns of the transpose.
        matrices.extend_from_slice(pose.to_homogeneous().transpose().as_slice());
    }
    let made = PyDict::new(py);
    made.set_item("position_m", array(py, positions, &[count, 3], is_single)?)?;
    made.set_item("quat_wxyz", array(py, quaternions, &[count, 4], is_single)?)?;
    made.set_item("rotvec_rad", array(py, vectors, &[count, 3], is_single)?)?;
    made.set_item("matrix", array(py, matrices, &[count, 4, 4], is_single)?)?;
    Ok(made)
}

/// A flat array of doubles.
pub(crate) type Flat = PyArray1<f64>;
