//! Input files: read with limits, held against a schema, and what is wrong with them said with its place.
//!
//! | Modules | What they are |
//! |---|---|
//! | `finding` | what is wrong with an input: file, line, key, value and hint |
//! | `read`, `location` | files on disk, with limits of their size; models that ship inside the program |
//! | `file_kind` | what a file is that was taken for something else |
//! | [`schema`] | what a file may hold: one source of its JSON schema and of the reader's checks |
//! | `toml_text`, `toml_value` | TOML with the places of its values; values as TOML |
//! | `delimited`, `limit`, `printable` | tables of text, limits of counts, texts that are safe to print |
#![cfg_attr(any(doc, doctest), doc = include_str!("../README.md"))]

mod delimited;
mod file_kind;
mod finding;
mod limit;
mod location;
mod printable;
mod read;
pub mod schema;
mod toml_text;
mod toml_value;
mod yaml_text;

pub use delimited::Separator;
pub use file_kind::{FileKind, or_wrong_kind};
pub use finding::{Finding, nearest_name, nothing_serves};
pub use limit::{Limit, digits_apart};
pub use location::{Expanded, Location, ModelSource, PackagePaths, sha256_hex, source_of};
pub use printable::{commented, printable, printable_json, printable_line};
pub use read::{InputError, open_input, read_data, read_data_text, read_text};
pub use toml_text::TomlText;
pub use toml_value::{from_toml, read_table, read_value, to_toml};
pub use yaml_text::{YamlEntry, YamlNode, YamlValue, parse_yaml, parse_yaml_documents};
