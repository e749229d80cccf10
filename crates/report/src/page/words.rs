//! What people in the room call things: the page's dictionary.

use needlebench_cell::ResolvedScenario;
use serde_json::{Map, Value, json};

/// Words for the names that the documents of pages use.
pub(super) fn words(_resolved: &ResolvedScenario) -> Value {
    let known: [(&str, &str); 0] = [];
    let words: Map<String, Value> = known
        .into_iter()
        .map(|(name, words)| (name.to_owned(), json!(words)))
        .collect();
    Value::Object(words)
}
