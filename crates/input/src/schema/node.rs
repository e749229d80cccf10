//! A schema as a tree, for quick checks.

use std::collections::BTreeMap;

use serde_json::Value;

use super::unit::{written, written_after};
use super::{FORMER, HINT, OFF, UNIT};

/// What a value may be.
#[derive(Debug, Clone, PartialEq)]
pub enum Node {
    /// Anything at all.
    Anything,
    /// True or false.
    Truth,
    /// A number.
    Number(Limits<f64>),
    /// A whole number.
    Whole(Limits<i64>),
    /// A text.
    Text(Text),
    /// A list.
    List(List),
    /// A table.
    Table(Table),
}

/// Least and greatest value.
#[derive(Debug, Clone, PartialEq)]
pub struct Limits<N> {
    pub least: N,
    pub most: N,
    /// The least value itself is left out.
    pub above_least: bool,
    /// The word "off" may stand in its place.
    pub or_off: bool,
    /// As written after a number; empty for plain numbers.
    pub unit: String,
    /// How to fix what is outside, if there is more to say than the unit.
    pub hint: Option<String>,
}

#[derive(Debug, Clone, PartialEq)]
pub struct Text {
    /// All that it may be, unless empty.
    pub one_of: Vec<String>,
    /// Former names of those, and what they are now.
    pub former: BTreeMap<String, String>,
    /// Characters that a name may have besides letters and digits; any text if there is none.
    pub name_with: Option<String>,
    /// Characters that it may have at most.
    pub longest: usize,
    pub hint: Option<String>,
}

#[derive(Debug, Clone, PartialEq)]
pub struct List {
    /// What its items are; the last is for all that follow.
    pub items: Vec<Node>,
    pub least: usize,
    pub most: usize,
    pub hint: Option<String>,
}

#[derive(Debug, Clone, Default, PartialEq)]
pub struct Table {
    pub keys: BTreeMap<String, Entry>,
    /// Former names of keys, which are among the keys too, and what they are now.
    pub former: BTreeMap<String, String>,
    /// What keys besides these may be, and have for a value; none if there is none.
    pub others: Option<Box<(Text, Node)>>,
}

#[derive(Debug, Clone, PartialEq)]
pub struct Entry {
    pub node: Node,
    pub is_required: bool,
}

/// What a value inherits from the key that it stands under.
#[derive(Clone, Copy, Default)]
struct Under<'a> {
    unit: &'a str,
    hint: Option<&'a str>,
}

impl Node {
    /// The tree of a schema.
    ///
    /// # Panics
    /// Where the schema says what this tree cannot: a bug that the tests of every schema find.
    pub fn of(root: &Value) -> Self {
        Self::read(root, root, Under::default())
    }

    fn read(root: &Value, here: &Value, under: Under<'_>) -> Self {
        if here.as_bool() == Some(true) {
            return Self::Anything;
        }
        let under = Under {
            unit: here[UNIT].as_str().unwrap_or(under.unit),
            hint: here[HINT].as_str().or(under.hint),
        };
        let one_of = || Text::one_of(here, under);
        if let Some(reference) = here["$ref"].as_str() {
            let found = root.pointer(reference.trim_start_matches('#'));
            return Self::read(root, found.expect("a schema defines what it names"), under);
        }
        if let Some([only]) = here["allOf"].as_array().map(Vec::as_slice) {
            return Self::read(root, only, under);
        }
        if here["oneOf"].is_array() || here["enum"].is_array() && here["type"] == "string" {
            return Self::Text(one_of());
        }
        if here["anyOf"].is_array() {
            // Names that are known, and others: where they are read it shows whether they exist.
            return Self::Text(Text::default());
        }
        match here["type"].as_str() {
            Some("boolean") => Self::Truth,
            Some("number") => Self::Number(Limits::of(here, under, Value::as_f64, f64::MAX)),
            #[expect(clippy::cast_possible_truncation, reason = "limits are whole numbers")]
            Some("integer") => {
                let whole = |value: &Value| {
                    let number = value.as_f64().map(|number| number as i64);
                    value.as_i64().or(number)
                };
                Self::Whole(Limits::of(here, under, whole, i64::MAX))
            }
            Some("string") => Self::Text(Text {
                one_of: Vec::new(),
                former: BTreeMap::new(),
                name_with: here["pattern"].as_str().map(characters_of_names),
                longest: here["maxLength"]
                    .as_u64()
                    .and_then(|most| usize::try_from(most).ok())
                    .unwrap_or(usize::MAX),
                hint: under.hint.map(str::to_owned),
            }),
            Some("array") => {
                let count = |key: &str| here[key].as_u64().and_then(|n| usize::try_from(n).ok());
                let of_item = Under {
                    hint: None,
                    ..under
                };
                let items = match &here["items"] {
                    Value::Array(items) => items.as_slice(),
                    item => std::slice::from_ref(item),
                };
                let items = items.iter().map(|item| Self::read(root, item, of_item));
                Self::List(List {
                    items: items.collect(),
                    least: count("minItems").unwrap_or(0),
                    most: count("maxItems").unwrap_or(usize::MAX),
                    hint: under.hint.map(str::to_owned),
                })
            }
            Some("object") => Self::Table(Table::of(root, here)),
            _ => panic!("no way to check {here}"),
        }
    }
}

