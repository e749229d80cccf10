//! JSON schemas of file formats as Markdown for people: a section per table, a row per key.

use std::collections::{BTreeMap, VecDeque};
use std::fmt::Write as _;

use serde_json::{Map, Number, Value};

/// The reference of a file format, from its JSON schema: every table with its keys, what they may be,
/// their defaults and what they mean.
pub fn schema_markdown(title: &str, schema: &Value) -> String {
    let mut reference = Reference {
        definitions: schema.get("definitions").and_then(Value::as_object),
        sections: BTreeMap::new(),
        waiting: VecDeque::new(),
        text: format!("# {title}\n"),
    };
    reference.paragraph(words(schema).trim());
    let root = Section::root();
    reference.keys(&root, schema);
    while let Some((section, definition)) = reference.waiting.pop_front() {
        reference.section(&section, definition);
    }
    reference.text
}

/// A table of the file.
#[derive(Debug, Clone)]
struct Section {
    path: String,
    /// One of several, `[[path]]`.
    listed: bool,
}

impl Section {
    fn root() -> Self {
        Self {
            path: String::new(),
            listed: false,
        }
    }

    fn of(&self, key: &str, listed: bool) -> Self {
        let path = if self.path.is_empty() {
            key.to_owned()
        } else {
            format!("{}.{key}", self.path)
        };
        Self { path, listed }
    }

    fn heading(&self) -> String {
        if self.listed {
            format!("[[{}]]", self.path)
        } else {
            format!("[{}]", self.path)
        }
    }

    /// The anchor of the heading, as mdBook and GitHub make it.
    fn anchor(&self) -> String {
        let kept = self.path.chars();
        kept.filter(|c| c.is_alphanumeric() || "-_".contains(*c))
            .flat_map(char::to_lowercase)
            .collect()
    }

    fn link(&self) -> String {
        format!("[`{}`](#{})", self.heading(), self.anchor())
    }
}

struct Reference<'a> {
    definitions: Option<&'a Map<String, Value>>,
    /// Where each definition of a table is described.
    sections: BTreeMap<String, Section>,
    waiting: VecDeque<(Section, &'a Value)>,
    text: String,
}

/// The description, its line ends as blanks.
fn words(schema: &Value) -> String {
    let text = schema.get("description").and_then(Value::as_str);
    let paragraphs = text.unwrap_or_default().split("\n\n");
    let joined: Vec<String> = paragraphs
        .map(|paragraph| paragraph.split_whitespace().collect::<Vec<_>>().join(" "))
        .collect();
    joined.join("\n\n")
}

/// The one schema that another stands for: `allOf` of one is how a reference gets a description.
fn only(schema: &Value) -> Option<&Value> {
    match schema.get("allOf")?.as_array()?.as_slice() {
        [one] => Some(one),
        _ => None,
    }
}

/// Whether it is no former name.
fn is_present(schema: &Value) -> bool {
    schema.get("deprecated").is_none()
}

fn alternatives(schema: &Value) -> Option<&Vec<Value>> {
    let found = schema.get("oneOf").or_else(|| schema.get("anyOf"));
    found.and_then(Value::as_array)
}

/// A value as a TOML file has it.
fn toml(value: &Value) -> String {
    match value {
        Value::Array(all) => {
            let all: Vec<String> = all.iter().map(toml).collect();
            format!("[{}]", all.join(", "))
        }
        Value::Number(number) => plain(number),
        other => other.to_string(),
    }
}

fn plain(number: &Number) -> String {
    if !number.is_f64() {
        return number.to_string();
    }
    let number = number.as_f64().unwrap_or_default();
    if number != 0.0 && !(1e-4..1e7).contains(&number.abs()) {
        format!("{number:e}")
    } else {
        number.to_string()
    }
}

impl<'a> Reference<'a> {
    fn paragraph(&mut self, text: &str) {
        if !text.is_empty() {
            let _ = writeln!(self.text, "\n{text}");
        }
    }

