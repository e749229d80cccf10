//! The command line of the testbench, for a terminal and for embedding in other programs ([`invoke`]).
//!
//! Data goes to standard output, logs and progress to standard error.
#![cfg_attr(any(doc, doctest), doc = include_str!("../README.md"))]

mod arguments;
mod cli;
mod clock;
mod command;
pub mod exit;
mod failure;
mod findings;
mod host;
mod interrupts;
mod log;
mod output;
mod progress;
mod renamed;
mod xacro;

pub use cli::{command_line, invoke, main, main_with};
pub use command::{KinematicArm, needle_case_schema};
pub use findings::findings_text;
pub use host::Invocation;
