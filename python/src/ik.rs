//! Inverse kinematics of many poses in closed form, in memory shared with NumPy.

use std::sync::{LazyLock, Mutex, MutexGuard, PoisonError};

use nalgebra::{Quaternion, Translation3, Unit, Vector3};
use needlebench_kinematics::ik::{ClosedForm, Preference, Tolerance, closed_form_batch_within};
use needlebench_kinematics::{
    JointLimits, Joints, LimitPolicy, Pose, UrGeometry, UrModel, pose_from_matrix,
    pose_from_rotation_vector,
};
use numpy::{IntoPyArray, PyArrayMethods};
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PySlice};

use crate::arm::model_named;
use crate::arrays::{Flat, Rows, postures};
use crate::errors::wrong_argument;

/// Number of poses per block: they and their answers fit into the nearest caches.
const CHUNK: usize = 256;
/// Calls with fewer poses keep the interpreter's lock: releasing it costs as much as the work.
const DETACHED: usize = 64;

/// The solutions of poses in all eight configurations, without copies.
#[pyclass(frozen, module = "needlebench._native")]
pub(crate) struct IkAnswers {
    memory: Mutex<Memory>,
    count: usize,
    is_single: bool,
}

/// State of the memory of the answers.
enum Memory {
    /// Not shared with NumPy yet.
    Answers(Vec<ClosedForm>),
    /// Shared with NumPy.
    Array(Py<Flat>),
    /// Being written to without the interpreter's lock.
    InUse,
}

/// Solves poses of the flange in the controller's base frame for a nominal arm.
#[pyfunction]
#[pyo3(signature = (poses, arm="UR3", *, seed=None, tolerance=1e-7, out=None))]
pub(crate) fn ik<'py>(
    py: Python<'py>,
    poses: &Bound<'py, PyAny>,
    arm: &str,
    seed: Option<&Bound<'py, PyAny>>,
    tolerance: f64,
    out: Option<Bound<'py, IkAnswers>>,
) -> PyResult<Bound<'py, IkAnswers>> {
    let model = model_named(py, arm)?;
    if !(0.0..=1e-3).contains(&tolerance) {
        return Err(wrong_argument(
            py,
            "tolerance",
            format!("{tolerance:?} is outside 0 to 0.001 m and rad"),
            "the unit is metres and radians: 1e-6 is a micrometre and a microradian",
        ));
    }
    let seed = match seed {
        Some(seed) => postures(seed, "seed")?.0.first().copied(),
        None => None,
    };
    let rows = Rows::new(poses, "poses", &[&[7], &[6], &[4, 4]])?;
    let asked = Asked {
        geometry: geometry_of(model),
        limits: LimitPolicy::of_ros(model).limits_of(model),
        seed,
        tolerance: Tolerance {
            m: tolerance,
            rad: tolerance,
        },
    };
    let numbers = rows.numbers()?;
    let layout = match rows.row.as_slice() {
        [7] => Layout::Quaternion,
        [6] => Layout::RotationVector,
        _ => Layout::Matrix,
    };
    layout
        .check(numbers)
        .map_err(|(message, hint)| wrong_argument(py, "poses", message, hint))?;
    let Some(out) = out else {
        let answers = aside(py, rows.count, || asked.solve_anew(layout, numbers));
        return Bound::new(
            py,
            IkAnswers {
                memory: Mutex::new(Memory::Answers(answers)),
                count: rows.count,
                is_single: rows.is_single,
            },
        );
    };
    if out.get().count != rows.count || out.get().is_single != rows.is_single {
        return Err(wrong_argument(
            py,
            "out",
            format!(
                "it has space for {} poses, {} given",
                out.get().count,
                rows.count
            ),
            "use the answers of an earlier call with poses of the same shape, or omit `out`",
        ));
    }
    out.get().fill(py, &asked, layout, numbers)?;
    Ok(out)
}

