//! Scenario and model files, resolved into one validated cell.

pub mod shape;
