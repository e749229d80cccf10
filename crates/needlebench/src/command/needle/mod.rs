//! `needlebench needle`: a needle in tissue, without a robot.

mod bends;
mod case;
mod fit;
mod insert;
mod setup;

use clap::{Args, Subcommand};

use crate::exit::ExitStatus;
use crate::failure::Failure;

pub use case::needle_case_schema;
use fit::{FIT_HELP, FitArguments, fit};
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
    /// Find the force across the tip from recorded bends of a needle.
    #[command(
        after_help = "Example: needlebench needle fit guide/examples/bends.csv --held hub --gauge 22 --needle-length-mm 89",
        after_long_help = FIT_HELP
    )]
    Fit(Box<FitArguments>),
}

/// Runs a subcommand of `needle`.
pub(crate) fn needle(arguments: &NeedleArguments) -> Result<ExitStatus, Failure> {
    match &arguments.command {
        NeedleCommand::Insert(arguments) => insert_case(arguments),
        NeedleCommand::Fit(arguments) => fit(arguments),
    }
}
