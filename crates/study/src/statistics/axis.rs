//! Factors cut into bins.

use serde::{Deserialize, Serialize};

use crate::{Factor, FactorKind, FactorValue, Role};

/// Some of a factor's values.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Bin {
    /// In tables: the level, or the range.
    pub label: String,
    /// Lower end of the range of a continuum, or the level if it is a number; unit of the factor.
    pub low: Option<f64>,
    /// Upper end, likewise.
    pub high: Option<f64>,
}

/// A factor as the statistics see it: a few bins.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Axis {
    /// Index among the factors.
    pub factor: usize,
    /// Name of the factor.
    pub name: String,
    /// Unit of the factor.
    pub unit: String,
    /// Control or noise factor.
    pub role: Role,
    /// Whether a bin holds several levels or a part of a continuum.
    pub coarse: bool,
    /// The bins, in the order of the levels or of the numbers.
    pub bins: Vec<Bin>,
    /// Number of levels, 0 of a continuum.
    #[serde(skip)]
    levels: usize,
    #[serde(skip)]
    low: f64,
    #[serde(skip)]
    high: f64,
}

impl Axis {
    /// Cuts a factor into at most `bins` bins: a bin per level; several neighbouring levels per bin
    /// where there are more; equal widths of a continuum, whose first and last bin hold what is
    /// beyond its ends too.
    pub(crate) fn new(index: usize, factor: &Factor, bins: usize) -> Self {
        let bins = bins.max(1);
        let mut axis = Self {
            factor: index,
            name: factor.name.clone(),
            unit: factor.unit.clone(),
            role: factor.role,
            coarse: true,
            bins: Vec::new(),
            levels: 0,
            low: 0.0,
            high: 0.0,
        };
        match &factor.kind {
            FactorKind::Levels(levels) => {
                axis.levels = levels.len();
                axis.coarse = levels.len() > bins;
                let count = levels.len().min(bins);
                for bin in 0..count {
                    // The levels that `bin` puts here.
                    let first = (bin * levels.len()).div_ceil(count);
                    let last = ((bin + 1) * levels.len()).div_ceil(count) - 1;
                    let (a, b) = (&levels[first], &levels[last]);
                    axis.bins.push(Bin {
                        label: if first == last {
                            a.label.clone()
                        } else {
                            format!("{} .. {}", a.label, b.label)
                        },
                        low: a.number,
                        high: b.number,
                    });
                }
            }
            FactorKind::Continuous { low, high } => {
                (axis.low, axis.high) = (*low, *high);
                let width = (high - low) / bins as f64;
                let bins = if width > 0.0 { bins } else { 1 };
                for bin in 0..bins {
                    let a = low + width * bin as f64;
                    let b = low + width * (bin + 1) as f64;
                    axis.bins.push(Bin {
                        label: format!("{} .. {}", short(a, width), short(b, width)),
                        low: Some(a),
                        high: Some(b),
                    });
                }
            }
        }
        axis
    }

    /// Number of bins.
    pub fn len(&self) -> usize {
        self.bins.len()
    }

    /// Whether it has no bins: a factor without levels.
    pub fn is_empty(&self) -> bool {
        self.bins.is_empty()
    }

    /// Combinations of the crossed factors that it distinguishes.
    pub(crate) fn crossed(&self) -> u64 {
        self.levels.max(1) as u64
    }

    /// Whether it is cut from a continuum.
    pub(crate) fn is_continuous(&self) -> bool {
        self.levels == 0
    }

    /// Bin of a value.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "clamped to the bins"
    )]
    pub(crate) fn bin(&self, value: FactorValue) -> usize {
        match value {
            FactorValue::Level(level) => level * self.bins.len() / self.levels.max(1),
            FactorValue::Number(number) => {
                let share = (number - self.low) / (self.high - self.low);
                let last = self.bins.len().saturating_sub(1);
                ((share * self.bins.len() as f64).max(0.0) as usize).min(last)
            }
        }
    }
}

/// A number with a hundredth of a step's resolution.
fn short(value: f64, step: f64) -> String {
    let mut decimals = 0;
    let mut unit = 1.0;
    while unit > 0.3 * step && decimals < 9 {
        unit /= 10.0;
        decimals += 1;
    }
    let text = format!("{value:.decimals$}");
    // -0 is 0.
    if text.trim_start_matches(['-', '0', '.']).is_empty() {
        text.trim_start_matches('-').to_owned()
    } else {
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Level;

    #[test]
    fn levels_and_numbers_fall_into_the_bins_that_name_them() {
        for (count, bins) in [(3, 8), (8, 8), (30, 8), (1, 4), (7, 3)] {
            let levels = (0..count).map(|number: u32| Level {
                label: number.to_string(),
                number: Some(f64::from(number)),
            });
            let factor = Factor {
                name: "x".to_owned(),
                unit: String::new(),
                role: Role::Control,
                sampled: false,
                kind: FactorKind::Levels(levels.collect()),
            };
            let axis = Axis::new(0, &factor, bins);
            for level in 0..count {
                let bin = &axis.bins[axis.bin(FactorValue::Level(level as usize))];
                let value = f64::from(level);
                assert!(
                    bin.low.unwrap() <= value && value <= bin.high.unwrap(),
                    "{bin:?}"
                );
            }
        }
        let factor = Factor {
            name: "x".to_owned(),
            unit: "mm".to_owned(),
            role: Role::Noise,
            sampled: false,
            kind: FactorKind::Continuous {
                low: -10.0,
                high: 10.0,
            },
        };
        let axis = Axis::new(0, &factor, 4);
        let labels: Vec<&str> = axis.bins.iter().map(|bin| bin.label.as_str()).collect();
        assert_eq!(labels, ["-10 .. -5", "-5 .. 0", "0 .. 5", "5 .. 10"]);
        let bin = |number| axis.bin(FactorValue::Number(number));
        assert_eq!(
            [-99.0, -10.0, -5.0, 4.9, 10.0, 99.0].map(bin),
            [0, 0, 1, 2, 3, 3]
        );
    }
}
