//! Programs in URScript, the language of the controllers of UR arms.
//!
//! [`parse`] makes of a text a tree in which everything has its line and column. [`Program`] is a text that was checked
//! as a whole, and [`Run`] does it cycle by cycle on a [`Host`], a controller with its clock. No files, no clock and no
//! arm but those.
#![cfg_attr(any(doc, doctest), doc = include_str!("../README.md"))]

mod builtin;
mod call;
mod code;
mod compile;
mod elements;
mod functions;
mod host;
mod lexer;
mod live;
mod load;
mod motion;
mod operators;
mod parser;
mod place;
mod run;
pub mod tree;
mod value;
mod walk;

pub use compile::Program;
pub use host::{ArmState, Bank, Host, Message, Request, Signal};
pub use motion::{Belief, Motion, MotionKind, Pace};
pub use parser::{MOST_BYTES, MOST_LEVELS, parse};
pub use place::{Place, ScriptError};
pub use run::{End, LONGEST_BUSY_S, MOST_INSTRUCTIONS, MOST_THREADS, Progress, Run};
pub use value::Value;