    /// The schema behind references, and the name of its definition.
    fn resolve(&self, schema: &'a Value) -> (&'a Value, Option<&'a str>) {
        if let Some(inner) = only(schema) {
            return self.resolve(inner);
        }
        let name = schema.get("$ref").and_then(Value::as_str);
        let name = name.and_then(|path| path.rsplit('/').next());
        let found = name.and_then(|name| self.definitions?.get(name));
        found.map_or((schema, None), |schema| (schema, name))
    }

    fn section(&mut self, section: &Section, definition: &'a Value) {
        let _ = writeln!(self.text, "\n## `{}`", section.heading());
        self.paragraph(&words(definition));
        self.keys(section, definition);
    }

    fn keys(&mut self, section: &Section, schema: &'a Value) {
        let Some(properties) = schema.get("properties").and_then(Value::as_object) else {
            return;
        };
        let required: Vec<&str> = schema
            .get("required")
            .and_then(Value::as_array)
            .map(|keys| keys.iter().filter_map(Value::as_str).collect())
            .unwrap_or_default();
        self.text
            .push_str("\n| Key | Value | Meaning |\n|---|---|---|\n");
        for (key, property) in properties.iter().filter(|(_, each)| is_present(each)) {
            let mut value = self.value(section, key, property);
            if required.contains(&key.as_str()) {
                value.push_str("; **required**");
            }
            if let Some(default) = self.default(property) {
                let _ = write!(value, "; default `{default}`");
            }
            let meaning = self.meaning(property);
            let _ = writeln!(
                self.text,
                "| `{key}` | {} | {} |",
                cell(&value),
                cell(&meaning)
            );
        }
    }

    /// What a key may be.
    fn value(&mut self, section: &Section, key: &str, schema: &'a Value) -> String {
        let (inner, name) = self.resolve(schema);
        if let Some(constant) = inner.get("const") {
            return format!("`{}`", toml(constant));
        }
        if let Some(all) = inner.get("enum").and_then(Value::as_array) {
            let all: Vec<String> = all.iter().map(|each| format!("`{}`", toml(each))).collect();
            return all.join(" or ");
        }
        if let Some(all) = alternatives(inner) {
            let all: Vec<String> = all
                .iter()
                .filter(|each| is_present(each))
                .map(|each| self.value(section, key, each))
                .collect();
            return all.join(" or ");
        }
        match inner.get("type").and_then(Value::as_str) {
            Some("number") => range("number", inner),
            Some("integer") => range("whole number", inner),
            Some("boolean") => "`true` or `false`".to_owned(),
            Some("string") => "text".to_owned(),
            Some("array") => self.list(section, key, inner),
            Some("object") if inner.get("properties").is_some() => {
                self.table(section.of(key, false), inner, name)
            }
            Some("object") => match inner.get("additionalProperties") {
                Some(each) if each.is_object() => {
                    format!("table, of {} each", self.value(section, key, each))
                }
                _ => "table".to_owned(),
            },
            _ => "any value".to_owned(),
        }
    }

    fn list(&mut self, section: &Section, key: &str, schema: &'a Value) -> String {
        let Some(items) = schema.get("items") else {
            return "list".to_owned();
        };
        if let Some(each) = items.as_array() {
            let each: Vec<String> = each
                .iter()
                .map(|each| self.value(section, key, each))
                .collect();
            return format!("[{}]", each.join("; "));
        }
        let (inner, name) = self.resolve(items);
        if inner.get("properties").is_some() {
            return self.table(section.of(key, true), inner, name);
        }
        let limit = |key: &str| schema.get(key).and_then(Value::as_u64);
        let each = self.value(section, key, items);
        match (limit("minItems"), limit("maxItems")) {
            (Some(least), Some(most)) if least == most => format!("{least} of: {each}"),
            _ => format!("list of: {each}"),
        }
    }

    /// A table of its own: a link to its section, which is written once for each definition.
    fn table(&mut self, section: Section, schema: &'a Value, name: Option<&str>) -> String {
        let known = name.and_then(|name| self.sections.get(name));
        if let Some(known) = known.filter(|known| known.path != section.path) {
            return format!("table, with the keys of {}", known.link());
        }
        let link = section.link();
        if let Some(name) = name {
            self.sections.insert(name.to_owned(), section.clone());
        }
        self.waiting.push_back((section, schema));
        link
    }

