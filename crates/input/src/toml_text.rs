//! TOML files into structs, with messages that name file, line, key and value.

mod slips;

use std::ops::Range;

use serde::de::DeserializeOwned;
use toml::de::{DeTable, DeValue};
use toml::{Spanned, Table, Value};

use crate::Finding;
use crate::schema::{FileSchema, Misfit, MisfitKind, Path};
use crate::toml_value;

/// A parsed file together with where everything stands in it.
#[derive(Debug)]
pub struct TomlText<'a> {
    /// The file, as the user named it.
    pub file: &'a str,
    /// Its text.
    pub text: &'a str,
    /// Values with their places.
    places: Spanned<DeTable<'a>>,
    values: Table,
}

impl<'a> TomlText<'a> {
    /// Of values that stand in no text: findings have keys but no lines.
    pub fn without_text(file: &'a str) -> Self {
        Self {
            file,
            text: "",
            places: Spanned::new(0..0, DeTable::new()),
            values: Table::new(),
        }
    }

    /// Parses a text.
    ///
    /// # Errors
    /// What is no TOML, with its place.
    pub fn parse(file: &'a str, text: &'a str) -> Result<Self, Finding> {
        let places = DeTable::parse(text).map_err(|error| {
            let mut message = error.message().to_owned();
            let Some(span) = error.span() else {
                return Finding::new(file, message);
            };
            let hint = slips::hint_about(text, span.clone());
            if message == "duplicate key"
                && let Some(key) = text.get(span.clone())
            {
                message = format!("duplicate key `{key}`");
            }
            let finding = Finding::new(file, message).at(text, span);
            Finding { hint, ..finding }
        })?;
        let values = table(Path::Top, places.get_ref()).map_err(|beyond| {
            Finding::new(file, beyond.message)
                .key(beyond.key)
                .hint(beyond.hint)
                .at(text, beyond.span)
        })?;
        Ok(Self {
            file,
            text,
            places,
            values,
        })
    }

    /// Values that may be meant in another unit than their keys say, in words.
    pub fn doubts(&self) -> Vec<String> {
        slips::doubtful_units(&self.values)
    }

    /// A note for each former name of a key or a choice.
    pub fn former_names(&self, schema: &FileSchema) -> Vec<String> {
        schema.former_names(&self.values)
    }

    /// The whole file as a struct.
    ///
    /// # Errors
    /// All that its schema refuses.
    pub fn read<T: DeserializeOwned>(&self, schema: &FileSchema) -> Result<T, Vec<Finding>> {
        let misfits = schema.check(&self.values);
        if !misfits.is_empty() {
            let mut findings: Vec<Finding> = misfits
                .into_iter()
                .map(|misfit| self.misfit(misfit))
                .collect();
            findings.sort_by_key(|finding| finding.span.as_ref().map(|span| span.start));
            return Err(findings);
        }
        // The schema is that of the struct, so this can fail by a mistake of ours alone.
        toml_value::read_table(&self.values).map_err(|error| vec![Finding::new(self.file, error)])
    }

    fn misfit(&self, misfit: Misfit) -> Finding {
        let mut finding = self.finding(&misfit.key, misfit.message);
        // What is wrong is the key, not its value.
        if matches!(misfit.kind, MisfitKind::Unknown | MisfitKind::Former)
            && let Some((key, _)) = self.place_of(&misfit.key)
        {
            finding = finding.at(self.text, key);
        }
        finding.hint = misfit.hint;
        finding
    }

    /// Where the value of a key stands: `goals[0].entry_mm` and so on.
    pub fn span_of(&self, path: &str) -> Option<Range<usize>> {
        self.place_of(path).map(|(_, value)| value)
    }

