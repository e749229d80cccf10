//! One case by itself.

use std::collections::BTreeMap;
use std::fmt::Write;

use comfy_table::{Cell, CellAlignment};
use needlebench_kinematics::ik::Configuration;
use needlebench_study::{CaseResult, Design, FactorKind, FactorValue, METRICS, Metric, Row};
use serde::Serialize;
use serde_json::{Value, json};

use super::case::StudyCase;
use crate::output::plain_table;

/// A case as a JSON value: its factors, and its rows with every metric that they have.
#[derive(Debug, Serialize)]
pub(crate) struct CaseReport {
    case: u64,
    mode: &'static str,
    factors: BTreeMap<String, Value>,
    rows: Vec<RowReport>,
}

#[derive(Debug, Serialize)]
struct RowReport {
    configuration: String,
    outcome: &'static str,
    detail: String,
    /// By column; what a row does not have is left out.
    metrics: serde_json::Map<String, Value>,
}

impl CaseReport {
    pub fn new(design: &Design, layout: &StudyCase, result: &CaseResult) -> Self {
        let factors = design
            .factors()
            .iter()
            .zip(&layout.values)
            .map(|(factor, value)| {
                let value = match (value, &factor.kind) {
                    (FactorValue::Number(number), _) => json!(number),
                    (FactorValue::Level(index), FactorKind::Levels(levels)) => {
                        let level = &levels[*index];
                        level
                            .number
                            .map_or_else(|| json!(level.label), |number| json!(number))
                    }
                    (FactorValue::Level(index), FactorKind::Continuous { .. }) => json!(index),
                };
                (factor.name.clone(), value)
            })
            .collect();
        Self {
            case: result.case,
            mode: layout.mode.name(),
            factors,
            rows: result.rows.iter().map(row_report).collect(),
        }
    }
}

fn row_report(row: &Row) -> RowReport {
    let metrics = METRICS
        .iter()
        // The shortest number that is this one among those with 24 bits, as the CSV has it.
        .filter_map(|column| {
            let value = row.get(column.metric)?;
            let number: serde_json::Number = value.to_string().parse().ok()?;
            Some((column.name.to_owned(), Value::Number(number)))
        })
        .collect();
    RowReport {
        configuration: label(row),
        outcome: row.outcome.name(),
        detail: row.detail.to_string(),
        metrics,
    }
}

fn label(row: &Row) -> String {
    Configuration::ALL[usize::from(row.configuration)]
        .label()
        .to_owned()
}

/// Columns of the table of a case.
const COLUMNS: [(Metric, &str, usize); 8] = [
    (Metric::Clearance, "clear\nmm", 1),
    (Metric::SelfClearance, "self\nmm", 1),
    (Metric::NeedleCorridor, "corridor\nmm", 1),
    (Metric::TipError, "tip\nmm", 4),
    (Metric::TipSensitivity, "tip\nmm/mrad", 2),
    (Metric::JointMargin, "joint\nmargin", 2),
    (Metric::Surplus, "surplus\nmm", 1),
    (Metric::Roll, "roll\ndeg", 1),
];

/// A case as a table.
pub(crate) fn case_text(design: &Design, layout: &StudyCase, result: &CaseResult) -> String {
    let mut text = format!("case {}, {}\n", result.case, layout.mode.name());
    for (name, value) in layout.in_words(design) {
        // Writing to a String cannot fail.
        let _ = writeln!(text, "  {name:<16} {value}");
    }
    let header: Vec<&str> = ["configuration", "outcome"]
        .into_iter()
        .chain(COLUMNS.iter().map(|(_, name, _)| *name))
        .chain(["why"])
        .collect();
    let mut table = plain_table(&header);
    for row in &result.rows {
        let mut cells = vec![Cell::new(label(row)), Cell::new(row.outcome.name())];
        cells.extend(COLUMNS.iter().map(|(metric, _, digits)| {
            let value = row
                .get(*metric)
                .map_or_else(String::new, |value| format!("{value:.digits$}"));
            Cell::new(value).set_alignment(CellAlignment::Right)
        }));
        cells.push(Cell::new(&row.detail));
        table.add_row(cells);
    }
    let _ = write!(text, "{table}");
    text
}
