//! What two results were made from, side by side.

use std::collections::BTreeMap;

use serde::Serialize;
use serde_json::Value;

use crate::stored::StoredReport;

/// A difference between the two that is no result.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct ProvenanceDifference {
    /// What it is of.
    pub what: String,
    /// In the first result.
    pub a: Option<String>,
    /// In the second.
    pub b: Option<String>,
}

/// What differs between the provenance of two results, by name.
pub(crate) fn provenance_differences(
    a: &StoredReport,
    b: &StoredReport,
) -> Vec<ProvenanceDifference> {
    let (of_a, of_b) = (provenance(a), provenance(b));
    let mut keys: Vec<&String> = of_a.keys().chain(of_b.keys()).collect();
    keys.sort();
    keys.dedup();
    let has_all = !a.is_case() && !b.is_case();
    keys.into_iter()
        .filter(|key| has_all || of_a.contains_key(*key) && of_b.contains_key(*key))
        .filter(|key| of_a.get(*key).map(|v| &v.identity) != of_b.get(*key).map(|v| &v.identity))
        .map(|key| ProvenanceDifference {
            what: key.clone(),
            a: of_a.get(key).map(|value| value.text.clone()),
            b: of_b.get(key).map(|value| value.text.clone()),
        })
        .collect()
}

/// What decides whether two are the same, and what people read.
struct Origin {
    identity: String,
    text: String,
}

/// Everything in a report's provenance, by name.
fn provenance(report: &StoredReport) -> BTreeMap<String, Origin> {
    let mut found = BTreeMap::new();
    let plain = |text: &str| Origin {
        identity: text.to_owned(),
        text: text.to_owned(),
    };
    for key in [
        "version",
        "git_revision",
        "source_sha256",
        "arithmetic",
        "cargo_lock_sha256",
        "seed",
        "truth",
    ] {
        let value = report.value(&format!("/provenance/{key}"));
        let text = match value {
            None | Some(Value::Null) => continue,
            Some(Value::String(text)) => text.clone(),
            Some(other) => other.to_string(),
        };
        let origin = Origin {
            text: if key.ends_with("sha256") {
                short(&text).to_owned()
            } else {
                text.clone()
            },
            identity: text,
        };
        found.insert(key.replace('_', " "), origin);
    }
    let list = |key: &str| {
        let list = report.value(&format!("/provenance/{key}"));
        list.and_then(Value::as_array).cloned().unwrap_or_default()
    };
    let text = |value: &Value, key: &str| {
        let text = value.get(key).and_then(Value::as_str);
        text.unwrap_or_default().to_owned()
    };
    for engine in list("engines") {
        let name = text(&engine, "name");
        found.insert(name.clone(), plain(&text(&engine, "version")));
        let settings = engine.get("settings").and_then(Value::as_array);
        for setting in settings.into_iter().flatten() {
            let part = |index: usize| setting.get(index).and_then(Value::as_str);
            if let (Some(key), Some(value)) = (part(0), part(1)) {
                found.insert(format!("{name} {key}"), plain(value));
            }
        }
    }
    let mut counts: BTreeMap<String, usize> = BTreeMap::new();
    for input in list("inputs") {
        let role = text(&input, "role");
        let count = counts.entry(role.clone()).or_default();
        *count += 1;
        let name = if *count == 1 {
            role
        } else {
            format!("{role} {count}")
        };
        let hash = text(&input, "sha256");
        let shown = format!("{} ({})", text(&input, "file"), short(&hash));
        found.insert(
            name,
            Origin {
                identity: hash,
                text: shown,
            },
        );
    }
    found
}

/// The start of a hash, as people tell them apart.
fn short(hash: &str) -> &str {
    hash.get(..12).unwrap_or(hash)
}
