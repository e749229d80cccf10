//! A case of a study compared with a run.

use std::path::Path;

use needlebench_engine::{ENGINES, engine_names};
use needlebench_evaluation::metric::MetricKey;
use needlebench_evaluation::{StoredConfiguration, StoredReport};
use needlebench_input::Finding;
use needlebench_kinematics::ik::Configuration;
use needlebench_study::{FactorKind, FactorValue, Outcome, ParquetResults, Results, Row};

use super::studies::{finding, open};

/// A case of a study's table as a report of its goal; the only case if none is named.
pub(super) fn case_of_study(path: &Path, case: Option<u64>) -> Result<StoredReport, Vec<Finding>> {
    let results = open(path)?;
    let source = path.display().to_string();
    let refused = |message: String, hint: String| {
        let finding = Finding::new(&source, message).key("--case");
        vec![finding.hint(hint)]
    };
    let cases = results.cases();
    let case = match case {
        Some(case) => case,
        None if cases == 1 => 0,
        None => {
            let message = format!("the study has {cases} cases, and a run is compared with one");
            return Err(refused(message, "select one: `--case N`".to_owned()));
        }
    };
    let mut found = None;
    let visited = results.visit(&mut |values, result| {
        if result.case == case {
            found = Some((values[0], result.rows.clone()));
        }
    });
    visited.map_err(|error| vec![finding(error)])?;
    let Some((goal, rows)) = found else {
        let message = format!("the table has no case {case}");
        let hint = format!("the study has the cases 0 to {}", cases.saturating_sub(1));
        return Err(refused(message, hint));
    };
    let name = format!("{source}, case {case}");
    let goal = goal_name(&results, goal);
    let engines = engine_names(ENGINES);
    let columns = results.columns().iter();
    let keys: Vec<Option<MetricKey>> = columns
        .map(|column| MetricKey::named(&column.key, &engines))
        .collect();
    let configurations = rows.iter().map(|row| configuration(row, &keys));
    Ok(StoredReport::of_case(
        name,
        results.study_name(),
        &goal,
        configurations.collect(),
        program(&results),
    ))
}

/// The goal is the first factor.
fn goal_name(results: &ParquetResults, value: FactorValue) -> String {
    let goal = &results.factors()[0];
    match (&goal.kind, value) {
        (FactorKind::Levels(levels), FactorValue::Level(level)) => levels[level].label.clone(),
        _ => goal.name.clone(),
    }
}

/// A row by the keys of its columns, in SI units.
fn configuration(row: &Row, keys: &[Option<MetricKey>]) -> StoredConfiguration {
    let values = keys.iter().enumerate().filter_map(|(index, key)| {
        let key = key.as_ref()?;
        let value = f64::from(row.get(index)?) * key.metric().unit.si;
        Some((key.key().into_owned(), value))
    });
    // A failed criterion is not a rejection.
    let rejected = matches!(row.outcome, Outcome::Rejected | Outcome::Invalid);
    StoredConfiguration {
        label: Configuration::ALL[usize::from(row.configuration)].label(),
        status: row.outcome.name(),
        rejection: rejected.then(|| row.detail.to_string()),
        measured: values.collect(),
    }
}

/// Version of the program that computed the study, and the hash of its sources.
fn program(results: &ParquetResults) -> [Option<&str>; 2] {
    ["version", "source_sha256"].map(|key| results.provenance()[key].as_str())
}
