//! What a criterion came to, and all of them together.

use serde::Serialize;

/// Whether all criteria were met.
///
/// What was missed is known, whatever else might have come out: `Fail` goes before `Incomplete`, and
/// only what was judged as a whole passes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    /// All were judged and met.
    Pass,
    /// One was judged and not met.
    Fail,
    /// All that were judged were met, but something that was to be judged was not.
    Incomplete,
}

impl Verdict {
    /// Of what was missed and what could not be judged.
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

/// A criterion that was to be judged and could not be.
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

/// Criteria, as far as they could be judged.
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

    /// Adds a criterion on a value, which is not judged where there is none.
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

    /// Adds those of a part.
    pub fn extend(&mut self, other: Self) {
        self.results.extend(other.results);
        self.not_judged.extend(other.not_judged);
    }
}

/// Why the criteria on what an engine measures are not judged where it did not.
pub fn unmeasured_by(engine: &str) -> String {
    format!("{engine} did not measure it")
}

/// Why the criteria on what engines differ by are not judged where one is missing.
pub const UNCOMPARED: &str = "not all engines measured it";

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
