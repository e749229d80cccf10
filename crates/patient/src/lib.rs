//! Patients: scanned, built from their scans, and the needle paths that they and the robot admit.
//!
//! A run of a scenario with `[ct]` begins here, before its cell is planned and simulated: this crate knows no run.
#![cfg_attr(any(doc, doctest), doc = include_str!("../README.md"))]

pub mod ct;
mod proposal;
pub mod routes;
mod stop;

pub use proposal::{Refused, SuggestError, counted};
pub use stop::Stop;
