//! The schema of scenario files.

use std::fs;

use serde_json::Value;

use crate::support::{Bench, workspace};

const FILE: &str = "scenarios/scenario.schema.json";

fn printed() -> String {
    let answer = Bench::new().run(&["schema", "scenario"]);
    answer.exits_with(0).stdout
}

#[test]
fn committed_schema_is_the_one_of_this_program() {
    let committed = fs::read_to_string(workspace().join(FILE)).unwrap_or_default();
    assert!(
        committed.replace("\r\n", "\n") == printed(),
        "{FILE} is out of date; make it again with\n  \
         cargo run -- schema scenario > {FILE}"
    );
}

/// Objects with `properties`, with their path.
fn structs<'a>(path: &str, value: &'a Value, found: &mut Vec<(String, &'a Value)>) {
    let Some(object) = value.as_object() else {
        return;
    };
    if object.contains_key("properties") {
        found.push((path.to_owned(), value));
    }
    for (key, inner) in object {
        structs(&format!("{path}/{key}"), inner, found);
    }
}

#[test]
fn every_key_has_a_description_and_no_struct_takes_unknown_keys() {
    let schema: Value = serde_json::from_str(&printed()).unwrap();
    let mut found = Vec::new();
    structs("", &schema, &mut found);
    // The file, its sections, and their parts.
    assert!(found.len() > 15, "{}", found.len());
    for (path, each) in found {
        assert_eq!(each["additionalProperties"], false, "{path}");
        for (key, property) in each["properties"].as_object().unwrap() {
            let description = property["description"].as_str().unwrap_or_default();
            assert!(!description.is_empty(), "{path}: {key} is not described");
        }
    }
}
