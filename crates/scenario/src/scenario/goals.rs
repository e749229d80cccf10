//! Needle goals: `[[goals]]`.

use std::collections::BTreeMap;

use needlebench_cell::Rule;
use needlebench_input::schema::{LONGEST_NAME, NAME};
use needlebench_input::{Finding, TomlText};
use needlebench_kinematics::ik::Configuration;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Serialize};

use super::criteria::CriteriaSection;
use super::route::RouteSection;

/// Outcomes that `expected` may use besides the names of rules: feasible with all criteria passed, or a failed
/// criterion.
pub(crate) const OUTCOMES: [&str; 2] = ["ok", "failed"];

/// The key of `expected` for all configurations that it does not name.
pub(crate) const EVERY_CONFIGURATION: &str = "every";

/// A flange pose as the UR controller shows it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FlangePose {
    /// Position in the controller's `base` frame, mm.
    #[schemars(inner(range(min = -5000.0, max = 5000.0)))]
    pub position_mm: [f64; 3],
    /// Rotation vector in the `base` frame, rad.
    #[schemars(inner(range(min = -20.0, max = 20.0)))]
    pub rotation_vector_rad: [f64; 3],
}

/// One needle: from entry and target, or from a flange pose.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GoalSection {
    /// Name in reports: letters, digits, `-` and `_`. Default: the lesion's name, or `goal_` and a number.
    #[serde(default)]
    #[schemars(regex(pattern = NAME), length(max = LONGEST_NAME), extend("x-hint" = "names become file names"))]
    pub name: String,
    /// Entry point on the skin, phantom frame (left, posterior, superior), mm. A point within 5 mm of the skin is
    /// projected onto it along the needle axis.
    #[serde(default)]
    #[schemars(inner(range(min = -5000.0, max = 5000.0)))]
    pub entry_mm: Option<[f64; 3]>,
    /// Direction of the entry point from the target, instead of `entry_mm`: azimuth and elevation in the phantom frame,
    /// deg. Azimuth 0 is anterior, 90 the patient's left, -90 the right; elevation 90 is superior. The entry is where
    /// this ray leaves the skin, so one goal fits phantoms of all sizes. Default without `entry_mm`: the best entry of
    /// `needlebench suggest`, with a note.
    #[serde(default)]
    #[schemars(schema_with = "directions")]
    pub entry_direction_deg: Option<[f64; 2]>,
    /// Target point, phantom frame (left, posterior, superior), mm.
    #[serde(default)]
    #[schemars(inner(range(min = -5000.0, max = 5000.0)))]
    pub target_mm: Option<[f64; 3]>,
    /// Name of a lesion of the phantom whose centre is the target, instead of `target_mm`.
    #[serde(default)]
    #[schemars(schema_with = "lesions")]
    pub lesion: Option<String>,
    /// Offset added to `target_mm` or to the lesion's centre, phantom frame (left, posterior, superior), mm.
    #[serde(default)]
    #[schemars(inner(range(min = -5000.0, max = 5000.0)))]
    pub target_offset_mm: Option<[f64; 3]>,
    /// Ground-truth position of the lesion, phantom frame (left, posterior, superior), mm, at most 50 mm from the
    /// planned target. It is known where the planned target comes from a simulated reconstruction and registration; it
    /// does not affect planning. The engines measure the distance of the final tip position from it. Breathing and
    /// tissue motion move it; draws of `hand_eye`, `registration`, `skin_markers` and `imaging` do not.
    #[serde(default)]
    #[schemars(inner(range(min = -5000.0, max = 5000.0)))]
    pub true_target_mm: Option<[f64; 3]>,
    /// Flange pose, instead of entry and target. The needle then follows from the guide.
    #[serde(default)]
    pub flange_pose: Option<FlangePose>,
    /// Distance from the guide's exit to the needle tip, mm. Default: the distance from the guide's exit to the target;
    /// required with `flange_pose`.
    #[serde(default)]
    #[schemars(range(min = 1.0, max = 500.0))]
    pub insertion_length_mm: Option<f64>,
    /// Stand-off: gap between the guide's exit and the entry point, mm. Not used with `flange_pose`.
    #[serde(default = "default_standoff_mm")]
    #[schemars(range(min = 0.0, max = 200.0))]
    pub standoff_mm: f64,
    /// Length of the linear approach of the guide along the needle axis, mm.
    #[serde(default = "default_approach_mm")]
    #[schemars(range(min = 0.0, max = 500.0))]
    pub approach_mm: f64,
    /// Roll angle of the guide about the needle axis, deg; at 0 the guide's x axis points as far superior as possible.
    /// Default: free, chosen for each configuration.
    #[serde(default)]
    #[schemars(range(min = -720.0, max = 720.0))]
    pub roll_deg: Option<f64>,
    /// Plans the entry by risk and rules, with the robot, instead of a given entry.
    #[serde(default)]
    pub route: Option<RouteSection>,
    /// Expected outcome of a configuration: `ok`, `failed`, or the rule that rejects it; `too_close` also satisfies
    /// `collision`. The key `every` stands for all configurations that are not named.
    #[serde(default)]
    #[schemars(schema_with = "outcomes")]
    pub expected: BTreeMap<String, String>,
}

