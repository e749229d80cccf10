//! Scenario and model files, resolved into one validated cell.
//!
//! [`load_scenario`] is the way in: it reads a scenario and all that it names and gives a
//! [`ResolvedScenario`], or [`Finding`]s that say what to mend and where.

mod calibration;
mod enclosure;
pub mod envelope;
mod events;
pub mod family;
mod files;
mod finding;
pub mod fixtures;
mod goal;
pub mod imperfections;
pub mod iso9283;
mod mesh;
mod model;
mod nominal;
mod pairs;
mod parts;
pub mod people;
pub mod phantom;
mod phantom_place;
pub mod ranking;
mod resolve;
mod robot;
pub mod scenario;
pub mod shape;
mod shelf;
mod srdf;
mod tessellate;
mod thresholds;
mod toml_text;
mod tool;
mod urdf;
mod user_parts;
mod values;
mod yaml_text;

pub use calibration::{AppliedCalibration, Calibration, OriginDeviation};
pub use enclosure::{LinkEnclosure, enclosures};
pub use family::{Change, KeyPath, ScenarioFamily, Setting};
pub use files::{PackagePaths, sha256_hex};
pub use finding::{Finding, nearest_name};
pub use goal::{Expectation, Goal, PlacedPhantom, REJECTION_RULES, Roll};
pub use mesh::convex_hull;
pub use model::{
    BodyKind, BodyPair, Cell, ClearanceClass, CollisionBody, Frame, Link, LinkMember, ModelSource,
    Needle, NeedleCorridor, Robot, Tool,
};
pub use pairs::{LeftOut, PairRule, pair_rule, place_in_chain};
pub use resolve::{Overrides, ResolvedScenario, load_robot, load_scenario, resolve_scenario};
pub use robot::MissingInertia;
pub use srdf::{DisabledPair, Srdf};
pub use thresholds::ThresholdsFile;
