//! The page of a study: plots in which every point leads to its case.

mod columns;
mod looks;
#[cfg(test)]
mod tests;

use needlebench_cell::reason_in_words;
use needlebench_kinematics::ik::Configuration;
use needlebench_scenario::ResolvedScenario;
use needlebench_study::{FactorKind, Results, ResultsError};
use serde_json::{Value, json};

use super::pack::Pack;
use super::scene;
use super::viewer::Viewer;
use columns::{Columns, LABELLED};
use looks::Looks;

const SCRIPT: &str = concat!(
    include_str!("../assets/study_figure.js"),
    include_str!("../assets/statistics.js"),
    include_str!("../assets/study_plots.js"),
    include_str!("../assets/study_case.js"),
    include_str!("../assets/study.js")
);

const STYLE: &str = include_str!("../assets/study.css");

/// What a study's page is made of.
pub struct StudyPage<'a> {
    /// Name of the study.
    pub name: &'a str,
    /// Its description.
    pub description: &'a str,
    /// The study's file as it is to stand in the command that reruns a case.
    pub file: &'a str,
    /// The table.
    pub results: &'a dyn Results,
    /// Statistics of the table, as in `summary.json`.
    pub summary: &'a Value,
    /// Provenance, as in `study.json`.
    pub manifest: &'a Value,
    /// What cases look like; without it there is no 3D view.
    pub pictures: Option<CasePictures<'a>>,
}

/// What cases look like.
pub struct CasePictures<'a> {
    /// The base scenario, whose arm is shown.
    pub base: &'a ResolvedScenario,
    /// The scenario of a case; none of an invalid layout.
    pub scenario_of: &'a dyn Fn(u64) -> Option<ResolvedScenario>,
}

impl StudyPage<'_> {
    /// The whole page. Reads the results once; keeps at most `MOST_CASES` cases.
    ///
    /// # Errors
    /// Results that cannot be read.
    pub fn html(&self) -> Result<String, ResultsError> {
        let columns = Columns::read(self.results, &noted_cases(self.summary))?;
        let mut pack = Pack::default();
        let factors: Vec<Value> = self
            .results
            .factors()
            .iter()
            .zip(&columns.factors)
            .map(|(factor, values)| {
                let levels: Option<Vec<Value>> = match &factor.kind {
                    FactorKind::Levels(levels) => Some(
                        levels
                            .iter()
                            .map(|level| json!({"label": level.label, "number": level.number}))
                            .collect(),
                    ),
                    FactorKind::Continuous { .. } => None,
                };
                let column = match (&factor.kind, levels.as_ref().map(Vec::len)) {
                    (FactorKind::Levels(_), Some(count)) if count <= LABELLED => {
                        pack.u8s(&columns::narrow(values))
                    }
                    (FactorKind::Levels(_), _) => pack.u16s(&columns::codes(values)),
                    (FactorKind::Continuous { .. }, _) => pack.coarse_column(values, u16::MAX - 1),
                };
                json!({
                    "name": factor.name,
                    "words": factor.name.replace('_', " "),
                    "unit": factor.unit,
                    "role": factor.role,
                    "levels": levels,
                    "column": column,
                })
            })
            .collect();
        let metrics: Vec<Value> = columns
            .metrics
            .iter()
            .map(|(metric, steps, values)| {
                let column = &self.results.columns()[*metric];
                json!({
                    "name": column.name,
                    "words": column.words,
                    "unit": column.unit,
                    "description": column.description,
                    "moreIsBetter": column.more_is_better,
                    "measure": column.measure,
                    "column": pack.coarse_column(values, *steps),
                })
            })
            .collect();
        let postures = json!({
            "cases": pack.indices(&columns.posed),
            "joints": pack.coarse_column(&columns.joints_deg, u16::MAX - 1),
        });
        let pictures = self.pictures.as_ref();
        let scene = pictures.map(|each| scene::arm(&each.base.cell.robot, &mut pack));
        let looks = pictures.map(|each| each.looks(&columns, &mut pack));
        let outcomes = columns
            .outcome_names
            .iter()
            .map(|[outcome, detail]| json!([outcome, detail, reason_in_words(detail)]));
        let outcomes: Vec<Value> = outcomes.collect();
        let labels = Configuration::ALL.map(Configuration::label);
        let document = json!({
            "kind": "study",
            "name": self.name,
            "file": self.file,
            "cases": self.results.cases(),
            "kept": columns.cases.len(),
            "configurations": labels,
            "factors": factors,
            "metrics": metrics,
            "numbers": (columns.cases.len() as u64 != self.results.cases()).then(|| pack.numbers(&columns.cases)),
            "outcomes": pack.u8s(&columns.outcomes),
            "outcomeNames": outcomes,
            "postures": postures,
            "looks": looks,
            "summary": self.summary,
            "manifest": self.manifest,
            "scene": scene,
        });
        let page = Viewer {
            kind: "study",
            name: self.name,
            description: self.description,
            script: SCRIPT,
            style: STYLE,
        };
        Ok(page.html(pack, &document))
    }
}

impl CasePictures<'_> {
    /// What the cases that have postures look like.
    fn looks(&self, columns: &Columns, pack: &mut Pack) -> Value {
        let mut looks = Looks::new(self.base, pack);
        for &index in &columns.posed {
            let found = (self.scenario_of)(columns.cases[index as usize]);
            looks.push(found.as_ref(), pack);
        }
        looks.finish(pack)
    }
}

/// Numbers of the cases that the statistics name as evidence: they are on the page in any case.
fn noted_cases(summary: &Value) -> Vec<u64> {
    fn collect(value: &Value, into: &mut Vec<u64>) {
        match value {
            Value::Array(items) => {
                for item in items {
                    match item.as_u64() {
                        Some(case) => into.push(case),
                        None => collect(item, into),
                    }
                }
            }
            Value::Object(fields) => {
                for (key, field) in fields {
                    match field.as_u64() {
                        Some(case) if key == "case" => into.push(case),
                        _ => collect(field, into),
                    }
                }
            }
            _ => {}
        }
    }
    let mut cases = Vec::new();
    collect(&summary["evidence"], &mut cases);
    if let Some(choices) = summary["choices"]["choices"].as_array() {
        for choice in choices {
            collect(&choice["failing"], &mut cases);
        }
    }
    if let Some(robustness) = summary.get("robustness") {
        collect(robustness, &mut cases);
    }
    cases.sort_unstable();
    cases.dedup();
    cases.truncate(columns::MOST_NOTED);
    cases
}
