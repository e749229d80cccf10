//! The schemas of scenario and study files.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;

use serde_json::Value;

use crate::support::{Bench, Json, workspace};

/// Formats and their committed schemas.
const FILES: [(&str, &str); 2] = [
    ("scenario", "scenarios/scenario.schema.json"),
    ("study", "scenarios/studies/study.schema.json"),
];

fn printed(format: &str) -> String {
    let answer = Bench::new().run(format!("schema {format}"));
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

/// What a schema says of each key, by the key's place: everything by which it could come to accept less.
fn keys(schema: &Value) -> BTreeMap<String, Value> {
    fn walk(path: &str, value: &Value, found: &mut BTreeMap<String, Value>) {
        let Some(object) = value.as_object() else {
            return;
        };
        for required in object
            .get("required")
            .and_then(Value::as_array)
            .into_iter()
            .flatten()
        {
            found.insert(format!("{path} needs {}", required.word()), Value::Null);
        }
        for (key, property) in object
            .get("properties")
            .and_then(Value::as_object)
            .into_iter()
            .flatten()
        {
            found.insert(format!("{path}.{key}"), property.clone());
        }
        for (key, inner) in object {
            walk(&format!("{path}/{key}"), inner, found);
        }
    }
    let mut found = BTreeMap::new();
    walk("", schema, &mut found);
    found
}

/// All of a property but what is said to people.
fn without_words(property: &Value) -> Value {
    match property {
        Value::Object(object) => {
            let kept = object
                .iter()
                .filter(|(key, _)| !["description", "default"].contains(&key.as_str()));
            kept.map(|(key, inner)| (key.clone(), without_words(inner)))
                .collect()
        }
        Value::Array(items) => items.iter().map(without_words).collect(),
        other => other.clone(),
    }
}

/// Words of enumerations and bounds of numbers: those that are gone, and those that are tighter.
fn tightened(path: &str, before: &Value, after: &Value, found: &mut Vec<String>) {
    let words = |value: &Value, key: &str| -> BTreeSet<String> {
        let list = value
            .get(key)
            .and_then(Value::as_array)
            .into_iter()
            .flatten();
        list.map(|item| item.get("const").unwrap_or(item).to_string())
            .collect()
    };
    for key in ["enum", "oneOf", "type"] {
        // A single type is a word, of several there is a list.
        let of = |value: &Value| match value.get(key) {
            Some(Value::String(word)) => BTreeSet::from([format!("\"{word}\"")]),
            _ => words(value, key),
        };
        let gone: Vec<String> = of(before).difference(&of(after)).cloned().collect();
        if !gone.is_empty() && after.get(key).is_some() {
            found.push(format!("{path} no longer takes {}", gone.join(", ")));
        }
    }
    for (key, rises) in [
        ("minimum", true),
        ("exclusiveMinimum", true),
        ("minItems", true),
        ("maximum", false),
        ("exclusiveMaximum", false),
        ("maxItems", false),
    ] {
        let of = |value: &Value| value.get(key).and_then(Value::as_f64);
        let tighter = match (of(before), of(after)) {
            (Some(before), Some(after)) if rises => after > before,
            (Some(before), Some(after)) => after < before,
            (None, Some(_)) => true,
            _ => false,
        };
        if tighter {
            found.push(format!("{path}: `{key}` is tighter"));
        }
    }
}

/// What files of the former schema could have that the new one does not take; and what is new.
fn changes(before: &Value, after: &Value) -> (Vec<String>, Vec<String>) {
    let (old, new) = (keys(before), keys(after));
    let mut lost = Vec::new();
    for (path, property) in &old {
        match new.get(path) {
            None if !path.contains(" needs ") => lost.push(format!("{path} is gone")),
            Some(now) => {
                let [property, now] = [property, now].map(without_words);
                tightened(path, &property, &now, &mut lost);
            }
            None => {}
        }
    }
    let added = |wanted: bool| {
        let fresh = new.keys().filter(|path| !old.contains_key(*path));
        fresh.filter(move |path| path.contains(" needs ") == wanted)
    };
    // In a table that is new itself nothing can be missed.
    let is_old_table = |path: &str| {
        old.keys()
            .any(|known| known.starts_with(&format!("{path}.")))
    };
    let needed = added(true).filter(|path| is_old_table(path.split(" needs ").next().unwrap()));
    lost.extend(needed.cloned());
    for (name, definition) in before["definitions"].as_object().into_iter().flatten() {
        if let Some(now) = after["definitions"].get(name) {
            let [definition, now] = [definition, now].map(without_words);
            tightened(name, &definition, &now, &mut lost);
        }
    }
    (lost, added(false).cloned().collect())
}

#[test]
fn a_file_that_a_released_schema_takes_is_taken_as_long_as_the_version_stands() {
    let changelog = fs::read_to_string(workspace().join("CHANGELOG.md")).unwrap();
    for format in ["scenario", "study", "arm"] {
        let now: Value = serde_json::from_str(&printed(format)).unwrap();
        let id = now["$id"].word();
        let version = id.strip_prefix(&format!("urn:needlebench:schema:{format}:"));
        let version: u32 = version.unwrap().parse().unwrap();
        let file = workspace().join(format!("tests/schema/released/{format}.{version}.json"));
        let released = fs::read_to_string(&file).unwrap_or_else(|_| {
            panic!(
                "a new version: cargo run -- schema {format} > {}",
                file.display()
            )
        });
        let (lost, added) = changes(&serde_json::from_str(&released).unwrap(), &now);
        assert!(
            lost.is_empty(),
            "files of {id} are refused now; raise SCHEMA_VERSION: {lost:#?}"
        );
        for path in added {
            let key = path.rsplit('.').next().unwrap();
            assert!(
                changelog.contains(&format!("`{key}`")),
                "{path} is new in {id}: CHANGELOG.md has to say so, with `{key}`"
            );
        }
    }
}

#[test]
fn what_a_schema_comes_to_refuse_is_noticed() {
    let before = serde_json::json!({
        "properties": {"a": {"type": "number", "minimum": 0}, "b": {"enum": ["x", "y"]}},
        "definitions": {"Kind": {"oneOf": [{"const": "p"}, {"const": "q"}]}},
    });
    let (lost, added) = changes(&before, &before);
    assert_eq!((lost.len(), added.len()), (0, 0));
    for (place, value, expected) in [
        (
            "/properties/a",
            serde_json::json!({"type": "string", "minimum": 0}),
            "no longer takes",
        ),
        (
            "/properties/a",
            serde_json::json!({"type": "number", "minimum": 1}),
            "`minimum` is tighter",
        ),
        (
            "/properties/a",
            serde_json::json!({"type": "number", "minimum": 0, "maximum": 9}),
            "`maximum` is tighter",
        ),
        (
            "/properties/b",
            serde_json::json!({"enum": ["x"]}),
            "no longer takes \"y\"",
        ),
        (
            "/properties",
            serde_json::json!({"a": before["properties"]["a"]}),
            ".b is gone",
        ),
        (
            "/definitions/Kind/oneOf",
            serde_json::json!([{"const": "p"}]),
            "no longer takes \"q\"",
        ),
    ] {
        let mut after = before.clone();
        *after.pointer_mut(place).unwrap() = value;
        let (lost, _) = changes(&before, &after);
        assert!(lost.len() == 1 && lost[0].contains(expected), "{lost:?}");
    }
    let mut after = before.clone();
    after["required"] = serde_json::json!(["a"]);
    after["properties"]["c"] = serde_json::json!({"type": "number"});
    let (lost, added) = changes(&before, &after);
    assert_eq!(lost, [" needs a"]);
    assert_eq!(added, [".c"]);
}
