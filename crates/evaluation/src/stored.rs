//! Reports that were stored.

use std::borrow::Cow;
use std::collections::BTreeMap;

use needlebench_input::{Finding, printable, printable_line};
use serde_json::{Value, json};

use crate::metric::MetricKey;
use crate::report::{Report, SCHEMA_VERSION, Verdict};

/// A configuration of a study's case.
#[derive(Debug, Clone, PartialEq)]
pub struct StoredConfiguration {
    /// Label.
    pub label: &'static str,
    /// What became of it, as reports and studies call it.
    pub status: &'static str,
    /// The rule that rejects it, with what it is about behind it: `collision robot_phantom`.
    pub rejection: Option<String>,
    /// What was measured, by metrics' keys, in SI units.
    pub measured: BTreeMap<String, f64>,
}

/// A report as its documented keys, with where it comes from.
///
/// What a report lacks was not measured; only those keys that say what it is about, and what was
/// measured of each configuration, have to be there.
#[derive(Debug, Clone, PartialEq)]
pub struct StoredReport {
    source: String,
    report: Value,
    is_case: bool,
}

impl StoredReport {
    /// A report that was just made.
    pub fn of(source: impl Into<String>, report: &Report) -> Self {
        Self {
            source: source.into(),
            report: serde_json::to_value(report).expect("reports have string keys"),
            is_case: false,
        }
    }

    /// A case of a study, as a report with its goal alone. `program` is the version of what computed it, and
    /// the hash of its sources.
    pub fn of_case(
        source: impl Into<String>,
        study: &str,
        goal: &str,
        configurations: Vec<StoredConfiguration>,
        program: [Option<&str>; 2],
    ) -> Self {
        let configurations: Vec<Value> = configurations
            .into_iter()
            .map(|each| {
                let rejections = each.rejection.iter().map(|rejection| {
                    let (rule, detail) = rejection.split_once(' ').unwrap_or((rejection, ""));
                    json!({ "rule": rule, "detail": detail })
                });
                json!({
                    "label": each.label,
                    "status": each.status,
                    "rejections": rejections.collect::<Vec<Value>>(),
                    "metrics": each.measured,
                })
            })
            .collect();
        Self {
            source: source.into(),
            report: json!({
                "schema_version": SCHEMA_VERSION,
                "scenario": { "name": study },
                "provenance": { "version": program[0], "source_sha256": program[1] },
                "goals": [{ "name": goal, "configurations": configurations }],
            }),
            is_case: true,
        }
    }

    /// Leaves of a run what a case of a study has: its goal, if the run has that too, without a
    /// recommendation, the metrics that are columns of the study, and of each number the seven digits
    /// that a column keeps.
    pub fn as_case(&mut self, case: &Self) {
        let of_case: Vec<&str> = case.goals().map(|(name, _)| name).collect();
        let is_kept = |goal: &Value| {
            let name = goal.get("name").and_then(Value::as_str);
            name.is_some_and(|name| of_case.contains(&name))
        };
        let Some(goals) = self.report.get_mut("goals").and_then(Value::as_array_mut) else {
            return;
        };
        if goals.iter().any(is_kept) {
            goals.retain(is_kept);
        }
        for goal in goals.iter_mut().filter_map(Value::as_object_mut) {
            goal.remove("recommended");
        }
        let configurations = goals
            .iter_mut()
            .filter_map(|goal| goal.get_mut("configurations")?.as_array_mut())
            .flatten();
        for configuration in configurations {
            let mut measured = Self::measured(configuration);
            measured.retain(|key, _| case.measures(key));
            let engines = configuration.get("engines").and_then(Value::as_object);
            let engines: Vec<&str> =
                engines.map_or(Vec::new(), |each| each.keys().map(String::as_str).collect());
            for key in MetricKey::all(&engines) {
                if let Some(value) = measured.get_mut(&*key.key()) {
                    *value = key.metric().unit.as_column(*value);
                }
            }
            configuration["metrics"] = json!(measured);
        }
    }

