//! What a page computes itself: clearances of a posture, and which configurations reach a goal, with the
//! robot's base anywhere.
//!
//! The program writes a [`Scene`] into a page, as bytes that give the same bits back, and beside it this
//! crate compiled to WebAssembly (`crates/live/build.mjs`). So the page's numbers come from the code that
//! the program's come from: [`needlebench_clearance::ClearanceModel`] and
//! [`needlebench_kinematics::ik::Kinematics`].
//!
//! All of it is of one posture. Nothing is said of motions.
#![cfg_attr(any(doc, doctest), doc = include_str!("../README.md"))]

#[cfg(target_arch = "wasm32")]
mod exports;
mod live;
mod reach;
mod scene;

pub use live::{Live, Overlap};
pub use reach::{Outcome, Reach};
pub use scene::{GoalPose, Limits, Scene, SceneBody, Tie};
