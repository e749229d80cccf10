//! The cell as a value: arm, tool, patient and everything else that can be hit, the pairs of bodies whose distance
//! counts, and the words in which people read them. No files, no formats.
//!
//! [`Cell::assemble`] puts robot, tool and surroundings together. Metres, radians and kilograms; bodies of the arm are
//! in their links' frames, all others in the world.
#![cfg_attr(any(doc, doctest), doc = include_str!("../README.md"))]

mod bodies;
mod brakes;
mod gears;
mod pairs;
mod parts;
mod physics;
mod rule;
mod words;

pub use bodies::{BodyKind, ClearanceClass, CollisionBody, Frame};
pub use brakes::{BrakeFigure, BrakeFigures};
pub use gears::GearTwist;
pub use pairs::{LeftOut, PairRule, pair_rule, place_in_chain};
pub use parts::{BodyPair, Cell, Link, Needle, NeedleCorridor, Robot, Tool, UnseenPart, placed};
pub use physics::{EngineSettings, MujocoSettings, RapierSettings, STANDARD_GRAVITY_M_S2};
pub use rule::{Amount, Rule};
pub use words::{
    SCAN_ENDS, UNSEEN_BODY, pair_in_words, part_in_words, reason_in_words, rule_in_words,
};
