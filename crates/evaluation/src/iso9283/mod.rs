//! A simulated test by ISO 9283: recorded cycles become attained poses, and these what is reported and judged.

mod judge;
mod measure;
mod report;

pub use judge::{SUBJECT, judge};
pub use measure::{CycleMeasurement, Effort, measure_cycle};
pub use report::{EngineMeasurement, Iso9283Report, ProtocolSummary, StabilisationReport};
