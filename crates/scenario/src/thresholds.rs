//! Files of thresholds for the comparison of two results.

use std::collections::BTreeMap;
use std::path::Path;

use schemars::JsonSchema;
use serde::Deserialize;

use needlebench_input::schema::FileSchema;
use needlebench_input::{Finding, TomlText, read_text};

/// A file of thresholds: the maximum loss of each metric.
#[derive(Debug, Clone, PartialEq)]
pub struct ThresholdsFile {
    file: String,
    text: String,
    content: Content,
}

#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Content {
    /// A configuration that is no longer feasible does not fail the comparison.
    #[serde(default)]
    allow_status_change: bool,
    /// Goals, configurations, metrics or cases that only the first result has do not fail the comparison.
    #[serde(default)]
    allow_lost: bool,
    /// Maximum loss by metric, with its unit.
    #[serde(default)]
    max_loss: BTreeMap<String, String>,
}

impl ThresholdsFile {
    /// Reads a file.
    ///
    /// # Errors
    /// If it cannot be read, is not TOML, or has other keys.
    pub fn load(path: &Path) -> Result<Self, Finding> {
        let file = path.display().to_string();
        let text = read_text(path).map_err(|error| {
            let hint = error.hint("thresholds are a TOML file with the section [max_loss]");
            Finding::new(&file, format!("cannot read the thresholds: {error}")).hint(hint)
        })?;
        Self::parse(file, text)
    }

    fn parse(file: String, text: String) -> Result<Self, Finding> {
        let content = TomlText::parse(&file, &text)?
            .read(&FileSchema::of::<Content>())
            .map_err(|mut findings| findings.swap_remove(0))?;
        Ok(Self {
            file,
            text,
            content,
        })
    }

    /// Whether a configuration that is no longer feasible does not fail the comparison.
    pub fn allow_status_change(&self) -> bool {
        self.content.allow_status_change
    }

    /// Whether what only the first result has does not fail the comparison.
    pub fn allow_lost(&self) -> bool {
        self.content.allow_lost
    }

    /// Largest losses: metric and limit, as written.
    pub fn max_loss(&self) -> impl Iterator<Item = (&str, &str)> {
        let entries = self.content.max_loss.iter();
        entries.map(|(metric, limit)| (metric.as_str(), limit.as_str()))
    }

    /// A finding about the limit of a metric.
    pub fn finding(&self, metric: &str, message: impl Into<String>) -> Finding {
        let key = format!("max_loss.{metric}");
        match TomlText::parse(&self.file, &self.text) {
            Ok(toml) => toml.finding(&key, message),
            Err(_) => Finding::new(&self.file, message).key(key),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<ThresholdsFile, Finding> {
        ThresholdsFile::parse("t.toml".to_owned(), text.to_owned())
    }

    #[test]
    fn limits_are_read_with_their_units() {
        let file = parse("allow_status_change = true\n[max_loss]\nclearance = \"1mm\"").unwrap();
        assert!(file.allow_status_change());
        let limits: Vec<_> = file.max_loss().collect();
        assert_eq!(limits, [("clearance", "1mm")]);
        let found = file.finding("clearance", "wrong");
        assert_eq!((found.line, found.file.as_str()), (Some(3), "t.toml"));
    }

    #[test]
    fn numbers_without_a_unit_and_unknown_keys_are_refused_where_they_stand() {
        let found = parse("[max_loss]\nclearance = 1").unwrap_err();
        assert_eq!(found.line, Some(2), "{found}");
        let found = parse("max_los = {}").unwrap_err();
        assert_eq!(found.hint.as_deref(), Some("did you mean `max_loss`?"));
    }
}
