//! Values of other crates as TOML.

mod held;

use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::Finding;

pub use held::{read as read_value, read_table};

/// A value as TOML.
///
/// # Errors
/// A value that TOML does not have.
pub fn to_toml<T: Serialize>(value: &T) -> Result<String, String> {
    toml::to_string(value).map_err(|error| error.to_string())
}

/// A value from TOML; `file` is its name in messages.
///
/// # Errors
/// What is wrong with the text, with its line.
pub fn from_toml<T: DeserializeOwned>(file: &str, text: &str) -> Result<T, Finding> {
    toml::from_str(text).map_err(|error| {
        let line = error
            .span()
            .map(|span| text[..span.start.min(text.len())].matches('\n').count() + 1);
        Finding {
            line,
            ..Finding::new(file, error.message().to_owned())
        }
    })
}
