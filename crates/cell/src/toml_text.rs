//! TOML files into structs, with messages that name file, line, key and value.

use std::ops::Range;

use serde::de::DeserializeOwned;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

use crate::{Finding, nearest_name};

/// A parsed file together with where everything stands in it.
#[derive(Debug)]
pub(crate) struct TomlText<'a> {
    pub file: &'a str,
    pub text: &'a str,
    table: Spanned<DeTable<'a>>,
}

impl<'a> TomlText<'a> {
    /// Of values that stand in no text: findings have keys but no lines.
    pub(crate) fn without_text(file: &'a str) -> Self {
        let table = Spanned::new(0..0, DeTable::new());
        Self {
            file,
            text: "",
            table,
        }
    }

    pub(crate) fn parse(file: &'a str, text: &'a str) -> Result<Self, Finding> {
        let table = DeTable::parse(text).map_err(|error| {
            let mut message = error.message().to_owned();
            let Some(span) = error.span() else {
                return Finding::new(file, message);
            };
            if message == "duplicate key"
                && let Some(key) = text.get(span.clone())
            {
                message = format!("duplicate key `{key}`");
            }
            Finding::new(file, message).at(text, span)
        })?;
        let parsed = Self { file, text, table };
        parsed.refuse_non_finite()?;
        Ok(parsed)
    }

    /// The whole file as a struct.
    pub(crate) fn deserialize<T: DeserializeOwned>(&self) -> Result<T, Finding> {
        let deserializer = toml::Deserializer::parse(self.text)
            .map_err(|error| Finding::new(self.file, error.message().to_owned()))?;
        serde_path_to_error::deserialize(deserializer).map_err(|error| {
            let path = error.path().to_string();
            let inner = error.into_inner();
            let Misfit {
                key,
                mut message,
                hint,
            } = Misfit::read(path, inner.message());
            let mut finding = Finding::new(self.file, "");
            if let Some(span) = inner.span() {
                finding = finding.at(self.text, span);
            }
            let value = finding.span.clone().and_then(|span| self.text.get(span));
            let short = |value: &&str| !value.is_empty() && !value.contains('\n');
            if Misfit::is_of_type(inner.message())
                && let Some(value) = value.filter(short)
                && !message.contains(value)
            {
                message = format!("{message}, got `{value}`");
            }
            finding.message = message;
            finding.hint = hint;
            finding.key(key)
        })
    }

    /// Where the value of a key stands: `goals[0].entry_mm` and so on.
    pub(crate) fn span_of(&self, path: &str) -> Option<Range<usize>> {
        let mut at: Option<(&DeValue<'_>, Range<usize>)> = None;
        for part in path.split('.') {
            let (name, indices) = part
                .split_once('[')
                .map_or((part, ""), |(n, rest)| (n, rest));
            let table = match at {
                None => self.table.get_ref(),
                Some((DeValue::Table(table), _)) => table,
                Some(_) => return at.map(|(_, span)| span),
            };
            let found = table.get(name)?;
            at = Some((found.get_ref(), found.span()));
            for index in indices.split('[').filter(|text| !text.is_empty()) {
                let index: usize = index.trim_end_matches(']').parse().ok()?;
                let Some((DeValue::Array(array), _)) = at else {
                    return None;
                };
                let found = array.get(index)?;
                at = Some((found.get_ref(), found.span()));
            }
        }
        at.map(|(_, span)| span)
    }

    /// A finding about a key of this file; a missing key's is placed at the table that lacks it.
    pub(crate) fn finding(&self, key: &str, message: impl Into<String>) -> Finding {
        let finding = Finding::new(self.file, message).key(key);
        let mut path = key;
        loop {
            if let Some(span) = self.span_of(path) {
                return finding.at(self.text, span);
            }
            match path.rfind('.') {
                Some(dot) => path = &path[..dot],
                None => return finding,
            }
        }
    }

    fn refuse_non_finite(&self) -> Result<(), Finding> {
        fn walk(
            path: &str,
            value: &Spanned<DeValue<'_>>,
        ) -> Option<(String, Range<usize>, String)> {
            match value.get_ref() {
                DeValue::Float(number) => {
                    let text = number.as_str().replace('_', "");
                    let finite = text.parse::<f64>().is_ok_and(f64::is_finite);
                    (!finite).then(|| (path.to_owned(), value.span(), text))
                }
                DeValue::Array(array) => array
                    .iter()
                    .enumerate()
                    .find_map(|(i, item)| walk(&format!("{path}[{i}]"), item)),
                DeValue::Table(table) => table
                    .iter()
                    .find_map(|(key, item)| walk(&format!("{path}.{}", key.get_ref()), item)),
                _ => None,
            }
        }
        let table = self.table.get_ref();
        let found = table
            .iter()
            .find_map(|(key, item)| walk(key.get_ref(), item));
        match found {
            None => Ok(()),
            Some((key, span, text)) => Err(Finding::new(
                self.file,
                format!("`{key}` is {text}, which is not a finite number"),
            )
            .key(key)
            .hint("give a finite number")
            .at(self.text, span)),
        }
    }
}

/// What the deserializer dislikes, in words.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Misfit {
    /// The key at fault.
    pub key: String,
    pub message: String,
    pub hint: Option<String>,
}