    /// Reads the text of a `report.json`, or of `run --json` with one scenario.
    ///
    /// # Errors
    /// The text is no JSON, or no report, or one of a newer version.
    pub fn parse(file: &str, text: &str) -> Result<Self, Finding> {
        let mut report: Value = serde_json::from_str(text).map_err(|error| {
            let cut = if error.is_eof() {
                "the file is truncated"
            } else {
                "the file is not JSON"
            };
            let finding = Finding::new(
                file,
                format!("{cut}: {error}"), // with line and column
            )
            .hint("give a report.json written by `needlebench run`, or its folder");
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
                    "the file contains the reports of {} scenarios: {}",
                    names.len(),
                    names.join(", ")
                );
                return Err(Finding::new(file, message)
                    .key("results")
                    .hint("compare one at a time: the results folder has a report.json for each"));
            }
            report = results.swap_remove(0);
        }
        make_printable(&mut report);
        let stored = Self {
            source: printable_line(file),
            report,
            is_case: false,
        };
        stored.check()?;
        Ok(stored)
    }

    fn check(&self) -> Result<(), Finding> {
        let foreign = |key: String, message: String| {
            Finding::new(&self.source, message)
                .key(key)
                .hint("give a report.json written by `needlebench run`, or its folder")
        };
        let version = self.report.get("schema_version").and_then(Value::as_u64);
        match version {
            Some(version) if version > u64::from(SCHEMA_VERSION) => {
                return Err(Finding::new(
                    &self.source,
                    format!(
                        "the report has schema version {version}; this program supports up to \
                         {SCHEMA_VERSION}"
                    ),
                )
                .key("schema_version")
                .hint("compare with the version of needlebench that wrote it, or a newer one"));
            }
            Some(1..) => {}
            _ => {
                return Err(foreign(
                    "schema_version".to_owned(),
                    "the file is not a report: `schema_version` is missing".to_owned(),
                ));
            }
        }
        let Some(goals) = self.report.get("goals").and_then(Value::as_array) else {
            return Err(foreign(
                "goals".to_owned(),
                "the file is not a report of a run: the list `goals` is missing".to_owned(),
            ));
        };
        let mut names = Vec::new();
        for (index, goal) in goals.iter().enumerate() {
            let missing = |key: String| {
                let message = format!("the report is incomplete: `{key}` is missing");
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
                let has = |key: &str, is: fn(&Value) -> bool| each.get(key).is_some_and(is);
                let is_there = [
                    ("label", has("label", Value::is_string)),
                    ("status", has("status", Value::is_string)),
                    ("metrics", has("metrics", Value::is_object)),
                ];
                if let Some((key, _)) = is_there.into_iter().find(|(_, is_there)| !is_there) {
                    return Err(missing(format!(
                        "goals[{index}].configurations[{at}].{key}"
                    )));
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

    /// What was measured of a configuration of its goals, by metrics' keys.
    pub(crate) fn measured(configuration: &Value) -> BTreeMap<String, f64> {
        let metrics = configuration.get("metrics").and_then(Value::as_object);
        let numbers = metrics.into_iter().flatten();
        numbers
            .filter_map(|(key, value)| Some((key.clone(), value.as_f64()?)))
            .collect()
    }

    /// Whether it is a case of a study: it has the study's columns, and little of where it comes from.
    pub(crate) fn is_case(&self) -> bool {
        self.is_case
    }

    /// Whether any of its configurations has a metric.
    fn measures(&self, key: &str) -> bool {
        let configurations = self
            .goals()
            .filter_map(|(_, goal)| goal.get("configurations")?.as_array())
            .flatten();
        configurations
            .filter_map(|each| each.get("metrics"))
            .any(|metrics| metrics.get(key).is_some())
    }

    /// Why it is not complete, if it is not: by its verdict, by what was not evaluated, and by engines that failed.
    pub(crate) fn incomplete(&self) -> Option<String> {
        let count = |key: &str| {
            self.report
                .get(key)
                .and_then(Value::as_array)
                .map_or(0, Vec::len)
        };
        let engines = self.report.get("engine_failures").and_then(Value::as_array);
        let failed: Vec<&str> = engines
            .into_iter()
            .flatten()
            .filter_map(|each| each.get("engine")?.as_str())
            .collect();
        let unjudged = count("not_judged");
        let why = match (unjudged, failed.is_empty()) {
            (0, true) if self.text("/verdict") != Some(Verdict::Incomplete.name()) => return None,
            (0, true) => "its verdict is incomplete".to_owned(),
            (0, false) => format!("{} failed", failed.join(", ")),
            (_, true) => format!("{unjudged} criteria were not evaluated"),
            (_, false) => format!(
                "{unjudged} criteria were not evaluated, {} failed",
                failed.join(", ")
            ),
        };
        Some(format!("{} is not complete: {why}", self.source))
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

/// Takes what a terminal would take for a command out of all texts: a report may come from anywhere.
fn make_printable(value: &mut Value) {
    match value {
        Value::String(text) => {
            if let Cow::Owned(shown) = printable(text) {
                *text = shown;
            }
        }
        Value::Array(values) => values.iter_mut().for_each(make_printable),
        Value::Object(entries) => entries.values_mut().for_each(make_printable),
        _ => {}
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
