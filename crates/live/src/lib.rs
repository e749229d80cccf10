//! Computations within a page: clearances of a posture, and feasible configurations at a goal, with any
//! placement of the robot's base.
//!
//! The program writes a [`Scene`] into a page, as bytes that give the same bits back, and beside it this
//! crate compiled to WebAssembly (`crates/live/build.mjs`). The page's numbers come from the same code as
//! the program's: [`needlebench_clearance::ClearanceModel`] and
//! [`needlebench_kinematics::ik::Kinematics`].
//!
//! All results are of single postures; motions are not evaluated.
#![cfg_attr(any(doc, doctest), doc = include_str!("../README.md"))]

#[cfg(target_arch = "wasm32")]
mod exports;
mod live;
mod reach;
mod scene;

pub use live::{Live, Overlap};
pub use reach::{Outcome, Reach};
pub use scene::{GoalPose, Limits, Scene, SceneBody, Tie};
