//! What is wrong with a value, by its schema.

use std::fmt;

use toml::Value;

use super::node::{Limits, List, Node, Table, Text};
use super::unit::{in_words, quantity, unit_of, written};
use super::{FORMER_NAMES_UNTIL, SWITCHED_OFF};
use crate::nearest_name;

/// One thing that does not fit.
#[derive(Debug, Clone, PartialEq)]
pub struct Misfit {
    /// The key at fault: `goals[0].entry_mm[2]`.
    pub key: String,
    /// What kind of thing is wrong.
    pub kind: MisfitKind,
    /// What is wrong, with the value.
    pub message: String,
    /// How to mend it.
    pub hint: Option<String>,
}

/// What kind of thing does not fit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MisfitKind {
    /// A key that is not known.
    Unknown,
    /// A former name of a key that is there too.
    Former,
    /// A key that is not there; `key` names it.
    Missing,
    /// A value of another type, or none of those that there are.
    Type,
    /// A value of the right type outside its range.
    Range,
}

/// Way from the top of a file to a value.
#[derive(Clone, Copy)]
pub enum Path<'a> {
    /// The whole file.
    Top,
    /// A key of a table.
    Key(&'a Path<'a>, &'a str),
    /// An item of a list, from 0.
    Index(&'a Path<'a>, usize),
}

impl Path<'_> {
    /// Name of the last key.
    fn name(&self) -> &str {
        match self {
            Self::Top => "",
            Self::Key(_, name) => name,
            Self::Index(list, _) => list.name(),
        }
    }
}

impl fmt::Display for Path<'_> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Top => Ok(()),
            Self::Key(table, name) => {
                if !matches!(table, Self::Top) {
                    write!(formatter, "{table}.")?;
                }
                let is_bare = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
                if name.chars().all(is_bare) {
                    formatter.write_str(name)
                } else {
                    write!(formatter, "\"{name}\"")
                }
            }
            Self::Index(list, index) => write!(formatter, "{list}[{index}]"),
        }
    }
}

impl Node {
    /// All that is wrong with a value, in the order of its keys.
    pub fn check(&self, at: Path<'_>, value: &Value, found: &mut Vec<Misfit>) {
        match (self, value) {
            (Self::Anything, _) | (Self::Truth, Value::Boolean(_)) => {}
            (Self::Number(limits), Value::String(word))
                if limits.or_off && word == SWITCHED_OFF => {}
            (Self::Number(limits), Value::Float(number)) => limits.check(at, *number, found),
            (Self::Number(limits), Value::Integer(number)) => {
                limits.check(at, *number as f64, found);
            }
            (Self::Whole(limits), Value::Integer(number)) => limits.check(at, *number, found),
            (Self::Text(text), Value::String(value)) => text.check(at, value, found),
            (Self::List(list), Value::Array(values)) => list.check(at, values, found),
            (Self::Table(table), Value::Table(values)) => table.check(at, values, found),
            _ => found.push(self.other_type(at, value)),
        }
    }

    fn other_type(&self, at: Path<'_>, value: &Value) -> Misfit {
        let expected = match self {
            Self::Anything => "a value",
            Self::Truth => "true or false",
            Self::Number(limits) if limits.or_off => "a number or \"off\"",
            Self::Number(_) => "a number",
            Self::Whole(_) => "a whole number",
            Self::Text(_) => "a string",
            Self::List(_) => "a list",
            Self::Table(_) => "a table",
        };
        let hint = match self {
            Self::Number(limits) if limits.or_off => Some(format!(
                "the only word allowed is \"{SWITCHED_OFF}\", which switches it off"
            )),
            Self::Number(_) => Some(match in_words(unit_of(at.name())) {
                "" => "give a plain number, in the unit in its name".to_owned(),
                unit => format!("give a plain number, in {unit}"),
            }),
            Self::Whole(_) => {
                Some("give a plain whole number, without a unit and quotes".to_owned())
            }
            Self::Truth => Some("write true or false, without quotes".to_owned()),
            Self::List(List { items, .. }) => Some(match (&items[0], value) {
                (Self::Table(_), Value::Table(_)) => {
                    format!("there may be several: write [[{at}]] in double brackets, one for each")
                }
                (Self::Table(_), _) => format!("write a [[{at}]] section for each"),
                (Self::Text(_), Value::String(_)) => format!("write it in brackets: [{value}]"),
                _ => format!("such as `{} = {}`", at.name(), self.example(at.name())),
            }),
            Self::Table(table) => Some(table.as_example(at)),
            Self::Text(_) => match value {
                Value::Array(_) | Value::Table(_) => None,
                _ => Some(format!("write it in quotes: \"{value}\"")),
            },
            Self::Anything => None,
        };
        Misfit {
            key: at.to_string(),
            kind: MisfitKind::Type,
            message: format!("expected {expected}, got {}", shown(value)),
            hint,
        }
    }
}

