//! A limit that a value has to keep.

/// A limit, in the unit of what it is on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limit {
    /// The value.
    pub value: f64,
    /// What is limited has to be at least that much, instead of at most.
    pub at_least: bool,
}

impl Limit {
    /// Whether a value keeps it; one that is missing or not a number does not.
    pub fn is_met_by(self, found: Option<f64>) -> bool {
        found.is_some_and(|found| {
            if self.at_least {
                found >= self.value
            } else {
                found <= self.value
            }
        })
    }
}

/// Fewest digits of [`digits_apart`].
const FEWEST_DIGITS: usize = 3;
/// As many as an `f64` ever needs.
const MOST_DIGITS: usize = 17;

/// A value with as many significant digits as show on which side of a limit it is, at least three.
pub fn digits_apart(value: f64, limit: f64) -> String {
    let rounded = |number: f64, digits: usize| {
        let text = format!("{number:.*e}", digits - 1);
        text.parse::<f64>().unwrap_or(number)
    };
    let side = value.partial_cmp(&limit);
    let digits = (FEWEST_DIGITS..=MOST_DIGITS)
        .find(|&digits| rounded(value, digits).partial_cmp(&limit) == side)
        .unwrap_or(MOST_DIGITS);
    let magnitude = value.abs();
    if value == 0.0 || (1e-3..1e7).contains(&magnitude) {
        // Fixed point, with the same digits.
        format!("{}", rounded(value, digits))
    } else {
        format!("{value:.*e}", digits - 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn digits_show_on_which_side_of_the_limit_a_value_is() {
        assert_eq!(digits_apart(10.0014, 10.001), "10.0014");
        assert_eq!(digits_apart(12.345, 10.0), "12.3");
        assert_eq!(digits_apart(0.1 + 0.2, 0.3), "0.30000000000000004");
        assert_eq!(digits_apart(1.234e-9, 0.0), "1.23e-9");
        assert_eq!(digits_apart(9.9999, 10.0), "9.9999");
    }

    #[test]
    fn limits_include_their_value_and_nothing_that_is_missing() {
        for (at_least, below, above) in [(true, false, true), (false, true, false)] {
            let limit = Limit {
                value: 2.0,
                at_least,
            };
            let met = [1.9, 2.0, 2.1].map(|value| limit.is_met_by(Some(value)));
            assert_eq!(met, [below, true, above]);
            assert!(!limit.is_met_by(None) && !limit.is_met_by(Some(f64::NAN)));
        }
    }
}
