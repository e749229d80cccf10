//! `needlebench report`.

use std::path::PathBuf;

use anyhow::{Context, Result};
use clap::Args;
use needlebench_credibility::{Credibility, Judgement, credibility_markdown};
use needlebench_report::files::Folder;

use super::results_folder::prepare_folder;
use super::{print_as_it_is, print_json};
use crate::exit::ExitStatus;
use crate::failure::Failure;
use crate::output::shown;

pub(crate) const REPORT_HELP: &str = "\
Collects evidence from folders of results - versions, hashes of inputs, tests against closed forms, the engines' \
difference, halved time steps, criteria, assumptions, held-out errors relative to a recorded run - and the statements \
in a TOML file, in the framework of ASME V&V 40. It claims no conformity.

Example: needlebench report out/table3 --credibility --judgement judgement.toml
Example: needlebench report --template > judgement.toml";

#[derive(Debug, Args)]
pub(crate) struct ReportArguments {
    /// Folders of results of `run` or `replay`, e.g. out/table3.
    #[arg(required_unless_present = "template", value_name = "RESULTS_FOLDER")]
    pub folders: Vec<PathBuf>,
    /// Write the evidence for the credibility of the results: credibility.md and credibility.json.
    #[arg(long, required_unless_present = "template")]
    pub credibility: bool,
    /// File with the assessments by people: question, context of use, risk, applicability, limitations.
    #[arg(long, value_name = "FILE")]
    pub judgement: Option<PathBuf>,
    /// Print an empty file for --judgement.
    #[arg(long, conflicts_with_all = ["folders", "credibility", "judgement", "out", "json"])]
    pub template: bool,
    /// Folder for the documents [default: that of the first results].
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Print the JSON document instead of the Markdown.
    #[arg(long)]
    pub json: bool,
}

/// Collects, writes and prints the evidence.
pub(crate) fn report(arguments: &ReportArguments) -> Result<ExitStatus, Failure> {
    if arguments.template {
        print_as_it_is(Judgement::template().trim_end())?;
        return Ok(ExitStatus::Success);
    }
    let judgement = match &arguments.judgement {
        Some(path) => Judgement::load(path),
        None => Ok(Judgement::default()),
    };
    let collected = judgement.and_then(|judged| Credibility::collect(&arguments.folders, judged));
    let document = collected?;
    let first = arguments.folders.first();
    let folder = arguments.out.as_ref().or(first).context("no folder")?;
    prepare_folder(folder)?;
    let markdown = credibility_markdown(&document);
    let written = Folder(folder)
        .write("credibility.md", &markdown)
        .and_then(|()| Folder(folder).write_json("credibility.json", &document));
    written.with_context(|| format!("cannot write to {}", folder.display()))?;
    if arguments.json {
        print_json(&document)?;
    } else {
        let place = shown(&folder.join("credibility.md"));
        print_as_it_is(&format!("{markdown}\nreport: {place}"))?;
    }
    Ok(ExitStatus::Success)
}
