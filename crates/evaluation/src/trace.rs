//! The trace matrix: which requirement is stood for by which criterion, and what came of it.

use needlebench_cell::requirements::{Requirements, requirement_of};
use serde::Serialize;

use crate::report::Report;

/// What came of a criterion.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum TraceOutcome {
    /// Wherever it was to be judged it was, and met.
    Met,
    /// It was missed somewhere.
    Missed,
    /// It was not missed, but not judged everywhere, or nowhere at all.
    NotJudged,
}

impl TraceOutcome {
    /// Of how often it was met, missed and not judged.
    pub fn of(met: u64, missed: u64, not_judged: u64) -> Self {
        match (met, missed, not_judged) {
            (_, 1.., _) => Self::Missed,
            (1.., 0, 0) => Self::Met,
            _ => Self::NotJudged,
        }
    }

    /// In words.
    pub fn words(self) -> &'static str {
        match self {
            Self::Met => "met",
            Self::Missed => "missed",
            Self::NotJudged => "not judged",
        }
    }
}

/// One criterion that stands for a requirement.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct TraceRow {
    /// The requirement, as the scenario has it.
    pub requirement: String,
    /// Key of the criterion.
    pub criterion: String,
    /// What came of it.
    pub outcome: TraceOutcome,
    /// How often it was met, over goals, configurations and engines.
    pub met: u64,
    /// How often it was missed.
    pub missed: u64,
    /// How often it was to be judged and could not be; 0 with nothing met nor missed: nothing of this run
    /// was to be judged by it.
    pub not_judged: u64,
}

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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_not_judged_is_never_met() {
        assert_eq!(TraceOutcome::of(3, 0, 0), TraceOutcome::Met);
        assert_eq!(TraceOutcome::of(3, 0, 1), TraceOutcome::NotJudged);
        assert_eq!(TraceOutcome::of(0, 0, 0), TraceOutcome::NotJudged);
        assert_eq!(TraceOutcome::of(3, 1, 1), TraceOutcome::Missed);
    }
}
