//! Names of physics engines.

use std::borrow::Cow;
use std::fmt;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Serialize};

use needlebench_input::{Finding, TomlText, nearest_name};

/// Name of an engine. Which engines there are is for those to say who have them, by
/// [`Overrides::engines`](crate::Overrides::engines).
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(transparent)]
pub struct EngineName(pub String);

impl AsRef<str> for EngineName {
    fn as_ref(&self) -> &str {
        &self.0
    }
}

impl From<&str> for EngineName {
    fn from(name: &str) -> Self {
        Self(name.to_owned())
    }
}

impl fmt::Display for EngineName {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.pad(&self.0)
    }
}

/// A definition of its own, to which those who know the engines add their names.
impl JsonSchema for EngineName {
    fn schema_name() -> Cow<'static, str> {
        "EngineName".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": "string", "description": "Name of an engine." })
    }
}

/// What is wrong with a list of engines at a key: that it is empty, or names one that there is not.
pub(crate) fn check_engine_names(
    toml: &TomlText<'_>,
    key: &str,
    names: Option<&[EngineName]>,
    known: &[&'static str],
) -> Vec<Finding> {
    let listed = known.join(", ");
    let Some(names) = names else {
        return Vec::new();
    };
    if names.is_empty() {
        let finding = toml.finding(key, "no engine is named");
        return vec![if known.is_empty() {
            finding.hint("name one, or omit the key")
        } else {
            finding.hint(format!("some of {listed}, or omit the key"))
        }];
    }
    let unknown = |(_, name): &(usize, &EngineName)| !known.contains(&name.as_ref());
    names
        .iter()
        .enumerate()
        .filter(|each| !known.is_empty() && unknown(each))
        .map(|(index, name)| {
            let near = nearest_name(name.as_ref(), known.iter().copied());
            toml.finding(
                &format!("{key}[{index}]"),
                format!("there is no engine `{name}`"),
            )
            .hint(near.map_or_else(
                || format!("one of {listed}"),
                |near| format!("did you mean `{near}`?"),
            ))
        })
        .collect()
}
