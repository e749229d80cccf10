//! How likely a needle meets a structure or reaches the lesion: *of the model*, never of a patient.
//!
//! ```text
//! Law   entry and tip together, bend, breath          what is known of one needle, in its own frame
//!   |       + Needle, Structure, Anatomy = Case       where it goes, and how far anything is from a point
//!   +--> at_most       an upper bound without sampling, given the law
//!   +--> estimate      counts of draws with a 95 % interval, the rare ones by importance sampling
//!   +--> difference    two cases on the same draws, paired
//! ```
//!
//! # Frame
//!
//! x along the planned needle from the planned entry point (0, 0, 0) to the planned tip (depth, 0, 0); y and z lateral.
//! Metres. What moves with the chest wall and what moves with the lung are seen from the body that they move with: the
//! path of a draw relative to a body is the planned path plus
//!
//! ```text
//! e(s) = (1 - s) e_entry + s e_tip + bend(s) - displacement of the body,   s = depth / planned depth
//! ```
//!
//! # Draws
//!
//! Draw i is a function of the seed and i alone: the same for every law, structure and number of threads. Two laws, two
//! entries or two configurations are thus compared on the same arms, patients and needles.

mod bend;
mod bound;
mod breath;
mod case;
mod draw;
mod error;
mod estimate;
mod event;
mod importance;
mod influence;
mod interval;
mod law;
mod least;
mod planes;
#[cfg(test)]
mod tests;
mod words;

pub use bend::{Bend, BendDirection};
pub use bound::{Bound, BoundKind, at_most};
pub use breath::{Body, Hold};
pub use case::{Anatomy, Case, CaseError, Needle, Structure};
pub use draw::{PathDraw, draw};
pub use error::LawError;
pub use estimate::{
    Draws, Estimate, EstimateError, MOST_DRAWS, Method, Told, difference, estimate,
};
pub use event::{Event, EventError};
pub use influence::{Influence, Origin};
pub use interval::{
    CONFIDENCE, Difference, Interval, LEAST_PRINTED, share_interval, weighted_interval,
};
pub use law::{Larger, Law, Part};
pub use planes::HalfPlane;
pub use words::{bound_label, estimate_label};
