//! Long work beside the interpreter: without its lock, with progress, interrupted by its signals.

use std::ffi::OsString;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::Duration;

use needlebench_parallel::Progress;
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use pyo3::types::PyList;

use crate::errors;

/// Polling period of signals and progress.
const PERIOD: Duration = Duration::from_millis(50);

/// Progress of the work.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
struct State {
    message: String,
    done: u64,
    total: u64,
    notices: Vec<String>,
}

/// Stores the progress until it is polled.
#[derive(Debug, Default)]
struct Watched(Mutex<State>);

impl Watched {
    fn state(&self) -> MutexGuard<'_, State> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Progress for Watched {
    fn message(&self, text: &str) {
        text.clone_into(&mut self.state().message);
    }

    fn notice(&self, text: &str) {
        self.state().notices.push(text.to_owned());
    }

    fn expect(&self, steps: u64) {
        self.state().total += steps;
    }

    fn at(&self, done: u64, total: u64) {
        let mut state = self.state();
        (state.done, state.total) = (done, total);
    }

    fn step(&self) {
        self.state().done += 1;
    }
}

/// The context of long work.
#[derive(Clone)]
pub(crate) struct Task {
    pub cancel: Arc<AtomicBool>,
    pub progress: Arc<dyn Progress + Send + Sync>,
}

/// The result of long work.
pub(crate) struct Done<T> {
    pub value: T,
    /// The exception that interrupted it: of a signal or of a callback.
    pub interrupted: Option<PyErr>,
}

/// Does long work on its own thread, calls `progress(message, done, total)`, and interrupts the work on a signal of the
/// interpreter or an exception of the callback.
pub(crate) fn in_background<T: Send + 'static>(
    py: Python<'_>,
    progress: Option<&Bound<'_, PyAny>>,
    work: impl FnOnce(&Task) -> T + Send + 'static,
) -> PyResult<Done<T>> {
    let watched = Arc::new(Watched::default());
    let task = Task {
        cancel: Arc::new(AtomicBool::new(false)),
        progress: Arc::clone(&watched) as Arc<dyn Progress + Send + Sync>,
    };
    let (sender, receiver) = channel();
    let own = task.clone();
    let worker = thread::Builder::new()
        .name("needlebench".to_owned())
        // As much as a program's first thread has.
        .stack_size(8 << 20)
        .spawn(move || {
            let value = work(&own);
            // Nobody waits any more if the interpreter ends.
            let _ = sender.send(value);
        })?;
    let receiver = Mutex::new(receiver);
    let mut interrupted = None;
    let mut told = State::default();
    loop {
        let received = py.detach(|| {
            let receiver = receiver.lock().unwrap_or_else(PoisonError::into_inner);
            receiver.recv_timeout(PERIOD)
        });
        let outcome = tell(progress, &watched, &mut told).and_then(|()| py.check_signals());
        if let Err(error) = outcome
            && interrupted.is_none()
        {
            task.cancel.store(true, Ordering::Relaxed);
            interrupted = Some(error);
        }
        match received {
            Ok(value) => {
                let _ = worker.join();
                return Ok(Done { value, interrupted });
            }
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => {
                return Err(PyRuntimeError::new_err(
                    "this is a bug in needlebench, not in your input",
                ));
            }
        }
    }
}

/// Calls the callback with new progress.
fn tell(progress: Option<&Bound<'_, PyAny>>, watched: &Watched, told: &mut State) -> PyResult<()> {
    let mut state = watched.state().clone();
    if state == *told {
        return Ok(());
    }
    let notices = std::mem::take(&mut state.notices);
    watched.state().notices.drain(..notices.len());
    if let Some(progress) = progress {
        for notice in notices {
            progress.call1((notice, state.done, state.total))?;
        }
        progress.call1((&state.message, state.done, state.total))?;
    }
    *told = state;
    Ok(())
}

/// The result of a command: see [`invoke`].
type Answer<'py> = (u8, String, String, Bound<'py, PyList>, Option<Py<PyAny>>);

/// Runs a command of the command line in this process; returns its exit status, output, messages, findings, and the
/// exception that interrupted it.
#[pyfunction]
#[pyo3(signature = (arguments, progress=None))]
pub(crate) fn invoke<'py>(
    py: Python<'py>,
    arguments: Vec<OsString>,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<Answer<'py>> {
    let done = in_background(py, progress, move |task| {
        needlebench::invoke(
            arguments,
            Arc::clone(&task.cancel),
            Arc::clone(&task.progress),
        )
    })?;
    let made = done.value;
    Ok((
        made.status.code(),
        made.output,
        made.messages,
        errors::values(py, &made.findings)?,
        done.interrupted
            .map(|error| error.into_value(py).into_any()),
    ))
}

/// Runs the program on its terminal. Returns its exit status.
#[pyfunction]
pub(crate) fn main(py: Python<'_>, arguments: Vec<OsString>) -> u8 {
    py.detach(|| needlebench::main_with(arguments).code())
}
