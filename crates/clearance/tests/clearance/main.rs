//! Clearances, from outside the crate.

mod cell;
mod common;
mod cuts;
mod obstacles;
mod pairs;
mod shipped_arms;
