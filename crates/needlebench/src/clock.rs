//! How long a command has been running.

use std::cell::Cell;
use std::time::{Duration, Instant};

thread_local! {
    static STARTED: Cell<Option<Instant>> = const { Cell::new(None) };
}

/// Starts the clock of the command of this thread.
pub(crate) fn start() {
    STARTED.set(Some(Instant::now()));
}

/// Time since the command of this thread began.
pub(crate) fn elapsed() -> Duration {
    STARTED
        .get()
        .map_or(Duration::ZERO, |start| start.elapsed())
}
