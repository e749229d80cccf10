//! Programs in URScript, the language of the controllers of UR arms.
//!
//! [`parse`] makes of a text a tree in which everything has its line and column. No files, no arm, no clock.
#![cfg_attr(any(doc, doctest), doc = include_str!("../README.md"))]

mod lexer;
mod motion;
mod operators;
mod parser;
mod place;
pub mod tree;
mod value;

pub use motion::{Arm, Belief, Motion, MotionKind, Pace};
pub use parser::{MOST_BYTES, MOST_LEVELS, parse};
pub use place::{Place, ScriptError};
pub use value::Value;
