//! Columns of a table of results, and what else a table says about itself.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use needlebench_kinematics::ik::Configuration;
use parquet::basic::{LogicalType, Repetition, Type as PhysicalType};
use parquet::schema::types::{Type, TypePtr};

use super::manifest::Manifest;
use crate::{Factor, FactorKind, Level, MetricColumn, Role};

/// Key of the metadata: version of the table's layout.
pub(crate) const VERSION_KEY: &str = "needlebench.schema_version";
/// Key of the metadata: hash of everything that decides the results.
pub(crate) const ID_KEY: &str = "needlebench.study_id";
/// Key of the metadata: name of the study.
pub(crate) const NAME_KEY: &str = "needlebench.study_name";
/// Key of the metadata: number of cases.
pub(crate) const CASES_KEY: &str = "needlebench.cases";
/// Key of the metadata: the factors with levels, role and unit, JSON.
pub(crate) const FACTORS_KEY: &str = "needlebench.factors";
/// Key of the metadata: where the results come from, JSON.
pub(crate) const PROVENANCE_KEY: &str = "needlebench.provenance";
/// Key of the metadata: what each column is, JSON.
pub(crate) const COLUMNS_KEY: &str = "needlebench.columns";
/// Key of the metadata: the metrics, in the order of their columns, JSON.
pub(crate) const METRICS_KEY: &str = "needlebench.metrics";
/// Key of the metadata: CRC32 of the bytes of each row group, JSON.
pub(crate) const CRC_KEY: &str = "needlebench.row_group_crc32";

/// Key of the metadata: SHA-256 of the whole file.
pub(crate) const SUM_KEY: &str = "needlebench.sha256";

/// Version of tables.
pub(crate) const TABLE_VERSION: u32 = 3;

/// What a column holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Content {
    /// Number of the case.
    Case,
    /// Numbers of a factor, by its index.
    Number(usize),
    /// Labels of a factor, by its index.
    Label(usize),
    /// Label of the configuration.
    Configuration,
    /// Name of the outcome.
    Outcome,
    /// Detail of the outcome.
    Detail,
    /// A metric, by its index.
    Metric(usize),
}

/// A column of a table.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Column {
    pub(crate) name: String,
    pub(crate) content: Content,
}

/// The columns of a study's tables, in their order.
pub(crate) fn columns(factors: &[Factor], metrics: &[MetricColumn]) -> Vec<Column> {
    let column = |name: &str, content| Column {
        name: name.to_owned(),
        content,
    };
    let mut columns = vec![column("case", Content::Case)];
    for (index, factor) in factors.iter().enumerate() {
        let content = if is_number(factor) {
            Content::Number(index)
        } else {
            Content::Label(index)
        };
        columns.push(column(&factor.name, content));
    }
    columns.push(column("configuration", Content::Configuration));
    columns.push(column("outcome", Content::Outcome));
    columns.push(column("detail", Content::Detail));
    for (index, metric) in metrics.iter().enumerate() {
        columns.push(column(&metric.name, Content::Metric(index)));
    }
    columns
}

/// Whether a factor's column has numbers.
fn is_number(factor: &Factor) -> bool {
    match &factor.kind {
        FactorKind::Levels(levels) => levels.iter().all(|level| level.number.is_some()),
        FactorKind::Continuous { .. } => true,
    }
}

