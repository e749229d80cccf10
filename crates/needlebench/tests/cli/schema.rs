//! The schemas of scenario and study files.

use std::fs;

use serde_json::Value;

use crate::support::{Bench, workspace};

/// Formats and their committed schemas.
const FILES: [(&str, &str); 2] = [
    ("scenario", "scenarios/scenario.schema.json"),
    ("study", "scenarios/studies/study.schema.json"),
];

fn printed(format: &str) -> String {
    let answer = Bench::new().run(&["schema", format]);
    answer.exits_with(0).stdout
}

#[test]
fn committed_schemas_are_those_of_this_program() {
    for (format, file) in FILES {
        let committed = fs::read_to_string(workspace().join(file)).unwrap_or_default();
        assert!(
            committed.replace("\r\n", "\n") == printed(format),
            "{file} is out of date; make it again with\n  \
             cargo run -- schema {format} > {file}"
        );
    }
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
    for (format, _) in FILES {
        let schema: Value = serde_json::from_str(&printed(format)).unwrap();
        let mut found = Vec::new();
        structs("", &schema, &mut found);
        // The file, its sections, and their parts.
        assert!(found.len() > 8, "{}", found.len());
        for (path, each) in found {
            assert_eq!(each["additionalProperties"], false, "{path}");
            for (key, property) in each["properties"].as_object().unwrap() {
                let description = property["description"].as_str().unwrap_or_default();
                assert!(!description.is_empty(), "{path}: {key} is not described");
            }
        }
    }
}
