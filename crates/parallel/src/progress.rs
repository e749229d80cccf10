//! Progress of the work.

/// Watches long work. Every method does nothing unless it is implemented.
pub trait Progress: Sync {
    /// What is being done now.
    fn message(&self, _text: &str) {}
    /// A message that is also written without a progress display: an engine is set up or repaired.
    fn notice(&self, text: &str) {
        self.message(text);
    }
    /// So many steps more are to be done.
    fn expect(&self, _steps: u64) {}
    /// So many steps of all are done.
    fn at(&self, _done: u64, _total: u64) {}
    /// One step is done.
    fn step(&self) {}
}

/// Without a display.
#[derive(Debug, Clone, Copy, Default)]
pub struct Silent;

impl Progress for Silent {}
