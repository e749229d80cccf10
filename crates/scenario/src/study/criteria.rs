//! Criteria of a study: the section `[criteria]` of a study file.

use std::collections::BTreeMap;

use needlebench_kinematics::ik::Configuration;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Serialize};

use needlebench_input::Limit;

/// Every configuration individually, in `of` and in `min_success_rate`.
pub const EVERY: &str = "every";

/// The best configuration of each layout, in `of`.
pub const BEST: &str = "best";

/// Criteria of a study. A layout is a case with its goal. Invalid layouts count in `max_invalid_layouts` only.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct StudyCriteria {
    /// Evaluates the unfavourable bound of each 95 % CI instead of the estimate: passes only if the sample is large
    /// enough. Default false.
    pub confidence: bool,
    /// Number of configurations that must be ok for a layout to be feasible, 1 to 8. Default 1.
    #[schemars(range(min = 1, max = 8), extend("x-hint" = "an arm of six joints has eight configurations"))]
    pub working_configurations: Option<u32>,
    /// Minimum share of feasible layouts among the valid ones, 0 to 1.
    #[schemars(range(min = 0.0, max = 1.0), extend("x-hint" = "it is a share: 95 % are 0.95"))]
    pub min_layouts_working: Option<f64>,
    /// Minimum success rate of a configuration: share of the valid layouts in which it is ok, 0 to 1, by its label,
    /// such as `Right-Up-Fold`; `every` stands for each that is not named.
    #[schemars(schema_with = "shares")]
    pub min_success_rate: BTreeMap<String, f64>,
    /// Maximum share of cases with an invalid layout, 0 to 1.
    #[schemars(range(min = 0.0, max = 1.0), extend("x-hint" = "it is a share: 95 % are 0.95"))]
    pub max_invalid_layouts: Option<f64>,
    /// Minimum clearance, mm: along the simulated motion; of planned cases along the planned motion, of static cases in
    /// the final posture.
    pub min_clearance_mm: Option<LowerQuantile>,
    /// Minimum certified clearance over the whole motion, mm; planned and dynamic studies only.
    pub min_certified_clearance_mm: Option<LowerQuantile>,
    /// Minimum self-clearance of arm and tool, mm.
    pub min_self_mm: Option<LowerQuantile>,
    /// Maximum tip error, mm: simulated; of planned and static cases predicted by static equilibrium.
    pub max_tip_error_mm: Option<UpperQuantile>,
    /// Maximum lateral tip error, mm.
    pub max_tip_lateral_mm: Option<UpperQuantile>,
    /// Maximum RMS tip error over the arm and patient population (of `[imperfections]`, else of `[expected]`), mm.
    pub max_tip_rms_mm: Option<UpperQuantile>,
}

/// A lower limit on a quantile.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LowerQuantile {
    /// Quantile: share of the values that may be lower, 0 to 1. Default 0.05 (P5).
    #[serde(default = "low_quantile")]
    #[schemars(range(min = 0.0, max = 1.0), extend("x-hint" = "it is a share: 95 % are 0.95"))]
    pub quantile: f64,
    /// Limit, in the unit of the criterion.
    #[schemars(range(min = -1e12, max = 1e12))]
    pub at_least: f64,
    /// Configurations: `best`, the one with the largest clearance in each feasible layout; `every`, each configuration
    /// over the layouts in which it is not rejected; or a configuration's label. Default `best`.
    #[serde(default = "best")]
    #[schemars(schema_with = "configurations")]
    pub of: String,
}

/// An upper limit on a quantile.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct UpperQuantile {
    /// Quantile: share of the values that must not exceed the limit, 0 to 1. Default 0.95 (P95).
    #[serde(default = "high_quantile")]
    #[schemars(range(min = 0.0, max = 1.0), extend("x-hint" = "it is a share: 95 % are 0.95"))]
    pub quantile: f64,
    /// Limit, in the unit of the criterion.
    #[schemars(range(min = -1e12, max = 1e12))]
    pub at_most: f64,
    /// Configurations: `best`, the one with the largest clearance in each feasible layout; `every`, each configuration
    /// over the layouts in which it is not rejected; or a configuration's label. Default `best`.
    #[serde(default = "best")]
    #[schemars(schema_with = "configurations")]
    pub of: String,
}

fn low_quantile() -> f64 {
    0.05
}

fn high_quantile() -> f64 {
    0.95
}

fn best() -> String {
    BEST.to_owned()
}

/// A criterion on a quantile.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct QuantileCriterion<'a> {
    /// Key in the section; the columns that it is about are those that name it.
    pub key: &'static str,
    /// Share, 0 to 1.
    pub quantile: f64,
    /// Limit of the quantile, in the unit of the key.
    pub limit: Limit,
    /// A label, [`BEST`] or [`EVERY`].
    pub of: &'a str,
}