impl Misfit {
    /// Reads the deserializer's message; `path` is how far it came.
    pub fn read(path: String, message: &str) -> Self {
        let quoted: Vec<&str> = message.split('`').skip(1).step_by(2).collect();
        // The path ends at the table that lacks a key; `.` is the file itself.
        let inside = |name: &str| {
            if path == "." {
                name.to_owned()
            } else {
                format!("{path}.{name}")
            }
        };
        if message.starts_with("unknown field")
            && let [unknown, known @ ..] = quoted.as_slice()
        {
            // Or it ends at the unknown key.
            let is_there = path.ends_with(unknown);
            Self {
                key: if is_there { path } else { inside(unknown) },
                message: format!("unknown key `{unknown}`"),
                hint: Some(unknown_key_hint(unknown, known)),
            }
        } else if message.starts_with("unknown variant")
            && let [unknown, known @ ..] = quoted.as_slice()
        {
            Self {
                message: format!("`{unknown}` is not a value that `{path}` can have"),
                hint: Some(match nearest_name(unknown, known.iter().copied()) {
                    Some(near) => format!("did you mean `{near}`?"),
                    None => format!("one of {}", known.join(", ")),
                }),
                key: path,
            }
        } else if message.starts_with("missing field")
            && let [missing] = quoted.as_slice()
        {
            Self {
                key: inside(missing),
                message: format!("the key `{missing}` is missing"),
                hint: None,
            }
        } else {
            Self {
                message: in_words(message),
                hint: unit_hint(&path, message),
                key: path,
            }
        }
    }

    /// Whether the message is about the type of a value.
    fn is_of_type(message: &str) -> bool {
        !["unknown field", "unknown variant", "missing field"]
            .iter()
            .any(|start| message.starts_with(start))
    }
}

/// How to mend a key that is not known; `known` are those that are.
pub(crate) fn unknown_key_hint(unknown: &str, known: &[&str]) -> String {
    // The same quantity in another unit, or without one.
    let stem = |key: &str| {
        key.rsplit_once('_')
            .filter(|(_, unit)| {
                matches!(
                    *unit,
                    "m" | "mm" | "cm" | "deg" | "rad" | "s" | "ms" | "kg" | "nm" | "um"
                )
            })
            .map_or(key.to_owned(), |(stem, _)| stem.to_owned())
    };
    if let Some(same) = known.iter().find(|key| stem(key) == stem(unknown)) {
        return format!("did you mean `{same}`? The key says the unit");
    }
    match nearest_name(unknown, known.iter().copied()) {
        Some(near) => format!("did you mean `{near}`?"),
        None if known.is_empty() => "it takes no keys".to_owned(),
        None => format!("known keys: {}", known.join(", ")),
    }
}

/// A message of the deserializer without the names of Rust's types.
fn in_words(message: &str) -> String {
    [
        ("expected f64", "expected a number"),
        ("expected u64", "expected a whole number, not negative"),
        ("expected u32", "expected a whole number, not negative"),
    ]
    .iter()
    .fold(message.to_owned(), |text, (from, to)| {
        text.replace(from, to)
    })
}

fn unit_hint(key: &str, message: &str) -> Option<String> {
    let wants_number = message.contains("expected f64") || message.contains("expected a float");
    if !wants_number {
        return None;
    }
    // `goals[0].entry_mm[2]`: the unit is at the end of the last name.
    let key = key.rsplit('.').next().unwrap_or(key);
    let key = key.split('[').next().unwrap_or(key);
    let unit = match key.rsplit('_').next()? {
        "mm" => "millimetres",
        "deg" => "degrees",
        "s" => "seconds",
        "ms" => "milliseconds",
        "rad" => "radians",
        _ => "the unit in its name",
    };
    Some(format!("give a plain number, in {unit}"))
}
