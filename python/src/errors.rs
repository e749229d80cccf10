//! Errors as exceptions of the package.

use needlebench::findings_text;
use needlebench_input::Finding;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

/// Findings as the values of `needlebench.Finding`.
pub(crate) fn values<'py>(py: Python<'py>, findings: &[Finding]) -> PyResult<Bound<'py, PyList>> {
    let rows = findings.iter().map(|finding| {
        let row = PyDict::new(py);
        row.set_item("file", &finding.file)?;
        row.set_item("line", finding.line)?;
        row.set_item("key", &finding.key)?;
        row.set_item("message", &finding.message)?;
        row.set_item("hint", &finding.hint)?;
        Ok(row)
    });
    PyList::new(py, rows.collect::<PyResult<Vec<_>>>()?)
}

/// `needlebench.InputError` with the lines of the command line.
pub(crate) fn input_error(py: Python<'_>, findings: &[Finding]) -> PyErr {
    let text = findings_text(findings);
    let made = values(py, findings).and_then(|values| {
        let class = py.import("needlebench._errors")?.getattr("InputError")?;
        class.call1((text.trim_end(), values))
    });
    made.map_or_else(|error| error, PyErr::from_value)
}

/// The same of one argument.
pub(crate) fn wrong_argument(
    py: Python<'_>,
    argument: &str,
    message: impl Into<String>,
    hint: impl Into<String>,
) -> PyErr {
    let message: String = message.into();
    let finding = Finding::new(argument, message).hint(hint);
    input_error(py, &[finding])
}

/// `needlebench.EnvironmentFailed`.
pub(crate) fn environment_failed(py: Python<'_>, message: &str) -> PyErr {
    let made = py
        .import("needlebench._errors")
        .and_then(|module| module.getattr("EnvironmentFailed"))
        .and_then(|class| class.call1((message,)));
    made.map_or_else(|error| error, PyErr::from_value)
}
