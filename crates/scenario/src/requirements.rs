//! Requirements that criteria stand for: the section `[requirements]` of scenarios and studies.

use std::collections::BTreeMap;

use schemars::{Schema, json_schema};
use serde::Serialize;
use serde_json::Value;

/// Requirement by the key of the criterion that stands for it: `SRS-12: the needle's tip within 0.1 mm`.
pub type Requirements = BTreeMap<String, String>;

/// Keys of a section's criteria, with those of its tables behind a dot.
pub(crate) fn keys(section: &impl Serialize, prefix: &str) -> Vec<String> {
    let Ok(Value::Object(entries)) = serde_json::to_value(section) else {
        return Vec::new();
    };
    let all = entries.into_iter().flat_map(|(key, value)| match value {
        Value::Object(inner) => inner
            .into_iter()
            .map(|(name, _)| format!("{prefix}{key}.{name}"))
            .collect(),
        _ => vec![format!("{prefix}{key}")],
    });
    all.collect()
}

/// The schema of a section on such criteria.
pub(crate) fn schema(names: &[String]) -> Schema {
    json_schema!({
        "type": "object",
        "propertyNames": { "enum": names },
        "additionalProperties": { "type": "string" },
    })
}

/// The requirement that a criterion stands for; that of an event's place in its list is that of all.
pub fn requirement_of<'a>(requirements: &'a Requirements, criterion: &str) -> Option<&'a str> {
    let plain: String = criterion
        .split('[')
        .enumerate()
        .map(|(index, part)| match (index, part.split_once(']')) {
            (1.., Some((_, after))) => after,
            _ => part,
        })
        .collect();
    requirements.get(&plain).map(String::as_str)
}
