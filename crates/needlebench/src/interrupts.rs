//! Interrupts, and threads that were asked for.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::{Context, Result};

use crate::host;

/// Set when the user interrupts the program, or the program that has this one inside interrupts it.
pub(crate) fn watch_interrupts() -> Result<Arc<AtomicBool>> {
    if let Some(cancel) = host::cancel() {
        return Ok(cancel);
    }
    let cancel = Arc::new(AtomicBool::new(false));
    let requested = Arc::clone(&cancel);
    ctrlc::set_handler(move || requested.store(true, Ordering::Relaxed))
        .context("cannot watch for interrupts")?;
    Ok(cancel)
}

/// Threads: those that were asked for, or as many as the machine has cores.
pub(crate) fn threads(jobs: Option<u16>) -> usize {
    jobs.map_or_else(
        || std::thread::available_parallelism().map_or(1, std::num::NonZero::get),
        usize::from,
    )
}
