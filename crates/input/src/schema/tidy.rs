//! A derived schema as TOML has it: without nulls and number formats, with the limits of whole
//! numbers.

use serde_json::{Map, Value, json};

use super::{FORMER, FORMER_NAMES_UNTIL, HINT, OFF, UNIT};

/// Of everything in a schema.
pub(super) fn tidy(schema: &mut Value) {
    each_object(schema, &mut |object| {
        add_former_names(object);
        remove_null(object);
        if let Some(format) = object.remove("format") {
            let limits = match format.as_str() {
                Some("uint8") => (0, i64::from(u8::MAX)),
                Some("uint32") => (0, i64::from(u32::MAX)),
                // Whole numbers of TOML have 64 bits with their sign.
                Some("uint64") => (0, i64::MAX),
                _ => return,
            };
            let minimum = object.entry("minimum").or_insert(json!(limits.0));
            if minimum.as_i64().is_none_or(|least| least < limits.0) {
                *minimum = json!(limits.0);
            }
            object.entry("maximum").or_insert(json!(limits.1));
        }
    });
}

/// Takes away the words that only this program knows.
pub(super) fn without_own_words(schema: &mut Value) {
    each_object(schema, &mut |object| {
        object.remove(UNIT);
        object.remove(HINT);
        object.remove(FORMER);
        if object.remove(OFF).is_some() {
            let words = ["type", "minimum", "exclusiveMinimum", "maximum"];
            let number: Map<String, Value> = words
                .into_iter()
                .filter_map(|word| Some((word.to_owned(), object.remove(word)?)))
                .collect();
            object.insert("anyOf".to_owned(), json!([number, { "enum": ["off"] }]));
        }
    });
}

/// Adds former names of keys and choices, and that none stands beside its present name.
fn add_former_names(object: &mut Map<String, Value>) {
    /// The same under its former name.
    fn former(schema: &Value, present: &str) -> Option<(String, Value)> {
        let name = schema.get(FORMER)?.as_str()?.to_owned();
        let mut schema = schema.clone();
        let words = schema.as_object_mut()?;
        words.remove(FORMER);
        words.remove("default");
        let said = format!("Former name of `{present}`, accepted until {FORMER_NAMES_UNTIL}.");
        words.insert("description".to_owned(), said.into());
        words.insert("deprecated".to_owned(), true.into());
        Some((name, schema))
    }
    if let Some(Value::Object(properties)) = object.get_mut("properties") {
        let mut both = Vec::new();
        let mut added = Vec::new();
        for (key, schema) in &*properties {
            if let Some((name, schema)) = former(schema, key) {
                both.push(json!({ "required": [&name, key] }));
                added.push((name, schema));
            }
        }
        properties.extend(added);
        if !both.is_empty() {
            object.insert("not".to_owned(), json!({ "anyOf": both }));
        }
    }
    if let Some(Value::Array(choices)) = object.get_mut("oneOf") {
        let added: Vec<Value> = choices
            .iter()
            .filter_map(|schema| {
                let (name, mut schema) = former(schema, schema.get("const")?.as_str()?)?;
                schema["const"] = name.into();
                Some(schema)
            })
            .collect();
        choices.extend(added);
    }
}

/// What may be left out may be null for serde, but there is no null in TOML.
fn remove_null(object: &mut Map<String, Value>) {
    if object.get("default").is_some_and(Value::is_null) {
        object.remove("default");
    }
    // A name that may be left out is not empty where it is given.
    if object.get("default").is_some_and(|default| default == "") && object.contains_key("pattern")
    {
        object.remove("default");
    }
    if let Some(default) = object.get_mut("default") {
        leave_out_nulls(default);
    }
    if let Some(Value::Array(types)) = object.get_mut("type") {
        types.retain(|each| each != "null");
        if let [only] = types.as_slice() {
            let only = only.clone();
            object.insert("type".to_owned(), only);
        }
    }
    if let Some(Value::Array(values)) = object.get_mut("enum") {
        values.retain(|each| !each.is_null());
    }
    if let Some(Value::Array(choices)) = object.get_mut("anyOf") {
        choices.retain(|each| each["type"] != "null");
        if choices.len() == 1 {
            let only = object.remove("anyOf");
            object.insert("allOf".to_owned(), only.unwrap_or_default());
        }
    }
}

fn leave_out_nulls(value: &mut Value) {
    match value {
        Value::Object(object) => {
            object.retain(|_, inner| !inner.is_null());
            object.values_mut().for_each(leave_out_nulls);
        }
        Value::Array(values) => values.iter_mut().for_each(leave_out_nulls),
        _ => {}
    }
}

/// Changes a schema and all that are inside.
fn each_object(value: &mut Value, change: &mut impl FnMut(&mut Map<String, Value>)) {
    match value {
        Value::Object(object) => {
            change(object);
            for (key, inner) in object {
                match (key.as_str(), inner) {
                    // Values, not schemas.
                    ("default" | "enum" | "const", _) => {}
                    // Names with their schemas.
                    ("properties" | "definitions", Value::Object(named)) => {
                        for inner in named.values_mut() {
                            each_object(inner, change);
                        }
                    }
                    (_, inner) => each_object(inner, change),
                }
            }
        }
        Value::Array(values) => {
            for inner in values {
                each_object(inner, change);
            }
        }
        _ => {}
    }
}
