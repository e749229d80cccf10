//! What an engine is to the rest of the program.

use std::fmt;

use needlebench_cell::{Cell, EngineSettings};

use crate::fleet::{Fleet, Lone};
use crate::{EngineError, Plant};

/// A physics engine.
pub trait Engine: fmt::Debug + Sync {
    /// Name in scenarios, reports and names of files: `rapier`, `mujoco`.
    fn name(&self) -> &'static str;

    /// Name in headings: `rapier`, `MuJoCo`.
    fn title(&self) -> &'static str;

    /// Whether it runs where neither scenario nor command line names any engines.
    fn runs_by_default(&self) -> bool {
        false
    }

    /// How many motions it makes at a time: more than one where [`EngineSession::make_fleet`] steps
    /// arms together.
    fn motions_at_a_time(&self) -> usize {
        1
    }

    /// Order of convergence with the time step, by the engine's documentation.
    fn documented_order(&self) -> f64 {
        1.0
    }

    /// What the engine needs on this machine, tried out one by one; nothing if it needs nothing.
    fn check(&self, _tell: &mut dyn FnMut(&str)) -> Vec<EngineCheck> {
        Vec::new()
    }

    /// Starts what the engine needs: a process of its own, or nothing at all.
    ///
    /// `tell` is called with what is being done where that takes long.
    ///
    /// # Errors
    /// [`EngineError::NotStarted`], with words for people.
    fn start(
        &self,
        settings: &EngineSettings,
        tell: &mut dyn FnMut(&str),
    ) -> Result<Box<dyn EngineSession>, EngineError>;
}

/// Something that an engine needs.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct EngineCheck {
    /// What it is.
    pub name: &'static str,
    /// What was found, or what is missing and how to mend it.
    pub found: Result<String, String>,
}

/// An engine that has been started.
pub trait EngineSession: Send {
    /// Makes an arm; arms that were made before are gone.
    ///
    /// # Errors
    /// What the engine says of the cell or the settings.
    fn make_plant<'s>(&'s mut self, arm: &ArmSpec<'_>) -> Result<Box<dyn Plant + 's>, EngineError>;

    /// Makes up to `count` arms of one cell that are stepped together; arms that were made before
    /// are gone.
    ///
    /// # Errors
    /// As [`Self::make_plant`].
    fn make_fleet<'s>(
        &'s mut self,
        arm: &ArmSpec<'_>,
        count: usize,
    ) -> Result<Box<dyn Fleet + 's>, EngineError> {
        let _ = count;
        Ok(Box::new(Lone(self.make_plant(arm)?)))
    }

    /// Operating system's id of the process that the engine runs in, if it has one of its own.
    fn process_id(&self) -> Option<u32> {
        None
    }
}

/// What arms are made of.
#[derive(Debug, Clone, Copy)]
pub struct ArmSpec<'a> {
    /// The arm, and all that it may touch.
    pub cell: &'a Cell,
    /// The scenario's settings of the engines.
    pub settings: &'a EngineSettings,
    /// Coulomb friction between any two solids, in place of the settings'.
    pub friction: f64,
    /// Length of a step, s, in place of the settings'.
    pub timestep_s: f64,
}

impl<'a> ArmSpec<'a> {
    /// As the settings have it.
    pub fn new(cell: &'a Cell, settings: &'a EngineSettings) -> Self {
        Self {
            cell,
            settings,
            friction: settings.friction,
            timestep_s: settings.timestep_s,
        }
    }
}
