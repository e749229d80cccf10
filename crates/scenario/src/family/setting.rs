//! Values that keys are set to.

use std::borrow::Cow;
use std::fmt;

use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::{Deserialize, Serialize};
use toml::Value;

/// A value of a key, as a file gives it: a number, a text, a list, a table ...
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Setting(pub(super) Value);

impl Setting {
    /// If it is a number.
    pub fn number(&self) -> Option<f64> {
        match &self.0 {
            Value::Integer(number) => Some(*number as f64),
            Value::Float(number) => Some(*number),
            _ => None,
        }
    }

    /// If it is a text.
    pub fn text(&self) -> Option<&str> {
        self.0.as_str()
    }
}

impl From<f64> for Setting {
    fn from(number: f64) -> Self {
        Self(number_value(number))
    }
}

impl From<&str> for Setting {
    fn from(text: &str) -> Self {
        Self(Value::String(text.to_owned()))
    }
}

impl From<bool> for Setting {
    fn from(truth: bool) -> Self {
        Self(Value::Boolean(truth))
    }
}

impl<const N: usize> From<[f64; N]> for Setting {
    fn from(numbers: [f64; N]) -> Self {
        Self(Value::Array(numbers.map(number_value).to_vec()))
    }
}

/// A number as a file would give it: a whole one without a point, which keys take that want whole
/// numbers and keys that do not.
pub(super) fn number_value(number: f64) -> Value {
    /// Whole numbers up to here are exact in both forms.
    const EXACT: f64 = 9_007_199_254_740_992.0;
    let is_negative_zero = number == 0.0 && number.is_sign_negative();
    if number.fract() == 0.0 && number.abs() <= EXACT && !is_negative_zero {
        #[expect(clippy::cast_possible_truncation, reason = "whole and small enough")]
        Value::Integer(number as i64)
    } else {
        Value::Float(number)
    }
}

/// In tables: a text without quotes, all else as in a file.
impl fmt::Display for Setting {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.0 {
            Value::String(text) => formatter.pad(text),
            Value::Float(number) => formatter.pad(&number.to_string()),
            other => formatter.pad(&other.to_string()),
        }
    }
}

impl JsonSchema for Setting {
    fn schema_name() -> Cow<'static, str> {
        "Setting".into()
    }

    fn inline_schema() -> bool {
        true
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        Schema::from(true)
    }
}

/// What is done to a key.
#[derive(Debug, Clone, PartialEq)]
pub enum Change {
    /// It gets this value.
    Set(Setting),
    /// This is added to its value, which has to be a number.
    Add(f64),
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_numbers_are_whole_and_nothing_is_rounded() {
        assert_eq!(Setting::from(3.0).0, Value::Integer(3));
        assert_eq!(Setting::from(-3.5).0, Value::Float(-3.5));
        assert!(matches!(Setting::from(-0.0).0, Value::Float(zero) if zero.is_sign_negative()));
        for number in [0.1, -7.0, 1e15, 1e300, -0.0] {
            let same = Setting::from(number).number().map(f64::to_bits);
            assert_eq!(same, Some(number.to_bits()));
        }
    }

    #[test]
    fn tables_show_texts_without_quotes() {
        assert_eq!(Setting::from("offset").to_string(), "offset");
        assert_eq!(Setting::from(0.5).to_string(), "0.5");
        assert_eq!(Setting::from([1.0, 2.5]).to_string(), "[1, 2.5]");
        assert_eq!(Setting::from(true).to_string(), "true");
    }
}