/// Link lengths of the command line, bit for bit, recovered from the chain.
fn geometry_of(model: UrModel) -> UrGeometry {
    static FOUND: LazyLock<Vec<(UrModel, UrGeometry)>> = LazyLock::new(|| {
        let found = |model: UrModel| {
            let nominal = model.geometry();
            UrGeometry::of_chain(&nominal.chain()).unwrap_or(nominal)
        };
        UrModel::ALL.map(|model| (model, found(model))).to_vec()
    });
    let found = FOUND.iter().find(|(each, _)| *each == model);
    found.map_or_else(|| model.geometry(), |(_, geometry)| *geometry)
}

/// Releases the interpreter's lock if the work is long enough.
fn aside<T: Send>(py: Python<'_>, count: usize, work: impl FnOnce() -> T + Send) -> T {
    if count < DETACHED {
        work()
    } else {
        py.detach(work)
    }
}

/// Layout of a pose in an array.
#[derive(Clone, Copy)]
enum Layout {
    /// Position (m), quaternion (w, x, y, z).
    Quaternion,
    /// Position (m), rotation vector (rad).
    RotationVector,
    /// 4 x 4, row by row.
    Matrix,
}

/// A coordinate above this is in another unit, m; as on the command line.
const FARTHEST_M: f64 = 10.0;

impl Layout {
    fn length(self) -> usize {
        match self {
            Self::Quaternion => 7,
            Self::RotationVector => 6,
            Self::Matrix => 16,
        }
    }

    /// Rejects what the command line rejects, with row and hint. Invalid quaternions get a certificate of their own.
    fn check(self, numbers: &[f64]) -> Result<(), (String, String)> {
        if matches!(self, Self::Quaternion) {
            return Ok(());
        }
        for (row, pose) in numbers.chunks_exact(self.length()).enumerate() {
            self.check_one(pose)
                .map_err(|(message, hint)| (format!("pose {row}: {message}"), hint))?;
        }
        Ok(())
    }

    fn check_one(self, pose: &[f64]) -> Result<(), (String, String)> {
        let position = match self {
            Self::Matrix => [pose[3], pose[7], pose[11]],
            _ => [pose[0], pose[1], pose[2]],
        };
        if !position.iter().all(|value| value.abs() <= FARTHEST_M) {
            let [x, y, z] = position;
            let message =
                format!("the position is {x:?}, {y:?}, {z:?} m, but no arm reaches {FARTHEST_M} m");
            return Err((message, "x, y and z are in metres".to_owned()));
        }
        match self {
            Self::Quaternion => Ok(()),
            Self::RotationVector => {
                let angle_rad = Vector3::new(pose[3], pose[4], pose[5]).norm();
                // A little over a whole turn is still rounding.
                if angle_rad <= 1.01 * std::f64::consts::TAU {
                    return Ok(());
                }
                let message = format!(
                    "the length of the rotation vector is {angle_rad:.4} rad, above a full turn of {:.4} rad",
                    std::f64::consts::TAU
                );
                let hint =
                    "rx, ry and rz are axis times angle in radians, as shown by the controller";
                Err((message, hint.to_owned()))
            }
            Self::Matrix => {
                if pose[12..] != [0.0, 0.0, 0.0, 1.0] {
                    let message = format!("the last row of the matrix is {:?}", &pose[12..]);
                    return Err((message, "0, 0, 0, 1 required".to_owned()));
                }
                match pose_from_matrix(&rotation_of(pose), Vector3::zeros()) {
                    Ok(_) => Ok(()),
                    Err(error) => Err((
                        error.to_string(),
                        "the columns are the axes of the flange, each of length 1".to_owned(),
                    )),
                }
            }
        }
    }

    fn pose(numbers: &[f64]) -> Pose {
        match *numbers {
            [x, y, z, w, i, j, k] => of_quaternion(&[x, y, z, w, i, j, k]),
            [x, y, z, rx, ry, rz] => {
                pose_from_rotation_vector(Vector3::new(x, y, z), Vector3::new(rx, ry, rz))
            }
            _ => {
                let position = Vector3::new(numbers[3], numbers[7], numbers[11]);
                // They were checked.
                pose_from_matrix(&rotation_of(numbers), position)
                    .unwrap_or_else(|_| Pose::identity())
            }
        }
    }
}

