//! `needlebench ct`: CT volumes.

mod build;
mod info;
mod position;
mod routes;
mod synth;

use anyhow::Result;
use clap::{Args, Subcommand};

use crate::exit::ExitStatus;
use crate::failure::Failure;

use build::{BUILD_HELP, BuildArguments, build_scan};
use info::{InfoArguments, info};
use routes::{ROUTES_HELP, RoutesArguments, routes};
use synth::{SYNTH_HELP, SynthArguments, synth};

#[derive(Debug, Args)]
pub(crate) struct CtArguments {
    #[command(subcommand)]
    command: CtCommand,
}

#[derive(Debug, Subcommand)]
enum CtCommand {
    /// Describe a volume: geometry, Hounsfield units and defects.
    #[command(after_help = "Example: needlebench ct info scan.nii.gz")]
    Info(InfoArguments),
    /// Build surfaces, lesions, markers and a scenario from a volume.
    #[command(
        after_help = "Example: needlebench ct build scan.nii.gz --out out/patient --lesion nodule=-60,40,-112 --markers markers.toml",
        after_long_help = BUILD_HELP
    )]
    Build(Box<BuildArguments>),
    /// Plan admissible needle paths to a target and check which of them are feasible for the robot.
    #[command(
        after_help = "Example: needlebench ct routes out/patient --lesion nodule --write out/patient/planned.toml",
        after_long_help = ROUTES_HELP
    )]
    Routes(Box<RoutesArguments>),
    /// Synthesise a CT of a phantom, with its ground truth.
    #[command(
        after_help = "Example: needlebench ct synth scenarios/supine_suite.toml --out out/ct --preset biopsy --markers ct-sphere",
        after_long_help = SYNTH_HELP
    )]
    Synth(Box<SynthArguments>),
}

/// Runs a subcommand of `ct`.
pub(crate) fn ct(arguments: &CtArguments) -> Result<ExitStatus, Failure> {
    match &arguments.command {
        CtCommand::Info(arguments) => info(arguments),
        CtCommand::Build(arguments) => build_scan(arguments),
        CtCommand::Routes(arguments) => routes(arguments),
        CtCommand::Synth(arguments) => synth(arguments),
    }
}
