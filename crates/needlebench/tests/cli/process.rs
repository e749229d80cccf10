//! Programs that run in the background, and what Linux says of their children.

use std::fs;
use std::os::unix::process::CommandExt;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use crate::support::{Bench, SMALL, with_edit};

/// Nothing here takes longer, even on a machine that does ten other things.
const PATIENCE: Duration = Duration::from_mins(5);

/// Context switches of a harness that has certainly answered many steps: it waits for each.
const SWITCHES_IN_MID_RUN: u64 = 1000;

/// `SMALL` with so many steps that a run takes seconds.
pub fn long_scenario() -> String {
    let text = with_edit(SMALL, "hold_s = 0.1", "hold_s = 1");
    with_edit(
        &text,
        "[recording]",
        "[engines]\ntimestep_ms = 0.05\nharness_timeout_s = 5\n[recording]",
    )
}

#[track_caller]
pub fn wait_until<T>(what: &str, mut found: impl FnMut() -> Option<T>) -> T {
    let started = Instant::now();
    loop {
        if let Some(found) = found() {
            return found;
        }
        assert!(started.elapsed() < PATIENCE, "still waiting for {what}");
        thread::sleep(Duration::from_millis(5));
    }
}

/// A line of `/proc/ID/status`; `None` once the process is gone.
fn status_of(id: u32, name: &str) -> Option<String> {
    let status = fs::read_to_string(format!("/proc/{id}/status")).ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix(name))?;
    Some(line.trim_start_matches(':').trim().to_owned())
}

/// Whether a process is there and not merely waiting to be reaped.
pub fn is_alive(id: u32) -> bool {
    status_of(id, "State").is_some_and(|state| !state.starts_with('Z'))
}

fn children_of(id: u32) -> Vec<u32> {
    fs::read_dir("/proc")
        .unwrap()
        .filter_map(|entry| entry.ok()?.file_name().to_str()?.parse().ok())
        .filter(|child| status_of(*child, "PPid").is_some_and(|parent| parent == id.to_string()))
        .collect()
}

/// Sends a signal to a process, or to a process group if the id is negative.
pub fn signal(name: &str, id: i64) {
    let kill = format!("kill -s {name} -- {id}");
    let status = Command::new("sh").args(["-c", &kill]).status().unwrap();
    assert!(status.success(), "{kill}");
}

/// `run` of the long scenario in both engines, in mid-run, in a process group of its own.
pub struct LongRun {
    pub bench: Bench,
    child: Child,
    pub harness: u32,
}

impl LongRun {
    pub fn start() -> Self {
        crate::support::mujoco_is_ready();
        let bench = Bench::with_scenario(&long_scenario());
        let arguments = "run s.toml --engine both --jobs 2";
        let child = bench
            .command(arguments)
            .process_group(0)
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let harness = wait_until("the harness to step", || {
            children_of(child.id()).into_iter().find(|harness| {
                status_of(*harness, "voluntary_ctxt_switches")
                    .and_then(|count| count.parse::<u64>().ok())
                    .is_some_and(|count| count > SWITCHES_IN_MID_RUN)
            })
        });
        Self {
            bench,
            child,
            harness,
        }
    }

    pub fn id(&self) -> i64 {
        i64::from(self.child.id())
    }

    pub fn end(&mut self) -> ExitStatus {
        let child = &mut self.child;
        wait_until("the run to end", || child.try_wait().unwrap())
    }
}

impl Drop for LongRun {
    fn drop(&mut self) {
        // Only after a failed assertion is there anything left to end.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
