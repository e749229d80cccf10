//! Signed clearances of an arm among solids, of postures and proven along motions.
#![cfg_attr(any(doc, doctest), doc = include_str!("../README.md"))]
//!
//! ## In this crate
//!
//! Of a posture: that of the distances; enclosing volumes only leave out pairs of which they prove
//! that they are not the nearest, so that the result is bit for bit the least of all pairs
//! (`tests/clearance/cell.rs`). Of postures that follow each other, bounds of the one before and what
//! has moved since leave out pairs in the same way ([`Nearby`]). Of a motion: [`certify`] proves a
//! lower bound at all times, which is within [`CertificateOptions::tolerance_m`] of a clearance that is attained, less
//! [`ROUNDING_M`] for rounding. Of all joint positions: [`examine_pairs`] likewise, in
//! [`RangeBound`].

mod body;
mod certificate;
mod known_gaps;
mod model;
mod pairs;
mod posture;
mod search;

pub use certificate::{
    CertificateOptions, ClassCertificate, Effort, LEAST_INTERVAL_S, MOST_INTERVALS, Motion,
    MotionBound, MotionCertificate, ROUNDING_M, RecordedMotion, Span, certify, certify_enough,
    certify_sampled,
};
pub use known_gaps::KnownGaps;
pub use model::{
    CUT_MARGIN_M, ClassMinima, ClearanceModel, ClearanceParts, PairClearance, is_known,
};
pub use pairs::{PairConcern, PairExamination, PairSettings, PairState, RangeBound, examine_pairs};
pub use search::{AIMS, Counted, Counts, Couple, Held, Nearby};
