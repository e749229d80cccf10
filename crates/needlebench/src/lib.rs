//! The testbench: pipeline, command line and output formats.
//!
//! Data goes to standard output, logs and progress to standard error.

mod assemble;
mod atlas;
mod atomic;
mod budgets;
mod cli;
mod command;
mod events;
pub mod exit;
mod iso9283;
mod output;
mod paper;
pub mod picture;
mod pipeline;
mod plants;
mod progress;
mod provenance;
mod reality;
mod servo;
pub mod study;
mod trial;

pub use atlas::{GoalAtlas, goal_atlas};
pub use cli::{command_line, main};
pub use iso9283::ProtocolRun;
pub use pipeline::{EngineChoice, RunOptions, ScenarioRun, run_scenario};
