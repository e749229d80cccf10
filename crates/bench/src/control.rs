//! What a caller decides of a run while it goes on.

use std::sync::atomic::{AtomicBool, Ordering};

use crate::progress::Progress;

/// Threads, interruption and progress of a run.
#[derive(Clone, Copy)]
pub struct Control<'a> {
    /// Threads that may be used.
    pub threads: usize,
    /// Once it is set, the run ends with what is finished by then.
    pub cancel: &'a AtomicBool,
    /// Is told how far the run is.
    pub progress: &'a dyn Progress,
}

impl Control<'_> {
    pub(crate) fn is_cancelled(&self) -> bool {
        self.cancel.load(Ordering::Relaxed)
    }
}
