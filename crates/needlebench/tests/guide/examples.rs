//! Examples of scenarios, studies, arms' data and lists of markers in the guide.

use serde_json::Value;

use crate::book::{blocks, chapters};

/// Whether every key of a document is one of the schema's, wherever the document starts.
fn unknown_key(schema: &Value, part: &Value, value: &toml::Value) -> Option<String> {
    let part = resolved(schema, part);
    match value {
        toml::Value::Table(table) => table.iter().find_map(|(key, value)| {
            let known = part["properties"].get(key);
            let further = part
                .get("additionalProperties")
                .filter(|each| each.is_object());
            let property = known.or(further);
            property.map_or_else(
                || Some(key.clone()),
                |property| unknown_key(schema, property, value),
            )
        }),
        toml::Value::Array(all) if part["items"].is_object() => all
            .iter()
            .find_map(|each| unknown_key(schema, &part["items"], each)),
        _ => None,
    }
}

/// The part that references and alternatives lead to: of alternatives the one that is a table.
fn resolved<'a>(schema: &'a Value, part: &'a Value) -> &'a Value {
    if let Some(name) = part["$ref"].as_str() {
        return resolved(
            schema,
            schema.pointer(name.trim_start_matches('#')).unwrap(),
        );
    }
    let one = part["allOf"].as_array().and_then(|all| all.first());
    let all = part["anyOf"]
        .as_array()
        .or_else(|| part["oneOf"].as_array());
    let table = all.and_then(|all| {
        let mut tables = all.iter().map(|each| resolved(schema, each));
        tables.find(|each| each["properties"].is_object() || each["items"].is_object())
    });
    one.map(|one| resolved(schema, one))
        .or(table)
        .unwrap_or(part)
}

#[test]
fn keys_of_examples_exist() {
    let schemas = [
        needlebench_scenario::scenario::scenario_schema(),
        needlebench_scenario::study::study_schema(),
        needlebench_robot::arm::data::arm_schema(),
        needlebench_scenario::marker_list_schema(),
        needlebench::needle_case_schema(),
    ];
    let mut seen = 0;
    for chapter in chapters() {
        for block in blocks(&chapter)
            .iter()
            .filter(|block| block.language == "toml")
        {
            let place = format!("{}:\n{}", chapter.display(), block.text);
            let example: toml::Value =
                toml::from_str(&block.text).unwrap_or_else(|error| panic!("{place}\n{error}"));
            let unknown: Vec<String> = schemas
                .iter()
                .map_while(|schema| unknown_key(schema, schema, &example))
                .collect();
            assert!(
                unknown.len() < schemas.len(),
                "{place}\nno file has {unknown:?}"
            );
            seen += 1;
        }
    }
    assert!(seen > 10, "{seen} examples");
}