impl StudyCriteria {
    /// The criteria on quantiles, in the order of their keys.
    pub fn quantiles(&self) -> Vec<QuantileCriterion<'_>> {
        let lower = [
            ("min_clearance_mm", &self.min_clearance_mm),
            (
                "min_certified_clearance_mm",
                &self.min_certified_clearance_mm,
            ),
            ("min_self_mm", &self.min_self_mm),
        ];
        let upper = [
            ("max_tip_error_mm", &self.max_tip_error_mm),
            ("max_tip_lateral_mm", &self.max_tip_lateral_mm),
            ("max_tip_rms_mm", &self.max_tip_rms_mm),
        ];
        let lower = lower.into_iter().filter_map(|(key, found)| {
            found.as_ref().map(|found| QuantileCriterion {
                key,
                quantile: found.quantile,
                limit: Limit {
                    value: found.at_least,
                    at_least: true,
                },
                of: &found.of,
            })
        });
        let upper = upper.into_iter().filter_map(|(key, found)| {
            found.as_ref().map(|found| QuantileCriterion {
                key,
                quantile: found.quantile,
                limit: Limit {
                    value: found.at_most,
                    at_least: false,
                },
                of: &found.of,
            })
        });
        lower.chain(upper).collect()
    }
}

fn shares(_: &mut SchemaGenerator) -> Schema {
    let labels = Configuration::ALL.map(Configuration::label);
    let names = [&[EVERY][..], &labels].concat();
    json_schema!({
        "type": "object",
        "propertyNames": { "enum": names },
        "additionalProperties": {
            "type": "number",
            "minimum": 0.0,
            "maximum": 1.0,
            "x-hint": "it is a share: 95 % are 0.95",
        },
    })
}

fn configurations(_: &mut SchemaGenerator) -> Schema {
    let labels = Configuration::ALL.map(Configuration::label);
    let names = [&[BEST, EVERY][..], &labels].concat();
    json_schema!({ "type": "string", "enum": names })
}

#[cfg(test)]
mod tests {
    use super::*;
    use needlebench_input::schema::FileSchema;
    use needlebench_input::{Finding, TomlText};

    #[derive(Debug, Deserialize, JsonSchema)]
    struct File {
        criteria: StudyCriteria,
    }

    fn read(text: &str) -> Result<File, Vec<Finding>> {
        let toml = TomlText::parse("study.toml", text).unwrap();
        toml.read(&FileSchema::of::<File>())
    }

    fn findings(text: &str) -> Vec<String> {
        let found = read(text).err().unwrap_or_default();
        found.iter().map(ToString::to_string).collect()
    }

    #[test]
    fn criteria_are_read_with_their_defaults() {
        let text = "[criteria]\nmin_layouts_working = 0.95\nmin_clearance_mm = { at_least = 10 }\n\
                    max_tip_error_mm = { quantile = 0.9, at_most = 2, of = \"every\" }\n\
                    [criteria.min_success_rate]\nevery = 0.5\nRight-Up-Fold = 0.9";
        assert!(findings(text).is_empty());
        let file = read(text).unwrap();
        let found = file.criteria.quantiles();
        assert_eq!(found.len(), 2);
        assert_eq!(
            (found[0].quantile, found[0].of, found[0].limit.at_least),
            (0.05, BEST, true)
        );
        assert_eq!(
            (found[1].quantile, found[1].of, found[1].limit.at_least),
            (0.9, EVERY, false)
        );
    }

    #[test]
    fn wrong_values_are_refused_where_they_stand() {
        for (text, line, parts) in [
            (
                "[criteria]\nmin_layouts_working = 95",
                2,
                ["min_layouts_working` is 95", "95 % are 0.95"],
            ),
            (
                "[criteria]\n\nmax_tip_error_mm = { at_most = 1, quantile = 5 }",
                3,
                ["max_tip_error_mm.quantile` is 5", "share"],
            ),
            (
                "[criteria.min_success_rate]\nRight-Up-Fld = 0.5",
                2,
                ["`Right-Up-Fld`", "did you mean `Right-Up-Fold`?"],
            ),
            (
                "[criteria]\nmin_clearance_mm = { at_least = 1, of = \"worst\" }",
                2,
                [
                    "`worst` is not a valid value of `criteria.min_clearance_mm.of`",
                    "hint",
                ],
            ),
            (
                "[criteria]\nworking_configurations = 9",
                2,
                ["is 9", "1 to 8"],
            ),
        ] {
            let found = findings(text);
            assert_eq!(found.len(), 1, "{found:?}");
            assert!(
                found[0].starts_with(&format!("study.toml:{line}:")),
                "{found:?}"
            );
            for part in parts {
                assert!(found[0].contains(part), "{found:?}");
            }
        }
    }
}
