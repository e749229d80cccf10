//! Long work beside the interpreter: without its lock, watched, and ended by its signals.

use std::ffi::OsString;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::Duration;

use needlebench_bench::progress::Progress;
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use pyo3::types::PyList;

use crate::errors;

/// How often signals and progress are looked at.
const PERIOD: Duration = Duration::from_millis(50);

/// How far the work is.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
struct State {
    message: String,
    done: u64,
    total: u64,
    notices: Vec<String>,
}

/// Keeps how far the work is until somebody looks.
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

/// What long work is given.
#[derive(Clone)]
pub(crate) struct Task {
    pub cancel: Arc<AtomicBool>,
    pub progress: Arc<dyn Progress + Send + Sync>,
}

/// What became of long work.
pub(crate) struct Done<T> {
    pub value: T,
    /// What interrupted it: a signal's exception, or that of a callback.
    pub interrupted: Option<PyErr>,
}

/// Does long work on a thread of its own, tells `progress(message, done, total)` how far it is, and interrupts it when the
/// interpreter has a signal or the callback raises.
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
                    "this is a bug of needlebench, not of your input",
                ));
            }
        }
    }
}

/// Tells what is new.
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

/// What a command left: see [`invoke`].
type Answer<'py> = (u8, String, String, Bound<'py, PyList>, Option<Py<PyAny>>);

/// Runs a command of the command line in this process: its exit status, its output, its messages, what it found wrong, and
/// the exception that interrupted it.
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

/// The program on its terminal. Gives its exit status.
#[pyfunction]
pub(crate) fn main(py: Python<'_>, arguments: Vec<OsString>) -> u8 {
    py.detach(|| needlebench::main_with(arguments).code())
}
