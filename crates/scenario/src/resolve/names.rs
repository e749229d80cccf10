//! Models that scenarios name.

use std::path::Path;

use needlebench_input::{Finding, Location, TomlText, nearest_name};

/// A model that a scenario names but that does not exist: points at the key and lists what does.
pub(super) fn with_model_names(
    toml: &TomlText<'_>,
    finding: Finding,
    location: &Location,
    key: &str,
    names: &[String],
) -> Finding {
    if location.read().is_ok() || finding.file != location.display() {
        return finding;
    }
    let given = location.display();
    let stem = Path::new(&given)
        .file_stem()
        .and_then(|stem| stem.to_str())
        .unwrap_or("");
    let hint = match nearest_name(stem, names.iter().map(String::as_str)) {
        Some(near) => format!("did you mean `{near}`? Shipped: {}", names.join(", ")),
        None => format!(
            "a path relative to the scenario, or a shipped model: {}",
            names.join(", ")
        ),
    };
    let mut finding = finding.hint(hint);
    if toml.span_of(key).is_some() {
        let placed = toml.finding(key, format!("{}: {}", location.display(), finding.message));
        finding = Finding {
            hint: finding.hint,
            ..placed
        };
    }
    finding
}