/// The numbers unchanged: an invalid rotation gets a certificate of its own.
#[inline]
fn of_quaternion(&[x, y, z, w, i, j, k]: &[f64; 7]) -> Pose {
    Pose::from_parts(
        Translation3::new(x, y, z),
        Unit::new_unchecked(Quaternion::new(w, i, j, k)),
    )
}

fn rotation_of(pose: &[f64]) -> nalgebra::Matrix3<f64> {
    nalgebra::Matrix3::from_fn(|row, column| pose[4 * row + column])
}

/// The settings for every pose.
struct Asked {
    geometry: UrGeometry,
    limits: JointLimits,
    seed: Option<Joints>,
    tolerance: Tolerance,
}

impl Asked {
    /// Solves into new memory, each part of which is first written while it is in a cache.
    fn solve_anew(&self, layout: Layout, numbers: &[f64]) -> Vec<ClosedForm> {
        let count = numbers.len() / layout.length();
        let mut answers = Vec::with_capacity(count);
        for chunk in numbers.chunks(CHUNK * layout.length()) {
            let first = answers.len();
            answers.resize(first + chunk.len() / layout.length(), ClosedForm::BLANK);
            self.solve_chunk(layout, chunk, &mut answers[first..]);
        }
        answers
    }

    /// Solves into existing memory.
    fn solve_into(&self, layout: Layout, numbers: &[f64], answers: &mut [ClosedForm]) {
        let chunks = numbers.chunks(CHUNK * layout.length());
        for (chunk, answers) in chunks.zip(answers.chunks_mut(CHUNK)) {
            self.solve_chunk(layout, chunk, answers);
        }
    }

    fn solve_chunk(&self, layout: Layout, numbers: &[f64], answers: &mut [ClosedForm]) {
        let mut poses = [Pose::identity(); CHUNK];
        let poses = &mut poses[..answers.len()];
        if let Layout::Quaternion = layout {
            for (pose, numbers) in poses.iter_mut().zip(numbers.as_chunks().0) {
                *pose = of_quaternion(numbers);
            }
        } else {
            for (pose, numbers) in poses.iter_mut().zip(numbers.chunks_exact(layout.length())) {
                *pose = Layout::pose(numbers);
            }
        }
        let preference = Preference {
            seed: self.seed.as_ref(),
            limits: Some(&self.limits),
        };
        closed_form_batch_within(&self.geometry, poses, preference, self.tolerance, answers);
        for answer in answers {
            answer.blank_missing();
        }
    }
}

impl IkAnswers {
    fn memory(&self) -> MutexGuard<'_, Memory> {
        self.memory.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Solves into the same memory.
    fn fill(&self, py: Python<'_>, asked: &Asked, layout: Layout, numbers: &[f64]) -> PyResult<()> {
        // Nobody waits for the memory while holding the interpreter's lock.
        let taken = std::mem::replace(&mut *self.memory(), Memory::InUse);
        let (kept, outcome) = match taken {
            Memory::Answers(mut answers) => {
                aside(py, self.count, || {
                    asked.solve_into(layout, numbers, &mut answers);
                });
                (Memory::Answers(answers), Ok(()))
            }
            Memory::Array(array) => {
                let outcome = self.fill_array(py, array.bind(py), asked, layout, numbers);
                (Memory::Array(array), outcome)
            }
            Memory::InUse => {
                return Err(PyRuntimeError::new_err(
                    "another thread is writing to these answers",
                ));
            }
        };
        *self.memory() = kept;
        outcome
    }

