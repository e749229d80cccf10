//! Signed clearance of a whole cell by class, certificates along motions, and pairs over all
//! joint positions.
//!
//! Positive is a gap, negative a penetration depth. Distances of two shapes are those of
//! [`needlebench_geometry::separation`], as accurate as it says there.
//!
//! ```
//! use std::path::Path;
//!
//! use needlebench_cell::{ClearanceClass, Overrides, load_scenario};
//! use needlebench_clearance::ClearanceModel;
//! use needlebench_kinematics::Joints;
//!
//! # let scenarios = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenarios"));
//! let scenario = load_scenario(&scenarios.join("table3.toml"), &Overrides::default())
//!     .expect("a shipped scenario is sound");
//! let model = ClearanceModel::new(&scenario.cell);
//!
//! // Nearly straight, the forearm level.
//! let stretched_out = Joints::new(0.0, -0.4, 0.2, 0.2, 0.0, 0.0);
//! let minima = model.minimum_per_class(&stretched_out);
//! let nearest = minima.get(ClearanceClass::RobotTable).expect("the cell has a table");
//! let (link, table) = nearest.solid_names(&scenario.cell);
//! println!("{link} is {:.1} mm from {table}", nearest.separation.distance_m * 1e3);
//! assert_eq!((link, table), ("upper_arm.0", "table"));
//! assert!((0.253..0.255).contains(&nearest.separation.distance_m));
//! ```
//!
//! # Accuracy
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
pub use model::{ClassMinima, ClearanceModel, ClearanceParts, PairClearance};
pub use pairs::{
    PairConcern, PairExamination, PairSettings, PairState, RangeBound, SrdfAnswer, SrdfVerdict,
    check_srdf, examine_pairs,
};
pub use search::{AIMS, Counted, Counts, Nearby};
