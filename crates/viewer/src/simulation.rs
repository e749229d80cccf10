//! A plan simulated in the background: `needlebench run` as a process of its own.

use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::{Arc, Mutex, PoisonError};

use axum::http::StatusCode;
use serde::Serialize;

use crate::answer::Problem;

/// Folder of results within the case's.
const RESULTS: &str = "runs";
/// Lines of what went wrong that are shown.
const LAST_LINES: usize = 12;

/// How far a simulation is.
#[derive(Debug, Clone, PartialEq, Serialize, Default)]
pub struct Progress {
    /// `none`, `running`, `finished`, `failed` or `cancelled`.
    pub state: State,
    /// File of the plan.
    pub plan: Option<String>,
    /// Goals that the plan does not include: no entry was chosen there.
    pub left_out: Vec<String>,
    /// What it does now, or what it said last.
    pub message: String,
    /// Exit status: 0 all criteria met, 1 one is not, 2 bad input, 3 the environment failed.
    pub status: Option<i32>,
    /// There is a report to open.
    pub has_report: bool,
}

/// See [`Progress::state`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Default)]
#[serde(rename_all = "lowercase")]
pub enum State {
    /// Nothing was simulated yet.
    #[default]
    None,
    /// It runs.
    Running,
    /// It ended with a report.
    Finished,
    /// It ended without one.
    Failed,
    /// It was cancelled.
    Cancelled,
}

/// The simulation of a case: one at a time.
#[derive(Debug)]
pub struct Simulation {
    program: PathBuf,
    folder: PathBuf,
    inner: Arc<Mutex<Inner>>,
}

#[derive(Debug, Default)]
struct Inner {
    progress: Progress,
    child: Option<Child>,
    report: Option<PathBuf>,
}

impl Simulation {
    /// Of the plans in a folder, by this program.
    pub fn new(program: PathBuf, folder: &Path) -> Self {
        Self {
            program,
            folder: folder.to_owned(),
            inner: Arc::default(),
        }
    }

    /// Starts one with a plan that was written.
    ///
    /// # Errors
    /// One that runs already; a program that does not start.
    pub fn start(
        &self,
        plan: &Path,
        left_out: Vec<String>,
        engine: Engine,
    ) -> Result<Progress, Problem> {
        let mut inner = self.lock();
        if inner.progress.state == State::Running {
            return Err(
                Problem::new(StatusCode::CONFLICT, "a simulation is running")
                    .hint("wait for it, or cancel it"),
            );
        }
        let stem = plan.file_stem().unwrap_or_default();
        let results = self.folder.join(RESULTS);
        let mut child = Command::new(&self.program)
            .arg("run")
            .arg(plan)
            .arg("--out")
            .arg(&results)
            .args(["--engine", engine.name()])
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .map_err(|error| {
                Problem::new(
                    StatusCode::INTERNAL_SERVER_ERROR,
                    format!("the simulation cannot start: {error}"),
                )
            })?;
        let said = child.stderr.take();
        let report = results.join(stem).join("report.html");
        inner.progress = Progress {
            state: State::Running,
            plan: plan
                .file_name()
                .map(|name| name.to_string_lossy().into_owned()),
            left_out,
            message: "starting".to_owned(),
            ..Progress::default()
        };
        inner.report = Some(report);
        inner.child = Some(child);
        let progress = inner.progress.clone();
        drop(inner);
        let watched = Arc::clone(&self.inner);
        std::thread::spawn(move || watch(&watched, said));
        Ok(progress)
    }

    /// How far it is.
    pub fn progress(&self) -> Progress {
        self.lock().progress.clone()
    }

    /// Stops it, if it runs.
    pub fn cancel(&self) -> Progress {
        let mut inner = self.lock();
        if inner.progress.state == State::Running
            && let Some(child) = &mut inner.child
        {
            // One that has just ended cannot be killed, and need not be.
            let _ = child.kill();
            inner.progress.state = State::Cancelled;
            "cancelled, results discarded".clone_into(&mut inner.progress.message);
        }
        inner.progress.clone()
    }

    /// The report of the last one that finished.
    pub fn report(&self) -> Option<PathBuf> {
        let inner = self.lock();
        inner.report.clone().filter(|_| inner.progress.has_report)
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, Inner> {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drop for Simulation {
    fn drop(&mut self) {
        self.cancel();
    }
}

/// Which engines simulate.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Engine {
    /// The one in this process: quick, and needs nothing else.
    Rapier,
    /// Both, compared with each other.
    Both,
}

impl Engine {
    fn name(self) -> &'static str {
        match self {
            Self::Rapier => "rapier",
            Self::Both => "both",
        }
    }
}

/// Follows what it says until it ends.
fn watch(inner: &Mutex<Inner>, said: Option<impl std::io::Read>) {
    let lock = || inner.lock().unwrap_or_else(PoisonError::into_inner);
    let mut last: Vec<String> = Vec::new();
    for line in said
        .into_iter()
        .flat_map(|said| BufReader::new(said).lines())
    {
        let Ok(line) = line else { break };
        if line.trim().is_empty() {
            continue;
        }
        let mut inner = lock();
        if inner.progress.state == State::Running {
            inner.progress.message.clone_from(&line);
        }
        last.push(line);
        if last.len() > LAST_LINES {
            last.remove(0);
        }
    }
    // It has closed its output, so it ends now.
    let child = lock().child.take();
    let status = child.and_then(|mut child| child.wait().ok());
    let mut inner = lock();
    let code = status.and_then(|status| status.code());
    inner.progress.status = code;
    if inner.progress.state != State::Running {
        return;
    }
    let has_report =
        matches!(code, Some(0 | 1)) && inner.report.as_ref().is_some_and(|path| path.is_file());
    inner.progress.has_report = has_report;
    inner.progress.state = if has_report {
        State::Finished
    } else {
        State::Failed
    };
    inner.progress.message = match code {
        Some(0) => "all criteria met".to_owned(),
        Some(1) => "a criterion failed or was not evaluated".to_owned(),
        _ => last.join("\n"),
    };
}
