//! How something is run, and what it leaves.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use needlebench_bench::RunOptions;

use super::{EngineArgument, EngineParser, PicturesArguments};
use crate::interrupts::threads;

/// How a scenario is run or a motion is judged, and what that writes and prints.
#[derive(Debug, Args)]
#[expect(clippy::struct_excessive_bools, reason = "flags of a command line")]
pub(crate) struct RunningArguments {
    /// Physics engines [default: those of the scenario].
    #[arg(long, value_name = "ENGINE[,ENGINE]", value_parser = EngineParser)]
    pub engine: Option<EngineArgument>,
    /// Verify every motion against the reference integrator at steps h, h/2 and h/4 (3 to 10 times slower).
    #[arg(long = "reference", alias = "referee")]
    pub referee: bool,
    /// Folder for results; each scenario has a subfolder of its name.
    #[arg(long, value_name = "DIR", default_value = "out")]
    pub out: PathBuf,
    /// Print the report as one JSON document instead of the table.
    #[arg(long)]
    pub json: bool,
    /// Also write JUnit XML to this file.
    #[arg(long, value_name = "FILE")]
    pub junit: Option<PathBuf>,
    /// Number of threads [default: all cores]; does not affect results.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=256))]
    pub jobs: Option<u16>,
    /// Also write each motion as an RTDE log, in the format of the UR recorder.
    #[arg(long)]
    pub rtde: bool,
    /// Also write each recorded motion in another format, beside its CSV.
    #[arg(long, value_name = "FORMAT", value_enum)]
    pub record: Option<Record>,
    #[command(flatten)]
    pub pictures: PicturesArguments,
    /// Do not write the report page.
    #[arg(long)]
    pub no_page: bool,
    /// Do not show progress.
    #[arg(long)]
    pub quiet: bool,
    /// Print all tables at full width instead of one screen.
    #[arg(long, conflicts_with = "json")]
    pub wide: bool,
}

/// Format of recordings.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Record {
    /// ROS 2 messages in an MCAP file for each goal, configuration and engine.
    Mcap,
}

impl RunningArguments {
    /// How it is run.
    pub(crate) fn options(&self) -> RunOptions {
        RunOptions {
            engines: self.engine.as_ref().map(EngineArgument::names),
            jobs: threads(self.jobs),
            referee: self.referee,
            ..RunOptions::default()
        }
    }
}
