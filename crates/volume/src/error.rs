//! Errors of a volume, and of what is looked for in it; remarks on one.

use serde::{Deserialize, Serialize};

/// An error: what is wrong, where, and how to fix it.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum VolumeError {
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
        /// How to fix it.
        hint: Option<String>,
    },
}

impl VolumeError {
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

    /// As a remark, where the rest is used nevertheless; none of an interruption.
    pub fn remark(&self) -> Option<Remark> {
        match self {
            Self::Interrupted => None,
            Self::Refused { place, message, .. } => Some(Remark {
                place: place.clone(),
                message: message.clone(),
            }),
        }
    }

    /// With how to fix it.
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

/// A remark on a volume that is used nevertheless.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Remark {
    /// File, series, slice or header element it is about, where it is not the whole input.
    pub place: Option<String>,
    /// What was found and how it was handled, with value and unit.
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
