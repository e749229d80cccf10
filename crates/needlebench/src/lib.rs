//! The command line of the testbench.
//!
//! Data goes to standard output, logs and progress to standard error.

mod arguments;
mod cli;
mod clock;
mod command;
pub mod exit;
mod findings;
mod interrupts;
mod output;
mod progress;

pub use cli::{command_line, main};
