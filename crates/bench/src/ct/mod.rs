//! From phantoms and scenarios to CT volumes.

mod anatomy;
mod scan_order;
mod truth;

pub use anatomy::{Materials, phantom_scene};
pub use scan_order::{CtSubject, ScanOrder, ScanRange, SyntheticScan};
pub use truth::{LesionTruth, MarkerTruth, ScanTruth};
