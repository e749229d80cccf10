//! The page of a study: plots from every point of which one gets to the case.

mod columns;
mod looks;
#[cfg(test)]
mod tests;

use needlebench_cell::ResolvedScenario;
use needlebench_kinematics::ik::Configuration;
use needlebench_study::{FactorKind, Results, ResultsError};
use serde_json::{Value, json};

use super::pack::Pack;
use super::scene::{pose, surroundings};
use super::viewer::Viewer;
use columns::{Columns, LABELLED};
use looks::Looks;

const SCRIPT: &str = concat!(
    include_str!("../assets/statistics.js"),
    include_str!("../assets/study_plots.js"),
    include_str!("../assets/study.js")
);

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
    /// Where the numbers come from, as in `study.json`.
    pub manifest: &'a Value,
    /// The base scenario, for the picture.
    pub base: Option<&'a ResolvedScenario>,
    /// The scenario of a case, none of one that cannot exist; without it the picture shows the base
    /// scenario, and says so.
    pub scenarios: Option<&'a dyn Fn(u64) -> Option<ResolvedScenario>>,
}

impl StudyPage<'_> {
    /// The whole page. Reads the results once; keeps at most `MOST_CASES` cases.
    ///
    /// # Errors
    /// What cannot be read of the results.
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
        let scene = self.base.map(|base| surroundings(base, &mut pack));
        let [places, codes, looks] = self.case_places(&columns, &mut pack);
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
            "outcomeNames": columns.outcome_names,
            "postures": postures,
            "places": places,
            "lookOf": codes,
            "looks": looks,
            "summary": self.summary,
            "manifest": self.manifest,
            "scene": scene,
            "goals": self.base.map(goals),
            "phantom": self.base.and_then(|base| base.phantom.as_ref()).map(|placed| pose(&placed.world_from_phantom)),
        });
        let page = Viewer {
            kind: "study",
            name: self.name,
            description: self.description,
            script: SCRIPT,
        };
        Ok(page.html(pack, &document))
    }

    /// Robot and phantom of the cases that have postures, seven numbers each; what they look like.
    fn case_places(&self, columns: &Columns, pack: &mut Pack) -> [Value; 3] {
        let Some(scenarios) = self.scenarios else {
            return [Value::Null, Value::Null, Value::Array(Vec::new())];
        };
        let mut looks = Looks::new(self.base, pack);
        let mut numbers = Vec::with_capacity(14 * columns.posed.len());
        for &index in &columns.posed {
            let found = scenarios(columns.cases[index as usize]);
            looks.push(found.as_ref(), pack);
            let robot = found
                .as_ref()
                .map(|each| each.cell.robot.world_from_base_link);
            let placed = found.as_ref().and_then(|each| each.phantom.as_ref());
            let phantom = placed.map(|placed| placed.world_from_phantom);
            for pose in [robot, phantom] {
                match pose {
                    Some(pose) => {
                        let (t, q) = (pose.translation.vector, pose.rotation);
                        numbers.extend([t.x, t.y, t.z, q.i, q.j, q.k, q.w]);
                    }
                    None => numbers.extend([f64::NAN; 7]),
                }
            }
        }
        let [codes, looks] = looks.finish(pack);
        [pack.f32s(numbers), codes, looks]
    }
}

/// Goals of the base scenario, by name.
fn goals(base: &ResolvedScenario) -> Value {
    let goals = base.goals.iter().map(|goal| {
        let (target, axis) = (goal.target_m, goal.axis.into_inner());
        let place = json!({
            "target": [target.x, target.y, target.z],
            "axis": [axis.x, axis.y, axis.z],
            "exit": pose(&goal.world_from_guide_exit),
        });
        (goal.name.clone(), place)
    });
    Value::Object(goals.collect())
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