    fn fill_array(
        &self,
        py: Python<'_>,
        array: &Bound<'_, Flat>,
        asked: &Asked,
        layout: Layout,
        numbers: &[f64],
    ) -> PyResult<()> {
        let mut borrowed = array.try_readwrite()?;
        let doubles = borrowed.as_slice_mut()?;
        let answers = ClosedForm::of_doubles(doubles).ok_or_else(|| {
            PyRuntimeError::new_err("the memory of these answers was changed by other code")
        })?;
        aside(py, self.count, || {
            asked.solve_into(layout, numbers, answers);
        });
        Ok(())
    }

    /// Shares the memory with NumPy.
    fn array<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, Flat>> {
        let mut memory = self.memory();
        let made = match std::mem::replace(&mut *memory, Memory::InUse) {
            Memory::Answers(answers) => ClosedForm::into_doubles(answers).into_pyarray(py),
            Memory::Array(array) => array.into_bound(py),
            Memory::InUse => {
                return Err(PyRuntimeError::new_err(
                    "another thread is writing to these answers",
                ));
            }
        };
        *memory = Memory::Array(made.clone().unbind());
        Ok(made)
    }

    /// A column of bytes behind the joint positions.
    fn bytes<'py>(&self, py: Python<'py>, column: Column) -> PyResult<Bound<'py, PyAny>> {
        let bytes = self
            .array(py)?
            .call_method1("view", ("uint8",))?
            .call_method1("reshape", (self.count, 8 * ClosedForm::DOUBLES))?;
        let all = PySlice::full(py);
        bytes.get_item((all, ClosedForm::BYTES[column as usize]))
    }

    /// Bits of a column of bytes, one boolean a configuration.
    fn bits<'py>(&self, py: Python<'py>, column: Column) -> PyResult<Bound<'py, PyAny>> {
        let options = PyDict::new(py);
        options.set_item("bitorder", "little")?;
        let bytes = self.bytes(py, column)?;
        let bits = py
            .import("numpy")?
            .call_method("unpackbits", (bytes,), Some(&options))?
            .call_method1("view", ("bool",))?
            .call_method1("reshape", (self.count, 8))?;
        self.first_if_single(bits)
    }

    fn first_if_single<'py>(&self, array: Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        if self.is_single {
            array.get_item(0)
        } else {
            Ok(array)
        }
    }
}

/// Offsets in [`ClosedForm::BYTES`].
#[derive(Clone, Copy)]
enum Column {
    Exists,
    Merged,
    Free,
    Touching,
    Certificate,
}

#[pymethods]
impl IkAnswers {
    /// Number of poses.
    fn __len__(&self) -> usize {
        self.count
    }

    fn __repr__(&self) -> String {
        format!("IkAnswers of {} poses", self.count)
    }

    /// Joint positions, rad: (n, 8, 6), by configuration; NaN without a solution. A view.
    #[getter]
    fn joints<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let array = self
            .array(py)?
            .call_method1("reshape", (self.count, ClosedForm::DOUBLES))?;
        let all = PySlice::full(py);
        let joints = array
            .get_item((all, PySlice::new(py, 0, 48, 1)))?
            .call_method1("reshape", (self.count, 6, 8))?
            .call_method1("transpose", (0, 2, 1))?;
        let options = PyDict::new(py);
        options.set_item("write", false)?;
        joints.call_method("setflags", (), Some(&options))?;
        self.first_if_single(joints)
    }

    /// Which configurations have a solution: (n, 8).
    #[getter]
    fn exists<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.bits(py, Column::Exists)
    }

    /// Which are coincident solutions: (n, 8).
    #[getter]
    fn merged<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.bits(py, Column::Merged)
    }

    /// Which stand for a family of solutions with free wrist 3: (n, 8).
    #[getter]
    fn wrist_3_is_free<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.bits(py, Column::Free)
    }

    /// Which are boundary solutions: (n, 8).
    #[getter]
    fn touching<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.bits(py, Column::Touching)
    }

    /// Certificates of completeness, as indices into `CERTIFICATES`: (n,). A view.
    #[getter]
    fn certificate<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let bytes = self.bytes(py, Column::Certificate)?;
        self.first_if_single(bytes)
    }
}
