//! The last words of a child process.

use std::collections::VecDeque;
use std::io::Read;
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

/// Enough for a Python traceback or a resolver's explanation.
const TAIL_BYTES: usize = 4096;

/// How long the end of a dead process's output may take to arrive.
const DRAIN_LIMIT: Duration = Duration::from_millis(500);

/// Drains a stream on a thread of its own, so that its writer never blocks, and keeps the end.
#[derive(Debug)]
pub(super) struct Tail {
    kept: Arc<Mutex<VecDeque<u8>>>,
    drain: JoinHandle<()>,
}

impl Tail {
    pub(super) fn of(mut stream: impl Read + Send + 'static) -> Self {
        let kept = Arc::new(Mutex::new(VecDeque::new()));
        let shared = Arc::clone(&kept);
        let drain = thread::spawn(move || {
            let mut chunk = [0; 1024];
            while let Ok(count @ 1..) = stream.read(&mut chunk) {
                let mut kept = shared.lock().unwrap_or_else(PoisonError::into_inner);
                kept.extend(&chunk[..count]);
                let excess = kept.len().saturating_sub(TAIL_BYTES);
                kept.drain(..excess);
            }
        });
        Self { kept, drain }
    }

    /// The end of the output of a process that has ended.
    ///
    /// Waits briefly for what is still in the pipe, and not at all for a grandchild that keeps the
    /// pipe open.
    pub(super) fn after_exit(&self) -> String {
        let asked = Instant::now();
        while !self.drain.is_finished() && asked.elapsed() < DRAIN_LIMIT {
            thread::sleep(Duration::from_millis(2));
        }
        let kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        let bytes: Vec<u8> = kept.iter().copied().collect();
        String::from_utf8_lossy(&bytes).trim().to_owned()
    }
}
