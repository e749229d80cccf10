//! Work in parallel, results in order.
//!
//! Not through `rayon`: it collects all results, and these are written while others are made, few of which may wait.

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

#[cfg(test)]
mod tests {
    use std::sync::atomic::AtomicUsize;
    use std::time::Duration;

    use super::*;

    #[test]
    fn results_come_in_order_and_few_wait() {
        let waiting = AtomicUsize::new(0);
        let most = AtomicUsize::new(0);
        let mut written = Vec::new();
        let make = |index: u64| {
            // The first of every four is the slowest.
            std::thread::sleep(Duration::from_micros(500 * (3 - index % 4)));
            most.fetch_max(waiting.fetch_add(1, Ordering::SeqCst) + 1, Ordering::SeqCst);
            Ok::<u64, ()>(index)
        };
        in_order(100, 4, make, |index| {
            waiting.fetch_sub(1, Ordering::SeqCst);
            written.push(index);
            Ok(())
        })
        .unwrap();
        assert_eq!(written, (0..100).collect::<Vec<_>>());
        assert!(most.into_inner() <= 4);
    }

    #[test]
    fn the_first_error_ends_it() {
        for threads in [1, 2, 3] {
            let mut written = Vec::new();
            let make = |index: u64| if index >= 7 { Err(index) } else { Ok(index) };
            let end = in_order(100, threads, make, |index| {
                written.push(index);
                Ok(())
            });
            assert_eq!(end, Err(7));
            assert_eq!(written, (0..7).collect::<Vec<_>>());
            let end = in_order(100, threads, Ok, |index| {
                if index == 5 { Err("full") } else { Ok(()) }
            });
            assert_eq!(end, Err("full"));
        }
    }

    #[test]
    #[should_panic(expected = "a scoped thread panicked")]
    fn a_panic_does_not_leave_the_others_waiting() {
        let main = std::thread::current().id();
        let make = |index: u64| {
            let spawned = std::thread::current().id() != main;
            assert!(!spawned, "our own bug");
            // Leaves something for the other thread.
            std::thread::sleep(Duration::from_millis(20));
            Ok::<u64, ()>(index)
        };
        let _ = in_order(100, 2, make, |_| Ok(()));
    }
}
