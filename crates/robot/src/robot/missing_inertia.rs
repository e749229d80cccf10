//! What to do when a moving link has no mass.

use std::fmt;
use std::str::FromStr;
use std::sync::LazyLock;

use needlebench_cell::Robot;
use needlebench_input::nearest_name;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::ArmInUse;
use crate::arm::Arm;

/// What to do when a moving link has no mass.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub enum MissingInertia {
    /// Refuse the robot.
    #[default]
    Error,
    /// Take the link's mass, centre of mass and inertia from the arm whose data the robot has, and say
    /// so in the report.
    Nominal,
    /// The same, if that is the arm of this name.
    NominalOf(String),
}

/// Text of [`MissingInertia::Error`].
const ERROR: &str = "error";

/// Text of [`MissingInertia::Nominal`], and the start of those with a name.
const NOMINAL: &str = "nominal";

/// Every text that there is.
static TEXTS: LazyLock<Vec<String>> = LazyLock::new(|| {
    let named = Arm::shipped_names().map(|name| format!("{NOMINAL}-{name}"));
    let general = [ERROR, NOMINAL].map(str::to_owned);
    general.into_iter().chain(named).collect()
});

impl MissingInertia {
    /// Every text that there is: `error`, `nominal`, and `nominal-` with each arm that ships.
    pub fn texts() -> Vec<&'static str> {
        TEXTS.iter().map(String::as_str).collect()
    }

    /// The arm, and its own URDF's robot, that stands in for a link without mass.
    pub(crate) fn stand_in<'a>(&self, arm: Option<&'a ArmInUse>) -> Option<(&'a Arm, &'a Robot)> {
        let used = arm.filter(|used| used.has_its_lengths() && self.is_of(&used.arm))?;
        Some((&used.arm, used.nominal.as_deref()?))
    }

    fn is_of(&self, arm: &Arm) -> bool {
        // Masses of which nobody says where they are from are nobody's.
        arm.data.inertia.is_some()
            && match self {
                Self::Error => false,
                Self::Nominal => true,
                Self::NominalOf(name) => arm.key == *name,
            }
    }

    /// What else can be done about a link without mass, after `give it an <inertial>`.
    pub(crate) fn way_out(&self, arm: Option<&ArmInUse>) -> String {
        let known = arm.filter(|used| {
            used.has_its_lengths() && used.nominal.is_some() && used.arm.data.inertia.is_some()
        });
        match (self, known) {
            (Self::NominalOf(name), used) if used.is_none_or(|used| used.arm.key != *name) => {
                let name = Arm::named(name).map_or(name.clone(), |arm| arm.data.name.clone());
                format!(": the arm's lengths are not a {name}'s, so its masses do not apply")
            }
            (_, Some(used)) => {
                let (key, whose) = (&used.arm.key, used.arm.possessive());
                format!(
                    ", or set `missing_inertia = \"{NOMINAL}-{key}\"` under [robot] \
                     (`--missing-inertia {NOMINAL}-{key}`) to use {whose}"
                )
            }
            _ => ": its lengths match no arm with known masses".to_owned(),
        }
    }
}

impl fmt::Display for MissingInertia {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Error => formatter.write_str(ERROR),
            Self::Nominal => formatter.write_str(NOMINAL),
            Self::NominalOf(name) => write!(formatter, "{NOMINAL}-{name}"),
        }
    }
}

impl FromStr for MissingInertia {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let texts = Self::texts();
        if !texts.contains(&text) {
            let hint = match nearest_name(text, texts.iter().copied()) {
                Some(near) => format!("did you mean `{near}`?"),
                None => format!("one of {}", texts.join(", ")),
            };
            return Err(format!("`{text}` is not a valid policy; {hint}"));
        }
        Ok(match text {
            ERROR => Self::Error,
            NOMINAL => Self::Nominal,
            named => Self::NominalOf(named[NOMINAL.len() + 1..].to_owned()),
        })
    }
}

impl TryFrom<String> for MissingInertia {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        text.parse()
    }
}

impl From<MissingInertia> for String {
    fn from(policy: MissingInertia) -> Self {
        policy.to_string()
    }
}

impl JsonSchema for MissingInertia {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "MissingInertia".into()
    }

    fn json_schema(_: &mut schemars::SchemaGenerator) -> schemars::Schema {
        schemars::json_schema!({
            "description": "Handling of a moving link without mass: reject the robot, or use the mass \
                            properties of the arm that it is.",
            "type": "string",
            "enum": Self::texts(),
        })
    }
}
