//! The control factors of a search.

use crate::FactorValue;

/// A value of each control factor, in their order.
pub type Candidate = Vec<FactorValue>;

/// A control factor.
#[derive(Debug, Clone, PartialEq)]
pub enum ChoiceAxis {
    /// One of so many.
    Levels(usize),
    /// Between two ends.
    Range {
        /// The lower one.
        low: f64,
        /// The upper one.
        high: f64,
    },
}

/// The control factors: combinations of the finite ones, and for each of them a unit cube of those with ranges.
#[derive(Debug, Clone, PartialEq)]
pub struct Choices(pub Vec<ChoiceAxis>);

/// Fewest steps that a range is resolved into.
const STEPS: f64 = 1000.0;

impl Choices {
    /// Number of factors with ranges.
    pub fn dimensions(&self) -> usize {
        let ranges = self.0.iter();
        ranges
            .filter(|axis| matches!(axis, ChoiceAxis::Range { .. }))
            .count()
    }

    /// Number of combinations of the finite ones; `None` beyond what can be counted.
    pub fn combinations(&self) -> Option<usize> {
        self.0.iter().try_fold(1_usize, |product, axis| match axis {
            ChoiceAxis::Levels(levels) => product.checked_mul(*levels),
            ChoiceAxis::Range { .. } => Some(product),
        })
    }

    /// A combination of the finite ones, the last factor's levels fastest, with a point of the unit cube. Numbers are
    /// rounded to a power of ten of at most a thousandth of their range: more digits would say nothing.
    pub fn candidate(&self, combination: usize, unit: &[f64]) -> Candidate {
        let mut rest = combination;
        let mut unit = unit.iter().rev();
        let mut values: Candidate = self
            .0
            .iter()
            .rev()
            .map(|axis| match *axis {
                ChoiceAxis::Levels(levels) => {
                    let level = rest % levels;
                    rest /= levels;
                    FactorValue::Level(level)
                }
                ChoiceAxis::Range { low, high } => {
                    let unit = unit.next().expect("a coordinate for each range");
                    FactorValue::Number(rounded(low + (high - low) * unit, low, high))
                }
            })
            .collect();
        values.reverse();
        values
    }
}

fn rounded(x: f64, low: f64, high: f64) -> f64 {
    #[expect(clippy::cast_possible_truncation, reason = "a decimal exponent")]
    let exponent = libm::log10((high - low) / STEPS).floor() as i32;
    // Negative powers of ten are not exact; their reciprocals are.
    let nearest = if exponent < 0 {
        let per_unit = libm::pow(10.0, f64::from(-exponent));
        (x * per_unit).round() / per_unit
    } else {
        let step = libm::pow(10.0, f64::from(exponent));
        (x / step).round() * step
    };
    nearest.clamp(low, high)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn combinations_count_the_last_factor_fastest() {
        let choices = Choices(vec![
            ChoiceAxis::Levels(2),
            ChoiceAxis::Range {
                low: -100.0,
                high: 300.0,
            },
            ChoiceAxis::Levels(3),
        ]);
        assert_eq!(choices.combinations(), Some(6));
        assert_eq!(choices.dimensions(), 1);
        let expected = [
            FactorValue::Level(1),
            FactorValue::Number(-33.3),
            FactorValue::Level(1),
        ];
        assert_eq!(choices.candidate(4, &[1.0 / 6.0]), expected);
    }

    #[test]
    fn numbers_have_the_digits_of_their_range() {
        assert_eq!(rounded(0.123_456, 0.0, 1.0), 0.123);
        assert_eq!(rounded(123_456.0, 0.0, 1e6), 123_000.0);
        assert_eq!(rounded(0.299_99, 0.0, 0.3), 0.3);
        assert_eq!(rounded(0.333_333, 0.0, 0.333_333_3), 0.3333);
    }
}
