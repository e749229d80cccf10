//! The plants that a scenario's settings ask for, and the process that MuJoCo runs in.

use std::sync::Mutex;
use std::time::Duration;

use needlebench_cell::scenario::{EngineName, EnginesSection};
use needlebench_cell::{Cell, ResolvedScenario};
use needlebench_engine::mujoco::{HarnessProcess, ensure};
use needlebench_engine::{
    EngineError, MujocoPlant, MujocoSettings, Plant, RapierPlant, RapierSettings,
};

use crate::progress::Progress;

/// The process that MuJoCo runs in, or why there is none.
pub(crate) type Harness = Result<Mutex<HarnessProcess>, String>;

pub(crate) fn start_harness(resolved: &ResolvedScenario, progress: &Progress) -> Harness {
    let timeout = Duration::from_secs_f64(resolved.scenario.engines.harness_timeout_s);
    let environment =
        ensure(&mut |text| progress.message(text)).map_err(|error| error.to_string())?;
    HarnessProcess::start(&environment, timeout)
        .map(Mutex::new)
        .map_err(|error| error.to_string())
}

/// One plant of an engine.
///
/// # Errors
/// What the engine reports of the cell or the settings.
///
/// # Panics
/// If MuJoCo is asked for without its process.
pub(crate) fn plant<'h>(
    engine: EngineName,
    cell: &Cell,
    engines: &EnginesSection,
    timestep_s: f64,
    process: Option<&'h mut HarnessProcess>,
) -> Result<Box<dyn Plant + 'h>, EngineError> {
    Ok(match engine {
        EngineName::Rapier => {
            let settings = rapier_settings(engines);
            Box::new(RapierPlant::new(cell, timestep_s, &settings)?)
        }
        EngineName::Mujoco => {
            let process = process.expect("MuJoCo has a process where it is asked for");
            let settings = mujoco_settings(engines);
            Box::new(MujocoPlant::new(process, cell, timestep_s, &settings)?)
        }
    })
}

pub(crate) fn rapier_settings(engines: &EnginesSection) -> RapierSettings {
    RapierSettings {
        contact_natural_frequency_hz: engines.rapier.contact_natural_frequency_hz,
        contact_damping_ratio: engines.rapier.contact_damping_ratio,
        contact_sweeps: engines.rapier.contact_sweeps as usize,
        friction: engines.friction,
        ..RapierSettings::default()
    }
}

pub(crate) fn mujoco_settings(engines: &EnginesSection) -> MujocoSettings {
    MujocoSettings {
        contact_stiffness_per_s2: engines.mujoco.contact_stiffness_per_s2,
        contact_damping_per_s: engines.mujoco.contact_damping_per_s,
        contact_impedance: engines.mujoco.contact_impedance,
        friction: engines.friction,
        ..MujocoSettings::default()
    }
}
