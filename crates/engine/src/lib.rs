//! Physics engines behind one interface: the same robot, the same geometry, the same servo.
//!
//! An [`Engine`] is a module of this crate and a line of [`ENGINES`]. Started, it makes [`Plant`]s: the
//! arm in an engine, which advances one step under joint torques. [`run_motions`] drives motions in
//! any engine with the [`Servo`], one after the other or several at a time, and hands over a
//! [`Recording`] of each. All plants are built from the one [`Cell`](needlebench_cell::Cell), so that
//! what differs between their recordings is the engines' doing.
#![cfg_attr(any(doc, doctest), doc = include_str!("../README.md"))]

mod actuation;
mod brakes;
mod broad_phase;
mod closed_loop;
mod contact_groups;
mod convert;
mod deviations;
mod drive;
mod engine;
mod error;
mod fleet;
mod live;
mod motions;
pub mod mujoco;
mod pieces;
mod plant;
mod pool;
mod rapier;
mod readings;
mod recording;
mod referee;
mod reference;
mod registry;
mod servo;
mod simulate;
mod state;
#[cfg(test)]
#[path = "../tests/engine/common/mod.rs"]
mod test_cell;
mod unstable_servo;

pub use actuation::{ActuatedTorque, Actuation, CommandTiming, Encoder, JointFriction, Reading};
pub use brakes::{Brakes, loaded, stretched};
pub use closed_loop::ClosedLoop;
pub use deviations::{KNOWN_DEVIATIONS, KnownDeviation};
pub use drive::{Braking, Keep, Motion};
pub use engine::{ArmSpec, Engine, EngineCheck, EngineSession};
pub use error::EngineError;
pub use fleet::Fleet;
pub use live::LiveArm;
pub use motions::{MotionJob, MotionSettings, MotionsDone, run_motions};
pub use mujoco::{MujocoFleet, MujocoIntegrator, MujocoPlant, MujocoSettings};
pub use pieces::pieces_in_words;
pub use plant::Plant;
pub use pool::EnginePool;
pub use rapier::{RapierPlant, RapierSettings};
pub use recording::{Cost, Recording, Saturation};
pub use referee::{HeldWindow, REFEREE, RefereePlant, RefereeSettings, TorqueHold};
pub use reference::Reference;
pub use registry::{ENGINES, UnknownEngine, choose_engines, engine_names};
pub use servo::{Servo, ServoGains, ServoOutput};
pub use simulate::{Hooks, simulate, simulate_fleet, simulate_motion};
pub use state::{Contact, EngineIdentity, PlantState};
pub use unstable_servo::UnstableServo;
