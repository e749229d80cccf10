//! `results.csv`, from a table.

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;

use needlebench_kinematics::ik::Configuration;

use super::atomic::AtomicFile;
use super::columns::{Columns, ROWS};
use super::error::StudyError;
use super::ordered::in_order;
use super::parquet_read::ParquetResults;
use super::schema::Content;
use crate::{Factor, FactorKind, FactorValue, Outcome, Results};

/// Writes a table as CSV (RFC 4180, UTF-8): the same columns in the same order, a cell without value
/// empty, numbers with as many digits as tell them apart from all others of their width.
///
/// # Errors
/// [`StudyError::Results`] if the table cannot be read, [`StudyError::Io`] if the file cannot be
/// written; then there is none.
pub fn write_csv(results: &ParquetResults, path: &Path, threads: usize) -> Result<(), StudyError> {
    let failed = || StudyError::io("write", path);
    let file = AtomicFile::create(path).map_err(failed())?;
    let mut header = String::new();
    for (index, column) in results.table_columns().iter().enumerate() {
        if index > 0 {
            header.push(',');
        }
        push_text(&mut header, &column.name);
    }
    header.push('\n');
    file.file().write_all(header.as_bytes()).map_err(failed())?;
    in_order(
        results.groups() as u64,
        threads,
        |index| {
            let index = usize::try_from(index).expect("groups are counted in memory");
            let (first, cases) = results.group(index)?;
            Ok(lines(results, first, &cases))
        },
        |lines: String| file.file().write_all(lines.as_bytes()).map_err(failed()),
    )?;
    file.commit().map_err(failed())
}

fn lines(results: &ParquetResults, first: u64, cases: &Columns) -> String {
    let mut text = String::new();
    let mut shared = Vec::new();
    for place in 0..cases.cases {
        shared.clear();
        for (column, factor) in cases.factors.iter().zip(results.factors()) {
            shared.push(factor_text(factor, column.get(place)));
        }
        for row in 0..ROWS {
            let at = place * ROWS + row;
            for (index, column) in results.table_columns().iter().enumerate() {
                if index > 0 {
                    text.push(',');
                }
                match column.content {
                    Content::Case => push_number(&mut text, first + place as u64),
                    Content::Number(factor) | Content::Label(factor) => {
                        text.push_str(&shared[factor]);
                    }
                    Content::Configuration => {
                        push_text(&mut text, Configuration::ALL[row].label());
                    }
                    Content::Outcome => {
                        push_text(
                            &mut text,
                            Outcome::ALL[usize::from(cases.outcomes[at])].name(),
                        );
                    }
                    Content::Detail => {
                        push_text(&mut text, &cases.texts[cases.details[at] as usize]);
                    }
                    Content::Metric(metric) => {
                        let value = cases.metrics[metric][at];
                        if !value.is_nan() {
                            push_number(&mut text, value);
                        }
                    }
                }
            }
            text.push('\n');
        }
    }
    text
}

fn factor_text(factor: &Factor, value: FactorValue) -> String {
    let mut text = String::new();
    match (value, &factor.kind) {
        (FactorValue::Level(level), FactorKind::Levels(levels)) => match levels[level].number {
            Some(number) if levels.iter().all(|level| level.number.is_some()) => {
                push_number(&mut text, number);
            }
            _ => push_text(&mut text, &levels[level].label),
        },
        (FactorValue::Number(number), _) => push_number(&mut text, number),
        (FactorValue::Level(_), _) => unreachable!("a continuum has no levels"),
    }
    text
}

fn push_number(text: &mut String, number: impl std::fmt::Display) {
    write!(text, "{number}").expect("a string takes everything");
}

fn push_text(text: &mut String, content: &str) {
    if content.contains([',', '"', '\n', '\r']) {
        text.push('"');
        text.push_str(&content.replace('"', "\"\""));
        text.push('"');
    } else {
        text.push_str(content);
    }
}
