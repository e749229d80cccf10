//! A running MuJoCo harness for tests.

use std::time::Duration;

use needlebench_engine::mujoco::{HarnessProcess, ensure};

/// Starts the harness in its environment, which is made first if it is not there yet.
pub fn harness() -> HarnessProcess {
    let environment = ensure(&mut |stage| println!("{stage}")).unwrap();
    HarnessProcess::start(&environment, Duration::from_mins(1)).unwrap()
}
