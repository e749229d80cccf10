//! `needlebench paper`.

use clap::Args;
use std::path::PathBuf;

use anyhow::{Context, Result};

use super::results_folder::prepare_folder;
use super::{print_json, print_text};
use crate::output::shown;

use crate::arguments::PicturesArguments;
use crate::exit::ExitStatus;
use crate::failure::Failure;
use crate::interrupts::watch_interrupts;
use crate::progress::TerminalProgress;
use needlebench_paper::{PaperError, Watch, reproduce};
use needlebench_report::files::Folder;

#[derive(Debug, Args)]
pub(crate) struct PaperArguments {
    /// Folder for `paper.json`, `paper.html` and the images.
    #[arg(long, value_name = "DIR", default_value = "out/paper")]
    pub out: PathBuf,
    /// Print the results as one JSON document instead of the tables.
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub pictures: PicturesArguments,
    /// Do not show progress.
    #[arg(long)]
    pub quiet: bool,
}

/// Reproduces the paper, writes and prints the results.
pub(crate) fn paper(arguments: &PaperArguments) -> Result<ExitStatus, Failure> {
    let cancel = watch_interrupts()?;
    prepare_folder(&arguments.out)?;
    let progress = TerminalProgress::new(arguments.quiet);
    let watch = Watch {
        cancel: &cancel,
        progress: &progress,
    };
    let found = reproduce(arguments.pictures.are_wanted(arguments.quiet), &watch);
    progress.finish();
    let mut found = found.map_err(|error| match error {
        PaperError::Interrupted => Failure::interrupted("interrupted: nothing was written"),
        error @ PaperError::Model(_) => Failure::Environment(error.into()),
    })?;
    found
        .write(Folder(&arguments.out))
        .with_context(|| format!("cannot write the results to {}", arguments.out.display()))?;
    if arguments.json {
        print_json(&found.report)?;
    } else {
        let out = shown(&arguments.out);
        print_text(&format!("{}results: {out}", found.text()))?;
    }
    Ok(if found.report.passes() {
        ExitStatus::Success
    } else {
        ExitStatus::CriterionFailed
    })
}
