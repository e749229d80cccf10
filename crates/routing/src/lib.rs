//! Straight ways for a needle: from which points of the skin a target is reached without harm, and at what risk.
//!
//! 1. [`Anatomy`] is what stands around a target: voxels of a label map ([`VoxelAnatomy`]), or the solids of a phantom
//!    ([`SolidAnatomy`]). Both answer the same questions about a ray from the target.
//! 2. [`search`] asks them for thousands of directions by hard [`RouteRules`]; each that is refused knows its rule and
//!    value, each that is free its distances and its [`Risk`], term by term.
//! 3. [`apart`] picks directions of which each stands for those around it, [`pareto`] what nothing beats in all aims.
//!
//! Whether a robot reaches a direction is asked elsewhere. Metres and radians throughout; frame `phantom` is the
//! patient's (left, posterior, superior).
#![cfg_attr(any(doc, doctest), doc = include_str!("../README.md"))]

mod anatomy;
mod directions;
mod pareto;
mod risk;
mod rules;
mod search;
mod solids;
mod voxels;

pub use anatomy::{Anatomy, Exit, LungPassage, Nearest, Obstacle, Ray};
pub use directions::{angles_rad, apart, around, evenly, outwards};
pub use pareto::pareto;
pub use risk::{Risk, RiskTerm};
pub use rules::{Refusal, RouteRule, RouteRules};
pub use search::{Candidate, Route, Searched, judge, refined, search};
pub use solids::SolidAnatomy;
pub use voxels::{VoxelAnatomy, VoxelOptions, body_normal};
