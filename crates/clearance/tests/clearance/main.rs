//! Clearances, from outside the crate.

mod cell;
mod common;
mod pairs;
mod shipped_arms;
