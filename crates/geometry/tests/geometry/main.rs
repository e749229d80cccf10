//! Distances, meshes and rays, from outside the crate.

mod against_coal;
mod against_parry;
mod closed_forms;
mod common;
mod meshes;
mod properties;
