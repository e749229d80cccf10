//! What a criterion came to, and all of them together.

use serde::Serialize;

/// Whether all criteria were met.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    /// All were met.
    Pass,
    /// One was not.
    Fail,
}

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
}
