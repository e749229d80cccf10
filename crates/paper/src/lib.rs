//! The paper reproduced: O. Abdelaziz, M. Luo, G. Jiang and S. Chen, *Multiple configurations for
//! puncturing robot positioning*.
//!
//! Table 3 under its true labels, every equation as printed and as corrected, accuracy and time of
//! both methods, convergence of the numerical one, and Figure 6. Everything is computed when it is
//! asked for, from fixed seeds: two runs differ in their timings only.

mod accuracy;
mod convergence;
mod dh;
mod equations;
mod figure_6;
mod files;
mod free_space;
mod html;
mod newton;
mod printed;
mod report;
mod roll;
mod solver;
mod table_3;
mod text;
mod timing;

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use needlebench_cell::Finding;

pub use files::write_paper;
use report::Findings;
pub use report::PaperReport;
pub use text::text;

use needlebench_bench::progress::Progress;
use needlebench_bench::provenance::provenance;
use needlebench_render::Image;

/// Somebody asked to stop.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("interrupted")]
pub struct Interrupted;

/// Why there is no result.
#[derive(Debug, thiserror::Error)]
pub enum PaperError {
    /// Somebody asked to stop.
    #[error("interrupted")]
    Interrupted,
    /// A shipped model does not resolve: our own bug.
    #[error("the shipped robot or tool cannot be used: {0}")]
    Model(String),
}

impl From<Interrupted> for PaperError {
    fn from(_: Interrupted) -> Self {
        Self::Interrupted
    }
}

impl From<Vec<Finding>> for PaperError {
    fn from(findings: Vec<Finding>) -> Self {
        let messages: Vec<String> = findings.into_iter().map(|each| each.message).collect();
        Self::Model(messages.join("; "))
    }
}

/// Who watches a run: progress, and whether to go on.
pub struct Watch<'a> {
    /// Set when somebody asks to stop.
    pub cancel: &'a AtomicBool,
    /// Is told how far it is.
    pub progress: &'a dyn Progress,
}

impl Watch<'_> {
    fn check(&self) -> Result<(), Interrupted> {
        if self.cancel.load(Ordering::Relaxed) {
            Err(Interrupted)
        } else {
            Ok(())
        }
    }

    fn stage(&self, name: &str) -> Result<(), Interrupted> {
        self.progress.message(name);
        self.progress.step();
        self.check()
    }
}

/// Random poses for equations and solvers.
const POSES: usize = 20_000;
/// Random poses for accuracy: each is solved six times.
const ACCURACY_POSES: usize = 5_000;
/// Stages of a run, for the progress bar.
const STAGES: u64 = 8;

/// Results and pictures of a run.
pub struct Reproduction {
    /// Every number.
    pub report: PaperReport,
    /// File name and picture, by configuration; none if they are not wanted.
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
    let equations = equations::evaluate(POSES, watch)?;
    watch.stage("whole solver")?;
    let (solver_variants, solution_counts) = solver::evaluate(POSES, watch)?;
    watch.stage("accuracy")?;
    let accuracy = accuracy::evaluate(ACCURACY_POSES, watch)?;
    watch.stage("convergence")?;
    let convergence = convergence::evaluate(watch)?;
    watch.stage("time")?;
    let times = timing::measure(watch)?;
    watch.stage("free space")?;
    let resolved = free_space::resolve("offset")?;
    let mut space = free_space::measure(&resolved, &table_3, watch)?;
    space.report.roll = roll::evaluate(watch)?;
    watch.stage("drawing")?;
    let drawn = if pictures {
        figure_6::pictures(&resolved, &space)
    } else {
        Vec::new()
    };
    watch.check()?;
    let report = PaperReport::new(Findings {
        table_3,
        equations,
        equation_45: equations::differential::turns_as_printed(),
        solver_variants,
        solution_counts,
        accuracy,
        convergence,
        free_space: space.report,
        provenance: provenance(&resolved, Vec::new()),
        timings: timing::Timings {
            cpu: timing::cpu_name(),
            optimised_build: !cfg!(debug_assertions),
            rows: times,
            run_s: started.elapsed().as_secs_f64(),
        },
    });
    Ok(Reproduction {
        report,
        pictures: drawn,
    })
}
