//! Physics engines behind one interface: the same robot, the same geometry, the same servo.
//!
//! A [`Plant`] is the arm in an engine: it advances one step under joint torques. [`simulate`]
//! drives any plant along a trajectory with the [`Servo`] and returns a [`Recording`]. Both plants
//! are built from the one [`Cell`](needlebench_cell::Cell), so that what differs between their
//! recordings is the engines' doing.

mod actuation;
mod brakes;
mod closed_loop;
mod contact_groups;
mod deviations;
mod error;
mod fleet_run;
pub mod mujoco;
mod nearness;
mod plant;
mod rapier;
mod recording;
mod referee;
mod servo;
mod simulate;
#[cfg(test)]
#[path = "../tests/common/mod.rs"]
mod test_cell;

pub use actuation::{ActuatedTorque, Actuation, CommandTiming, Encoder, JointFriction};
pub use brakes::{
    Brakes, PUBLISHED_LOAD_KG, PUBLISHED_SPEED_RAD_S, PUBLISHED_STOPS, PublishedStop, loaded,
    stretched,
};
pub use closed_loop::{ClosedLoop, UnstableServo};
pub use deviations::{KNOWN_DEVIATIONS, KnownDeviation};
pub use error::EngineError;
pub use fleet_run::{Motion, simulate_fleet};
pub use mujoco::{MujocoFleet, MujocoIntegrator, MujocoPlant, MujocoSettings};
pub use plant::{Contact, EngineIdentity, Plant, PlantState};
pub use rapier::{RapierPlant, RapierSettings};
pub use recording::{Cost, Recording, Saturation};
pub use referee::{RefereePlant, RefereeSettings, TorqueHold, retrace};
pub use servo::{Servo, ServoGains, ServoOutput};
pub use simulate::{Braking, Drive, Hooks, simulate, simulate_with_stop};
