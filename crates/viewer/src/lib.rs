//! The planning page on the CT of one patient: a server on this machine alone, and the page that it serves.
//!
//! [`Case::open`] reads the folder that `needlebench ct build` made and rejects one whose parts do not belong together;
//! [`Server`] serves it. A needle path is evaluated by [`live`] and [`motion`]; the user's decisions are saved by
//! [`session`].
//!
//! Voxels are told by index, places in millimetres of `ct` (patient LPS); the server alone turns one into the other.
#![cfg_attr(any(doc, doctest), doc = include_str!("../README.md"))]

mod answer;
mod around;
mod case;
pub mod entries;
mod guard;
mod listen;
pub mod live;
pub mod motion;
mod page;
mod people;
mod plan_file;
mod server;
pub mod session;
mod simulation;
mod turns;

pub use case::{Case, Place};
pub use server::{Server, ServerError, Stopper};
