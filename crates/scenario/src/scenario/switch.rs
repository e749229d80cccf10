//! Values that are a number or switched off by name.

use serde::de::{Error, Visitor};
use serde::{Deserializer, Serializer};

use needlebench_input::schema::SWITCHED_OFF;

/// A number, or [`SWITCHED_OFF`].
#[expect(clippy::ref_option, reason = "the signature that serde calls")]
pub(super) fn serialize<S: Serializer>(
    value: &Option<f64>,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    match value {
        Some(number) => serializer.serialize_f64(*number),
        None => serializer.serialize_str(SWITCHED_OFF),
    }
}

/// See [`serialize`].
pub(super) fn deserialize<'de, D: Deserializer<'de>>(
    deserializer: D,
) -> Result<Option<f64>, D::Error> {
    struct NumberOrOff;
    impl Visitor<'_> for NumberOrOff {
        type Value = Option<f64>;

        fn expecting(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
            write!(formatter, "a number or \"{SWITCHED_OFF}\"")
        }
        fn visit_f64<E: Error>(self, number: f64) -> Result<Self::Value, E> {
            Ok(Some(number))
        }
        fn visit_i64<E: Error>(self, number: i64) -> Result<Self::Value, E> {
            Ok(Some(number as f64))
        }
        fn visit_u64<E: Error>(self, number: u64) -> Result<Self::Value, E> {
            Ok(Some(number as f64))
        }
        fn visit_str<E: Error>(self, word: &str) -> Result<Self::Value, E> {
            match word {
                SWITCHED_OFF => Ok(None),
                _ => Err(E::invalid_value(serde::de::Unexpected::Str(word), &self)),
            }
        }
    }
    deserializer.deserialize_any(NumberOrOff)
}