/// A value in a message.
fn shown(value: &Value) -> String {
    /// Longer values are named by their type.
    const LONGEST: usize = 60;
    let text = value.to_string();
    if text.len() <= LONGEST && !text.contains('\n') {
        return format!("`{text}`");
    }
    match value {
        Value::Array(_) => "a list",
        Value::Table(_) => "a table",
        _ => "a long string",
    }
    .to_owned()
}

/// Numbers that have limits.
pub trait Limited: Copy + PartialOrd + fmt::Display {
    fn is_finite(self) -> bool;
    fn times(self, factor: i32) -> Self;
    /// As a message writes it.
    fn written(self) -> String {
        self.to_string()
    }
}

impl Limited for f64 {
    fn is_finite(self) -> bool {
        self.is_finite()
    }
    fn times(self, factor: i32) -> Self {
        self * f64::from(factor)
    }
    fn written(self) -> String {
        written(self)
    }
}

impl Limited for i64 {
    fn is_finite(self) -> bool {
        true
    }
    fn times(self, factor: i32) -> Self {
        self.saturating_mul(factor.into())
    }
}

impl<N: Limited> Limits<N> {
    pub(super) fn holds(&self, number: N) -> bool {
        let is_enough = if self.above_least {
            number > self.least
        } else {
            number >= self.least
        };
        is_enough && number <= self.most
    }

    fn check(&self, at: Path<'_>, number: N, found: &mut Vec<Misfit>) {
        if self.holds(number) {
            return;
        }
        let misfit = |message: String, hint: String| Misfit {
            key: at.to_string(),
            kind: MisfitKind::Range,
            message,
            hint: Some(hint),
        };
        if !number.is_finite() {
            let message = format!("`{at}` is {number}, which is not a finite number");
            found.push(misfit(message, "give a finite number".to_owned()));
            return;
        }
        let Self { least, most, .. } = self;
        let space = if self.unit.is_empty() { "" } else { " " };
        let without = if self.above_least {
            format!(", without {} itself", least.written())
        } else {
            String::new()
        };
        found.push(misfit(
            format!(
                "`{at}` is {}{space}{}, outside {} to {}{without}",
                number.written(),
                self.unit,
                least.written(),
                most.written()
            ),
            self.hint_about(number),
        ));
    }

    fn hint_about(&self, number: N) -> String {
        if let Some(hint) = &self.hint {
            return hint.clone();
        }
        if self.or_off {
            let unit = match self.unit.as_str() {
                "" => "it is a plain number".to_owned(),
                unit => format!("the value is in {unit}"),
            };
            return format!("{unit}; \"{SWITCHED_OFF}\" switches it off");
        }
        let meant = |factor: i32| self.unit == "mm" && self.holds(number.times(factor));
        match self.unit.as_str() {
            "" => "it is a plain number, without a unit".to_owned(),
            "mm" if meant(1000) => "the value is in millimetres: did you give metres?".to_owned(),
            "mm" if meant(10) => {
                "the value is in millimetres: did you give centimetres?".to_owned()
            }
            unit => format!("the value is in {unit}"),
        }
    }
}

