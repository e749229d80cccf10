//! `needlebench paper`.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::{Context, Result};
use needlebench_cell::Finding;

use super::{print_json, print_text};
use crate::atomic::write_atomically;
use crate::cli::PaperArguments;
use crate::exit::ExitStatus;
use crate::output::findings::print_findings;
use crate::paper::{PaperError, Reproduction, Watch, page, reproduce, text};
use crate::picture::tile;
use crate::progress::Progress;

/// Columns of the sheet with all configurations.
const SHEET_COLUMNS: usize = 4;

/// Reproduces the paper, writes the results and prints them.
pub(crate) fn paper(arguments: &PaperArguments) -> Result<ExitStatus> {
    let cancel = Arc::new(AtomicBool::new(false));
    let requested = Arc::clone(&cancel);
    ctrlc::set_handler(move || requested.store(true, Ordering::Relaxed))
        .context("cannot watch for interrupts")?;
    if let Err(error) = prepare(&arguments.out) {
        let finding = Finding::new(
            arguments.out.display().to_string(),
            format!("the results folder cannot be written: {error}"),
        );
        print_findings(&[finding
            .key("--out")
            .hint("choose another folder with --out DIR")]);
        return Ok(ExitStatus::BadInput);
    }
    let progress = Progress::new(arguments.quiet);
    let watch = Watch {
        cancel: &cancel,
        progress: &progress,
    };
    let found = reproduce(!arguments.no_pictures, &watch);
    progress.finish();
    let mut found = match found {
        Ok(found) => found,
        Err(PaperError::Interrupted) => {
            anstream::eprintln!("interrupted: nothing was written");
            return Ok(ExitStatus::Interrupted);
        }
        Err(error) => return Err(error.into()),
    };
    write(&mut found, &arguments.out)
        .with_context(|| format!("cannot write the results to {}", arguments.out.display()))?;
    if arguments.json {
        print_json(&found.report)?;
    } else {
        let out = arguments.out.display();
        print_text(&format!("{}results: {out}", text(&found.report)))?;
    }
    Ok(if found.report.passes() {
        ExitStatus::Success
    } else {
        ExitStatus::CriterionFailed
    })
}

/// Makes the folder and proves that it can be written, before a run of many seconds.
fn prepare(folder: &Path) -> std::io::Result<()> {
    std::fs::create_dir_all(folder)?;
    let probe = folder.join(format!(".probe-{}", std::process::id()));
    std::fs::write(&probe, [])?;
    std::fs::remove_file(&probe)
}

fn write(found: &mut Reproduction, folder: &Path) -> Result<()> {
    let mut encoded = Vec::new();
    for (name, image) in &found.pictures {
        let bytes = image.to_png()?;
        write_atomically(&folder.join(name), &bytes)?;
        found.report.files.push(name.clone());
        encoded.push((name.clone(), bytes));
    }
    if !found.pictures.is_empty() {
        let captioned: Vec<_> = found
            .pictures
            .iter()
            .map(|(name, image)| (image.clone(), name.trim_end_matches(".png").to_owned()))
            .collect();
        let name = "figure_6.png";
        tile(&captioned, SHEET_COLUMNS).write_png(&folder.join(name))?;
        found.report.files.push(name.to_owned());
    }
    found.report.files.push("paper.html".to_owned());
    let html = page(&found.report, &encoded);
    write_atomically(&folder.join("paper.html"), html.as_bytes())?;
    let mut json = serde_json::to_vec_pretty(&found.report)?;
    json.push(b'\n');
    write_atomically(&folder.join("paper.json"), &json)?;
    Ok(())
}
