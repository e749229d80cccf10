//! How sections name shipped models and files.

use std::collections::BTreeSet;
use std::path::Path;

use schemars::{Schema, json_schema};
use serde::Serialize;

use needlebench_input::Location;

/// Schema of a key that names a shipped model, or has the path of a file.
///
/// A path is told from a name by its folder or its ending. `words` are values that are neither.
pub(super) fn reference_schema(folder: &str, extension: &str, words: &[&str]) -> Schema {
    let mut names = Location::builtin_names(folder, extension);
    names.extend(words.iter().map(|word| (*word).to_owned()));
    names_or_path(&names)
}

/// Schema of a key that has one of some names, or the path of a file.
pub(super) fn names_or_path<T: Serialize>(names: &[T]) -> Schema {
    json_schema!({
        "anyOf": [
            { "type": "string", "enum": names },
            { "type": "string", "pattern": r"[./\\:]" },
        ]
    })
}

/// Names of the lesions that shipped phantoms have.
pub(super) fn shipped_lesions() -> BTreeSet<String> {
    let names = Location::builtin_names("chest_phantom", "toml");
    let tables = names.iter().filter_map(|name| {
        let file = Location::of_model(name, "chest_phantom", "toml", Path::new(""));
        let text = String::from_utf8(file.read().ok()?).ok()?;
        text.parse::<toml::Table>().ok()
    });
    let lesions = tables.filter_map(|mut table| match table.remove("lesions") {
        Some(toml::Value::Array(lesions)) => Some(lesions),
        _ => None,
    });
    lesions
        .flatten()
        .filter_map(|lesion| lesion.get("name")?.as_str().map(str::to_owned))
        .collect()
}

/// Names of the shipped needle guides.
pub fn shipped_tools() -> Vec<String> {
    Location::builtin_names("needle_guide", "urdf")
}