impl Text {
    fn check(&self, at: Path<'_>, value: &str, found: &mut Vec<Misfit>) {
        let (message, hint) = if !self.one_of.is_empty() {
            if self.one_of.iter().any(|each| each == value) || self.former.contains_key(value) {
                return;
            }
            let message = format!("`{value}` is not a valid value of `{at}`");
            let known = self.one_of.iter().map(String::as_str);
            let hint = match nearest_name(value, known) {
                Some(near) => format!("did you mean `{near}`?"),
                None => format!("one of {}", self.one_of.join(", ")),
            };
            (message, hint)
        } else if let Some(more) = &self.name_with {
            let may_be = |c: char| c.is_ascii_alphanumeric() || more.contains(c);
            if !value.is_empty() && value.chars().all(may_be) {
                let letters = value.chars().count();
                if letters > self.longest {
                    let why = self.hint.as_ref();
                    found.push(Misfit {
                        key: at.to_string(),
                        kind: MisfitKind::Type,
                        message: format!(
                            "`{at}` has {letters} characters, more than {}",
                            self.longest
                        ),
                        hint: Some(
                            why.map_or("shorten it".to_owned(), |why| format!("shorten it: {why}")),
                        ),
                    });
                }
                return;
            }
            let hint = match more.as_str() {
                "_" => "letters, digits and `_`",
                _ => "letters, digits, `-` and `_`",
            };
            (
                format!("`{value}` is not a usable name"),
                match &self.hint {
                    Some(why) => format!("{hint}: {why}"),
                    None => hint.to_owned(),
                },
            )
        } else {
            return;
        };
        found.push(Misfit {
            key: at.to_string(),
            kind: MisfitKind::Type,
            message,
            hint: Some(hint),
        });
    }
}

impl List {
    /// How to fix a list of another length.
    fn hint_about(&self, at: Path<'_>, values: &[Value]) -> Option<String> {
        let is_whole = |value: &Value| value.is_integer();
        // Lists without an end have the largest number as their most.
        let is_double = values.len().is_multiple_of(2) && values.len() / 2 == self.most;
        let are_halves = is_double && values.iter().all(is_whole);
        if are_halves {
            let pairs = values
                .chunks(2)
                .map(|pair| format!("{}.{}", pair[0], pair[1]));
            let numbers: Vec<String> = pairs.collect();
            return Some(format!(
                "use points for decimals and commas between numbers: [{}]",
                numbers.join(", ")
            ));
        }
        let example = || {
            let node = Node::List(self.clone());
            format!("such as `{} = {}`", at.name(), node.example(at.name()))
        };
        self.hint
            .clone()
            .or_else(|| (self.least == self.most).then(example))
    }

    /// What an item is.
    pub fn item(&self, index: usize) -> &Node {
        &self.items[index.min(self.items.len() - 1)]
    }

    fn check(&self, at: Path<'_>, values: &[Value], found: &mut Vec<Misfit>) {
        let count = values.len();
        if !(self.least..=self.most).contains(&count) {
            let wanted = match (self.least, self.most) {
                (least, most) if least == most => format!("{least}"),
                (least, usize::MAX) => format!("at least {least}"),
                (least, most) => format!("{least} to {most}"),
            };
            found.push(Misfit {
                key: at.to_string(),
                kind: MisfitKind::Type,
                message: format!(
                    "{} has length {count}, expected {wanted}",
                    shown(&Value::Array(values.to_vec()))
                ),
                hint: self.hint_about(at, values),
            });
            return;
        }
        for (index, value) in values.iter().enumerate() {
            self.item(index)
                .check(Path::Index(&at, index), value, found);
        }
    }
}

impl Table {
    /// How to write such a table.
    fn as_example(&self, at: Path<'_>) -> String {
        let required = self.keys.iter().filter(|(_, entry)| entry.is_required);
        let keys: Vec<String> = required
            .map(|(key, entry)| format!("\n    {key} = {}", entry.node.example(key)))
            .collect();
        if keys.is_empty() {
            return "it is a section with keys of its own".to_owned();
        }
        // Of one in a list the section is the list's.
        let section: String = at
            .to_string()
            .split('[')
            .next()
            .unwrap_or_default()
            .to_owned();
        let section = match at.to_string().rsplit_once("].") {
            Some((_, name)) => format!("{section}.{name}"),
            None => section,
        };
        format!("it is a section:\n\n    [{section}]{}", keys.concat())
    }

