//! Work in parallel, results in order.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};

/// Where the line stands.
struct Turn<W, E> {
    next: u64,
    write: W,
    stopped: bool,
    error: Option<E>,
}

/// Calls `make` for 0..`count` in `threads` threads and `write` with what it gives, in this order,
/// from one thread at a time. No more than `threads` results wait in memory.
///
/// # Errors
/// The first of either; nothing is written after it.
pub(crate) fn in_order<T, E: Send>(
    count: u64,
    threads: usize,
    make: impl Fn(u64) -> Result<T, E> + Sync,
    write: impl FnMut(T) -> Result<(), E> + Send,
) -> Result<(), E> {
    let claimed = AtomicU64::new(0);
    let line = Line {
        turn: Mutex::new(Turn {
            next: 0,
            write,
            stopped: false,
            error: None,
        }),
        turned: Condvar::new(),
    };
    let work = || {
        // Others must not wait for what a panic has ended.
        let _stop = StopOnPanic(&line);
        loop {
            let index = claimed.fetch_add(1, Ordering::Relaxed);
            if index >= count {
                return;
            }
            let made = make(index);
            let mut turn = line
                .turned
                .wait_while(line.lock(), |turn| turn.next < index && !turn.stopped)
                .unwrap_or_else(PoisonError::into_inner);
            if turn.stopped {
                return;
            }
            if let Err(error) = made.and_then(|made| (turn.write)(made)) {
                turn.stopped = true;
                turn.error = Some(error);
            }
            turn.next += 1;
            line.turned.notify_all();
        }
    };
    std::thread::scope(|scope| {
        for _ in 1..threads {
            scope.spawn(work);
        }
        work();
    });
    let turn = line
        .turn
        .into_inner()
        .unwrap_or_else(PoisonError::into_inner);
    turn.error.map_or(Ok(()), Err)
}

struct Line<W, E> {
    turn: Mutex<Turn<W, E>>,
    turned: Condvar,
}

impl<W, E> Line<W, E> {
    fn lock(&self) -> MutexGuard<'_, Turn<W, E>> {
        self.turn.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

struct StopOnPanic<'a, W, E>(&'a Line<W, E>);

impl<W, E> Drop for StopOnPanic<'_, W, E> {
    fn drop(&mut self) {
        if std::thread::panicking() {
            self.0.lock().stopped = true;
            self.0.turned.notify_all();
        }
    }
}
