//! One case by itself.

use std::collections::BTreeMap;
use std::fmt::Write;

use needlebench_bench::study::{StudyCase, StudyColumns};
use needlebench_cell::reason_in_words;
use needlebench_evaluation::metric::Show;
use needlebench_kinematics::ik::Configuration;
use needlebench_show::number::three_digits;
use needlebench_show::{Block, blocks_text};
use needlebench_study::{CaseResult, Design, FactorKind, FactorValue, Row};
use serde::Serialize;
use serde_json::{Value, json};

/// A case as a JSON value: its factors, and its rows with all their metrics.
#[derive(Debug, Serialize)]
pub struct CaseReport {
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
    /// A case with its rows.
    pub fn new(
        design: &Design,
        columns: &StudyColumns,
        layout: &StudyCase,
        result: &CaseResult,
    ) -> Self {
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
            rows: result
                .rows
                .iter()
                .map(|row| row_report(columns, row))
                .collect(),
        }
    }
}

fn row_report(columns: &StudyColumns, row: &Row) -> RowReport {
    let keys = columns.keys().iter().enumerate();
    let metrics = keys
        // The shortest number that is this one among those with 24 bits, as the CSV has it.
        .filter_map(|(index, key)| {
            let value = row.get(index)?;
            let number: serde_json::Number = value.to_string().parse().ok()?;
            Some((key.column(), Value::Number(number)))
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

/// A column of the table of a case: its heading, and the columns of rows of which the last that a row
/// has is shown, and how.
struct Column {
    heading: &'static str,
    shown: Vec<(usize, Show)>,
}

impl Column {
    fn text(&self, row: &Row) -> String {
        let mut shown = self.shown.iter().rev();
        let found = shown.find_map(|(index, show)| Some((f64::from(row.get(*index)?), show)));
        found.map_or_else(String::new, |(value, show)| match show {
            Show::SmallLength => three_digits(value),
            Show::Millimetres | Show::Degrees => format!("{value:.1}"),
            Show::Seconds | Show::Percent | Show::Number => format!("{value:.2}"),
        })
    }
}

/// Those that the table of metrics gives a heading, in the order of their places.
fn columns_of_table(columns: &StudyColumns) -> Vec<Column> {
    let mut places: BTreeMap<u8, Column> = BTreeMap::new();
    for (index, key) in columns.keys().iter().enumerate() {
        let metric = key.metric();
        let Some((place, heading)) = metric.heading.case.filter(|_| !key.is_of_engine()) else {
            continue;
        };
        let column = places.entry(place).or_insert_with(|| Column {
            heading,
            shown: Vec::new(),
        });
        column.shown.push((index, metric.show));
    }
    places.into_values().collect()
}

/// A case as a table.
pub fn case_text(
    design: &Design,
    columns: &StudyColumns,
    layout: &StudyCase,
    result: &CaseResult,
) -> String {
    let mut text = format!("case {}, {}\n", result.case, layout.mode.name());
    for (name, value) in layout.in_words(design) {
        // Writing to a String cannot fail.
        let _ = writeln!(text, "  {name:<16} {value}");
    }
    let columns = columns_of_table(columns);
    let header = ["configuration", "<outcome"]
        .into_iter()
        .chain(columns.iter().map(|column| column.heading))
        .chain(["<reason"])
        .map(str::to_owned)
        .collect();
    let rows = result.rows.iter().map(|row| {
        let mut cells = vec![label(row), row.outcome.name().to_owned()];
        cells.extend(columns.iter().map(|column| column.text(row)));
        cells.push(reason_in_words(&row.detail));
        cells
    });
    let table = Block::Table {
        header,
        rows: rows.collect(),
    };
    text.push_str(&blocks_text(&[table]));
    text
}
