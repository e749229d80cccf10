//! How often each Hounsfield unit occurs.

use crate::AIR_HU;

/// Values looked at in a hurry: enough to see a peak.
const SAMPLE: usize = 1 << 20;

/// Lowest and highest HU at which air is looked for, and how far from -1000 its peak may be.
const AIR_BELOW_HU: i16 = -500;
const AIR_PEAK_HU: i16 = 60;

/// Share of values below [`AIR_BELOW_HU`] without which there is no peak to speak of.
const SOME_AIR: f64 = 1e-3;

/// Counts of all values that 16 bits have.
#[derive(Debug, Clone, PartialEq)]
pub struct HuHistogram {
    counts: Vec<u64>,
    total: u64,
}

impl HuHistogram {
    /// Of all values but those which are padding: `padding` of them, which are air.
    pub fn of(hu: &[i16], padding: u64) -> Self {
        Self::counted(hu.iter(), padding)
    }

    /// Of about a million values, evenly taken: quick, and good for peaks. Padding stays in it.
    pub fn sampled(hu: &[i16]) -> Self {
        // Odd, lest it keeps step with rows.
        let step = (hu.len() / SAMPLE) | 1;
        Self::counted(hu.iter().step_by(step), 0)
    }

    fn counted<'a>(values: impl Iterator<Item = &'a i16>, padding: u64) -> Self {
        let mut counts = vec![0; 1 << 16];
        let mut total = 0;
        for value in values {
            counts[bin(*value)] += 1;
            total += 1;
        }
        let padding = padding.min(counts[bin(AIR_HU)]);
        counts[bin(AIR_HU)] -= padding;
        Self {
            counts,
            total: total - padding,
        }
    }

    /// Number of values.
    pub fn total(&self) -> u64 {
        self.total
    }

    /// How many values are just this.
    pub fn count(&self, hu: i16) -> u64 {
        self.counts[bin(hu)]
    }

    /// Least and greatest value; none where all is padding.
    pub fn range_hu(&self) -> Option<[i16; 2]> {
        let first = self.counts.iter().position(|count| *count > 0)?;
        let last = self.counts.iter().rposition(|count| *count > 0)?;
        Some([value(first), value(last)])
    }

    /// The least value that at least this share of the values does not exceed.
    pub fn quantile_hu(&self, share: f64) -> Option<i16> {
        let mut seen = 0;
        let bin = self.counts.iter().position(|count| {
            seen += count;
            seen > 0 && seen as f64 >= share * self.total as f64
        })?;
        Some(value(bin))
    }

    /// Mean of the values.
    pub fn mean_hu(&self) -> Option<f64> {
        let sum: f64 = self
            .counts
            .iter()
            .enumerate()
            .map(|(bin, count)| f64::from(value(bin)) * *count as f64)
            .sum();
        (self.total > 0).then(|| sum / self.total as f64)
    }

    /// The most frequent value below -500 HU, over a window of 11: where air is. None where hardly anything is there.
    pub fn air_peak_hu(&self) -> Option<i16> {
        let low = &self.counts[..bin(AIR_BELOW_HU)];
        let share = low.iter().sum::<u64>() as f64 / self.total.max(1) as f64;
        if share < SOME_AIR {
            return None;
        }
        let first = low.iter().position(|count| *count > 0)?;
        let last = low.iter().rposition(|count| *count > 0)?;
        let smooth = |at: usize| -> u64 {
            low[at.saturating_sub(5)..(at + 6).min(low.len())]
                .iter()
                .sum()
        };
        let peak = (first..=last).max_by_key(|at| (smooth(*at), low[*at], usize::MAX - at))?;
        Some(value(peak))
    }

    /// Whether there is a peak within 60 HU of -1000, as there is in every CT with air in it.
    pub fn has_air_peak(&self) -> bool {
        self.air_peak_hu()
            .is_some_and(|peak| (peak - AIR_HU).abs() <= AIR_PEAK_HU)
    }
}

fn bin(hu: i16) -> usize {
    usize::from(hu.cast_unsigned() ^ 0x8000)
}

fn value(bin: usize) -> i16 {
    u16::try_from(bin).map_or(i16::MAX, |bin| (bin ^ 0x8000).cast_signed())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_values_that_occur_and_padding_is_none() {
        let hu: Vec<i16> = (0..100).chain([AIR_HU; 50]).collect();
        let histogram = HuHistogram::of(&hu, 50);
        assert_eq!(histogram.total(), 100);
        assert_eq!(histogram.range_hu(), Some([0, 99]));
        assert_eq!(histogram.quantile_hu(0.0), Some(0));
        assert_eq!(histogram.quantile_hu(0.5), Some(49));
        assert_eq!(histogram.quantile_hu(1.0), Some(99));
        assert_eq!(histogram.mean_hu(), Some(49.5));
        assert_eq!(HuHistogram::of(&[AIR_HU; 3], 3).range_hu(), None);
    }

    #[test]
    fn extremes_of_sixteen_bits_have_their_own_bins() {
        let histogram = HuHistogram::of(&[i16::MIN, i16::MAX, i16::MAX], 0);
        assert_eq!(histogram.range_hu(), Some([i16::MIN, i16::MAX]));
        assert_eq!(histogram.count(i16::MAX), 2);
    }

    #[test]
    fn the_peak_of_noisy_air_is_found_and_that_of_stored_numbers_is_not() {
        let noisy = |mean: i16| -> Vec<i16> {
            (0..4000)
                .map(|each| mean + each % 41 - 20)
                .chain([40; 4000])
                .collect()
        };
        assert!(HuHistogram::of(&noisy(-1000), 0).has_air_peak());
        assert!(HuHistogram::of(&noisy(-1020), 0).has_air_peak());
        assert!(!HuHistogram::of(&noisy(24), 0).has_air_peak());
        assert!(!HuHistogram::of(&noisy(-700), 0).has_air_peak());
        assert_eq!(HuHistogram::of(&noisy(24), 0).air_peak_hu(), None);
    }
}
