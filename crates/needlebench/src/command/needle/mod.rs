//! `needlebench needle`: a needle in tissue, without a robot.

mod case;
mod insert;
mod setup;

use clap::{Args, Subcommand};

use crate::exit::ExitStatus;
use crate::failure::Failure;

pub use case::needle_case_schema;
use insert::{INSERT_HELP, InsertArguments, insert_case};

#[derive(Debug, Args)]
pub(crate) struct NeedleArguments {
    #[command(subcommand)]
    command: NeedleCommand,
}

#[derive(Debug, Subcommand)]
enum NeedleCommand {
    /// Insert a needle through given layers: where its tip ends, and the path that it cuts.
    #[command(
        after_help = "Example: needlebench needle insert guide/examples/needle.toml",
        after_long_help = INSERT_HELP
    )]
    Insert(InsertArguments),
}

/// Runs a subcommand of `needle`.
pub(crate) fn needle(arguments: &NeedleArguments) -> Result<ExitStatus, Failure> {
    match &arguments.command {
        NeedleCommand::Insert(arguments) => insert_case(arguments),
    }
}
