//! `needlebench ct`: CT volumes.

mod info;

use anyhow::Result;
use clap::{Args, Subcommand};

use crate::exit::ExitStatus;

use info::{InfoArguments, info};

#[derive(Debug, Args)]
pub(crate) struct CtArguments {
    #[command(subcommand)]
    command: CtCommand,
}

#[derive(Debug, Subcommand)]
enum CtCommand {
    /// What a volume is: geometry, Hounsfield units, and what is wrong with it.
    #[command(after_help = "Example: needlebench ct info scan.nii.gz")]
    Info(InfoArguments),
}

/// Runs what is asked for of a CT.
pub(crate) fn ct(arguments: &CtArguments) -> Result<ExitStatus> {
    match &arguments.command {
        CtCommand::Info(arguments) => info(arguments),
    }
}
