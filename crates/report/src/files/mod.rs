//! What commands write into their folders of results.
//!
//! Charts and pictures are drawn here and not before: they are large, and soon on the disk. Nothing
//! of an earlier run stays that could be taken for a result of this one.

mod accuracy;
mod atlas;
mod atomic;
mod error;
mod excitation;
mod folder;
mod iso9283;
mod pictures;
mod replan;
mod replay;
mod routes;
mod run;
mod search;
mod servo;
mod study;
mod suggest;

pub use accuracy::write_accuracy;
pub use atlas::write_atlas;
pub use atomic::write_atomically;
pub use error::FilesError;
pub use excitation::write_plan;
pub use folder::Folder;
pub use iso9283::write_measured;
pub use replay::{CALIBRATION_FILE, write_replay};
pub use routes::write_route_maps;
pub use run::{RunFiles, write_run};
pub use search::{SearchDocument, write_search, write_search_log};
pub use servo::write_servo;
pub use study::{FinishedStudy, StudyOutput, StudySummary, write_study};
pub use suggest::write_suggestions;
