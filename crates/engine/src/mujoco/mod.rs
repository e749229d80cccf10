//! MuJoCo, stepped in lock-step by a Python process at the other end of a pipe.

mod engine;
mod environment;
mod fleet;
mod member;
mod mjcf;
mod plant;
mod process;
mod settings;
mod tail;

pub(crate) use engine::Mujoco;
pub use environment::{
    DownloadedWheels, Environment, EnvironmentError, EnvironmentOptions, Prepared, PythonVersion,
    WheelPlatform, WheelsFor, download_wheels, ensure, ensure_with, prepare,
};
pub use fleet::MujocoFleet;
pub use mjcf::{Keyframe, MarkedPlace, StandaloneModel, standalone_model};
pub use plant::MujocoPlant;
pub use process::{
    ContactSummary, GeomDistance, HarnessError, HarnessProcess, HarnessState, HarnessVersions,
    InverseDynamics, PlantHandle, Replay,
};
pub use settings::{MujocoIntegrator, MujocoSettings};
