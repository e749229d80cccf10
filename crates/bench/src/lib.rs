//! What a run is: a scenario planned, simulated, measured and evaluated; and likewise its events, a test by ISO 9283,
//! an excitation run, the engines compared with the reference integrator, the roll map of a goal, the servo's data
//! sheet, the replay of a recorded run and a case of a study.
//!
//! Gives values only: nothing here prints, draws or writes files.
//!
//! A run is a row of stages, each of which takes what those before it made: `plan`, `simulate`,
//! `events`, `adjudication`, `budgets`, `assemble`. A case of a study goes through the same ones.
#![cfg_attr(any(doc, doctest), doc = include_str!("../README.md"))]

// Its functions are called by name, from wherever the C library's would be.
use needlebench_elementary as _;

pub mod accuracy;
mod adjudication;
mod assemble;
pub mod atlas;
mod budgets;
mod desk;
mod entry;
mod events;
pub mod excitation;
mod iso9283;
pub mod judge;
pub mod motion;
mod needle;
mod plan;
pub mod preview;
mod probability;
pub mod provenance;
mod ranked;
mod real_cell;
pub mod record_plan;
pub mod replay;
pub mod robot;
mod rtde;
mod run;
mod runnable;
mod scenario_run;
pub mod search;
pub mod servo;
mod setup;
mod simulate;
mod starter;
pub mod study;
pub mod suggest;

pub use atlas::{GoalAtlas, goal_atlas};
pub use desk::Desk;
pub use entry::EntryFinder;
pub use events::{EngineEvents, EventRun, StagedStop};
pub use needlebench_geometry::mesh::{forget_kept_meshes, kept_meshes};
pub use preview::Preview;
pub use ranked::rank_route;
pub use rtde::{RtdeLog, RtdeRow, RtdeSource};
pub use run::{LEFT_OUT, run, run_scenario};
pub use runnable::Runnable;
pub use scenario_run::{
    ExcitationRun, ProtocolRun, RealArm, RunError, RunOptions, ScenarioRun, StoppedRun,
};
pub use setup::SetupError;
pub use simulate::EngineRun;
pub use starter::{Starter, StarterOptions, Template, starter, starter_study};
