//! clearance

mod bounds;
mod closed_form;
mod core;
mod epa;
mod gjk;
mod hull;
mod model;
mod segment;
mod separation;

pub use crate::core::PreparedShape;
pub use model::{ClassMinima, ClearanceModel, PairClearance};
pub use segment::segment_clearance;
pub use separation::{Separation, separation};