/// What is wrong with factors of which no table can be made.
pub(crate) fn check(factors: &[Factor], metrics: &[MetricColumn]) -> Result<(), String> {
    let mut names = BTreeSet::new();
    // Factors last: whoever repeats a name of the others is at fault.
    let mut all = columns(factors, metrics);
    all.sort_by_key(|column| matches!(column.content, Content::Number(_) | Content::Label(_)));
    for column in all {
        if !names.insert(column.name.clone()) {
            let what = match column.content {
                Content::Number(_) | Content::Label(_) => "factor",
                _ => "metric",
            };
            return Err(format!("{what} {}: duplicate column name", column.name));
        }
    }
    for factor in factors {
        let legal = |letter: char| letter.is_ascii_alphanumeric() || letter == '_';
        if factor.name.is_empty() || !factor.name.chars().all(legal) {
            return Err(format!(
                "factor \"{}\": names consist of letters, digits and _ only",
                factor.name
            ));
        }
        let FactorKind::Levels(levels) = &factor.kind else {
            continue;
        };
        if levels.is_empty() {
            return Err(format!("factor {}: has no levels", factor.name));
        }
        let mut seen = BTreeSet::new();
        for level in levels {
            if level.number.is_some_and(|number| !number.is_finite()) {
                return Err(format!(
                    "factor {}: {} is not a finite number",
                    factor.name, level.label
                ));
            }
            let key = if is_number(factor) {
                number_key(level)
            } else {
                level.label.clone()
            };
            if !seen.insert(key) {
                return Err(format!(
                    "factor {}: {} is listed twice",
                    factor.name, level.label
                ));
            }
        }
    }
    Ok(())
}

fn number_key(level: &Level) -> String {
    // Zero has two signs but one value.
    (level.number.unwrap_or_default() + 0.0).to_string()
}

/// The same as Parquet has it. Only metrics can be missing.
pub(crate) fn parquet_schema(columns: &[Column]) -> TypePtr {
    let fields = columns.iter().map(|column| {
        let (physical, logical) = match column.content {
            Content::Case => (PhysicalType::INT64, None),
            Content::Number(_) => (PhysicalType::DOUBLE, None),
            Content::Metric(_) => (PhysicalType::FLOAT, None),
            Content::Label(_) | Content::Configuration | Content::Outcome | Content::Detail => {
                (PhysicalType::BYTE_ARRAY, Some(LogicalType::String))
            }
        };
        let repetition = match column.content {
            Content::Metric(_) => Repetition::OPTIONAL,
            _ => Repetition::REQUIRED,
        };
        let field = Type::primitive_type_builder(&column.name, physical)
            .with_repetition(repetition)
            .with_logical_type(logical);
        Arc::new(field.build().expect("a legal type"))
    });
    let fields = fields.collect();
    let schema = Type::group_type_builder("results").with_fields(fields);
    Arc::new(schema.build().expect("a legal schema"))
}

/// What a table says about itself.
pub(crate) fn metadata(manifest: &Manifest, columns: &[Column]) -> Vec<(&'static str, String)> {
    let descriptions: BTreeMap<&str, String> = columns
        .iter()
        .map(|column| (column.name.as_str(), describe(column.content, manifest)))
        .collect();
    let json = |result: serde_json::Result<String>| result.expect("string keys only");
    vec![
        (VERSION_KEY, TABLE_VERSION.to_string()),
        (ID_KEY, manifest.study_id.clone()),
        (NAME_KEY, manifest.name.clone()),
        (CASES_KEY, manifest.cases.to_string()),
        (FACTORS_KEY, json(serde_json::to_string(&manifest.factors))),
        (PROVENANCE_KEY, manifest.provenance.to_string()),
        (COLUMNS_KEY, json(serde_json::to_string(&descriptions))),
        (METRICS_KEY, json(serde_json::to_string(&manifest.columns))),
    ]
}

fn describe(content: Content, manifest: &Manifest) -> String {
    match content {
        Content::Case => {
            "number of the case, from 0; every case has one row per configuration".to_owned()
        }
        Content::Number(factor) | Content::Label(factor) => {
            let factor = &manifest.factors[factor];
            let role = match factor.role {
                Role::Control => "control factor",
                Role::Noise => "noise factor",
            };
            if factor.unit.is_empty() {
                role.to_owned()
            } else {
                format!("{role}, {}", factor.unit)
            }
        }
        Content::Configuration => format!(
            "configuration of the arm: {}",
            Configuration::ALL.map(Configuration::label).join(", ")
        ),
        Content::Outcome => {
            "ok: feasible, all criteria met; failed: fails the criterion in detail; rejected: rejected by the rule \
             in detail; not_judged: the criterion in detail could not be evaluated; invalid: invalid layout"
                .to_owned()
        }
        Content::Detail => {
            "rule or criterion that fails, or the invalid key; empty if ok".to_owned()
        }
        Content::Metric(metric) => manifest.columns[metric].description.clone(),
    }
}