impl GoalSection {
    /// The key that decides the entry.
    pub(crate) fn entry_key(&self) -> &'static str {
        self.entry_key_given().unwrap_or("entry_mm")
    }

    /// The key that decides the entry, if one does.
    pub(crate) fn entry_key_given(&self) -> Option<&'static str> {
        match (self.entry_mm, self.entry_direction_deg) {
            (_, Some(_)) => Some("entry_direction_deg"),
            (Some(_), None) => Some("entry_mm"),
            (None, None) => None,
        }
    }

    /// The goal has a target, and its entry is still to be chosen.
    pub(crate) fn is_open(&self) -> bool {
        let has_target = self.target_mm.is_some() || self.lesion.is_some();
        has_target && self.entry_key_given().is_none() && self.flange_pose.is_none()
    }

    /// A goal for a target, with all other keys at their defaults.
    pub fn at(target: Target) -> Self {
        let (target_mm, lesion) = match target {
            Target::Point(mm) => (Some(mm), None),
            Target::Lesion(name) => (None, Some(name)),
        };
        Self {
            name: lesion.clone().unwrap_or_else(|| "target".to_owned()),
            entry_mm: None,
            entry_direction_deg: None,
            target_mm,
            lesion,
            target_offset_mm: None,
            true_target_mm: None,
            flange_pose: None,
            insertion_length_mm: None,
            standoff_mm: default_standoff_mm(),
            approach_mm: default_approach_mm(),
            roll_deg: None,
            route: None,
            expected: BTreeMap::new(),
        }
    }

    /// The key that decides the target.
    pub(crate) fn target_key(&self) -> &'static str {
        match (&self.target_offset_mm, &self.lesion) {
            (Some(_), _) => "target_offset_mm",
            (None, Some(_)) => "lesion",
            (None, None) => "target_mm",
        }
    }
}

/// Target of a needle.
#[derive(Debug, Clone, PartialEq)]
pub enum Target {
    /// A point of the phantom frame, mm.
    Point([f64; 3]),
    /// A lesion of the phantom, by name.
    Lesion(String),
}

fn default_standoff_mm() -> f64 {
    10.0
}
fn default_approach_mm() -> f64 {
    60.0
}

fn directions(_: &mut SchemaGenerator) -> Schema {
    let hint = "azimuth from anterior towards the patient's left, then elevation towards superior, in \
                degrees";
    json_schema!({
        "type": "array",
        "items": [
            { "type": "number", "minimum": -360.0, "maximum": 360.0, "x-hint": hint },
            { "type": "number", "minimum": -90.0, "maximum": 90.0, "x-hint": hint },
        ],
        "minItems": 2,
        "maxItems": 2,
    })
}

fn lesions(_: &mut SchemaGenerator) -> Schema {
    json_schema!({
        "anyOf": [
            { "type": "string", "enum": super::models::shipped_lesions() },
            { "type": "string", "pattern": NAME },
        ]
    })
}

fn outcomes(_: &mut SchemaGenerator) -> Schema {
    let labels = Configuration::ALL.map(Configuration::label);
    let names = [&[EVERY_CONFIGURATION][..], &labels].concat();
    let outcomes = [&OUTCOMES[..], &Rule::NAMES].concat();
    json_schema!({
        "type": "object",
        "propertyNames": { "enum": names },
        "additionalProperties": { "type": "string", "enum": outcomes },
    })
}

/// Checks that criteria on true targets have a goal with one.
pub(super) fn check_true_targets(
    toml: &TomlText<'_>,
    goals: &[GoalSection],
    criteria: &CriteriaSection,
    come_later: bool,
) -> Vec<Finding> {
    if come_later || goals.iter().any(|goal| goal.true_target_mm.is_some()) {
        return Vec::new();
    }
    let limits = [
        (
            "max_true_target_error_mm",
            criteria.max_true_target_error_mm,
        ),
        (
            "max_true_target_lateral_mm",
            criteria.max_true_target_lateral_mm,
        ),
    ];
    let asked = limits.into_iter().filter(|(_, limit)| limit.is_some());
    let keys = asked.map(|(name, _)| format!("criteria.{name}"));
    // A study computes goal by goal: one of them may have none.
    keys.filter(|key| toml.span_of(key).is_some())
        .map(|key| {
            toml.finding(&key, "no goal has a true target to evaluate this")
                .hint(
                    "add `true_target_mm` under [[goals]]: the ground-truth position of the lesion",
                )
        })
        .collect()
}

/// Checks for goals of the same name, and for a missing goal.
pub(super) fn check(
    toml: &TomlText<'_>,
    goals: &[GoalSection],
    needs_a_goal: bool,
) -> Vec<Finding> {
    let mut findings = Vec::new();
    for (i, goal) in goals.iter().enumerate() {
        if goals[..i].iter().any(|earlier| earlier.name == goal.name) {
            findings.push(
                toml.finding(
                    &format!("goals[{i}].name"),
                    format!("two goals are named `{}`", goal.name),
                )
                .hint("give each its own name: results go to a folder of that name"),
            );
        }
    }
    for (i, goal) in goals.iter().enumerate() {
        let given = goal.entry_key_given();
        let given = given.or(goal.flange_pose.as_ref().map(|_| "flange_pose"));
        if goal.route.is_some()
            && let Some(given) = given
        {
            findings.push(
                toml.finding(
                    &format!("goals[{i}].{given}"),
                    format!(
                        "goal `{}` has both an entry and a needle path to plan",
                        goal.name
                    ),
                )
                .hint(format!(
                    "remove `{given}` to plan the path, or [goals.route] to use the given entry"
                )),
            );
        }
    }
    if goals.is_empty() && needs_a_goal {
        findings.push(
            toml.finding(
                "goals",
                match toml.span_of("goals") {
                    Some(_) => "the scenario has no goal",
                    None => "the key `goals` is missing",
                },
            )
            .hint(
                "add a goal, such as\n\n    [[goals]]\n    lesion = \"pleural_based\"\n\nor an \
                 [iso9283] for a test of the robot itself",
            ),
        );
    }
    findings
}
