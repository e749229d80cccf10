//! What others have published of the accuracy of needle robots: `models/published/anchors.toml`.

use std::path::Path;
use std::sync::LazyLock;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use needlebench_input::schema::FileSchema;
use needlebench_input::{Location, TomlText};

/// What an error is of.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema,
)]
#[serde(rename_all = "snake_case")]
pub enum Stage {
    /// Robot, registration and guide, before the needle goes in.
    BeforeInsertion,
    /// Tissue, while it goes in.
    DueToInsertion,
    /// Both.
    Total,
    /// Accepted by radiologists.
    Allowed,
}

impl Stage {
    /// In words.
    pub fn words(self) -> &'static str {
        match self {
            Self::BeforeInsertion => "before insertion",
            Self::DueToInsertion => "due to insertion",
            Self::Total => "total, after insertion",
            Self::Allowed => "allowed",
        }
    }
}

/// One published figure.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Anchor {
    /// Its name.
    pub key: String,
    /// Who; left out where we have not seen their names.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub authors: Option<String>,
    /// When.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub year: Option<u32>,
    /// Where.
    pub doi: String,
    /// Which robot.
    pub system: String,
    /// In what.
    pub subject: String,
    /// How many needles or answers.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub n: Option<u32>,
    /// The same where it is not that simple.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub n_text: Option<String>,
    /// What the error is of.
    pub stage: Stage,
    /// Column of our accuracy table that measures the same; `other` where none is known to.
    pub quantity: String,
    /// What was measured, in words.
    pub measured: String,
    /// `mean`, `rms`, ...
    pub statistic: String,
    /// The figure.
    pub value: f64,
    /// Its standard deviation.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sd: Option<f64>,
    /// `mm` or `deg`.
    pub unit: String,
    /// What the source says, word for word but for signs that are not ASCII.
    pub statement: String,
}

impl Anchor {
    /// Who published it, for people: authors where they are known, else the robot.
    pub fn label(&self) -> String {
        let who = self.authors.as_ref().map_or_else(
            || self.system.clone(),
            // Of many the first.
            |authors| match authors.split_once(',') {
                Some((first, _)) => format!("{first} et al."),
                None => authors.clone(),
            },
        );
        match self.year {
            Some(year) => format!("{who} {year}"),
            None => who,
        }
    }

    /// Number of needles, for people.
    pub fn count(&self) -> String {
        match (&self.n, &self.n_text) {
            (Some(n), _) => n.to_string(),
            (None, Some(text)) => text.clone(),
            (None, None) => "not stated".to_owned(),
        }
    }
}

#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct AnchorsFile {
    anchors: Vec<Anchor>,
}

static ANCHORS: LazyLock<Vec<Anchor>> = LazyLock::new(|| {
    let location = Location::Builtin(Path::new("published").join("anchors.toml"));
    let bytes = location.read().expect("the file ships");
    let text = String::from_utf8(bytes).expect("the file is text");
    let file = location.display();
    let toml = TomlText::parse(&file, &text).expect("the file is TOML");
    let content: AnchorsFile = toml
        .read(&FileSchema::of::<AnchorsFile>())
        .expect("the file has its keys");
    content.anchors
});

/// All figures that ship, in the order of their file.
pub fn anchors() -> &'static [Anchor] {
    &ANCHORS
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn every_anchor_states_its_own_figures() {
        let mut keys = BTreeSet::new();
        for anchor in anchors() {
            assert!(keys.insert(&anchor.key), "{} is there twice", anchor.key);
            assert!(anchor.doi.starts_with("10."), "{}", anchor.key);
            assert!(["mm", "deg"].contains(&anchor.unit.as_str()));
            // `5.0` in a statement is the number 5.
            let is_in = |value: f64| {
                let plain = format!("{value}");
                let decimal = format!("{value:.1}");
                let padded = format!("{value:.2}");
                [plain, decimal, padded]
                    .iter()
                    .any(|text| anchor.statement.contains(text.as_str()))
            };
            assert!(is_in(anchor.value), "{}: {}", anchor.key, anchor.value);
            assert!(
                anchor.sd.is_none_or(is_in),
                "{}: {:?}",
                anchor.key,
                anchor.sd
            );
        }
        assert!(keys.len() > 10);
    }

    #[test]
    fn the_split_of_errors_is_the_sources_own() {
        let value = |key: &str| anchors().iter().find(|each| each.key == key).unwrap().value;
        let [before, due, total] =
            ["before", "due", "total"].map(|part| value(&format!("seifabadi_2013_{part}")));
        // Components at right angles, to the rounding of the printed digits.
        assert!((libm::hypot(before, due) - total).abs() < 0.05);
    }
}
