//! Reports that were stored, by this version or another one.

use std::collections::BTreeMap;

use needlebench_cell::Finding;
use serde_json::Value;

use crate::metric::former_report;
use crate::report::{Report, SCHEMA_VERSION};

/// A report as its documented keys, with where it comes from.
///
/// Keys that a report lacks were not measured by the version that wrote it; only those that say
/// what it is about have to be there.
#[derive(Debug, Clone, PartialEq)]
pub struct StoredReport {
    source: String,
    report: Value,
}

impl StoredReport {
    /// A report that was just made.
    pub fn of(source: impl Into<String>, report: &Report) -> Self {
        Self {
            source: source.into(),
            report: serde_json::to_value(report).expect("reports have string keys"),
        }
    }

    /// Reads the text of a `report.json`, or of `run --json` with one scenario.
    ///
    /// # Errors
    /// The text is no JSON, or no report, or one of a newer version.
    pub fn parse(file: &str, text: &str) -> Result<Self, Finding> {
        let mut report: Value = serde_json::from_str(text).map_err(|error| {
            let cut = if error.is_eof() {
                "the file ends too early"
            } else {
                "the file is no JSON"
            };
            let finding = Finding::new(
                file,
                format!("{cut}: {error}"), // with line and column
            )
            .hint("give a report.json as `needlebench run` writes it, or its folder");
            let start = offset(text, error.line(), error.column());
            finding.at(text, start..(start + 1).min(text.len()))
        })?;
        if let Some(results) = report.get_mut("results").and_then(Value::as_array_mut) {
            let names: Vec<&str> = results
                .iter()
                .filter_map(|each| each.pointer("/scenario/name")?.as_str())
                .collect();
            if names.len() != 1 {
                let message = format!(
                    "the file has the reports of {} scenarios: {}",
                    names.len(),
                    names.join(", ")
                );
                return Err(Finding::new(file, message)
                    .key("results")
                    .hint("compare one at a time: the results folder has a report.json for each"));
            }
            report = results.swap_remove(0);
        }
        let stored = Self {
            source: file.to_owned(),
            report,
        };
        stored.check()?;
        Ok(stored)
    }

    fn check(&self) -> Result<(), Finding> {
        let foreign = |key: String, message: String| {
            Finding::new(&self.source, message)
                .key(key)
                .hint("give a report.json as `needlebench run` writes it, or its folder")
        };
        let version = self.report.get("schema_version").and_then(Value::as_u64);
        match version {
            Some(version) if version > u64::from(SCHEMA_VERSION) => {
                return Err(Finding::new(
                    &self.source,
                    format!(
                        "the report has schema version {version}, but this program knows no newer \
                         one than {SCHEMA_VERSION}"
                    ),
                )
                .key("schema_version")
                .hint("compare with the version of needlebench that wrote it, or a newer one"));
            }
            Some(1..) => {}
            _ => {
                return Err(foreign(
                    "schema_version".to_owned(),
                    "the file is no report: `schema_version` is missing".to_owned(),
                ));
            }
        }
        let Some(goals) = self.report.get("goals").and_then(Value::as_array) else {
            return Err(foreign(
                "goals".to_owned(),
                "the file is no report of a run: it has no list `goals`".to_owned(),
            ));
        };
        let mut names = Vec::new();
        for (index, goal) in goals.iter().enumerate() {
            let missing = |key: String| {
                let message = format!("the report is not whole: `{key}` is missing");
                foreign(key, message)
            };
            let Some(name) = goal.get("name").and_then(Value::as_str) else {
                return Err(missing(format!("goals[{index}].name")));
            };
            if names.contains(&name) {
                return Err(foreign(
                    format!("goals[{index}].name"),
                    format!("two goals are named `{name}`"),
                ));
            }
            names.push(name);
            let Some(configurations) = goal.get("configurations").and_then(Value::as_array) else {
                return Err(missing(format!("goals[{index}].configurations")));
            };
            for (at, each) in configurations.iter().enumerate() {
                for key in ["label", "status"] {
                    if each.get(key).and_then(Value::as_str).is_none() {
                        return Err(missing(format!(
                            "goals[{index}].configurations[{at}].{key}"
                        )));
                    }
                }
            }
        }
        Ok(())
    }

    /// Where it comes from, as the user named it.
    pub fn source(&self) -> &str {
        &self.source
    }

    /// Text at a JSON pointer.
    pub fn text(&self, pointer: &str) -> Option<&str> {
        self.report.pointer(pointer)?.as_str()
    }

    /// Value at a JSON pointer.
    pub fn value(&self, pointer: &str) -> Option<&Value> {
        self.report.pointer(pointer)
    }

    /// What was measured of a configuration of its goals, by metrics' keys; of reports before those had
    /// keys as they are today's.
    pub(crate) fn measured(configuration: &Value) -> BTreeMap<String, f64> {
        let Some(metrics) = configuration.get("metrics").and_then(Value::as_object) else {
            return former_report(configuration);
        };
        let numbers = metrics.iter();
        numbers
            .filter_map(|(key, value)| Some((key.clone(), value.as_f64()?)))
            .collect()
    }

    /// Whether it was written before metrics had keys.
    pub(crate) fn is_former(&self) -> bool {
        let mut configurations = self
            .goals()
            .filter_map(|(_, goal)| goal.get("configurations")?.as_array())
            .flatten();
        configurations.any(|each| each.get("metrics").is_none())
    }

    /// Goals with their names, in the report's order.
    pub(crate) fn goals(&self) -> impl Iterator<Item = (&str, &Value)> {
        let goals = self.report.get("goals").and_then(Value::as_array);
        goals
            .into_iter()
            .flatten()
            .filter_map(|goal| Some((goal.get("name")?.as_str()?, goal)))
    }
}

/// Byte at a line and column, both from 1.
fn offset(text: &str, line: usize, column: usize) -> usize {
    let before: usize = text
        .split_inclusive('\n')
        .take(line.saturating_sub(1))
        .map(str::len)
        .sum();
    let mut at = (before + column.saturating_sub(1)).min(text.len().saturating_sub(1));
    while !text.is_char_boundary(at) {
        at -= 1;
    }
    at
}
