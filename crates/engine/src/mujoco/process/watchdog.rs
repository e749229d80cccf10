//! Ends a child process that does not answer in time.

use std::process::{Child, ExitStatus};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

/// No request is outstanding.
const IDLE: u64 = 0;

/// How long a child may take to end after its pipes are closed.
const EXIT_LIMIT: Duration = Duration::from_secs(2);

/// Owns the child; a thread kills it when a request has been outstanding longer than the limit.
///
/// The caller can thus use plain blocking reads: a killed child reads as the end of the stream.
#[derive(Debug)]
pub(super) struct Watchdog {
    shared: Arc<Shared>,
    limit: Duration,
    thread: Option<JoinHandle<()>>,
}

#[derive(Debug)]
struct Shared {
    child: Mutex<Child>,
    started: Instant,
    /// Nanoseconds after `started`, or [`IDLE`].
    deadline_ns: AtomicU64,
    expired: AtomicBool,
    stop: AtomicBool,
}

impl Watchdog {
    pub(super) fn of(child: Child, limit: Duration) -> Self {
        let shared = Arc::new(Shared {
            child: Mutex::new(child),
            started: Instant::now(),
            deadline_ns: AtomicU64::new(IDLE),
            expired: AtomicBool::new(false),
            stop: AtomicBool::new(false),
        });
        let tick = (limit / 10).clamp(Duration::from_millis(2), Duration::from_millis(100));
        let watched = Arc::clone(&shared);
        let thread = thread::spawn(move || watched.watch(tick));
        Self {
            shared,
            limit,
            thread: Some(thread),
        }
    }

    /// A request goes out: the limit runs from now.
    pub(super) fn arm(&self) {
        let deadline = self.shared.started.elapsed().saturating_add(self.limit);
        let deadline_ns = u64::try_from(deadline.as_nanos()).unwrap_or(u64::MAX);
        self.shared
            .deadline_ns
            .store(deadline_ns, Ordering::Release);
    }

    /// The answer is in.
    pub(super) fn disarm(&self) {
        self.shared.deadline_ns.store(IDLE, Ordering::Release);
    }

    /// Whether the child was killed for being late.
    pub(super) fn expired(&self) -> bool {
        self.shared.expired.load(Ordering::Acquire)
    }

    pub(super) fn limit(&self) -> Duration {
        self.limit
    }

    pub(super) fn process_id(&self) -> u32 {
        self.shared.child().id()
    }

    /// Waits for the child, whose pipes are closed or broken, and kills it if it lingers.
    pub(super) fn reap(&self) -> std::io::Result<ExitStatus> {
        let asked = Instant::now();
        while asked.elapsed() < EXIT_LIMIT {
            if let Some(status) = self.shared.child().try_wait()? {
                return Ok(status);
            }
            thread::sleep(Duration::from_millis(2));
        }
        let mut child = self.shared.child();
        child.kill()?;
        child.wait()
    }
}

impl Drop for Watchdog {
    fn drop(&mut self) {
        self.shared.stop.store(true, Ordering::Release);
        if let Some(thread) = self.thread.take() {
            thread.thread().unpark();
            // It holds nothing that could be lost, and it does not panic.
            let _ = thread.join();
        }
    }
}

impl Shared {
    fn child(&self) -> std::sync::MutexGuard<'_, Child> {
        self.child.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn watch(&self, tick: Duration) {
        while !self.stop.load(Ordering::Acquire) {
            thread::park_timeout(tick);
            let deadline_ns = self.deadline_ns.load(Ordering::Acquire);
            if deadline_ns != IDLE && self.started.elapsed().as_nanos() > u128::from(deadline_ns) {
                self.expired.store(true, Ordering::Release);
                // Fails only for a child that is gone already, which ends the wait as well.
                let _ = self.child().kill();
                return;
            }
        }
    }
}
