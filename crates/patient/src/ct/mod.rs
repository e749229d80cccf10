//! From phantoms and scenarios to CT volumes, and from CT volumes to scenarios.

mod anatomy;
mod build;
mod built_folder;
mod digest;
mod files;
mod imaged;
mod needles;
mod overview;
mod patient;
mod scan_order;
mod touched;
mod truth;
mod written_folder;

/// The default room of a patient.
pub const USUAL_ROOM: &str = include_str!("room.toml");

pub use anatomy::Materials;
pub(crate) use anatomy::phantom_scene;
pub use build::{
    BuildOptions, BuiltTarget, GivenLabels, KnownMarkers, Registered, ScanBuild, SeenScan, build,
};
pub use built_folder::{
    BuildFacts, BuiltFolder, LesionFacts, MarkerFacts, SurfaceFacts, TargetFacts,
};
pub use files::{
    BuildFiles, BuildReport, ROUTES_FILE, SCENARIO_FILE, SESSION_FILE, SLICES, VOLUME_FILE,
};
pub use imaged::{Imaged, LastScan, imaged, scanned};
pub use needles::{ScanNeedle, ScanNeedles};
pub use overview::{OverviewAccuracy, OverviewRow, OverviewSource, unlabelled};
pub use patient::{PatientFrame, Room};
pub use scan_order::{CtSubject, ScanOrder, ScanRange, SyntheticScan};
pub use touched::marker_list;
pub use truth::{LesionTruth, MarkerTruth, ScanTruth};
pub use written_folder::{SetAside, WrittenPatient, write_patient};
