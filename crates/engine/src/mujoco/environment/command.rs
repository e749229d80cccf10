//! Runs the commands of the set-up, each with a time limit.

use std::process::{Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use crate::mujoco::tail::Tail;

/// Variables that would let foreign packages or settings of another environment in.
///
/// Index, proxy and certificate settings of pip and uv stay: they are how a site reaches packages.
const FOREIGN_VARIABLES: &str = "PYTHONHOME PYTHONPATH PYTHONSTARTUP VIRTUAL_ENV __PYVENV_LAUNCHER__ \
                                 PIP_PREFIX PIP_PYTHON PIP_ROOT PIP_TARGET UV_PYTHON";

/// Runs a command to its end; what it wrote to standard output, or why it did not do its work.
///
/// Only the end of long output is kept; the commands here answer in a line or two.
pub(super) fn run(command: &mut Command, limit: Duration) -> Result<String, String> {
    for name in FOREIGN_VARIABLES.split(' ') {
        command.env_remove(name);
    }
    let not_started = |error: std::io::Error| format!("it cannot be started: {error}");
    let mut child = command
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .map_err(not_started)?;
    let stdout = child.stdout.take().map(Tail::of);
    let stderr = child.stderr.take().map(Tail::of);
    let text = |tail: &Option<Tail>| tail.as_ref().map_or_else(String::new, Tail::after_exit);
    let started = Instant::now();
    loop {
        match child.try_wait().map_err(not_started)? {
            Some(status) if status.success() => return Ok(text(&stdout)),
            Some(status) => return Err(format!("{status}\n{}", text(&stderr))),
            None if started.elapsed() > limit => {
                // It may have ended just now; either way it is gone afterwards.
                let _ = child.kill();
                let _ = child.wait();
                let seconds = limit.as_secs_f64();
                return Err(format!(
                    "it took longer than {seconds} s and was stopped\n{}",
                    text(&stderr)
                ));
            }
            None => thread::sleep(Duration::from_millis(5)),
        }
    }
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    #[test]
    fn late_command_is_stopped_at_its_limit() {
        let started = Instant::now();
        let failure = run(Command::new("sleep").arg("30"), Duration::from_millis(100));
        assert!(failure.unwrap_err().contains("longer than 0.1 s"));
        assert!(started.elapsed() < Duration::from_secs(10));
    }

    #[test]
    fn failing_command_reports_status_and_last_words() {
        let mut command = Command::new("sh");
        command.args(["-c", "echo why >&2; exit 7"]);
        let failure = run(&mut command, Duration::from_secs(10));
        assert_eq!(failure.unwrap_err(), "exit status: 7\nwhy");
    }
}
