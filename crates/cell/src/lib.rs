//! Scenario and model files, resolved into one validated cell.
//!
//! [`load_scenario`] is the way in: it reads a scenario and all that it names and gives a
//! [`ResolvedScenario`], or [`Finding`]s that say what to mend and where.
//!
//! Modules, from the bottom up; each knows those above it in this list alone:
//!
//! | Modules | What they are |
//! |---|---|
//! | `words` | what people call parts of the room |
//! | `finding`, `files`, `limit` | what is wrong with an input; shipped files and files on disk |
//! | `file_kind` | what a file is that was taken for something else |
//! | `schema`, `toml_text` | what a file may hold: one source of its JSON schema and of the reader's checks; texts with places |
//! | [`arm`] | what is known of an arm besides its URDF |
//! | [`published`] | what others have published of needle robots |
//! | `model` | the resolved cell: robot, tool, bodies, pairs |
//! | `robot` | robots and tools from URDFs, calibrations, enclosures |
//! | [`scenario`], `engine_name` | the sections of a scenario file: plain structs, ranges at their fields |
//! | [`requirements`], [`judgement`] | what criteria stand for; what people state about results |
//! | [`phantom`], [`fixtures`] | chests and furniture as solids |
//! | `resolve` with [`imperfections`], [`people`], [`iso9283`], [`excitation`] | from sections to a [`Cell`] with goals in the world |
//! | `excitation_text`, `scenario_edit`, `scenario_text` | the text of a scenario: given a run that excites every joint, changed key by key, or written anew |
//! | [`family`], [`study`], `thresholds` | many scenarios from one, and what is asked of them |
//! | `log_columns`, `marker_list` | which column of a recorded log is what; where markers are |
#![cfg_attr(any(doc, doctest), doc = include_str!("../README.md"))]

pub mod arm;
mod delimited;
mod engine_name;
mod excitation_text;
pub mod family;
mod file_kind;
mod files;
mod finding;
pub mod fixtures;
mod input;
pub mod judgement;
mod limit;
mod log_columns;
mod marker_list;
mod mesh_file;
mod model;
pub mod phantom;
mod printable;
pub mod published;
pub mod requirements;
mod resolve;
mod robot;
pub mod scenario;
mod scenario_edit;
mod scenario_text;
mod schema;
pub mod study;
mod thresholds;
mod toml_text;
mod toml_value;
mod words;

pub use arm::{Arm, Recognition};
pub use delimited::Separator;
pub use excitation_text::ExcitationText;
pub use family::{
    Change, KeyPath, MovedPhantom, PhantomMove, PhantomMoves, ScenarioFamily, Setting,
};
pub use file_kind::{FileKind, or_wrong_kind};
pub use files::{ModelSource, PackagePaths, sha256_hex};
pub use finding::{Finding, nearest_name};
pub use input::{InputError, open_input, read_data_text, read_text};
pub use limit::{Limit, digits_apart};
pub use log_columns::{LogColumns, MappedColumns};
pub use marker_list::{ListedMarker, MarkerFrame, MarkerList, marker_list_schema};
pub use model::{
    AppliedCalibration, ArmInUse, ArmReport, BodyKind, BodyPair, Cell, ClearanceClass,
    CollisionBody, Frame, LeftOut, Link, LinkMember, Needle, NeedleCorridor, PairRule, Robot, Tool,
    UnseenPart, WITHOUT_SHAPE, pair_rule, place_in_chain,
};
pub use printable::{printable, printable_json, printable_line};
pub use resolve::{
    ChosenEntry, EntryChooser, Expectation, Expected, FOOT_M, Goal, GoalPlacer, GravitySettings,
    OpenScenario, Overrides, PlacedPhantom, RIGID_M, ResolvedScenario, Roll, ServoSettings,
    direction, excitation, imperfections, iso9283, load_open_scenario, load_robot, load_scenario,
    name_from_file, people, pose_of, resolve_open_scenario, resolve_scenario,
};
pub use robot::{
    Calibration, DisabledPair, LinkEnclosure, MOVING_LINK_LABELS, MissingInertia, OriginDeviation,
    Srdf, enclosures,
};
pub use scenario::{envelope, ranking};
pub use scenario_edit::ScenarioEdit;
pub use scenario_text::{relative, scenario_text};
pub use study::criteria as study_criteria;
pub use thresholds::ThresholdsFile;
pub use toml_value::{from_toml, to_toml};
pub use words::{pair_in_words, part_in_words, reason_in_words, rule_in_words};
