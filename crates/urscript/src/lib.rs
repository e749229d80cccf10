//! Programs in URScript, the language of the controllers of UR arms.
#![cfg_attr(any(doc, doctest), doc = include_str!("../README.md"))]

mod lexer;
mod place;
pub mod tree;

pub use place::{Place, ScriptError};
