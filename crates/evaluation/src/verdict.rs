//! What a criterion came to, and all of them together.

use needlebench_cell::{SCAN_ENDS, UNSEEN_BODY};
use serde::Serialize;

/// Whether all criteria were met.
///
/// A failure is certain whatever else was not evaluated: `Fail` goes before `Incomplete`, and only what was evaluated
/// as a whole passes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    /// All were evaluated and met.
    Pass,
    /// One was evaluated and not met.
    Fail,
    /// All that were evaluated were met, but something that was to be evaluated was not.
    Incomplete,
}

impl Verdict {
    /// From what failed and what could not be evaluated.
    pub fn of(missed: bool, unjudged: bool) -> Self {
        match (missed, unjudged) {
            (true, _) => Self::Fail,
            (false, true) => Self::Incomplete,
            (false, false) => Self::Pass,
        }
    }

    /// As in the report.
    pub fn name(self) -> &'static str {
        match self {
            Self::Pass => "pass",
            Self::Fail => "fail",
            Self::Incomplete => "incomplete",
        }
    }
}

/// A criterion that was to be evaluated and could not be.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct NotJudged {
    /// Goal.
    pub goal: String,
    /// Configuration; none for criteria on the goal as a whole.
    pub label: Option<String>,
    /// Engine; none for criteria on all of them or on the plan.
    pub engine: Option<String>,
    /// Key of the scenario's `[criteria]`, or `expected`.
    pub criterion: String,
    /// Why: what is missing.
    pub reason: String,
    /// The requirement that it stands for, where the scenario says.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub requirement: Option<String>,
}

impl NotJudged {
    /// What stands for it where one word has to do: its criterion, or `scan_ends` and the class of a clearance.
    pub fn detail(&self) -> String {
        let class = self.criterion.strip_prefix("min_clearance_mm.");
        match class.filter(|_| self.reason == UNSEEN_BODY) {
            Some(class) => format!("{SCAN_ENDS} {class}"),
            None => self.criterion.clone(),
        }
    }
}

/// Criteria, as far as they could be evaluated.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Judged {
    /// Those that were.
    pub results: Vec<CriterionResult>,
    /// Those that were not.
    pub not_judged: Vec<NotJudged>,
}

impl Judged {
    /// All together.
    pub fn verdict(&self) -> Verdict {
        let missed = self.results.iter().any(|result| !result.pass);
        Verdict::of(missed, !self.not_judged.is_empty())
    }

    /// Adds a criterion on a value, which is not evaluated where there is none.
    pub fn add(&mut self, result: CriterionResult, reason: impl FnOnce() -> String) {
        if result.value.is_some_and(|value| !value.is_nan()) {
            self.results.push(result);
        } else {
            self.not_judged.push(NotJudged {
                goal: result.goal,
                label: result.label,
                engine: result.engine,
                criterion: result.criterion,
                reason: reason(),
                requirement: None,
            });
        }
    }

    /// A criterion is not evaluated, and has no result that would be a pass: what is known to fail fails all the same.
    pub(crate) fn leave_open(&mut self, open: &NotJudged) {
        let is_it = |each: &CriterionResult| {
            each.criterion == open.criterion
                && each.goal == open.goal
                && each.label == open.label
                && each.engine == open.engine
        };
        self.results.retain(|each| !is_it(each) || !each.pass);
        if !self.results.iter().any(is_it) {
            self.not_judged.push(open.clone());
        }
    }

    /// The same whatever its result: the value is not known well enough.
    pub(crate) fn set_open(&mut self, open: NotJudged) {
        let is_other = |criterion: &str, goal: &str, label: &Option<String>| {
            criterion != open.criterion || goal != open.goal || *label != open.label
        };
        self.results
            .retain(|each| is_other(&each.criterion, &each.goal, &each.label));
        self.not_judged
            .retain(|each| is_other(&each.criterion, &each.goal, &each.label));
        self.not_judged.push(open);
    }

    /// Adds those of a part.
    pub fn extend(&mut self, other: Self) {
        self.results.extend(other.results);
        self.not_judged.extend(other.not_judged);
    }
}

/// Why the criteria on what an engine measures are not evaluated where it did not.
pub fn unmeasured_by(engine: &str) -> String {
    format!("not measured by {engine}")
}

/// Why the criteria on what engines differ by are not evaluated where one is missing.
pub const UNCOMPARED: &str = "not measured by all engines";

/// One criterion on one value.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CriterionResult {
    /// Goal.
    pub goal: String,
    /// Configuration; none for criteria on the goal as a whole.
    pub label: Option<String>,
    /// Engine; none for criteria on both or on the plan.
    pub engine: Option<String>,
    /// Key of the scenario's `[criteria]`, or `expected`.
    pub criterion: String,
    /// The value; none where there is none to measure.
    pub value: Option<f64>,
    /// The limit.
    pub limit: Option<f64>,
    /// Unit of both.
    pub unit: &'static str,
    /// Met or not.
    pub pass: bool,
    /// What it is about, in words.
    pub detail: String,
    /// The requirement that it stands for, where the scenario says.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub requirement: Option<String>,
}

/// Outcome of a criterion.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum TraceOutcome {
    /// Wherever it was to be evaluated it was, and met.
    Met,
    /// It failed somewhere.
    Missed,
    /// It did not fail, but was not evaluated everywhere, or nowhere at all.
    NotJudged,
}

impl TraceOutcome {
    /// From how often it was met, failed and not evaluated.
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
            Self::Missed => "failed",
            Self::NotJudged => "not evaluated",
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
    /// How often it failed.
    pub missed: u64,
    /// How often it was to be evaluated and could not be; 0 with nothing met nor missed: nothing of this run was to be
    /// evaluated by it.
    pub not_judged: u64,
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
