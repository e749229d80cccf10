//! What is wrong with an input file, said so that its author can fix it.

use std::fmt;
use std::ops::Range;

use serde::Serialize;

/// One thing wrong with an input: where, what, and how to fix it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, thiserror::Error)]
pub struct Finding {
    /// File as the user named it.
    pub file: String,
    /// Line, from 1, where known.
    pub line: Option<usize>,
    /// Key or element, e.g. `goals[0].standoff_mm` or `link 'shoulder_link'`.
    pub key: Option<String>,
    /// What is wrong, with value and unit.
    pub message: String,
    /// How to fix it.
    pub hint: Option<String>,
    /// Byte range in the file's text, for a caret under the place.
    #[serde(skip)]
    pub span: Option<Range<usize>>,
    /// Nothing is wrong with the input: everything was tried, and nothing is feasible. In a study such a layout counts
    /// as one without a feasible configuration, not as an invalid layout.
    #[serde(skip)]
    pub nothing_serves: bool,
}

impl Finding {
    /// A finding about a whole file.
    pub fn new(file: impl Into<String>, message: impl Into<String>) -> Self {
        Self {
            file: file.into(),
            line: None,
            key: None,
            message: message.into(),
            hint: None,
            span: None,
            nothing_serves: false,
        }
    }

    /// With the key or element it is about.
    #[must_use]
    pub fn key(mut self, key: impl Into<String>) -> Self {
        self.key = Some(key.into());
        self
    }

    /// With a hint.
    #[must_use]
    pub fn hint(mut self, hint: impl Into<String>) -> Self {
        self.hint = Some(hint.into());
        self
    }

    /// With its place in the file's text.
    #[must_use]
    pub fn at(mut self, text: &str, span: Range<usize>) -> Self {
        let end = span.start.min(text.len());
        self.line = Some(
            1 + text
                .get(..end)
                .map_or(0, |before| before.matches('\n').count()),
        );
        self.span = Some(span);
        self
    }
}

/// Whether nothing is wrong with an input, but nothing is feasible: [`Finding::nothing_serves`] of all findings.
pub fn nothing_serves(findings: &[Finding]) -> bool {
    !findings.is_empty() && findings.iter().all(|finding| finding.nothing_serves)
}

impl fmt::Display for Finding {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{}", self.file)?;
        if let Some(line) = self.line {
            write!(formatter, ":{line}")?;
        }
        write!(formatter, ": ")?;
        if let Some(key) = &self.key
            && !self.message.contains(key.as_str())
        {
            write!(formatter, "{key}: ")?;
        }
        write!(formatter, "{}", self.message)?;
        if let Some(hint) = &self.hint {
            write!(formatter, "\n  hint: {hint}")?;
        }
        Ok(())
    }
}

/// The candidate most like `word`, if any is like it at all.
pub fn nearest_name<'a>(
    word: &str,
    candidates: impl IntoIterator<Item = &'a str>,
) -> Option<&'a str> {
    candidates
        .into_iter()
        .map(|candidate| (strsim::jaro_winkler(word, candidate), candidate))
        .filter(|(likeness, _)| *likeness > 0.75)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, candidate)| candidate)
}
