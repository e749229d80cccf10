//! Work on several threads: what comes of it is the same on any number of them.
//!
//! Threads are started for the work and end with it: a pool that outlives a call is of no use to a process that was
//! forked, such as those of Python's `multiprocessing`. Work that is part of other such work stays on its thread: there
//! are never more threads than were asked for, and none begins another item while one that it has begun waits.
#![cfg_attr(any(doc, doctest), doc = include_str!("../README.md"))]

mod control;
mod progress;

use rayon::prelude::*;
use rayon::{ThreadBuilder, ThreadPoolBuilder};

pub use control::Control;
pub use progress::{Progress, Silent};

/// Applies `f` to all items on up to `threads` threads; results are in the items' order. In this order they are begun
/// too: put those that take longest first.
pub fn in_parallel<T: Sync, R: Send>(
    threads: usize,
    items: &[T],
    f: impl Fn(&T) -> R + Sync,
) -> Vec<R> {
    let threads = threads.min(items.len());
    if !is_shared_out(threads) {
        return items.iter().map(f).collect();
    }
    // Slices of rayon's own are halved first: one thread would begin in the middle.
    let numbered = items.iter().enumerate().par_bridge();
    let results = numbered.map(|(at, item)| (at, f(item)));
    in_order(on_threads(threads, || results.collect()))
}

/// Gives parts of `of_each` values, the last one of what is left, to `work` with their numbers, on up to `threads`
/// threads; results are in the parts' order. What each thread needs beside them it makes for itself by `make`.
pub fn in_parts<T: Send, S, R: Send>(
    threads: usize,
    values: &mut [T],
    of_each: usize,
    make: impl Fn() -> S + Sync,
    work: impl Fn(&mut S, usize, &mut [T]) -> R + Sync,
) -> Vec<R> {
    let threads = threads.min(values.len().div_ceil(of_each));
    let numbered = values.chunks_mut(of_each).enumerate();
    if is_shared_out(threads) {
        let numbered = numbered.par_bridge();
        let results = numbered.map_init(&make, |own, (at, part)| (at, work(own, at, part)));
        in_order(on_threads(threads, || results.collect()))
    } else {
        let mut own = make();
        numbered
            .map(|(at, part)| work(&mut own, at, part))
            .collect()
    }
}

fn in_order<R>(mut results: Vec<(usize, R)>) -> Vec<R> {
    results.sort_unstable_by_key(|(at, _)| *at);
    results.into_iter().map(|(_, result)| result).collect()
}

fn is_shared_out(threads: usize) -> bool {
    threads > 1 && rayon::current_thread_index().is_none()
}

fn on_threads<R: Send>(threads: usize, work: impl FnOnce() -> R + Send) -> R {
    ThreadPoolBuilder::new()
        .num_threads(threads)
        .build_scoped(ThreadBuilder::run, |pool| pool.install(work))
        .expect("the system starts threads")
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;
    use std::sync::atomic::{AtomicUsize, Ordering};
    use std::sync::{Condvar, Mutex};
    use std::thread::{ThreadId, current};
    use std::time::Duration;

    use super::*;

    /// Until when a test waits for what does not come.
    const TOO_LONG: Duration = Duration::from_secs(20);

    /// Which threads have worked.
    #[derive(Default)]
    struct Seen(Mutex<HashSet<ThreadId>>, Condvar);

    impl Seen {
        /// Ends when so many threads have worked.
        fn work(&self, threads: usize) {
            let mut seen = self.0.lock().unwrap();
            seen.insert(current().id());
            self.1.notify_all();
            let few = |seen: &mut HashSet<ThreadId>| seen.len() < threads;
            drop(self.1.wait_timeout_while(seen, TOO_LONG, few).unwrap());
        }

        fn count(self) -> usize {
            self.0.into_inner().unwrap().len()
        }
    }

    #[test]
    fn results_are_in_the_order_of_the_items_on_as_many_threads_as_were_asked_for() {
        let items: Vec<u64> = (0..60).collect();
        for threads in [0, 1, 2, 5] {
            let seen = Seen::default();
            let squares = in_parallel(threads, &items, |item| {
                seen.work(threads);
                item * item
            });
            let expected: Vec<u64> = items.iter().map(|item| item * item).collect();
            assert_eq!(squares, expected);
            assert_eq!(seen.count(), threads.max(1));
        }
        assert_eq!(in_parallel(4, &[], |item: &u64| *item), []);
    }

    #[test]
    fn items_are_begun_in_their_order() {
        let items: Vec<usize> = (0..100).collect();
        let (ended, change) = (Mutex::new(Vec::new()), Condvar::new());
        in_parallel(2, &items, |item| {
            let mut ended = ended.lock().unwrap();
            if *item == 0 {
                // The other thread does all the rest.
                let few = |ended: &mut Vec<usize>| ended.len() + 1 < items.len();
                drop(change.wait_timeout_while(ended, TOO_LONG, few).unwrap());
            } else {
                ended.push(*item);
                change.notify_all();
            }
        });
        assert_eq!(ended.into_inner().unwrap(), items[1..]);
    }

    #[test]
    fn each_part_is_worked_on_once() {
        for (threads, count, of_each) in [(1, 10, 3), (4, 1000, 7), (8, 5, 100), (3, 0, 2)] {
            let mut values = vec![0; count];
            let made = AtomicUsize::new(0);
            in_parts(
                threads,
                &mut values,
                of_each,
                || made.fetch_add(1, Ordering::Relaxed),
                |_, part, values| {
                    for (at, value) in values.iter_mut().enumerate() {
                        *value += part * of_each + at;
                    }
                },
            );
            assert_eq!(values, (0..count).collect::<Vec<_>>());
            assert!(made.into_inner() <= threads + 1);
        }
    }

    #[test]
    fn work_within_such_work_starts_no_threads() {
        let seen = Seen::default();
        in_parallel(2, &[0; 8], |_| {
            let within = in_parallel(4, &[0; 8], |_| {
                seen.work(2);
                current().id()
            });
            assert_eq!(within, [current().id(); 8]);
        });
        assert_eq!(seen.count(), 2);
    }

    #[test]
    #[should_panic(expected = "item 7")]
    fn a_panic_is_that_of_the_item() {
        let items: Vec<u32> = (0..20).collect();
        in_parallel(2, &items, |item| assert!(*item != 7, "item {item}"));
    }
}