    /// The default, unless it is a table, whose section has its own.
    fn default(&self, schema: &'a Value) -> Option<String> {
        let (inner, _) = self.resolve(schema);
        let default = schema.get("default").or_else(|| inner.get("default"))?;
        let said = !default.is_object() && !default.is_null() && default.as_str() != Some("");
        let empty = default.as_array().is_some_and(Vec::is_empty);
        (said && !empty).then(|| toml(default))
    }

    /// What a key means, and each of the words that it may be.
    fn meaning(&self, schema: &'a Value) -> String {
        let (inner, _) = self.resolve(schema);
        let own = words(schema);
        let mut text = if own.is_empty() { words(inner) } else { own };
        let all = alternatives(inner).into_iter().flatten();
        for each in all.filter(|each| is_present(each)) {
            if let (Some(word), said) = (each.get("const"), words(each))
                && !said.is_empty()
            {
                let gap = if text.is_empty() { "" } else { " " };
                let _ = write!(text, "{gap}`{}`: {said}", toml(word));
            }
        }
        text
    }
}

fn range(kind: &str, schema: &Value) -> String {
    let bound = |keys: [&str; 2]| {
        let found = keys.iter().find_map(|key| schema.get(*key));
        found.and_then(Value::as_number).map(plain)
    };
    let least = bound(["minimum", "exclusiveMinimum"]);
    let above = schema.get("exclusiveMinimum").is_some();
    let most = bound(["maximum", "exclusiveMaximum"]);
    match (least, most) {
        (Some(least), Some(most)) if above => format!("{kind} above {least}, to {most}"),
        (Some(least), Some(most)) => format!("{kind}, {least} to {most}"),
        (Some(least), None) if above => format!("{kind} above {least}"),
        (Some(least), None) => format!("{kind}, {least} or more"),
        (None, Some(most)) => format!("{kind}, {most} or less"),
        (None, None) => kind.to_owned(),
    }
}

/// In a cell of a table.
fn cell(text: &str) -> String {
    text.replace('|', "\\|").replace("\n\n", "<br>")
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn example() -> Value {
        json!({
            "description": "A file.",
            "properties": {
                "name": { "type": "string", "description": "Its name." },
                "way": { "allOf": [{ "$ref": "#/definitions/Way" }], "default": "up" },
                "box": { "$ref": "#/definitions/Box" },
                "boxes": { "type": "array", "items": { "$ref": "#/definitions/Box" } },
                "limit": {
                    "anyOf": [{ "type": "number", "minimum": 0.0, "maximum": 5.0 }, { "enum": ["off"] }],
                    "default": "off",
                    "description": "`|x|` in\nmm."
                },
            },
            "required": ["name"],
            "definitions": {
                "Way": { "oneOf": [{ "const": "up", "description": "Upwards." }, { "const": "down" }] },
                "Box": {
                    "type": "object",
                    "description": "A box.",
                    "properties": {
                        "size_mm": {
                            "type": "array", "minItems": 3, "maxItems": 3,
                            "items": { "type": "number", "exclusiveMinimum": 0.0 },
                            "default": [1.0, 2.0, 3.5]
                        }
                    }
                }
            }
        })
    }

    #[test]
    fn every_key_has_its_row_and_every_table_one_section() {
        let text = schema_markdown("Keys", &example());
        let expected = "\
# Keys

A file.

| Key | Value | Meaning |
|---|---|---|
| `box` | [`[box]`](#box) | A box. |
| `boxes` | table, with the keys of [`[box]`](#box) |  |
| `limit` | number, 0 to 5 or `\"off\"`; default `\"off\"` | `\\|x\\|` in mm. |
| `name` | text; **required** | Its name. |
| `way` | `\"up\"` or `\"down\"`; default `\"up\"` | `\"up\"`: Upwards. |

## `[box]`

A box.

| Key | Value | Meaning |
|---|---|---|
| `size_mm` | 3 of: number above 0; default `[1, 2, 3.5]` |  |
";
        assert_eq!(text, expected);
    }
}
