//! Optimisation of the control factors: the section `[search]` of a study file.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use needlebench_cell::ClearanceClass;

/// Objective by which candidates are compared.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ObjectiveName {
    /// A lower quantile of the constraint margin over the layouts.
    #[default]
    Margin,
    /// Share of layouts with a feasible configuration.
    Rate,
    /// Mean over the layouts of the RMS tip error.
    TipError,
    /// Mean over the layouts of the probability that the needle's tip is in the lesion.
    LesionProbability,
}

impl ObjectiveName {
    /// Name in files and reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Margin => "margin",
            Self::Rate => "rate",
            Self::TipError => "tip_error",
            Self::LesionProbability => "lesion_probability",
        }
    }
}

/// Optimisation by `needlebench search` over the control factors (`role = "control"`). Cases are static; layouts are
/// sampled from all other factors, goals included.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SearchSection {
    /// Objective: `margin`, `rate`, `tip_error` or `lesion_probability`.
    pub objective: ObjectiveName,
    /// Second objective: the result is then the Pareto set. Default: none.
    pub second_objective: Option<ObjectiveName>,
    /// Clearance classes that count in full in the constraint margin, such as `["robot_phantom", "robot_table"]`;
    /// others count only where violated. Default: `needle_corridor`, and all classes of arm and tool against their
    /// surroundings except `tool_phantom`, which the stand-off decides.
    #[schemars(length(min = 1))]
    pub classes: Option<Vec<ClearanceClass>>,
    /// Quantile of the constraint margin: share of layouts that may have less.
    #[schemars(range(min = 0.001, max = 0.5), extend("x-hint" = "it is a share: 5 % are 0.05"))]
    pub quantile: f64,
    /// Number of layouts for each finalist. Default: that of `[sampling]`, else 128.
    #[schemars(range(min = 16, max = 1_000_000))]
    pub samples: Option<u64>,
    /// Number of held-out layouts, not used for selection, on which the winner is evaluated.
    #[serde(alias = "fresh")]
    #[schemars(range(min = 16, max = 1_000_000), extend("x-former" = "fresh"))]
    pub held_out_layouts: u64,
    /// Maximum number of cases. Default: a third of an exhaustive evaluation of all candidates on all layouts, or 6144
    /// if control factors have ranges; at least the minimum that suffices.
    #[schemars(range(min = 1, max = 1_000_000_000))]
    pub budget: Option<u64>,
    /// Failure penalty: tip error assigned to a layout without a feasible configuration in `tip_error`, mm.
    #[serde(alias = "failure_counts_mm")]
    #[schemars(range(max = 1000.0), extend("exclusiveMinimum" = 0.0, "x-former" = "failure_counts_mm"))]
    pub failure_penalty_mm: f64,
}

impl Default for SearchSection {
    fn default() -> Self {
        Self {
            objective: ObjectiveName::Margin,
            second_objective: None,
            classes: None,
            quantile: 0.05,
            samples: None,
            held_out_layouts: 256,
            budget: None,
            failure_penalty_mm: 10.0,
        }
    }
}

impl SearchSection {
    /// Whether a class counts in the constraint margin in full.
    pub fn counts(&self, class: ClearanceClass) -> bool {
        match &self.classes {
            Some(classes) => classes.contains(&class),
            // What no place changes would decide: how far the tool keeps from the skin is its build and the
            // stand-off, as the arm's clearance from itself is its build.
            None => match class {
                ClearanceClass::NeedleCorridor => true,
                ClearanceClass::ToolPhantom => false,
                _ => class.is_surroundings(),
            },
        }
    }
}
