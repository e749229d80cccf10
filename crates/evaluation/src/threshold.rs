//! Largest losses that a comparison allows.

use needlebench_cell::nearest_name;

use crate::metric::{METRICS, Metric, Quantity};

/// How much worse a metric may get.
#[derive(Debug, Clone)]
pub struct Threshold {
    /// The metric.
    pub metric: &'static Metric,
    /// The limit.
    pub limit: Limit,
    /// The limit as it was given.
    pub text: String,
}

/// A limit of a loss.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Limit {
    /// In the metric's SI unit.
    Absolute(f64),
    /// Share of the first value's magnitude.
    Relative(f64),
}

impl Threshold {
    /// Whether a loss from the first value is more than it allows.
    pub fn is_exceeded_by(&self, loss: f64, first: f64) -> bool {
        match self.limit {
            Limit::Absolute(limit) => loss > limit,
            Limit::Relative(share) => loss > share * first.abs(),
        }
    }

    /// Reads a limit such as `0.5mm`, `5%`, `0.1s`, `2deg` for a metric.
    ///
    /// # Errors
    /// In words: an unknown metric, no number, a negative one, or a unit of something else.
    pub fn parse(name: &str, limit: &str) -> Result<Self, ThresholdError> {
        let metric = Metric::named(name).ok_or_else(|| ThresholdError::Metric {
            name: name.to_owned(),
            near: nearest_name(name, METRICS.iter().map(|metric| metric.name)),
        })?;
        let text = limit.trim();
        // The unit starts with the first letter that is none of a number such as `1e-3`.
        let number_end = text
            .char_indices()
            .map(|(index, _)| index)
            .chain([text.len()])
            .rev()
            .find(|&end| text[..end].trim_end().parse::<f64>().is_ok())
            .ok_or_else(|| ThresholdError::Number {
                text: text.to_owned(),
            })?;
        let (number, unit) = (text[..number_end].trim_end(), text[number_end..].trim());
        let value: f64 = number.parse().map_err(|_| ThresholdError::Number {
            text: text.to_owned(),
        })?;
        if !value.is_finite() || value < 0.0 {
            return Err(ThresholdError::Range {
                text: text.to_owned(),
            });
        }
        let limit = if unit == "%" {
            Limit::Relative(value / 100.0)
        } else {
            let units = units(metric.quantity);
            let scale = units.iter().find(|(name, _)| *name == unit);
            let (_, scale) = scale.ok_or_else(|| ThresholdError::Unit {
                metric: metric.name,
                unit: unit.to_owned(),
                known: units
                    .iter()
                    .map(|(name, _)| *name)
                    .filter(|name| !name.is_empty())
                    .chain(["%"])
                    .collect::<Vec<_>>()
                    .join(", "),
            })?;
            Limit::Absolute(value * scale)
        };
        Ok(Self {
            metric,
            limit,
            text: text.to_owned(),
        })
    }
}

/// Units of a quantity, with their size in SI.
fn units(quantity: Quantity) -> &'static [(&'static str, f64)] {
    const DEGREE: f64 = std::f64::consts::PI / 180.0;
    match quantity {
        Quantity::Length => &[
            ("mm", 1e-3),
            ("m", 1.0),
            ("cm", 1e-2),
            ("um", 1e-6),
            ("nm", 1e-9),
        ],
        Quantity::Angle => &[("deg", DEGREE), ("rad", 1.0), ("mrad", 1e-3)],
        Quantity::Time => &[("s", 1.0), ("ms", 1e-3)],
        Quantity::Force => &[("N", 1.0), ("mN", 1e-3)],
        Quantity::LengthPerAngle => &[("mm/mrad", 1.0), ("m/rad", 1.0), ("mm/deg", 1e-3 / DEGREE)],
        Quantity::Ratio => &[("", 1.0)],
    }
}

/// What is wrong with a threshold.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ThresholdError {
    /// There is no such metric.
    #[error("`{name}` is no metric")]
    Metric {
        /// As given.
        name: String,
        /// The metric most like it.
        near: Option<&'static str>,
    },
    /// It does not start with a number.
    #[error("`{text}` is not a number with a unit")]
    Number {
        /// As given.
        text: String,
    },
    /// The number is negative or not finite.
    #[error("`{text}` is not a loss: it has to be finite and not negative")]
    Range {
        /// As given.
        text: String,
    },
    /// The unit does not fit the metric.
    #[error("`{unit}` is not a unit of {metric}")]
    Unit {
        /// The metric.
        metric: &'static str,
        /// As given.
        unit: String,
        /// Units that fit.
        known: String,
    },
}

impl ThresholdError {
    /// How to mend it.
    pub fn hint(&self) -> String {
        match self {
            Self::Metric {
                near: Some(near), ..
            } => format!("did you mean `{near}`?"),
            Self::Metric { near: None, .. } => {
                let names: Vec<&str> = METRICS.iter().map(|metric| metric.name).collect();
                format!("the metrics are {}", names.join(", "))
            }
            Self::Number { .. } | Self::Range { .. } => {
                "such as 0.5mm, 5%, 0.1s or 2deg".to_owned()
            }
            Self::Unit { known, .. } => format!("give one of {known}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn limit(metric: &str, text: &str) -> Limit {
        Threshold::parse(metric, text).unwrap().limit
    }

    fn hint(metric: &str, text: &str) -> String {
        let error = Threshold::parse(metric, text).unwrap_err();
        format!("{error}; {}", error.hint())
    }

    #[test]
    fn limits_come_out_in_si_units() {
        assert_eq!(limit("clearance", "0.5mm"), Limit::Absolute(0.5e-3));
        assert_eq!(limit("clearance", " 1e-3 m "), Limit::Absolute(1e-3));
        assert_eq!(limit("tip_error", "10um"), Limit::Absolute(10.0 * 1e-6));
        assert_eq!(limit("motion_time", "100 ms"), Limit::Absolute(0.1));
        assert_eq!(
            limit("hand_cone", "180deg"),
            Limit::Absolute(std::f64::consts::PI)
        );
        assert_eq!(limit("joint_margin", "0.05"), Limit::Absolute(0.05));
        assert_eq!(limit("joint_margin", "5%"), Limit::Relative(0.05));
    }

    #[test]
    fn wrong_thresholds_say_what_to_write() {
        assert!(hint("clearence", "1mm").contains("did you mean `clearance`?"));
        assert!(hint("xyz", "1mm").contains("the metrics are clearance, "));
        assert!(
            hint("clearance", "1s").contains("`s` is not a unit of clearance; give one of mm, m,")
        );
        assert!(hint("clearance", "1").contains("give one of mm, m,"));
        assert!(hint("motion_time", "1m").contains("give one of s, ms, %"));
        assert!(hint("clearance", "mm").contains("0.5mm"));
        for wrong in ["-1mm", "nan", "inf", "infmm"] {
            assert!(hint("clearance", wrong).contains("finite"), "{wrong}");
        }
    }

    #[test]
    fn share_is_of_the_first_value() {
        let threshold = Threshold::parse("clearance", "10%").unwrap();
        assert!(!threshold.is_exceeded_by(0.99e-3, 10e-3));
        assert!(threshold.is_exceeded_by(1.01e-3, 10e-3));
        assert!(threshold.is_exceeded_by(1e-9, 0.0));
    }
}
