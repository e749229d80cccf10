//! Needle paths: admissible entry points on the skin for a target, and their risk.
//!
//! 1. [`Anatomy`] describes the surroundings of a target: voxels of a label map ([`VoxelAnatomy`]), or the solids of
//!    a phantom ([`SolidAnatomy`]). Both answer the same questions about a ray from the target.
//! 2. [`search`] evaluates thousands of directions by hard [`RouteRules`]; each rejected one has its rule and value,
//!    each admissible one its distances and its [`Risk`], term by term. Where the [`RouteNeedle`] is known, the
//!    straight needle and the one that tissue bends keep the same margins.
//! 3. [`apart`] picks representative directions.
//!
//! Feasibility for a robot is checked elsewhere. Metres and radians throughout; frame `phantom` is the
//! patient's (left, posterior, superior).
#![cfg_attr(any(doc, doctest), doc = include_str!("../README.md"))]

mod anatomy;
mod bent;
mod directions;
mod risk;
mod rules;
mod search;
mod solids;
mod voxels;

pub use anatomy::{Anatomy, Exit, LungPassage, Nearest, Obstacle, Ray};
pub use bent::{Bend, RouteNeedle};
pub use directions::{angles_rad, apart, around, evenly, outwards};
pub use risk::{Risk, RiskTerm};
pub use rules::{Refusal, RouteRule, RouteRules};
pub use search::{Candidate, Route, Searched, bent_reason, judge, refined, search};
pub use solids::SolidAnatomy;
pub use voxels::{VoxelAnatomy, VoxelOptions, body_normal};
