//! How a patient lay in the scanner.

use std::fmt;

use serde::{Serialize, Serializer};

/// On what a patient lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Lying {
    /// On the back.
    Supine,
    /// On the front.
    Prone,
    /// On the left side.
    LeftSide,
    /// On the right side.
    RightSide,
}

/// How a patient lay in the scanner, as DICOM has it (0018,5100).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PatientPosition {
    /// On what.
    pub lying: Lying,
    /// Whether the head went into the gantry first, and not the feet.
    pub head_first: bool,
}

/// Defined terms, PS3.3 C.7.3.1.1.2.
const TERMS: [(&str, Lying, bool); 8] = [
    ("HFS", Lying::Supine, true),
    ("HFP", Lying::Prone, true),
    ("HFDL", Lying::LeftSide, true),
    ("HFDR", Lying::RightSide, true),
    ("FFS", Lying::Supine, false),
    ("FFP", Lying::Prone, false),
    ("FFDL", Lying::LeftSide, false),
    ("FFDR", Lying::RightSide, false),
];

impl PatientPosition {
    /// Of a defined term; none for those of patients who sit or stand.
    pub fn of_term(term: &str) -> Option<Self> {
        let (_, lying, head_first) = *TERMS.iter().find(|(known, ..)| *known == term.trim())?;
        Some(Self { lying, head_first })
    }

    /// The defined term.
    pub fn term(self) -> &'static str {
        let mut all = TERMS.iter();
        let found = all.find(|(_, lying, first)| (*lying, *first) == (self.lying, self.head_first));
        found.map_or("", |(term, ..)| term)
    }
}

impl fmt::Display for PatientPosition {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let lying = match self.lying {
            Lying::Supine => "supine",
            Lying::Prone => "prone",
            Lying::LeftSide => "left decubitus",
            Lying::RightSide => "right decubitus",
        };
        let first = if self.head_first { "head" } else { "feet" };
        write!(f, "{lying}, {first} first ({})", self.term())
    }
}

impl Serialize for PatientPosition {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.term())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn terms_are_read_and_written() {
        for (term, ..) in TERMS {
            assert_eq!(PatientPosition::of_term(term).unwrap().term(), term);
        }
        let prone = PatientPosition::of_term("FFP ").unwrap();
        assert_eq!(prone.to_string(), "prone, feet first (FFP)");
        assert_eq!(PatientPosition::of_term("SITTING"), None);
    }
}
