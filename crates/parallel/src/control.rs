//! What a caller decides of work while it goes on.

use std::sync::atomic::{AtomicBool, Ordering};

use crate::progress::Progress;

/// Threads, interruption and progress of long work.
#[derive(Clone, Copy)]
pub struct Control<'a> {
    /// Threads that may be used.
    pub threads: usize,
    /// Once it is set, the work ends with what is finished by then.
    pub cancel: &'a AtomicBool,
    /// Is told how far the work is.
    pub progress: &'a dyn Progress,
}

impl Control<'_> {
    /// Whether it is to end.
    pub fn is_cancelled(&self) -> bool {
        self.cancel.load(Ordering::Relaxed)
    }
}
