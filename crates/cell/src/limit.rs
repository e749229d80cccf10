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

#[cfg(test)]
mod tests {
    use super::*;

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
