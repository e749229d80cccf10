//! Names of the labels of a label map, in a file of their own.

use std::collections::BTreeMap;
use std::path::Path;

use crate::VolumeError;

/// Longest table of names that is read.
const MOST_BYTES: u64 = 1 << 20;

/// Reads which label is called what, in the order of the labels.
///
/// Takes `labels.json` as this program writes it; a JSON object such as `{"1": "spleen"}`; a colour table of 3D Slicer
/// (`1 name 255 0 0 255` on a line); and tables with commas or tabs whose first column is the label and second one the
/// name.
///
/// # Errors
/// A file that cannot be read, has no names, or has two names for one label.
pub fn read_label_names(path: &Path) -> Result<Vec<(u16, String)>, VolumeError> {
    let refused = |message: String| {
        VolumeError::refused(message)
            .at(path.display().to_string())
            .hint("a JSON object such as {\"1\": \"lung_left\"}, a colour table of 3D Slicer, or lines of `1,lung_left`")
    };
    let size = path
        .metadata()
        .map_err(|error| refused(format!("cannot be read: {error}")))?;
    if size.len() > MOST_BYTES {
        return Err(refused(
            "it is larger than 1 MiB: not a table of names".to_owned(),
        ));
    }
    let bytes = std::fs::read(path).map_err(|error| refused(format!("cannot be read: {error}")))?;
    let text = String::from_utf8(bytes).map_err(|_| refused("it is not text".to_owned()))?;
    let text = text.trim_start_matches('\u{feff}');
    let found = if text.trim_start().starts_with(['{', '[']) {
        from_json(text)
    } else {
        from_lines(text)
    };
    let mut names = BTreeMap::new();
    for (label, name) in found.map_err(refused)? {
        if let Some(other) = names.insert(label, name.clone())
            && other != name
        {
            return Err(refused(format!(
                "label {label} is named `{other}` and `{name}`"
            )));
        }
    }
    if names.is_empty() {
        return Err(refused("it has no names".to_owned()));
    }
    Ok(names.into_iter().collect())
}

fn label(text: &str) -> Option<u16> {
    text.trim().trim_matches('"').parse().ok()
}

fn from_json(text: &str) -> Result<Vec<(u16, String)>, String> {
    let value: serde_json::Value =
        serde_json::from_str(text).map_err(|error| format!("it is no JSON: {error}"))?;
    if let Some(list) = value.get("labels").and_then(|labels| labels.as_array()) {
        let entries = list.iter().map(|entry| {
            let label = entry.get("label").and_then(serde_json::Value::as_u64);
            let name = entry.get("name").and_then(serde_json::Value::as_str);
            let label = label.and_then(|label| u16::try_from(label).ok());
            label
                .zip(name)
                .map(|(label, name)| (label, name.to_owned()))
        });
        return entries.collect::<Option<_>>().ok_or_else(|| {
            "an entry of `labels` has no `label` from 0 to 65535, or no `name`".to_owned()
        });
    }
    let Some(object) = value.as_object() else {
        return Err("it is no JSON object".to_owned());
    };
    let entries = object.iter().map(|(key, value)| {
        // Either way round: {"1": "spleen"} and {"spleen": 1}.
        if let Some(name) = value.as_str() {
            return label(key).map(|label| (label, name.to_owned()));
        }
        let number = value.as_u64().and_then(|number| u16::try_from(number).ok());
        number.map(|label| (label, key.clone()))
    });
    entries.collect::<Option<_>>().ok_or_else(|| {
        "an entry is neither a label's name nor a name's label, from 0 to 65535".to_owned()
    })
}

fn from_lines(text: &str) -> Result<Vec<(u16, String)>, String> {
    let mut names = Vec::new();
    for (number, line) in text.lines().enumerate() {
        let line = line.trim();
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        let is_table = line.contains([',', '\t', ';']);
        let mut words: Vec<&str> = if is_table {
            line.split([',', '\t', ';']).map(str::trim).collect()
        } else {
            line.split_whitespace().collect()
        };
        words.retain(|word| !word.is_empty());
        match words.as_slice() {
            [first, name, ..] if label(first).is_some() => {
                let name = name.trim_matches('"').to_owned();
                names.extend(label(first).map(|label| (label, name)));
            }
            // What the columns are called.
            _ if names.is_empty() && number < 3 => {}
            _ => return Err(format!("line {}: no label and name", number + 1)),
        }
    }
    Ok(names)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Vec<(u16, String)>, VolumeError> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("names");
        std::fs::write(&path, text).unwrap();
        read_label_names(&path)
    }

    #[test]
    fn tables_of_all_kinds_are_read() {
        let wanted = vec![(1, "lung_left".to_owned()), (10, "rib_left_1".to_owned())];
        for text in [
            "{\"labels\": [{\"label\": 10, \"name\": \"rib_left_1\"}, {\"label\": 1, \"name\": \"lung_left\"}]}",
            "{\"10\": \"rib_left_1\", \"1\": \"lung_left\"}",
            "{\"lung_left\": 1, \"rib_left_1\": 10}",
            "# Color table file\n1 lung_left 128 174 128 255\n10 rib_left_1 1 2 3 255\n",
            "LabelValue,Name,Color_R\n1,lung_left,3\n10,\"rib_left_1\",4\n",
            "1\tlung_left\r\n10\trib_left_1\r\n",
        ] {
            assert_eq!(read(text).unwrap(), wanted, "{text}");
        }
    }

    #[test]
    fn what_is_no_table_is_refused() {
        for text in [
            "",
            "{",
            "[1]",
            "{\"a\": \"b\"}",
            "{\"99999\": \"b\"}",
            "1 a\n1 b\n",
            "1 a\nnonsense\n",
        ] {
            assert!(read(text).is_err(), "{text}");
        }
    }
}
