//! Axes.

use crate::number;

/// How values lie along an axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scale {
    /// Equal steps.
    Linear,
    /// Equal factors; both ends are positive, and what is at or below the lower one stands there.
    Logarithmic,
}

/// An axis: what it is of and in which unit, its range, and where its ticks are.
#[derive(Debug, Clone, PartialEq)]
pub struct Axis {
    /// Quantity and unit.
    pub label: String,
    /// How values lie along it.
    pub scale: Scale,
    /// Value at the left or lower end.
    pub low: f64,
    /// Value at the right or upper end.
    pub high: f64,
    /// Value and text of each tick; none to have round ones made.
    ticks: Option<Vec<(f64, String)>>,
}

impl Axis {
    /// From `low` to `high`.
    pub fn linear(label: impl Into<String>, low: f64, high: f64) -> Self {
        Self {
            label: label.into(),
            scale: Scale::Linear,
            low,
            high,
            ticks: None,
        }
    }

    /// From `low` to `high`, both positive, in equal factors.
    pub fn logarithmic(label: impl Into<String>, low: f64, high: f64) -> Self {
        Self {
            scale: Scale::Logarithmic,
            ..Self::linear(label, low, high)
        }
    }

    /// Around all values with a margin; unit length around a single one.
    pub fn around(label: impl Into<String>, values: impl IntoIterator<Item = f64>) -> Self {
        let (low, high) = values
            .into_iter()
            .filter(|value| value.is_finite())
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
                (low.min(value), high.max(value))
            });
        if low > high {
            return Self::linear(label, 0.0, 1.0);
        }
        let margin = if high > low { 0.06 * (high - low) } else { 0.5 };
        Self::linear(label, low - margin, high + margin)
    }

    /// Whole decades, from `10^low` to `10^high`, with a tick every `every`.
    pub fn decades(
        label: impl Into<String>,
        [low, high]: [i32; 2],
        every: usize,
        name: impl Fn(i32) -> String,
    ) -> Self {
        let powers = (low..=high).step_by(every.max(1));
        let ticks = powers.map(|power| (10_f64.powi(power), name(power)));
        Self::logarithmic(label, 10_f64.powi(low), 10_f64.powi(high)).with_ticks(ticks.collect())
    }

    /// Shares from 0 to `high`, in per cent.
    pub fn percent(label: impl Into<String>, high: f64) -> Self {
        let ticks = (0..=5).map(|fifth| {
            let share = high * f64::from(fifth) / 5.0;
            (share, number::rounded(100.0 * share, 1))
        });
        Self::linear(label, 0.0, high).with_ticks(ticks.collect())
    }

    /// The axis with these ticks.
    pub fn with_ticks(self, ticks: Vec<(f64, String)>) -> Self {
        Self {
            ticks: Some(ticks),
            ..self
        }
    }

    /// Share of the way from the low to the high end; 0 and 1 for what is beyond.
    pub fn share(&self, value: f64) -> f64 {
        let share = match self.scale {
            Scale::Linear => (value - self.low) / (self.high - self.low),
            Scale::Logarithmic => {
                libm::log(value.max(self.low) / self.low) / libm::log(self.high / self.low)
            }
        };
        share.clamp(0.0, 1.0)
    }

    /// Values and texts along the axis: its own, or else round ones, about `wanted` of them.
    pub fn ticks(&self, wanted: f64) -> Vec<(f64, String)> {
        if let Some(ticks) = &self.ticks {
            return ticks.clone();
        }
        match self.scale {
            Scale::Linear => {
                let step = round_step(self.high - self.low, wanted);
                let named = |value: f64| (value, number::tick(value, step));
                multiples(self.low, self.high, step).map(named).collect()
            }
            Scale::Logarithmic => {
                let within = |value: &f64| {
                    *value >= self.low * (1.0 - 1e-9) && *value <= self.high * (1.0 + 1e-9)
                };
                (-12..=12)
                    .map(|power| 10_f64.powi(power))
                    .flat_map(|decade| [decade, 2.0 * decade, 5.0 * decade])
                    .filter(within)
                    .map(|value| (value, number::rounded(value, 6)))
                    .collect()
            }
        }
    }
}

/// 1, 2 or 5 times a power of ten: the smallest with which a range has at most `wanted` steps. 0 for a
/// range that is none.
pub fn round_step(range: f64, wanted: f64) -> f64 {
    let raw = range / wanted.max(1.0);
    if !(raw > 0.0 && raw.is_finite()) {
        return 0.0;
    }
    let decade = libm::pow(10_f64, libm::log10(raw).floor());
    [1.0, 2.0, 5.0, 10.0]
        .map(|factor| factor * decade)
        .into_iter()
        .find(|step| *step >= raw * (1.0 - 1e-9))
        .unwrap_or(raw)
}

/// Multiples of a step from `low` to `high`; none of a step that is none.
fn multiples(low: f64, high: f64, step: f64) -> impl Iterator<Item = f64> {
    /// More would be a step that does not fit its range.
    const MOST: u32 = 100;
    let first = (low / step - 1e-9).ceil();
    (0..MOST)
        .map(move |k| (first + f64::from(k)) * step)
        .take_while(move |value| *value <= high + 1e-9 * step)
        // Zero, not its rounding.
        .map(move |value| {
            if value.abs() < 1e-9 * step {
                0.0
            } else {
                value
            }
        })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn texts(axis: &Axis, wanted: f64) -> Vec<String> {
        axis.ticks(wanted)
            .into_iter()
            .map(|(_, text)| text)
            .collect()
    }

    #[test]
    fn ticks_are_round_and_inside() {
        let axis = Axis::linear("", -0.13, 1.07);
        assert_eq!(
            texts(&axis, 7.0),
            ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"]
        );
        let decades = Axis::logarithmic("", 1.0, 100.0);
        assert_eq!(
            texts(&decades, 3.0),
            ["1", "2", "5", "10", "20", "50", "100"]
        );
        // Ends count, though rounding may put them outside.
        assert_eq!(texts(&Axis::linear("", -0.3, 0.3), 6.0).len(), 7);
    }

    #[test]
    fn steps_are_round() {
        for (range, step) in [(0.9, 0.1), (1.7, 0.2), (4.0, 0.5), (90.0, 10.0), (0.0, 0.0)] {
            let found = round_step(range, 10.0);
            assert!((found - step).abs() < 1e-9, "{range}: {found}");
        }
    }

    #[test]
    fn axes_of_nothing_have_no_ticks_or_few() {
        for axis in [
            Axis::around("", [f64::NAN]),
            Axis::around("", []),
            Axis::around("", [3.0]),
            Axis::linear("", 1.0, 1.0),
            Axis::linear("", f64::NAN, 1.0),
            Axis::linear("", 0.0, f64::INFINITY),
            Axis::linear("", 1e300, 1e300 + 1.0),
        ] {
            assert!(axis.ticks(5.0).len() <= 12, "{axis:?}");
        }
    }

    #[test]
    fn values_are_placed_by_their_scale() {
        let axis = Axis::logarithmic("", 1.0, 100.0);
        let shares = [10.0, 0.0, -5.0, 1e6].map(|value| axis.share(value));
        assert_eq!(shares, [0.5, 0.0, 0.0, 1.0]);
        assert_eq!(Axis::linear("", -1.0, 1.0).share(0.5), 0.75);
    }
}
