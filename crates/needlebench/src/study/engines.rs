//! What is expensive to start and serves one case after the other.

use needlebench_cell::ResolvedScenario;

use crate::plants::{Harness, start_harness};
use crate::progress::Progress;

/// The engines of one thread of a study.
///
/// rapier is part of the program; MuJoCo runs in a process of its own, which is started when a case
/// first asks for it, serves all later ones, and ends when this is dropped. No two sets share
/// anything.
#[derive(Debug, Default)]
pub struct EngineSet {
    harness: Option<Harness>,
}

impl EngineSet {
    /// Nothing is started yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// Id of the MuJoCo process, if it runs.
    pub fn process_id(&self) -> Option<u32> {
        let harness = self.harness.as_ref()?.as_ref().ok()?;
        Some(harness.lock().ok()?.process_id())
    }

    /// The MuJoCo process.
    ///
    /// # Errors
    /// Why it cannot be started; the next call tries again.
    pub(super) fn mujoco(&mut self, resolved: &ResolvedScenario) -> Result<&Harness, String> {
        if !matches!(self.harness, Some(Ok(_))) {
            self.harness = Some(start_harness(resolved, &Progress::new(true)));
        }
        match self.harness.as_ref() {
            Some(Err(message)) => Err(message.clone()),
            Some(harness) => Ok(harness),
            None => unreachable!("set above"),
        }
    }

    /// Ends the MuJoCo process; the next use starts another.
    pub(super) fn discard(&mut self) {
        self.harness = None;
    }
}
