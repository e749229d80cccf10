//! The order of answers: few at a time, and of a drag the latest.

use std::collections::HashMap;
use std::pin::Pin;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::task::{Context, Poll};

use axum::http::StatusCode;
use tokio::sync::Semaphore;

use crate::answer::Problem;

/// Most questions that wait.
const MOST_WAITING: usize = 64;
/// Most pages whose turns are remembered.
const MOST_PAGES: usize = 64;

/// Runs work that takes long beside the server's own threads.
#[derive(Debug)]
pub struct Turns {
    permits: Arc<Semaphore>,
    waiting: Semaphore,
    latest: Mutex<HashMap<String, Turn>>,
}

/// The newest question of a page of a kind, and what ends the work on it.
#[derive(Debug, Default)]
struct Turn {
    number: u64,
    cancel: Arc<AtomicBool>,
}

impl Turns {
    /// So many at a time.
    pub fn new(at_a_time: usize) -> Self {
        Self {
            permits: Arc::new(Semaphore::new(at_a_time)),
            waiting: Semaphore::new(MOST_WAITING),
            latest: Mutex::new(HashMap::new()),
        }
    }

    /// Works once there is capacity. Of one page's questions of a kind the latest `turn` is answered; earlier ones
    /// that still wait are not.
    ///
    /// # Errors
    /// Overtaken by a later turn (409); too many questions (503); a bug in the work (500).
    pub async fn run<T: Send + 'static>(
        &self,
        turn: Option<(String, u64)>,
        work: impl FnOnce() -> T + Send + 'static,
    ) -> Result<T, Problem> {
        self.run_until(turn, |_| work()).await
    }

    /// The same of work that looks whether a later turn has come.
    ///
    /// # Errors
    /// As [`Turns::run`].
    pub(crate) async fn run_until<T: Send + 'static>(
        &self,
        turn: Option<(String, u64)>,
        work: impl FnOnce(&AtomicBool) -> T + Send + 'static,
    ) -> Result<T, Problem> {
        let cancel = turn
            .as_ref()
            .map(|(page, number)| self.remember(page, *number))
            .unwrap_or_default();
        let Ok(_place) = self.waiting.try_acquire() else {
            return Err(
                Problem::new(StatusCode::SERVICE_UNAVAILABLE, "too many requests at once")
                    .hint("try again in a moment"),
            );
        };
        let permit = Arc::clone(&self.permits).acquire_owned().await;
        if turn.is_some_and(|(page, number)| self.is_overtaken(&page, number)) {
            return Err(
                Problem::new(StatusCode::CONFLICT, "superseded by a later request")
                    .with("overtaken", &true),
            );
        }
        let done = tokio::task::spawn_blocking(move || {
            // Given back when the work is done, whether its answer is still awaited or not.
            let _permit = permit;
            work(&cancel)
        });
        done.await.map_err(|_| {
            Problem::new(
                StatusCode::INTERNAL_SERVER_ERROR,
                "internal error: a bug of needlebench, not of your input",
            )
        })
    }

    fn remember(&self, page: &str, number: u64) -> Arc<AtomicBool> {
        let mut latest = self.latest.lock().unwrap_or_else(PoisonError::into_inner);
        if latest.len() >= MOST_PAGES && !latest.contains_key(page) {
            latest.clear();
        }
        let known = latest.entry(page.to_owned()).or_default();
        if number > known.number {
            known.cancel.store(true, Ordering::Relaxed);
            *known = Turn {
                number,
                cancel: Arc::default(),
            };
        }
        Arc::clone(&known.cancel)
    }

    fn is_overtaken(&self, page: &str, number: u64) -> bool {
        let latest = self.latest.lock().unwrap_or_else(PoisonError::into_inner);
        latest.get(page).is_some_and(|known| known.number > number)
    }
}

/// Blocks of a body, each made when it is asked for.
pub struct Blocks<I>(I);

impl<I> Blocks<I> {
    /// In their order.
    pub fn new(blocks: I) -> Self {
        Self(blocks)
    }
}

impl<I: Iterator + Unpin> futures_core::Stream for Blocks<I> {
    type Item = I::Item;

    fn poll_next(mut self: Pin<&mut Self>, _: &mut Context<'_>) -> Poll<Option<I::Item>> {
        Poll::Ready(self.0.next())
    }
}
