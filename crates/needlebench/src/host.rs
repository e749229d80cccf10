//! Commands inside another program, such as Python: their output is returned, and that program handles interrupts and
//! progress.

use std::cell::RefCell;
use std::fmt;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex, PoisonError};

use needlebench_input::Finding;
use needlebench_parallel::Progress;

use crate::exit::ExitStatus;

/// The result of a command.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Invocation {
    /// Its exit status.
    pub status: ExitStatus,
    /// The text for standard output.
    pub output: String,
    /// The text for standard error, without colours and progress.
    pub messages: String,
    /// Errors in its input.
    pub findings: Vec<Finding>,
}

/// The program that a command runs in.
struct Host {
    cancel: Arc<AtomicBool>,
    progress: Arc<dyn Progress + Send + Sync>,
    said: Mutex<Said>,
}

#[derive(Default)]
struct Said {
    output: String,
    messages: String,
    findings: Vec<Finding>,
}

thread_local! {
    static HOST: RefCell<Option<Arc<Host>>> = const { RefCell::new(None) };
}

/// Runs a command on this thread as part of another program: nothing is printed, and signals are left alone.
///
/// Setting `cancel` is an interrupt.
pub(crate) fn hosted(
    cancel: Arc<AtomicBool>,
    progress: Arc<dyn Progress + Send + Sync>,
    run: impl FnOnce() -> ExitStatus,
) -> Invocation {
    let host = Arc::new(Host {
        cancel,
        progress,
        said: Mutex::default(),
    });
    let before = HOST.replace(Some(Arc::clone(&host)));
    let status = needlebench_show::layout::for_file(run);
    HOST.set(before);
    let said = std::mem::take(&mut *host.said());
    Invocation {
        status,
        output: said.output,
        messages: said.messages,
        findings: said.findings,
    }
}

impl Host {
    fn said(&self) -> std::sync::MutexGuard<'_, Said> {
        self.said.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl fmt::Debug for Host {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.debug_struct("Host").finish_non_exhaustive()
    }
}

/// Calls a function with the host of this thread, if there is one.
fn with<T>(ask: impl FnOnce(&Host) -> T) -> Option<T> {
    HOST.with_borrow(|host| host.as_deref().map(ask))
}

/// Whether this thread's command runs in another program.
pub(crate) fn is_hosted() -> bool {
    with(|_| ()).is_some()
}

/// Stores a line of output; `false` if it must be printed.
pub(crate) fn take_output(text: &str) -> bool {
    with(|host| push_line(&mut host.said().output, text)).is_some()
}

/// Stores a line of standard error; `false` if it must be printed.
pub(crate) fn take_message(text: &str) -> bool {
    with(|host| push_line(&mut host.said().messages, text)).is_some()
}

/// Stores findings, in addition to their printed lines.
pub(crate) fn take_findings(findings: &[Finding]) {
    let _ = with(|host| host.said().findings.extend_from_slice(findings));
}

/// The flag with which the host interrupts.
pub(crate) fn cancel() -> Option<Arc<AtomicBool>> {
    with(|host| Arc::clone(&host.cancel))
}

/// The progress of the host.
pub(crate) fn progress() -> Option<Arc<dyn Progress + Send + Sync>> {
    with(|host| Arc::clone(&host.progress))
}

/// Adds a line without its colours.
fn push_line(text: &mut String, line: &str) {
    text.push_str(&anstream::adapter::strip_str(line).to_string());
    text.push('\n');
}
