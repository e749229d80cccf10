//! Where needles are to go: `[[goals]]`.

use std::collections::BTreeMap;

use needlebench_kinematics::ik::Configuration;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Serialize};

use super::criteria::CriteriaSection;
use super::route::RouteSection;
use crate::Finding;
use crate::schema::{LONGEST_NAME, NAME};
use crate::toml_text::TomlText;

/// Rules that reject configurations: the words that `expected` may use.
pub(crate) const REJECTION_RULES: [&str; 11] = [
    "needle_route",
    "unreachable",
    "merged",
    "joint_limit",
    "singular",
    "collision",
    "too_close",
    "needle_corridor",
    "approach",
    "nearest_only",
    "no_motion",
];

/// Outcomes that `expected` may use besides `REJECTION_RULES`: it works and meets all criteria, or
/// misses one.
pub(crate) const OUTCOMES: [&str; 2] = ["ok", "failed"];

/// The key of `expected` for all configurations that it does not name.
pub(crate) const EVERY_CONFIGURATION: &str = "every";

/// A pose of the flange as the UR controller shows it.
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
    /// Name in reports: letters, digits, `-` and `_`. Left out: that of its lesion, or `goal_` and its number.
    #[serde(default)]
    #[schemars(regex(pattern = NAME), length(max = LONGEST_NAME), extend("x-hint" = "names become file names"))]
    pub name: String,
    /// Entry point on the skin, phantom frame (left, posterior, superior), mm. A point within
    /// 5 mm of the skin is moved onto it along the needle.
    #[serde(default)]
    #[schemars(inner(range(min = -5000.0, max = 5000.0)))]
    pub entry_mm: Option<[f64; 3]>,
    /// Where the needle enters, as seen from the target, instead of `entry_mm`: azimuth and elevation
    /// in the phantom frame, deg. Azimuth 0 is towards the front of the body, 90 towards the patient's
    /// left, -90 towards the right; elevation 90 is towards the head. The entry is where the line from
    /// the target in that direction leaves the skin, so one goal suits phantoms of all sizes. Without
    /// `entry_mm` and without this the best entry that `needlebench suggest` finds is assumed, and said.
    #[serde(default)]
    #[schemars(schema_with = "directions")]
    pub entry_direction_deg: Option<[f64; 2]>,
    /// Target point, phantom frame, mm.
    #[serde(default)]
    #[schemars(inner(range(min = -5000.0, max = 5000.0)))]
    pub target_mm: Option<[f64; 3]>,
    /// Name of a lesion of the phantom whose centre is the target, instead of `target_mm`.
    #[serde(default)]
    #[schemars(schema_with = "lesions")]
    pub lesion: Option<String>,
    /// Added to `target_mm` or to the lesion's centre, phantom frame (left, posterior, superior), mm.
    #[serde(default)]
    #[schemars(inner(range(min = -5000.0, max = 5000.0)))]
    pub target_offset_mm: Option<[f64; 3]>,
    /// Where the lesion really is, phantom frame (left, posterior, superior), mm: known where the planned
    /// target comes from a reconstruction and a registration that are off, and these are simulated. Nothing
    /// is planned by it: the engines measure how far from it the needle's tip ends. Breathing and tissue move
    /// it; draws of `hand_eye`, `registration`, `skin_markers` and `imaging` do not, since where it is
    /// is known. At most 50 mm from the planned target.
    #[serde(default)]
    #[schemars(inner(range(min = -5000.0, max = 5000.0)))]
    pub true_target_mm: Option<[f64; 3]>,
    /// Pose of the flange, instead of entry and target. The needle then follows the guide.
    #[serde(default)]
    pub flange_pose: Option<FlangePose>,
    /// From the guide's exit to the needle's tip, mm. Left out: the distance from the guide's
    /// exit to the target. Needed with `flange_pose`.
    #[serde(default)]
    #[schemars(range(min = 1.0, max = 500.0))]
    pub insertion_length_mm: Option<f64>,
    /// Gap between the guide's exit and the entry point, mm. Not used with `flange_pose`.
    #[serde(default = "default_standoff_mm")]
    #[schemars(range(min = 0.0, max = 200.0))]
    pub standoff_mm: f64,
    /// How far behind its final place the guide starts to move straight along the needle, mm.
    #[serde(default = "default_approach_mm")]
    #[schemars(range(min = 0.0, max = 500.0))]
    pub approach_mm: f64,
    /// Angle of the guide about the needle, deg: 0 turns the guide's x axis as near to the
    /// patient's head as it gets. Left out: free, and chosen for each configuration.
    #[serde(default)]
    #[schemars(range(min = -720.0, max = 720.0))]
    pub roll_deg: Option<f64>,
    /// Plans where the needle enters, by rules and risks, with the robot: instead of an entry.
    #[serde(default)]
    pub route: Option<RouteSection>,
    /// Outcome that is expected of a configuration: `ok`, `failed`, or the rule that rejects it; `collision` is also met
    /// by `too_close`.
    /// The key `every` stands for all that are not named.
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

    /// It has a target, and where the needle enters is left to be chosen.
    pub(crate) fn is_open(&self) -> bool {
        let has_target = self.target_mm.is_some() || self.lesion.is_some();
        has_target && self.entry_key_given().is_none() && self.flange_pose.is_none()
    }

    /// A goal for a target, with everything else left to its defaults.
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

/// What a needle is to reach.
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
    let hint = "azimuth from the front towards the patient's left, then elevation towards the head, in \
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
    let outcomes = [&OUTCOMES[..], &REJECTION_RULES].concat();
    json_schema!({
        "type": "object",
        "propertyNames": { "enum": names },
        "additionalProperties": { "type": "string", "enum": outcomes },
    })
}

/// Criteria of the file on true targets, where no goal has one.
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
            toml.finding(&key, "no goal has a true target to be judged by")
                .hint("`true_target_mm` under [[goals]]: where the lesion really is")
        })
        .collect()
}

/// Two goals of one name, and no goal at all.
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
                        "goal `{}` has an entry and a route to be planned",
                        goal.name
                    ),
                )
                .hint(format!(
                    "leave out `{given}` for the planned route, or [goals.route] for this one"
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
                "add where the needle is to go, such as\n\n    [[goals]]\n    lesion = \"pleural_based\"\n\nor an \
                 [iso9283] for a test of the robot itself",
            ),
        );
    }
    findings
}
