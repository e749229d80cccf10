//! How imperfect the arm and the phantom are, and what that does to the needle.
//!
//! ```text
//! Imperfections --draw--> Truth --settle--> posture --> tip error        one arm, one patient
//!      |
//!      +--Jacobians--> covariance and bias by source        \
//!      +--many draws, the same way as one--> the same        } error budget
//! ```
//!
//! A [`Truth`] is one arm and one patient: what the engines simulate. The [`budget`] is the error budget of the
//! needle's tip over the arm and patient population, by source, analytically and by Monte Carlo; the two share no
//! formula but the model of each source. `tests/validation/budget` shares neither.
#![cfg_attr(any(doc, doctest), doc = include_str!("../README.md"))]

mod bend;
pub mod budget;
mod distribution;
mod fit;
mod jitter;
mod servo;
mod settle;
mod truth;

pub use bend::{DrawnNeedle, NoBend, drawn_bends_m};
pub use servo::servo_of;
pub use settle::{RestingFriction, SettleError, Settled, resting_friction, settle, settle_after};
pub use truth::{Bending, Draw, Layout, Source, Stage, Truth};
