//! The trace matrix: which requirement is stood for by which criterion, and what came of it.

use needlebench_scenario::requirements::{Requirements, requirement_of};

use crate::report::{Report, TraceOutcome, TraceRow};

/// Writes the requirements to the criteria of a report that stand for them, and the matrix of all.
pub fn trace(report: &mut Report, requirements: &Requirements) {
    for result in &mut report.criteria {
        result.requirement = requirement_of(requirements, &result.criterion).map(str::to_owned);
    }
    for open in &mut report.not_judged {
        open.requirement = requirement_of(requirements, &open.criterion).map(str::to_owned);
    }
    let mut rows: Vec<TraceRow> = requirements
        .iter()
        .map(|(criterion, requirement)| {
            let is_it = |key: &str| {
                let only = Requirements::from([(criterion.clone(), String::new())]);
                requirement_of(&only, key).is_some()
            };
            let results = report.criteria.iter();
            let results = results.filter(|each| is_it(&each.criterion));
            let met = results.clone().filter(|each| each.pass).count() as u64;
            let missed = results.filter(|each| !each.pass).count() as u64;
            let open = report.not_judged.iter();
            let not_judged = open.filter(|each| is_it(&each.criterion)).count() as u64;
            TraceRow {
                requirement: requirement.clone(),
                criterion: criterion.clone(),
                outcome: TraceOutcome::of(met, missed, not_judged),
                met,
                missed,
                not_judged,
            }
        })
        .collect();
    rows.sort_by(|a, b| (&a.requirement, &a.criterion).cmp(&(&b.requirement, &b.criterion)));
    report.trace = rows;
}
