//! Engines, from outside the crate.

mod agreement;
mod common;
mod harness;
mod hollow_solids;
mod motions;
mod mujoco;
#[path = "common/harness.rs"]
mod process;
mod rapier;
mod referee;
#[path = "common/replay.rs"]
mod replay;
mod simulate;
mod stops;
