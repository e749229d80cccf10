//! needlebench for Python: fast functions on arrays, long ones through the functions of the command line.
//!
//! Private to the Python package beside it (`needlebench/`), which has the documentation for users. This module only
//! checks and arranges arrays, calls functions without the interpreter's lock, and converts errors to exceptions with the
//! lines and hints of the command line.

mod arm;
mod arrays;
mod background;
mod errors;
mod ik;
mod judge;
mod run;
mod scenario;

use pyo3::prelude::*;

#[pymodule]
mod _native {
    #[pymodule_export]
    use crate::arm::{Arm, fk};
    #[pymodule_export]
    use crate::background::{invoke, main};
    #[pymodule_export]
    use crate::ik::{IkAnswers, ik};
    #[pymodule_export]
    use crate::judge::{judge, judge_answers, judge_free};
    #[pymodule_export]
    use crate::run::Run;
    #[pymodule_export]
    use crate::scenario::Scenario;
    use needlebench_cell::ClearanceClass;
    use needlebench_kinematics::ik::{Certificate, Configuration};
    use needlebench_kinematics::{JOINT_NAMES, UrModel};
    use pyo3::prelude::*;
    use pyo3::types::{PyModule, PyTuple};

    /// Names in the order of arrays.
    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        let py = module.py();
        let tuple = |names: Vec<&'static str>| PyTuple::new(py, names);
        module.add("VERSION", env!("CARGO_PKG_VERSION"))?;
        let configurations = Configuration::ALL.map(Configuration::label);
        module.add("CONFIGURATIONS", tuple(configurations.to_vec())?)?;
        let certificates = Certificate::ALL.map(Certificate::name);
        module.add("CERTIFICATES", tuple(certificates.to_vec())?)?;
        module.add("JOINT_NAMES", tuple(JOINT_NAMES.to_vec())?)?;
        let arms = UrModel::ALL.map(UrModel::name);
        module.add("ARMS", tuple(arms.to_vec())?)?;
        let classes = ClearanceClass::ALL.map(ClearanceClass::name);
        module.add("CLEARANCE_CLASSES", tuple(classes.to_vec())?)
    }
}
