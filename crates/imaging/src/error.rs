//! What is wrong with a volume, and what is worth knowing of one.

use serde::{Deserialize, Serialize};

/// Why there is no answer: what is wrong, where, and how to mend it.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ImagingError {
    /// The user stopped it.
    #[error("interrupted")]
    Interrupted,
    /// Something about the input.
    #[error("{message}")]
    Refused {
        /// File, series, slice or header element it is about, where it is not the whole input.
        place: Option<String>,
        /// What is wrong, with value and unit.
        message: String,
        /// How to mend it.
        hint: Option<String>,
    },
}

impl ImagingError {
    /// Something wrong with the input as a whole.
    pub fn refused(message: impl Into<String>) -> Self {
        Self::Refused {
            place: None,
            message: message.into(),
            hint: None,
        }
    }

    /// With the file, series, slice or element it is about.
    #[must_use]
    pub fn at(self, place: impl Into<String>) -> Self {
        match self {
            Self::Interrupted => self,
            Self::Refused { message, hint, .. } => Self::Refused {
                place: Some(place.into()),
                message,
                hint,
            },
        }
    }

    /// With how to mend it.
    #[must_use]
    pub fn hint(self, hint: impl Into<String>) -> Self {
        match self {
            Self::Interrupted => self,
            Self::Refused { place, message, .. } => Self::Refused {
                place,
                message,
                hint: Some(hint.into()),
            },
        }
    }
}

/// Something that a user has to know of a volume that is used all the same.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Remark {
    /// File, series, slice or header element it is about, where it is not the whole input.
    pub place: Option<String>,
    /// What was found and what was made of it, with value and unit.
    pub message: String,
}

impl Remark {
    /// About the whole input.
    pub fn new(message: impl Into<String>) -> Self {
        Self {
            place: None,
            message: message.into(),
        }
    }

    /// With the file, series, slice or element it is about.
    #[must_use]
    pub fn at(mut self, place: impl Into<String>) -> Self {
        self.place = Some(place.into());
        self
    }
}
