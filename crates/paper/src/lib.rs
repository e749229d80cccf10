//! The paper reproduced: O. Abdelaziz, M. Luo, G. Jiang and S. Chen, *Multiple configurations for
//! puncturing robot positioning*.
//!
//! Table 3 under its true labels, every equation as printed and as corrected, accuracy and time of
//! both methods, convergence of the numerical one, and Figure 6. Everything is recomputed in each run, from fixed
//! seeds: two runs differ in their timings only.
#![cfg_attr(any(doc, doctest), doc = include_str!("../README.md"))]

mod accuracy;
mod charts;
mod closed_form;
mod convergence;
mod dh;
mod document;
mod equations;
mod figure_6;
mod free_space;
mod numerical;
mod printed;
mod report;
mod solver;
mod table_3;
mod timing;

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use needlebench_bench::provenance::provenance;
use needlebench_evaluation::report::Verdict;
use needlebench_input::Finding;
use needlebench_parallel::Progress;
use needlebench_render::{Image, tile};
use needlebench_report::files::{FilesError, Folder};
use needlebench_report::page::parts::{Part, parts_page};
use needlebench_show::blocks_text;

pub use report::PaperReport;

/// Failures of the reproduction.
#[derive(Debug, thiserror::Error)]
pub enum PaperError {
    /// It was interrupted.
    #[error("interrupted")]
    Interrupted,
    /// A bundled model does not resolve: a bug in needlebench.
    #[error("the bundled robot or tool cannot be used: {0}")]
    Model(String),
}

impl From<Vec<Finding>> for PaperError {
    fn from(findings: Vec<Finding>) -> Self {
        let messages: Vec<String> = findings.into_iter().map(|each| each.message).collect();
        Self::Model(messages.join("; "))
    }
}

/// Progress and interruption of a run.
pub struct Watch<'a> {
    /// Set by an interrupt.
    pub cancel: &'a AtomicBool,
    /// Receives the progress.
    pub progress: &'a dyn Progress,
}

impl Watch<'_> {
    fn check(&self) -> Result<(), PaperError> {
        if self.cancel.load(Ordering::Relaxed) {
            Err(PaperError::Interrupted)
        } else {
            Ok(())
        }
    }

    fn stage(&self, name: &str) -> Result<(), PaperError> {
        self.progress.message(name);
        self.progress.step();
        self.check()
    }

    /// Items until an interrupt: incomplete results do not leave the stage.
    fn each<I: IntoIterator>(&self, items: I) -> impl Iterator<Item = I::Item> {
        items.into_iter().take_while(|_| self.check().is_ok())
    }
}

/// Random poses for equations and solvers.
const POSES: usize = 20_000;
/// Random poses for accuracy: each is solved six times.
const ACCURACY_POSES: usize = 5_000;
/// Stages of a run, for the progress bar.
const STAGES: u64 = 8;
/// Columns of the sheet with all configurations.
const SHEET_COLUMNS: usize = 4;

/// Results and images of a run.
pub struct Reproduction {
    /// All results.
    pub report: PaperReport,
    /// File name and image, by configuration; none if not requested.
    pub pictures: Vec<(String, Image)>,
}

/// Computes everything.
///
/// # Errors
/// [`PaperError::Interrupted`] if it was cancelled.
pub fn reproduce(pictures: bool, watch: &Watch<'_>) -> Result<Reproduction, PaperError> {
    let started = Instant::now();
    watch.progress.expect(STAGES);
    watch.stage("Table 3")?;
    let table_3 = table_3::reproduce();
    watch.stage("equations")?;
    let equations = equations::evaluate(POSES, watch);
    watch.stage("whole solver")?;
    let (solver_variants, solution_counts) = solver::evaluate(POSES, watch);
    watch.stage("accuracy")?;
    let accuracy = accuracy::evaluate(ACCURACY_POSES, watch);
    watch.stage("convergence")?;
    let convergence = convergence::evaluate(watch);
    watch.stage("time")?;
    let times = timing::measure(watch);
    watch.stage("free space")?;
    let resolved = free_space::resolve("offset")?;
    let space = free_space::measure(&resolved, &table_3, watch)?;
    watch.stage("images")?;
    let pictures = if pictures {
        figure_6::pictures(&resolved, &space)
    } else {
        Vec::new()
    };
    watch.check()?;
    let mut report = PaperReport {
        schema_version: 1,
        paper: report::Citation {
            authors: "O. Abdelaziz, M. Luo, G. Jiang and S. Chen",
            title: "Multiple configurations for puncturing robot positioning",
        },
        verdict: Verdict::Fail,
        checks: Vec::new(),
        table_3,
        equations,
        equation_45: equations::turns_as_printed(),
        solver_variants,
        solution_counts,
        accuracy,
        convergence,
        free_space: space.report,
        files: Vec::new(),
        provenance: provenance(&resolved, Vec::new()),
        timings: timing::Timings {
            cpu: timing::cpu_name(),
            optimised_build: !cfg!(debug_assertions),
            rows: times,
            run_s: started.elapsed().as_secs_f64(),
        },
    };
    report.checks = report.checks();
    if report.checks.iter().all(|check| check.pass) {
        report.verdict = Verdict::Pass;
    }
    Ok(Reproduction { report, pictures })
}

impl Reproduction {
    /// The results for a terminal.
    pub fn text(&self) -> String {
        let parts = document::parts(&self.report, &[]);
        blocks_text(parts.iter().filter_map(Part::block))
    }

    /// Writes images, page and report, and adds the file names to the report.
    ///
    /// # Errors
    /// A file cannot be written.
    pub fn write(&mut self, folder: Folder<'_>) -> Result<(), FilesError> {
        let mut pictures = Vec::new();
        let mut sheet = Vec::new();
        for (name, image) in &self.pictures {
            let png = image.to_png()?;
            folder.write(name, &png)?;
            self.report.files.push(name.clone());
            pictures.push(png);
            sheet.push((image.clone(), name.trim_end_matches(".png").to_owned()));
        }
        if !sheet.is_empty() {
            let name = "figure_6.png";
            folder.write_image(name, &tile(&sheet, SHEET_COLUMNS))?;
            self.report.files.push(name.to_owned());
        }
        let name = "paper.html";
        self.report.files.push(name.to_owned());
        let title = format!("{}: reproduced", self.report.paper.title);
        folder.write(
            name,
            parts_page(&title, &document::parts(&self.report, &pictures)),
        )?;
        folder.write_json("paper.json", &self.report)
    }
}
