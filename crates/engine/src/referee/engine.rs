//! The reference integrator, driven as the engines are.

use needlebench_cell::EngineSettings;

use super::{RefereePlant, RefereeSettings};
use crate::{ArmSpec, Engine, EngineError, EngineSession, Plant};

/// The reference integrator. It verifies engines and is none of [`ENGINES`](crate::ENGINES), since it knows no
/// contacts.
pub const REFEREE: &dyn Engine = &Referee;

#[derive(Debug)]
struct Referee;

impl Engine for Referee {
    fn name(&self) -> &'static str {
        "referee"
    }

    fn title(&self) -> &'static str {
        "referee"
    }

    fn start(
        &self,
        _settings: &EngineSettings,
        _tell: &mut dyn FnMut(&str),
    ) -> Result<Box<dyn EngineSession>, EngineError> {
        Ok(Box::new(InProcess))
    }
}

/// Nothing is to be started.
struct InProcess;

impl EngineSession for InProcess {
    fn make_plant<'s>(&'s mut self, arm: &ArmSpec<'_>) -> Result<Box<dyn Plant + 's>, EngineError> {
        let plant = RefereePlant::new(arm.cell, arm.timestep_s, &RefereeSettings::default())?;
        Ok(Box::new(plant))
    }
}
