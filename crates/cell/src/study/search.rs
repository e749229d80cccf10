//! What the best choice is searched by: the section `[search]` of a study file.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::ClearanceClass;

/// What choices are compared by.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ObjectiveName {
    /// A lower quantile of the signed margin: how much room the worst layouts leave.
    #[default]
    Margin,
    /// The share of layouts in which a configuration works.
    Rate,
    /// The mean of the expected error of the tip.
    TipError,
}

impl ObjectiveName {
    /// Name in files and reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Margin => "margin",
            Self::Rate => "rate",
            Self::TipError => "tip_error",
        }
    }
}

/// What `needlebench search` looks for among the factors with `role = "choice"`: static cases, and layouts that
/// are sampled from all other factors, goals included.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SearchSection {
    /// `margin`, `rate` or `tip_error`.
    pub objective: ObjectiveName,
    /// Another objective: the answer is then what cannot be improved in one without loss in the other.
    pub second_objective: Option<ObjectiveName>,
    /// Classes of clearance whose room counts in the margin, such as `["robot_phantom", "robot_table"]`. Others count
    /// where they are broken. If left out: all of arm and tool against what stands around them but `tool_phantom`, which
    /// the stand-off decides, and `needle_corridor`.
    #[schemars(length(min = 1))]
    pub classes: Option<Vec<ClearanceClass>>,
    /// Share of layouts that may have less than the margin that is compared.
    #[schemars(range(min = 0.001, max = 0.5), extend("x-hint" = "it is a share: 5 % are 0.05"))]
    pub quantile: f64,
    /// Layouts for each of the last candidates; those of `[sampling]` if left out, else 128.
    #[schemars(range(min = 16, max = 1_000_000))]
    pub samples: Option<u64>,
    /// Layouts that no candidate was compared by, on which the winner is judged.
    #[schemars(range(min = 16, max = 1_000_000))]
    pub fresh: u64,
    /// Most cases of the search. If left out: a third of those of all choices with all layouts, and 6144 if choices
    /// have ranges; the least that is enough where that is more.
    #[schemars(range(min = 1, max = 1_000_000_000))]
    pub budget: Option<u64>,
    /// What a layout in which nothing works counts in `tip_error`, mm.
    #[schemars(range(max = 1000.0), extend("exclusiveMinimum" = 0.0))]
    pub failure_counts_mm: f64,
}

impl Default for SearchSection {
    fn default() -> Self {
        Self {
            objective: ObjectiveName::Margin,
            second_objective: None,
            classes: None,
            quantile: 0.05,
            samples: None,
            fresh: 256,
            budget: None,
            failure_counts_mm: 10.0,
        }
    }
}

impl SearchSection {
    /// Whether the room of a class counts in the margin.
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
