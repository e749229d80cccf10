//! Scenario and study files, resolved into one validated cell with goals.
//!
//! [`load_scenario`] is the way in: it reads a scenario and all that it names and gives a
//! [`ResolvedScenario`], or [`Finding`](needlebench_input::Finding)s that say what to mend and where.
//!
//! Modules, from the bottom up; each knows those above it in this list alone:
//!
//! | Modules | What they are |
//! |---|---|
//! | [`published`] | what others have published of needle robots |
//! | [`scenario`], `engine_name` | the sections of a scenario file: plain structs, ranges at their fields |
//! | [`requirements`] | what criteria stand for |
//! | [`fixtures`] | furniture as solids |
//! | `resolve` with [`imperfections`], [`people`], [`iso9283`], [`excitation`] | from sections to a cell with goals in the world |
//! | `excitation_text`, `scenario_edit`, `scenario_text` | the text of a scenario: given an excitation run, changed key by key, or written anew |
//! | [`family`], [`study`], `thresholds` | many scenarios from one, and what is asked of them |
//! | `log_columns`, `marker_list` | which column of a recorded log is what; where markers are |
#![cfg_attr(any(doc, doctest), doc = include_str!("../README.md"))]

mod engine_name;
mod excitation_text;
pub mod family;
pub mod fixtures;
mod log_columns;
mod marker_list;
pub mod published;
pub mod requirements;
mod resolve;
pub mod scenario;
mod scenario_edit;
mod scenario_text;
pub mod study;
mod thresholds;

pub use excitation_text::ExcitationText;
pub use family::{
    Change, KeyPath, MovedPhantom, PhantomMove, PhantomMoves, ScenarioFamily, Setting,
};
pub use log_columns::{LogColumns, MappedColumns};
pub use marker_list::{ListedMarker, MarkerFrame, MarkerList, marker_list_schema};
pub use resolve::{
    ASSUMED_BODY, BevelFacing, ChooseEntry, ChosenEntry, EntryChooser, Expectation, Expected,
    FOOT_M, Goal, GoalPlacer, GravitySettings, NeedlePath, NoEntry, OpenScenario, Overrides,
    PlacedPhantom, RIGID_M, ResolvedScenario, Roll, RunsAlong, ServoSettings, bevel_clock,
    direction, excitation, imperfections, iso9283, load_open_scenario, load_robot, load_scenario,
    name_from_file, people, pose_of, resolve_open_scenario, resolve_scenario,
};
pub use scenario::{envelope, ranking};
pub use scenario_edit::ScenarioEdit;
pub use scenario_text::{relative, scenario_text};
pub use study::criteria as study_criteria;
pub use thresholds::ThresholdsFile;
