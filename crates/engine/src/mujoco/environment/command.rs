//! Runs the commands of the set-up, each with a time limit.

use std::process::{Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use crate::mujoco::tail::Tail;

/// Variables that would let foreign packages or settings of another environment in.
///
/// Index, proxy and certificate settings of pip and uv stay: they are how a site reaches packages.
const FOREIGN_VARIABLES: [&str; 10] = [
    "PYTHONHOME",
    "PYTHONPATH",
    "PYTHONSTARTUP",
    "VIRTUAL_ENV",
    "__PYVENV_LAUNCHER__",
    "PIP_PREFIX",
    "PIP_PYTHON",
    "PIP_ROOT",
    "PIP_TARGET",
    "UV_PYTHON",
];

/// Why a command did not do its work.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum CommandFailure {
    /// It could not be started.
    #[error("it cannot be started: {reason}")]
    Start {
        /// What the operating system says.
        reason: String,
    },
    /// It ended with an error.
    #[error("{status}\n{stderr_tail}")]
    Exit {
        /// Exit status or signal.
        status: String,
        /// The last that it wrote to standard error.
        stderr_tail: String,
    },
    /// It took too long and was killed.
    #[error("it took longer than {seconds} s and was stopped\n{stderr_tail}")]
    TimedOut {
        /// The limit, s.
        seconds: f64,
        /// The last that it wrote to standard error.
        stderr_tail: String,
    },
}

/// Runs a command to its end and returns what it wrote to standard output.
///
/// Only the end of long output is kept; the commands here answer in a line or two.
pub(super) fn run(command: &mut Command, limit: Duration) -> Result<String, CommandFailure> {
    for name in FOREIGN_VARIABLES {
        command.env_remove(name);
    }
    let start_failure = |error: std::io::Error| CommandFailure::Start {
        reason: error.to_string(),
    };
    let mut child = command
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .map_err(start_failure)?;
    let stdout = child.stdout.take().map(Tail::of);
    let stderr = child.stderr.take().map(Tail::of);
    let text = |tail: &Option<Tail>| tail.as_ref().map_or_else(String::new, Tail::after_exit);
    let started = Instant::now();
    loop {
        if let Some(status) = child.try_wait().map_err(start_failure)? {
            if status.success() {
                return Ok(text(&stdout));
            }
            return Err(CommandFailure::Exit {
                status: status.to_string(),
                stderr_tail: text(&stderr),
            });
        }
        if started.elapsed() > limit {
            // It may have ended just now; either way it is gone afterwards.
            let _ = child.kill();
            let _ = child.wait();
            return Err(CommandFailure::TimedOut {
                seconds: limit.as_secs_f64(),
                stderr_tail: text(&stderr),
            });
        }
        thread::sleep(Duration::from_millis(5));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(unix)]
    #[test]
    fn late_command_is_stopped_at_its_limit() {
        let started = Instant::now();
        let failure = run(Command::new("sleep").arg("30"), Duration::from_millis(100));
        assert!(matches!(failure, Err(CommandFailure::TimedOut { .. })));
        assert!(started.elapsed() < Duration::from_secs(10));
    }

    #[cfg(unix)]
    #[test]
    fn failing_command_reports_status_and_last_words() {
        let failure = run(
            Command::new("sh").args(["-c", "echo why >&2; exit 7"]),
            Duration::from_secs(10),
        );
        let Err(CommandFailure::Exit {
            status,
            stderr_tail,
        }) = failure
        else {
            panic!("{failure:?}");
        };
        assert!(status.contains('7'), "{status}");
        assert_eq!(stderr_tail, "why");
    }
}
