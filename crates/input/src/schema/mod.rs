//! What a file may hold: one source for the published JSON schema and for the reader's checks.
//!
//! A struct of a file is a plain struct with derived [`JsonSchema`]; the range of a value stands at
//! its field as a schemars attribute. From the derived schema come
//!
//! - the published one ([`FileSchema::published`]), which editors and validators read, and
//! - a tree of [`Node`]s, with which the reader checks a file before it makes the struct of it.
//!
//! So what a schema refuses the reader refuses, and the other way round. Rules between several values
//! are code beside the sections.

mod check;
mod node;
mod tidy;
mod unit;

use schemars::JsonSchema;
use serde_json::Value;

use check::unknown_key_hint;
pub use check::{Misfit, MisfitKind, Path};
pub use node::Node;
pub use unit::{unit_of, written};

/// Unit of a number, where its key does not end with it.
pub(crate) const UNIT: &str = "x-unit";

/// How to fix a value out of its range, where there is more to say than its unit.
pub(crate) const HINT: &str = "x-hint";

/// Whether a number may be switched off by the word "off".
pub(crate) const OFF: &str = "x-off";
/// The former name of a key or of a choice, which is accepted until [`FORMER_NAMES_UNTIL`].
pub(crate) const FORMER: &str = "x-former";
/// The version that no longer accepts former names of keys, choices, commands and options.
pub const FORMER_NAMES_UNTIL: &str = "0.2.0";

/// Word in place of a number that switches the value off.
pub const SWITCHED_OFF: &str = "off";

/// Longest name: file systems take 255 bytes, some 143, and a name gets endings such as
/// `.ranking.svg` and the name of a configuration beside it.
pub const LONGEST_NAME: usize = 100;

/// Names that become file names.
pub const NAME: &str = "^[A-Za-z0-9_-]+$";

/// Names that become columns of tables.
pub const COLUMN: &str = "^[A-Za-z0-9_]+$";

/// The schema of one kind of file.
#[derive(Debug)]
pub struct FileSchema {
    json: Value,
    node: Node,
}

impl FileSchema {
    /// From a struct with the ranges at its fields.
    pub fn of<T: JsonSchema>() -> Self {
        let mut json = schemars::generate::SchemaSettings::draft07()
            .into_generator()
            .into_root_schema_for::<T>()
            .to_value();
        tidy::tidy(&mut json);
        Self {
            node: Node::of(&json),
            json,
        }
    }

    /// As a JSON schema (draft-07), for editors.
    pub fn published(&self) -> Value {
        let mut json = self.json.clone();
        tidy::without_own_words(&mut json);
        json
    }

    /// All that is wrong with a file's values.
    pub fn check(&self, values: &toml::Table) -> Vec<Misfit> {
        let mut found = Vec::new();
        if let Node::Table(table) = &self.node {
            table.check(Path::Top, values, &mut found);
        }
        for misfit in &mut found {
            if misfit.kind == MisfitKind::Unknown
                && let Some(hint) = self.place_of_key(&misfit.key)
            {
                misfit.hint = Some(hint);
            }
        }
        found
    }

    /// A note for each former name that a file uses: `search.fresh is now search.held_out_layouts; ...`.
    pub fn former_names(&self, values: &toml::Table) -> Vec<String> {
        let mut found = Vec::new();
        if let Node::Table(table) = &self.node {
            table.former_names(Path::Top, values, &mut found);
        }
        found
    }

    /// Where a key belongs that stands where it is not known.
    fn place_of_key(&self, path: &str) -> Option<String> {
        /// More are no help.
        const MOST: usize = 3;
        let (_, key) = path.rsplit_once('.').unwrap_or(("", path));
        let sections = self.node.sections_with(key);
        let is_clear = (1..=MOST).contains(&sections.len());
        is_clear.then(|| format!("`{key}` is a key of {}", sections.join(", ")))
    }

    /// The whole file.
    pub fn root(&self) -> &Node {
        &self.node
    }
}

impl Node {
    /// What stands under a key of this table.
    ///
    /// # Errors
    /// What is wrong with the key, and which ones there are.
    pub fn key(&self, key: &str) -> Result<&Self, String> {
        let Self::Table(table) = self else {
            return Err(format!("unknown key `{key}`; it takes no keys"));
        };
        if let Some(name) = table.former.get(key) {
            return Err(format!("`{key}` is now `{name}`"));
        }
        if let Some(entry) = table.keys.get(key) {
            return Ok(&entry.node);
        }
        let names = match table.others.as_deref() {
            Some((names, node)) => {
                let is_known = names.one_of.is_empty() || names.one_of.iter().any(|n| n == key);
                if is_known {
                    return Ok(node);
                }
                names.one_of.iter().map(String::as_str).collect()
            }
            None => table.present_names(),
        };
        let hint = unknown_key_hint(key, &names);
        Err(format!("unknown key `{key}`; {hint}"))
    }

    /// What stands at a place of this list, from 0.
    ///
    /// # Errors
    /// Why there is no such place.
    pub fn item(&self, index: usize) -> Result<&Self, String> {
        match self {
            Self::List(list) if index < list.most => Ok(list.item(index)),
            Self::List(list) => Err(format!(
                "there is no [{index}]: it has {} numbers, the first is [0]",
                list.most
            )),
            _ => Err(format!("there is no [{index}]: it is not a list")),
        }
    }
}

#[cfg(test)]
mod tests;
