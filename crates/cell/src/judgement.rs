//! What people state about a simulation's credibility: a TOML file of texts, which the program can print as a
//! template and never fills in.

use std::fmt::Write;
use std::path::Path;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::Finding;
use crate::input::read_text;
use crate::schema::FileSchema;
use crate::toml_text::TomlText;

/// A judgement in the frame of ASME V&V 40. What is empty is not stated.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Judgement {
    /// Who judges.
    pub author: String,
    /// When, as text.
    pub date: String,
    /// The question that is to be answered, and to which the model contributes.
    pub question_of_interest: String,
    /// What the model is used for in answering it, and what else the answer rests on.
    pub context_of_use: String,
    /// How much the answer rests on the model: low, medium or high, and why.
    pub model_influence: String,
    /// How bad a wrong decision would be: low, medium or high, and for whom.
    pub decision_consequence: String,
    /// What follows from both for how good the evidence has to be.
    pub model_risk: String,
    /// What of the code's verification matters here, and whether it is enough.
    pub code_verification: String,
    /// The same of the calculation: time step, engines, sampling.
    pub calculation_verification: String,
    /// What the model is held against, and how good that measurement is itself.
    pub comparator: String,
    /// How well both agree, and whether that is enough.
    pub agreement: String,
    /// How the validation's conditions differ from those of the context of use.
    pub applicability: String,
    /// What the model leaves out that matters here.
    pub limitations: String,
    /// Whether the evidence is enough for the model's risk.
    pub adequacy: String,
}

/// Fields with what is to be written into them, in the order of the file.
const FIELDS: [(&str, &str); 14] = [
    ("author", "Who judges."),
    ("date", "When, in quotes: \"2026-01-31\"."),
    (
        "question_of_interest",
        "The question that is to be answered, and to which the model contributes.",
    ),
    (
        "context_of_use",
        "What the model is used for in answering it, and what else the answer rests on.",
    ),
    (
        "model_influence",
        "How much the answer rests on the model: low, medium or high, and why.",
    ),
    (
        "decision_consequence",
        "How bad a wrong decision would be: low, medium or high, and for whom.",
    ),
    (
        "model_risk",
        "What follows from both for how good the evidence has to be.",
    ),
    (
        "code_verification",
        "What of the code's verification matters here, and whether it is enough.",
    ),
    (
        "calculation_verification",
        "The same of the calculation: time step, engines, sampling.",
    ),
    (
        "comparator",
        "What the model is held against, and how good that measurement is itself.",
    ),
    (
        "agreement",
        "How well both agree, and whether that is enough.",
    ),
    (
        "applicability",
        "How the comparison's conditions differ from those of the context of use.",
    ),
    (
        "limitations",
        "What the model leaves out that matters here.",
    ),
    (
        "adequacy",
        "Whether the evidence is enough for the model's risk.",
    ),
];

impl Judgement {
    /// Reads a file.
    ///
    /// # Errors
    /// It cannot be read, is no TOML, or has other keys or values.
    pub fn load(path: &Path) -> Result<Self, Vec<Finding>> {
        let file = path.display().to_string();
        let text = read_text(path).map_err(|error| {
            let hint = error.hint("`needlebench report --template` prints one to fill in");
            vec![Finding::new(&file, format!("the judgement cannot be read: {error}")).hint(hint)]
        })?;
        Self::parse(&file, &text)
    }

    fn parse(file: &str, text: &str) -> Result<Self, Vec<Finding>> {
        let toml = TomlText::parse(file, text).map_err(|finding| vec![finding])?;
        toml.read(&FileSchema::of::<Self>())
    }

    /// A file to fill in.
    pub fn template() -> String {
        let mut text = String::from(
            "# A judgement on the credibility of a simulation, in the frame of ASME V&V 40.\n\
             # What is left empty is printed as \"not stated\". Longer texts: \"\"\"...\"\"\".\n",
        );
        for (key, what) in FIELDS {
            // Writing to a String cannot fail.
            let _ = write!(text, "\n# {what}\n{key} = \"\"\n");
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_template_states_nothing_and_has_every_field() {
        let template = Judgement::template();
        assert_eq!(
            Judgement::parse("j.toml", &template),
            Ok(Judgement::default())
        );
        let fields = serde_json::to_value(Judgement::default()).unwrap();
        let fields = fields.as_object().unwrap();
        assert_eq!(fields.len(), FIELDS.len());
        for (key, _) in FIELDS {
            assert!(fields.contains_key(key), "{key}");
        }
    }

    #[test]
    fn wrong_keys_and_values_are_refused_where_they_stand() {
        let text = "author = \"A\"\nquestion_of_intrest = \"?\"\n";
        let found = Judgement::parse("j.toml", text).unwrap_err();
        assert_eq!(found.len(), 1);
        assert_eq!(found[0].line, Some(2));
        let hint = found[0].hint.as_deref().unwrap();
        assert!(hint.contains("question_of_interest"), "{hint}");
        let found = Judgement::parse("j.toml", "\n\ndate = 2026-01-31\n").unwrap_err();
        assert_eq!(
            (found[0].line, found[0].key.as_deref()),
            (Some(3), Some("date"))
        );
        let found = Judgement::parse("j.toml", "author = \"A\nB\"").unwrap_err();
        // The text breaks off at the end of its line.
        assert!(found[0].line.is_some_and(|line| line <= 2));
    }
}
