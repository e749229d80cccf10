//! The table of metrics as Markdown.

use std::fmt::Write as _;

use needlebench_engine::{ENGINES, engine_names};
use needlebench_evaluation::metric::{GROUPS, Group, Metric, MetricKey};
use serde::Serialize;

const INTRODUCTION: &str = "All metrics by which configurations are evaluated, ranked and compared. A name has the same \
     meaning everywhere: in `report.json` (`configurations[].metrics`, in the unit under Report; \
     `configurations[].measured` has the same with the unit at the end of the name, `tip_rms_m`), in rankings, in columns of studies (in the unit under Study, which ends the column's name), \
     and in `compare`. Names ending in `_static` belong to static cases of studies. A metric that \
     was not measured is absent, never 0.";

/// A name of a metric, described.
#[derive(Debug, Serialize)]
pub struct MetricDescription {
    /// Name in reports, studies and comparisons.
    pub name: String,
    /// The same in words.
    pub words: String,
    /// What it is of.
    pub group: &'static str,
    /// Unit in reports.
    pub unit: &'static str,
    /// Unit of its column in studies.
    pub study_unit: &'static str,
    /// Whether more of it is better; none where neither is.
    pub more_is_better: Option<bool>,
    /// Its definition.
    pub definition: String,
}

/// All names of metrics: of runs, of static cases, of each engine.
pub fn metric_descriptions() -> Vec<MetricDescription> {
    GROUPS.iter().flat_map(descriptions).collect()
}

fn descriptions(group: &Group) -> Vec<MetricDescription> {
    let engines = engine_names(ENGINES);
    let keys = group
        .metrics
        .iter()
        .flat_map(|metric| keys(metric, &engines));
    keys.map(|key| describe(group, &key)).collect()
}

fn keys(metric: &'static Metric, engines: &[&str]) -> Vec<MetricKey> {
    let mut keys = vec![MetricKey::of_run(metric)];
    keys.extend(MetricKey::of_static_case(metric).filter(|key| key.key() != metric.key));
    let each = engines.iter().filter(|_| metric.each_engine);
    keys.extend(each.filter_map(|engine| MetricKey::of_engine(metric, engine)));
    keys
}

fn describe(group: &Group, key: &MetricKey) -> MetricDescription {
    MetricDescription {
        name: key.key().into_owned(),
        words: key.words(),
        group: group.title,
        unit: key.metric().quantity.unit(),
        study_unit: key.metric().unit.symbol,
        more_is_better: key.more_is_better(),
        definition: key.definition(),
    }
}

/// The reference of metrics: name, units, direction, and what exactly each is.
pub fn metrics_markdown() -> String {
    let mut text = format!("# Metrics\n\n{INTRODUCTION}\n");
    for group in GROUPS {
        let _ = writeln!(text, "\n## {}\n", group.title);
        text.push_str("| Name | Report | Study | Better | Definition |\n|---|---|---|---|---|\n");
        for metric in descriptions(group) {
            let better = match metric.more_is_better {
                Some(true) => "more",
                Some(false) => "less",
                None => "",
            };
            let what = metric.definition.replace('|', "\\|");
            let MetricDescription {
                name,
                unit,
                study_unit,
                ..
            } = metric;
            let _ = writeln!(
                text,
                "| `{name}` | {unit} | {study_unit} | {better} | {what} |"
            );
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use needlebench_evaluation::metric::metrics;

    use super::*;

    #[test]
    fn every_metric_has_one_row() {
        let text = metrics_markdown();
        for metric in metrics() {
            let row = format!("\n| `{}` | ", metric.key);
            assert_eq!(text.matches(&row).count(), 1, "{}", metric.key);
        }
    }
}