    /// Where a key and its value stand.
    fn place_of(&self, path: &str) -> Option<(Range<usize>, Range<usize>)> {
        let mut at: Option<(&DeValue<'_>, Range<usize>, Range<usize>)> = None;
        for (name, indices) in steps(path) {
            let table = match at {
                None => self.places.get_ref(),
                Some((DeValue::Table(table), ..)) => table,
                Some((_, key, value)) => return Some((key, value)),
            };
            let (key, value) = table.get_key_value(name)?;
            at = Some((value.get_ref(), key.span(), value.span()));
            for index in indices.split('[').filter(|text| !text.is_empty()) {
                let index: usize = index.trim_end_matches(']').parse().ok()?;
                let Some((DeValue::Array(array), ..)) = at else {
                    return None;
                };
                let item = array.get(index)?;
                at = Some((item.get_ref(), item.span(), item.span()));
            }
        }
        at.map(|(_, key, value)| (key, value))
    }

    /// A finding about a key of this file; a missing key's is placed at the table that lacks it.
    pub fn finding(&self, key: &str, message: impl Into<String>) -> Finding {
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
}

/// Names of a path, each with the indices after it. A name with other characters than those of bare
/// keys stands in quotes.
fn steps(path: &str) -> impl Iterator<Item = (&str, &str)> {
    let mut rest = path;
    std::iter::from_fn(move || {
        if rest.is_empty() {
            return None;
        }
        let (name, after) = match rest.strip_prefix('"').and_then(|rest| rest.split_once('"')) {
            Some(quoted) => quoted,
            None => rest.split_at(rest.find(['.', '[']).unwrap_or(rest.len())),
        };
        let (indices, next) = after.split_once('.').unwrap_or((after, ""));
        rest = next;
        Some((name, indices))
    })
}

/// A number that TOML can write but no file of ours can have.
struct Beyond {
    key: String,
    span: Range<usize>,
    message: String,
    hint: String,
}

fn table(at: Path<'_>, table: &DeTable<'_>) -> Result<Table, Beyond> {
    let entries = table.iter().map(|(key, inner)| {
        let name: &str = key.get_ref();
        Ok((name.to_owned(), value(Path::Key(&at, name), inner)?))
    });
    entries.collect()
}

fn value(at: Path<'_>, spanned: &Spanned<DeValue<'_>>) -> Result<Value, Beyond> {
    let beyond = |message: String, hint: &str| Beyond {
        key: at.to_string(),
        span: spanned.span(),
        message,
        hint: hint.to_owned(),
    };
    Ok(match spanned.get_ref() {
        DeValue::String(text) => Value::String(text.clone().into_owned()),
        DeValue::Integer(number) => {
            let parsed = i64::from_str_radix(number.as_str(), number.radix());
            Value::Integer(parsed.map_err(|_| {
                beyond(
                    format!("`{at}` is {number}, which has more than 64 bits"),
                    "whole numbers of TOML are within 2^63 of 0",
                )
            })?)
        }
        DeValue::Float(number) => {
            let parsed = number.as_str().parse().ok().filter(|n: &f64| n.is_finite());
            Value::Float(parsed.ok_or_else(|| {
                beyond(
                    format!("`{at}` is {number}, which is not a finite number"),
                    "give a finite number",
                )
            })?)
        }
        DeValue::Boolean(truth) => Value::Boolean(*truth),
        DeValue::Datetime(time) => Value::Datetime(*time),
        DeValue::Array(items) => {
            let items = items.iter().enumerate();
            let items = items.map(|(index, item)| value(Path::Index(&at, index), item));
            Value::Array(items.collect::<Result<_, _>>()?)
        }
        DeValue::Table(inner) => Value::Table(table(at, inner)?),
    })
}

impl Finding {
    /// With the place of its key in the file's text, where it has none yet and the key stands there.
    #[must_use]
    pub fn placed_in(self, text: &str) -> Self {
        let (None, Some(key)) = (&self.span, &self.key) else {
            return self;
        };
        let Ok(toml) = TomlText::parse(&self.file, text) else {
            return self;
        };
        let placed = toml.finding(key, "");
        Self {
            line: placed.line,
            span: placed.span,
            ..self
        }
    }
}
