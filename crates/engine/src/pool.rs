//! Engines that are started once and serve all callers.

use std::sync::{Mutex, MutexGuard, PoisonError};

use needlebench_cell::EngineSettings;

use crate::{Engine, EngineError, EngineSession};

/// Engines of one run, or of one thread of a study.
///
/// An engine is started when it is first asked for, serves one caller after the other, and ends when
/// the pool is dropped. No two pools share anything.
#[derive(Debug)]
pub struct EnginePool {
    slots: Vec<Slot>,
}

struct Slot {
    engine: &'static dyn Engine,
    state: Mutex<State>,
}

enum State {
    Idle,
    Started(Box<dyn EngineSession>),
    /// Why it could not be started.
    Failed(String),
}

impl std::fmt::Debug for Slot {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.write_str(self.engine.name())
    }
}

impl EnginePool {
    /// Nothing is started yet.
    pub fn new(engines: &[&'static dyn Engine]) -> Self {
        let idle = |&engine| Slot {
            engine,
            state: Mutex::new(State::Idle),
        };
        Self {
            slots: engines.iter().map(idle).collect(),
        }
    }

    /// Starts an engine, unless that was tried before.
    ///
    /// # Errors
    /// Why it cannot be started; the same to everybody until [`Self::discard`].
    ///
    /// # Panics
    /// If the pool has no such engine.
    pub fn start(
        &self,
        engine: &dyn Engine,
        settings: &EngineSettings,
        tell: &mut dyn FnMut(&str),
    ) -> Result<(), EngineError> {
        self.started(engine, settings, tell).map(|_| ())
    }

    /// Whether an engine could not be started when that was tried.
    ///
    /// # Panics
    /// If the pool has no such engine.
    pub fn could_not_start(&self, engine: &dyn Engine) -> bool {
        matches!(*self.state(engine), State::Failed(_))
    }

    /// Lends an engine, which is started if it has not been.
    ///
    /// # Errors
    /// As [`Self::start`], and what `work` reports.
    ///
    /// # Panics
    /// If the pool has no such engine.
    pub fn lend<T>(
        &self,
        engine: &dyn Engine,
        settings: &EngineSettings,
        work: impl FnOnce(&mut dyn EngineSession) -> Result<T, EngineError>,
    ) -> Result<T, EngineError> {
        let mut state = self.started(engine, settings, &mut |_| {})?;
        let State::Started(session) = &mut *state else {
            unreachable!("it was started");
        };
        work(session.as_mut())
    }

    /// Ends an engine; the next request starts it anew.
    ///
    /// # Panics
    /// If the pool has no such engine.
    pub fn discard(&self, engine: &dyn Engine) {
        *self.state(engine) = State::Idle;
    }

    /// Operating system's id of the process that an engine runs in, if it has one and it runs.
    ///
    /// # Panics
    /// If the pool has no such engine.
    pub fn process_id(&self, engine: &dyn Engine) -> Option<u32> {
        match &*self.state(engine) {
            State::Started(session) => session.process_id(),
            State::Idle | State::Failed(_) => None,
        }
    }

    fn state(&self, engine: &dyn Engine) -> MutexGuard<'_, State> {
        let named = |slot: &&Slot| slot.engine.name() == engine.name();
        let slot = self.slots.iter().find(named);
        let slot = slot.expect("a pool is asked for its own engines");
        // A caller that panicked has left the session as any other that stopped half way.
        slot.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn started(
        &self,
        engine: &dyn Engine,
        settings: &EngineSettings,
        tell: &mut dyn FnMut(&str),
    ) -> Result<MutexGuard<'_, State>, EngineError> {
        let mut state = self.state(engine);
        if let State::Idle = *state {
            let _stage = tracing::debug_span!("start", engine = engine.name()).entered();
            *state = match engine.start(settings, tell) {
                Ok(session) => {
                    tracing::info!(process = session.process_id(), "engine started");
                    State::Started(session)
                }
                Err(error) => {
                    tracing::warn!(%error, "engine could not be started");
                    State::Failed(error.to_string())
                }
            };
        }
        if let State::Failed(reason) = &*state {
            return Err(EngineError::NotStarted {
                reason: reason.clone(),
            });
        }
        Ok(state)
    }
}
