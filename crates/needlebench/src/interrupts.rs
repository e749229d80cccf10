//! Interrupts, and the number of threads.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::{Context, Result};

use crate::host;

/// A flag that is set when the user or the host program interrupts.
pub(crate) fn watch_interrupts() -> Result<Arc<AtomicBool>> {
    if let Some(cancel) = host::cancel() {
        return Ok(cancel);
    }
    let cancel = Arc::new(AtomicBool::new(false));
    let requested = Arc::clone(&cancel);
    ctrlc::set_handler(move || requested.store(true, Ordering::Relaxed))
        .context("cannot install the interrupt handler")?;
    Ok(cancel)
}

/// Number of threads: as requested, or the number of cores.
pub(crate) fn threads(jobs: Option<u16>) -> usize {
    jobs.map_or_else(
        || std::thread::available_parallelism().map_or(1, std::num::NonZero::get),
        usize::from,
    )
}
