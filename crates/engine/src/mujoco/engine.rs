//! MuJoCo as one of the engines.

use std::time::Duration;

use needlebench_cell::EngineSettings;

use super::{
    Environment, HarnessError, HarnessProcess, MujocoFleet, MujocoPlant, MujocoSettings, ensure,
};
use crate::{ArmSpec, Engine, EngineCheck, EngineError, EngineSession, Fleet, Plant};

/// Motions that share messages: as many as a goal has configurations.
const FLEET_ARMS: usize = 8;

/// Time that the process may take to answer where it is only tried out.
const CHECK_LIMIT: Duration = Duration::from_secs(30);

/// MuJoCo, in a Python process of its own.
#[derive(Debug)]
pub(crate) struct Mujoco;

impl Engine for Mujoco {
    fn name(&self) -> &'static str {
        "mujoco"
    }

    fn title(&self) -> &'static str {
        "MuJoCo"
    }

    fn runs_by_default(&self) -> bool {
        true
    }

    fn motions_at_a_time(&self) -> usize {
        FLEET_ARMS
    }

    fn check(&self, tell: &mut dyn FnMut(&str)) -> Vec<EngineCheck> {
        let environment = ensure(tell);
        let mut checks = vec![EngineCheck {
            name: "mujoco environment",
            found: match &environment {
                Ok(environment) => Ok(environment.python.display().to_string()),
                Err(error) => Err(error.to_string()),
            },
        }];
        checks.extend(environment.ok().map(|environment| EngineCheck {
            name: "mujoco harness",
            found: match HarnessProcess::start(&environment, CHECK_LIMIT) {
                Ok(process) => {
                    let versions = process.versions();
                    Ok(format!(
                        "MuJoCo {}, Python {}, numpy {}",
                        versions.mujoco, versions.python, versions.numpy
                    ))
                }
                Err(error) => Err(in_environment(&error, &environment)),
            },
        }));
        checks
    }

    /// Makes the Python environment on first use, and starts the process.
    fn start(
        &self,
        settings: &EngineSettings,
        tell: &mut dyn FnMut(&str),
    ) -> Result<Box<dyn EngineSession>, EngineError> {
        let not_started = |reason: String| EngineError::NotStarted { reason };
        let environment = ensure(tell).map_err(|error| not_started(error.to_string()))?;
        let timeout = Duration::from_secs_f64(settings.harness_timeout_s);
        let process = HarnessProcess::start(&environment, timeout)
            .map_err(|error| not_started(in_environment(&error, &environment)))?;
        Ok(Box::new(OwnProcess(process)))
    }
}

/// The process. What it was given before is forgotten whenever it is given something else, so that it
/// does not grow.
struct OwnProcess(HarnessProcess);

impl EngineSession for OwnProcess {
    fn make_plant<'s>(&'s mut self, arm: &ArmSpec<'_>) -> Result<Box<dyn Plant + 's>, EngineError> {
        let Self(process) = self;
        process.clear()?;
        let settings = MujocoSettings::of(arm);
        let plant = MujocoPlant::new(process, arm.cell, arm.timestep_s, &settings)?;
        Ok(Box::new(plant))
    }

    fn make_fleet<'s>(
        &'s mut self,
        arm: &ArmSpec<'_>,
        count: usize,
    ) -> Result<Box<dyn Fleet + 's>, EngineError> {
        let Self(process) = self;
        process.clear()?;
        let settings = MujocoSettings::of(arm);
        let fleet = MujocoFleet::new(process, arm.cell, arm.timestep_s, &settings, count)?;
        Ok(Box::new(fleet))
    }

    fn process_id(&self) -> Option<u32> {
        Some(self.0.process_id())
    }
}

impl MujocoSettings {
    /// What a scenario sets of them.
    pub(super) fn of(arm: &ArmSpec<'_>) -> Self {
        let own = &arm.settings.mujoco;
        Self {
            contact_stiffness_per_s2: own.contact_stiffness_per_s2,
            contact_damping_per_s: own.contact_damping_per_s,
            contact_impedance: own.contact_impedance,
            friction: arm.friction,
            ..Self::default()
        }
    }
}

/// Why the process did not start, and where the environment is that it did not start in.
fn in_environment(error: &HarnessError, environment: &Environment) -> String {
    match &environment.folder {
        Some(folder) => format!(
            "{error}\nhint: its environment is in {}; remove that folder to recreate it",
            folder.display()
        ),
        None => error.to_string(),
    }
}
