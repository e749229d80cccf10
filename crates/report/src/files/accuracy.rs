//! Files of the accuracy table.

use needlebench_evaluation::accuracy::AccuracyTable;

use super::error::FilesError;
use super::folder::Folder;
use crate::accuracy::{accuracy_csv, accuracy_latex, accuracy_markdown};

const MARKDOWN: &str = "accuracy.md";
const CSV: &str = "accuracy.csv";
const LATEX: &str = "accuracy.tex";

/// Writes the table as Markdown, CSV and LaTeX.
pub fn write_accuracy(table: &AccuracyTable, folder: Folder<'_>) -> Result<(), FilesError> {
    folder.write(MARKDOWN, accuracy_markdown(table))?;
    folder.write(CSV, accuracy_csv(table))?;
    folder.write(LATEX, accuracy_latex(table))
}

/// Removes the table of an earlier run.
pub(super) fn remove_accuracy(folder: Folder<'_>) -> Result<(), FilesError> {
    [MARKDOWN, CSV, LATEX]
        .iter()
        .try_for_each(|name| folder.remove(name))
}
