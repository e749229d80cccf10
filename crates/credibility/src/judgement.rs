//! Statements of the user on the credibility of a simulation: a TOML file of texts. The program can print a template
//! and never fills it in.

use std::fmt::Write;
use std::path::Path;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use needlebench_input::schema::FileSchema;
use needlebench_input::{Finding, TomlText, read_text};

/// A credibility assessment in the terms of ASME V&V 40. An empty field is not stated.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Judgement {
    /// Author of the judgement.
    pub author: String,
    /// Date, as text.
    pub date: String,
    /// Question of interest: the question to which the model contributes an answer.
    pub question_of_interest: String,
    /// Context of use: the role of the model in answering it, and the other evidence used.
    pub context_of_use: String,
    /// Model influence: contribution of the model to the answer, low, medium or high, and why.
    pub model_influence: String,
    /// Decision consequence: severity of a wrong decision, low, medium or high, and for whom.
    pub decision_consequence: String,
    /// Model risk: the combination of both, and the rigour of evidence that it requires.
    pub model_risk: String,
    /// Code verification relevant to the context of use, and whether it is sufficient.
    pub code_verification: String,
    /// Calculation verification: time step, engines, sampling, and whether it is sufficient.
    pub calculation_verification: String,
    /// Comparator: the measurement with which the model is compared, and its uncertainty.
    pub comparator: String,
    /// Agreement of model and comparator, and whether it is sufficient.
    pub agreement: String,
    /// Applicability: differences between the conditions of the validation and the context of use.
    pub applicability: String,
    /// Limitations: relevant effects that the model neglects.
    pub limitations: String,
    /// Adequacy: whether the evidence is sufficient for the model risk.
    pub adequacy: String,
}

/// Fields with their prompts, in the order of the file.
const FIELDS: [(&str, &str); 14] = [
    ("author", "Author of the judgement."),
    ("date", "Date, in quotes: \"2026-01-31\"."),
    (
        "question_of_interest",
        "Question of interest: the question to which the model contributes an answer.",
    ),
    (
        "context_of_use",
        "Context of use: the role of the model in answering it, and the other evidence used.",
    ),
    (
        "model_influence",
        "Model influence: contribution of the model to the answer, low, medium or high, and why.",
    ),
    (
        "decision_consequence",
        "Decision consequence: severity of a wrong decision, low, medium or high, and for whom.",
    ),
    (
        "model_risk",
        "Model risk: the combination of both, and the rigour of evidence that it requires.",
    ),
    (
        "code_verification",
        "Code verification relevant to the context of use, and whether it is sufficient.",
    ),
    (
        "calculation_verification",
        "Calculation verification: time step, engines, sampling, and whether it is sufficient.",
    ),
    (
        "comparator",
        "Comparator: the measurement with which the model is compared, and its uncertainty.",
    ),
    (
        "agreement",
        "Agreement of model and comparator, and whether it is sufficient.",
    ),
    (
        "applicability",
        "Applicability: differences between the conditions of the comparison and the context of use.",
    ),
    (
        "limitations",
        "Limitations: relevant effects that the model neglects.",
    ),
    (
        "adequacy",
        "Adequacy: whether the evidence is sufficient for the model risk.",
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
            let hint = error.hint("`needlebench report --template` prints a template");
            vec![Finding::new(&file, format!("cannot read the judgement: {error}")).hint(hint)]
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
            "# A credibility assessment of a simulation in the terms of ASME V&V 40.\n\
             # An empty field is printed as \"not stated\". Longer texts: \"\"\"...\"\"\".\n",
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
