//! Tables that are written on request.

use std::path::Path;

use anyhow::{Context, Result};
use clap::{Args, ValueEnum};
use needlebench_bench::accuracy::{AccuracyRequest, Needles};
use needlebench_evaluation::accuracy::AccuracyTable;
use needlebench_report::accuracy::accuracy_text;
use needlebench_report::files::{Folder, write_accuracy};

use crate::output::{print_text, shown};

/// Which table.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum TableKind {
    /// Errors at entry and target as reported in the needle literature, with published values.
    Accuracy,
}

/// The table of errors as reported in the literature.
#[derive(Debug, Clone, Args)]
pub(crate) struct TableArguments {
    /// Print a table and write it as accuracy.md, accuracy.csv and accuracy.tex.
    #[arg(long, value_name = "TABLE", value_enum)]
    pub table: Option<TableKind>,
    /// With --table: what defines its rows [default: goal]: goal and configuration, and for a study its factors.
    #[arg(
        long,
        value_name = "FACTOR[,FACTOR]",
        value_delimiter = ',',
        requires = "table"
    )]
    pub by: Vec<String>,
    /// With --table: configurations to include: `best` per case or goal, `every`, or a label [default: best for
    /// studies, every for runs].
    #[arg(long, value_name = "NEEDLES", requires = "table")]
    pub of: Option<Needles>,
    /// With --table: radius about the target within which a needle counts as a hit [default: the limit in the
    /// criteria].
    #[arg(long, value_name = "MM", requires = "table", value_parser = radius)]
    pub hit_radius: Option<f64>,
}

impl TableArguments {
    /// The requested table.
    pub fn request(&self) -> Option<AccuracyRequest> {
        let TableKind::Accuracy = self.table?;
        Some(AccuracyRequest {
            by: self.by.clone(),
            needles: self.of,
            hit_radius_mm: self.hit_radius,
        })
    }
}

/// Writes a table into a folder of results, and prints it.
pub(crate) fn leave(table: &AccuracyTable, folder: &Path, is_printed: bool) -> Result<()> {
    write_accuracy(table, Folder(folder))
        .with_context(|| format!("cannot write the table to {}", folder.display()))?;
    if is_printed {
        let text = accuracy_text(table);
        print_text(&format!(
            "{text}table: {}",
            shown(&folder.join("accuracy.md"))
        ))?;
    }
    Ok(())
}

fn radius(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(radius) if f64::is_finite(radius) && radius > 0.0 => Ok(radius),
        _ => Err("expected a length in mm above 0, such as 2.5".to_owned()),
    }
}
