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

use std::fmt::Write as _;

use sha2::{Digest, Sha256};

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

/// SHA-256 of some bytes, as people write it.
pub(crate) fn sha256_hex(bytes: &[u8]) -> String {
    let hash = Sha256::digest(bytes);
    hash.iter().fold(String::new(), |mut text, byte| {
        write!(text, "{byte:02x}").expect("a text takes everything");
        text
    })
}