    pub fn check(&self, at: Path<'_>, values: &toml::Table, found: &mut Vec<Misfit>) {
        let mut meant: Vec<&str> = Vec::new();
        for (key, value) in values {
            let here = Path::Key(&at, key);
            if let Some(entry) = self.keys.get(key) {
                entry.node.check(here, value, found);
                continue;
            }
            match self.others.as_deref() {
                Some((names, node)) if names.one_of.is_empty() || names.one_of.contains(key) => {
                    node.check(here, value, found);
                }
                others => {
                    let known: Vec<&str> = match others {
                        Some((names, _)) => names.one_of.iter().map(String::as_str).collect(),
                        None => self.present_names(),
                    };
                    let nearest = nearest_key(key, &known);
                    meant.extend(nearest);
                    found.push(Misfit {
                        key: here.to_string(),
                        kind: MisfitKind::Unknown,
                        message: format!("unknown key `{key}`"),
                        hint: Some(unknown_key_hint(key, &known)),
                    });
                }
            }
        }
        for (old, key) in &self.former {
            if values.contains_key(old) && values.contains_key(key) {
                found.push(Misfit {
                    key: Path::Key(&at, old).to_string(),
                    kind: MisfitKind::Former,
                    message: format!(
                        "`{old}` is the former name of `{key}`, which stands here too"
                    ),
                    hint: Some(format!("remove `{old}`")),
                });
                meant.push(key);
            } else if values.contains_key(old) {
                meant.push(key);
            }
        }
        for (key, entry) in &self.keys {
            // A key that is there under a wrong name is not missing besides.
            if entry.is_required && !values.contains_key(key) && !meant.contains(&key.as_str()) {
                found.push(Misfit {
                    key: Path::Key(&at, key).to_string(),
                    kind: MisfitKind::Missing,
                    message: format!("the key `{key}` is missing"),
                    hint: Some(format!("add `{key} = {}`", entry.node.example(key))),
                });
            }
        }
    }
}

impl Node {
    fn former_names(&self, at: Path<'_>, value: &Value, found: &mut Vec<String>) {
        match (self, value) {
            (Self::Table(table), Value::Table(values)) => table.former_names(at, values, found),
            (Self::List(list), Value::Array(values)) => {
                for (index, value) in values.iter().enumerate() {
                    let item = list.item(index);
                    item.former_names(Path::Index(&at, index), value, found);
                }
            }
            (Self::Text(text), Value::String(value)) => {
                if let Some(name) = text.former.get(value) {
                    found.push(former_name(
                        &format!("{at} = \"{value}\""),
                        &format!("\"{name}\""),
                    ));
                }
            }
            _ => {}
        }
    }
}

impl Table {
    /// A note for each former name of a key or a choice.
    pub(super) fn former_names(&self, at: Path<'_>, values: &toml::Table, found: &mut Vec<String>) {
        for (key, value) in values {
            let here = Path::Key(&at, key);
            if let Some(name) = self.former.get(key) {
                found.push(former_name(&here.to_string(), name));
            }
            let others = || self.others.as_deref().map(|(_, node)| node);
            let node = self.keys.get(key).map(|entry| &entry.node).or_else(others);
            if let Some(node) = node {
                node.former_names(here, value, found);
            }
        }
    }
}

fn former_name(old: &str, name: &str) -> String {
    format!("`{old}` is now `{name}`; the old name is accepted until {FORMER_NAMES_UNTIL}")
}

/// The known key that an unknown one is most like.
fn nearest_key<'k>(unknown: &str, known: &[&'k str]) -> Option<&'k str> {
    let same = known.iter().find(|key| quantity(key) == quantity(unknown));
    same.copied()
        .or_else(|| nearest_name(unknown, known.iter().copied()))
}

/// How to fix a key that is not known; `known` are those that are.
pub(super) fn unknown_key_hint(unknown: &str, known: &[&str]) -> String {
    match nearest_key(unknown, known) {
        Some(same) if quantity(same) == quantity(unknown) => {
            format!("did you mean `{same}`? The key states the unit")
        }
        Some(near) => format!("did you mean `{near}`?"),
        None if known.is_empty() => "it takes no keys".to_owned(),
        None => format!("known keys: {}", known.join(", ")),
    }
}
