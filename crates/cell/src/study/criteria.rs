//! What a study has to show: the section `[criteria]` of a study file.

use std::collections::BTreeMap;

use needlebench_kinematics::ik::Configuration;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Serialize};

use crate::limit::Limit;

/// Every configuration by itself, in `of` and in `min_success_rate`.
pub const EVERY: &str = "every";

/// The best configuration of each layout, in `of`.
pub const BEST: &str = "best";

/// What a study has to show. A layout is a case, with its goal; layouts that cannot exist count in
/// `max_invalid_layouts` alone.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct StudyCriteria {
    /// Judges the unfavourable end of each 95 % confidence interval instead of the estimate: passes
    /// where the sample is large enough to show it. Default false.
    pub confidence: bool,
    /// Configurations that have to be ok in a layout for it to work, 1 to 8. Default 1.
    #[schemars(range(min = 1, max = 8), extend("x-hint" = "an arm of six joints has eight configurations"))]
    pub working_configurations: Option<u32>,
    /// Least share of the valid layouts that work, 0 to 1.
    #[schemars(range(min = 0.0, max = 1.0), extend("x-hint" = "it is a share: 95 % are 0.95"))]
    pub min_layouts_working: Option<f64>,
    /// Least share of the valid layouts in which a configuration is ok, 0 to 1, by its label, such as
    /// `Right-Up-Fold`; `every` is for each that is not named.
    #[schemars(schema_with = "shares")]
    pub min_success_rate: BTreeMap<String, f64>,
    /// Largest share of the cases whose layout cannot exist, 0 to 1.
    #[schemars(range(min = 0.0, max = 1.0), extend("x-hint" = "it is a share: 95 % are 0.95"))]
    pub max_invalid_layouts: Option<f64>,
    /// Least clearance, mm: the nearest approach along the simulated motion; of planned cases along
    /// the planned one, of static cases in their posture.
    pub min_clearance_mm: Option<LowerQuantile>,
    /// Least certified clearance over the whole motion, mm; planned and dynamic studies.
    pub min_certified_clearance_mm: Option<LowerQuantile>,
    /// Least clearance of arm and tool from themselves, mm.
    pub min_self_mm: Option<LowerQuantile>,
    /// Largest tip error, mm: simulated, of planned and static cases as the balance of torques
    /// predicts it.
    pub max_tip_error_mm: Option<UpperQuantile>,
    /// Largest part of the tip error across the needle, mm.
    pub max_tip_lateral_mm: Option<UpperQuantile>,
    /// Largest root mean square tip error over the draws of `[imperfections]`, mm.
    pub max_tip_rms_mm: Option<UpperQuantile>,
}

/// A quantile that has to be large enough.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LowerQuantile {
    /// Share of the values that may be less, 0 to 1. Default 0.05.
    #[serde(default = "low_quantile")]
    #[schemars(range(min = 0.0, max = 1.0), extend("x-hint" = "it is a share: 95 % are 0.95"))]
    pub quantile: f64,
    /// Limit, in the unit of the criterion.
    #[schemars(range(min = -1e12, max = 1e12))]
    pub at_least: f64,
    /// `best`, the configuration with the largest clearance in each layout that works; `every`, each
    /// configuration over the layouts in which it is not rejected; or a configuration's label.
    /// Default `best`.
    #[serde(default = "best")]
    #[schemars(schema_with = "configurations")]
    pub of: String,
}

/// A quantile that has to be small enough.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct UpperQuantile {
    /// Share of the values that may not be more, 0 to 1. Default 0.95.
    #[serde(default = "high_quantile")]
    #[schemars(range(min = 0.0, max = 1.0), extend("x-hint" = "it is a share: 95 % are 0.95"))]
    pub quantile: f64,
    /// Limit, in the unit of the criterion.
    #[schemars(range(min = -1e12, max = 1e12))]
    pub at_most: f64,
    /// `best`, the configuration with the largest clearance in each layout that works; `every`, each
    /// configuration over the layouts in which it is not rejected; or a configuration's label.
    /// Default `best`.
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
    /// What the quantile has to keep, in the unit of the key.
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
    use crate::Finding;
    use crate::schema::FileSchema;
    use crate::toml_text::TomlText;

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
                    "`worst` is not a value that `criteria.min_clearance_mm.of` can have",
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