impl Node {
    /// A value that such a key may have, to be put in its place and changed.
    pub(super) fn example(&self, key: &str) -> String {
        match self {
            Self::Anything => "...".to_owned(),
            Self::Truth => "true".to_owned(),
            Self::Number(limits) => {
                let number = if limits.holds(0.0) { 0.0 } else { limits.least };
                written(number)
            }
            Self::Whole(limits) => {
                let number = if limits.holds(1) { 1 } else { limits.least };
                number.to_string()
            }
            Self::Text(text) => match (text.one_of.first(), key) {
                (Some(first), _) => format!("\"{first}\""),
                (None, "file") => "\"part.stl\"".to_owned(),
                (None, key) => format!("\"my_{key}\""),
            },
            Self::List(list) => {
                let items = (0..list.least).map(|index| list.item(index).example(key));
                let items: Vec<String> = items.collect();
                format!("[{}]", items.join(", "))
            }
            Self::Table(table) => {
                let required = table.keys.iter().filter(|(_, entry)| entry.is_required);
                let keys: Vec<String> = required
                    .map(|(key, entry)| format!("{key} = {}", entry.node.example(key)))
                    .collect();
                format!("{{ {} }}", keys.join(", "))
            }
        }
    }

    /// Sections that have a key of this name, as they are written: `[tool]`, `[[goals]]`, `[planning.needle_route]`.
    pub(super) fn sections_with(&self, key: &str) -> Vec<String> {
        let mut found = Vec::new();
        self.add_sections_with(key, "", false, &mut found);
        found
    }

    fn add_sections_with(&self, key: &str, here: &str, is_listed: bool, found: &mut Vec<String>) {
        match self {
            Self::List(list) => {
                for item in &list.items {
                    item.add_sections_with(key, here, true, found);
                }
            }
            Self::Table(table) => {
                if !here.is_empty() && table.keys.contains_key(key) {
                    found.push(if is_listed {
                        format!("[[{here}]]")
                    } else {
                        format!("[{here}]")
                    });
                }
                for (name, entry) in &table.keys {
                    let inner = match here {
                        "" => name.clone(),
                        here => format!("{here}.{name}"),
                    };
                    entry.node.add_sections_with(key, &inner, false, found);
                }
            }
            _ => {}
        }
    }
}

impl<N: Copy> Limits<N> {
    fn of(here: &Value, under: Under<'_>, read: impl Fn(&Value) -> Option<N>, most: N) -> Self
    where
        N: std::ops::Neg<Output = N>,
    {
        let above = read(&here["exclusiveMinimum"]);
        Self {
            least: above.or_else(|| read(&here["minimum"])).unwrap_or(-most),
            most: read(&here["maximum"]).unwrap_or(most),
            above_least: above.is_some(),
            or_off: here[OFF] == true,
            unit: under.unit.to_owned(),
            hint: under.hint.map(str::to_owned),
        }
    }
}

impl Default for Text {
    /// Any text.
    fn default() -> Self {
        Self {
            one_of: Vec::new(),
            former: BTreeMap::new(),
            name_with: None,
            longest: usize::MAX,
            hint: None,
        }
    }
}

impl Text {
    /// Of what is listed under `oneOf` or `enum`.
    fn one_of(here: &Value, under: Under<'_>) -> Self {
        let listed = |value: &Value| -> Vec<String> {
            let values = value["enum"].as_array().into_iter().flatten();
            let values = values.chain(value.get("const"));
            values
                .filter_map(|each| each.as_str().map(str::to_owned))
                .collect()
        };
        let choices = here["oneOf"].as_array().into_iter().flatten();
        let choices = choices.filter(|each| each["deprecated"] != true);
        let mut one_of = listed(here);
        let mut former = BTreeMap::new();
        for choice in choices {
            if let (Some(old), Some(new)) = (choice[FORMER].as_str(), choice["const"].as_str()) {
                former.insert(old.to_owned(), new.to_owned());
            }
            one_of.extend(listed(choice));
        }
        assert!(!one_of.is_empty(), "no texts to choose from in {here}");
        Self {
            one_of,
            former,
            name_with: None,
            longest: usize::MAX,
            hint: under.hint.map(str::to_owned),
        }
    }
}

impl Table {
    fn of(root: &Value, here: &Value) -> Self {
        let required: Vec<&str> = here["required"]
            .as_array()
            .into_iter()
            .flatten()
            .filter_map(Value::as_str)
            .collect();
        let keys = here["properties"].as_object().into_iter().flatten();
        let keys = keys.map(|(key, inner)| {
            let under = Under {
                unit: written_after(key),
                hint: None,
            };
            let entry = Entry {
                node: Node::read(root, inner, under),
                is_required: required.contains(&key.as_str()),
            };
            (key.clone(), entry)
        });
        let named = here["properties"].as_object().into_iter().flatten();
        let former = named.filter_map(|(key, inner)| {
            let old = inner[FORMER].as_str()?;
            Some((old.to_owned(), key.clone()))
        });
        let former = former.collect();
        let others = match &here["additionalProperties"] {
            Value::Bool(false) => None,
            Value::Null => Some((Text::default(), Node::Anything)),
            others => {
                let names = here.get("propertyNames");
                let names = names.map(|names| Text::one_of(names, Under::default()));
                let under = Under::default();
                Some((names.unwrap_or_default(), Node::read(root, others, under)))
            }
        };
        Self {
            keys: keys.collect(),
            former,
            others: others.map(Box::new),
        }
    }

    /// The keys by the names that they have now.
    pub(super) fn present_names(&self) -> Vec<&str> {
        let names = self.keys.keys().map(String::as_str);
        names
            .filter(|key| !self.former.contains_key(*key))
            .collect()
    }
}

/// The characters that a pattern of names allows besides letters and digits.
fn characters_of_names(pattern: &str) -> String {
    let inside = pattern
        .strip_prefix("^[A-Za-z0-9")
        .and_then(|rest| rest.strip_suffix("]+$"));
    inside
        .unwrap_or_else(|| panic!("{pattern} is not a pattern of names"))
        .to_owned()
}
