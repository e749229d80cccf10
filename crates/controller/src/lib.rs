//! A virtual controller of UR arms: no sockets, no engine, no clock but its cycles, and no program's text.
//!
//! ```text
//! requests, measured --cycle--> set-point at the cycle's end, events
//!                                 set-points --SetPoints--> the reference of engines, and the record
//! ```
//!
//! # States
//! [`TABLE`] has what follows from every request in every state. What a UR controller does where no source says it is
//! assumed, and marked so.
//!
//! Where [`State::is_braked`], the brakes hold the arm and not its drives: an emergency stop is the brakes' at once, and
//! the set-point, which then stops by itself, is no reference. When they are released it moves to where the arm is.
//!
//! # Motions
//! - `movej`, `movel`, `movep`, `movec`: from rest to rest by a ramped trapezoid, blends as the sum of the end of one
//!   and the begin of the next. Begun while the arm moves otherwise, they wait until it has stopped.
//! - `servoj`: a filter of second order. `speedj`, `speedl`, `stopj`, `stopl`: changes of velocity under bounds of
//!   acceleration and jerk, from any motion on.
//! - Stops of the controller: as `stopj`, at the deceleration of [`StopData`].
//!
//! Positions, velocities and accelerations are continuous throughout. Every set-point but those of stops is within the
//! limits of the arm, and so is a stop from there on: else the controller stops from the set-point before it.

mod arm;
mod controller;
mod course;
mod event;
mod legs;
mod mover;
mod ramp;
mod request;
mod servo;
mod set_points;
mod state;
mod tool_speed;

pub use arm::{ArmData, NotAnArm, StopData};
pub use controller::{Controller, Cycle, Measured};
pub use event::{Blend, Event, Trip};
pub use request::{Command, Goal, Move, Origin, Refusal, Request};
pub use set_points::SetPoints;
pub use state::{BRAKE_RELEASE_S, Order, Outcome, POWER_ON_S, State, TABLE, UNLOCK_S};
