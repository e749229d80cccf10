//! rapier as one of the engines.

use needlebench_cell::EngineSettings;

use super::{RapierPlant, RapierSettings};
use crate::{ArmSpec, Engine, EngineError, EngineSession, Plant};

/// rapier, in this process.
#[derive(Debug)]
pub(crate) struct Rapier;

impl Engine for Rapier {
    fn name(&self) -> &'static str {
        "rapier"
    }

    fn title(&self) -> &'static str {
        "rapier"
    }

    fn runs_by_default(&self) -> bool {
        true
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
        let settings = RapierSettings::of(arm);
        let plant = RapierPlant::new(arm.cell, arm.timestep_s, &settings)?;
        Ok(Box::new(plant))
    }
}

impl RapierSettings {
    /// What a scenario sets of them.
    fn of(arm: &ArmSpec<'_>) -> Self {
        let own = &arm.settings.rapier;
        Self {
            contact_natural_frequency_hz: own.contact_natural_frequency_hz,
            contact_damping_ratio: own.contact_damping_ratio,
            contact_sweeps: own.contact_sweeps as usize,
            friction: arm.friction,
            ..Self::default()
        }
    }
}
