//! Scenario and model files, from outside the crate.

mod arm_models;
mod arms;
mod assumed;
mod breathing;
mod calibration;
mod family;
mod foreign_chains;
mod foreign_urdf;
mod foreign_variants;
mod goal_direction;
mod layouts;
mod limbs;
mod measured;
mod moves;
mod needle;
mod obstacles;
mod pair_classes;
mod people;
mod schema;
mod schema_probes;
mod study;
mod urdf_slips;
mod values;
mod words;
