//! Exact quantiles of streams that do not fit into memory.
//!
//! A [`Selector`] sees the same values three times. Their bits, mapped so that they sort as the
//! values do, are counted by their first 11, then by the next 11 below each first part that holds a
//! wanted rank, then by the last 10: radix selection, exact, in memory that depends on the number
//! of wanted ranks alone.

use std::rc::Rc;

use needlebench_numerics::order::quantile_position;

use super::interval::{Interval, TAIL, quantile_ranks};

/// Times that a selector has to see all values.
pub(crate) const PASSES: usize = 3;

/// Bits that each pass tells apart.
const BITS: [u32; PASSES] = [11, 11, 10];

/// Bits that are left to the right of what a pass tells apart.
const REST: [u32; PASSES] = [21, 10, 0];

const NONE: u16 = u16::MAX;

/// Bits of a number, sorted as the numbers are; -0 comes before 0.
fn ordered(value: f32) -> u32 {
    let bits = value.to_bits();
    if bits >> 31 == 1 {
        !bits
    } else {
        bits | 1 << 31
    }
}

fn from_ordered(ordered: u32) -> f32 {
    f32::from_bits(if ordered >> 31 == 1 {
        ordered & !(1 << 31)
    } else {
        !ordered
    })
}

/// A rank on its way down.
#[derive(Debug, Clone, Copy)]
struct Wanted {
    /// From 0, of all values.
    rank: u64,
    /// From 0, of those that share the prefix.
    within: u64,
    /// Bits that are known.
    prefix: u32,
}

/// Exact order statistics in three passes.
#[derive(Debug, Clone)]
pub(crate) struct Selector {
    pass: usize,
    count: u64,
    wanted: Vec<Wanted>,
    /// Prefixes that this pass looks below, ascending.
    prefixes: Vec<u32>,
    /// By the first 11 bits, the first of [`Selector::prefixes`] that starts with them.
    first: Vec<u16>,
    /// One block of counts per prefix.
    counts: Vec<u32>,
}

impl Selector {
    pub(crate) fn new() -> Self {
        Self {
            pass: 0,
            count: 0,
            wanted: Vec::new(),
            prefixes: vec![0],
            first: Vec::new(),
            counts: vec![0; 1 << BITS[0]],
        }
    }

    /// Number of values.
    pub(crate) fn count(&self) -> u64 {
        self.count
    }

    /// Counts a value that is not NaN.
    pub(crate) fn push(&mut self, value: f32) {
        let key = ordered(value);
        if self.pass == 0 {
            self.count += 1;
            self.counts[(key >> REST[0]) as usize] += 1;
            return;
        }
        if self.pass >= PASSES {
            return;
        }
        let start = self.first[(key >> REST[0]) as usize];
        if start == NONE {
            return;
        }
        let prefix = key >> REST[self.pass - 1];
        let mut block = usize::from(start);
        // Ascending, and few below the same first bits.
        while let Some(known) = self.prefixes.get(block) {
            if *known == prefix {
                let digit = (key >> REST[self.pass]) & ((1 << BITS[self.pass]) - 1);
                self.counts[(block << BITS[self.pass]) + digit as usize] += 1;
                return;
            }
            if *known > prefix {
                return;
            }
            block += 1;
        }
    }

    /// Ends a pass. The ranks, from 0, are taken at the end of the first.
    pub(crate) fn next_pass(&mut self, ranks: impl FnOnce(u64) -> Vec<u64>) {
        if self.pass == 0 {
            let mut ranks = ranks(self.count);
            ranks.retain(|rank| *rank < self.count);
            ranks.sort_unstable();
            ranks.dedup();
            self.wanted = ranks
                .into_iter()
                .map(|rank| Wanted {
                    rank,
                    within: rank,
                    prefix: 0,
                })
                .collect();
        }
        if self.pass >= PASSES {
            return;
        }
        let bits = BITS[self.pass];
        for wanted in &mut self.wanted {
            let Ok(block) = self.prefixes.binary_search(&wanted.prefix) else {
                continue;
            };
            let counts = &self.counts[block << bits..(block + 1) << bits];
            for (digit, count) in (0_u32..).zip(counts) {
                if wanted.within < u64::from(*count) {
                    wanted.prefix = wanted.prefix << bits | digit;
                    break;
                }
                wanted.within -= u64::from(*count);
            }
        }
        self.pass += 1;
        self.prefixes = self.wanted.iter().map(|wanted| wanted.prefix).collect();
        self.prefixes.dedup();
        self.counts = Vec::new();
        self.first = Vec::new();
        if self.pass < PASSES {
            self.counts = vec![0; self.prefixes.len() << BITS[self.pass]];
            self.first = vec![NONE; 1 << BITS[0]];
            let below_first = REST[0] - REST[self.pass - 1];
            for (block, prefix) in self.prefixes.iter().enumerate().rev() {
                self.first[(prefix >> below_first) as usize] =
                    u16::try_from(block).expect("few ranks");
            }
        }
    }

    /// The value of a rank, from 0, that was asked for; after all passes.
    pub(crate) fn value(&self, rank: u64) -> Option<f32> {
        if self.pass < PASSES {
            return None;
        }
        let at = self.wanted.binary_search_by_key(&rank, |each| each.rank);
        at.ok().map(|at| from_ordered(self.wanted[at].prefix))
    }
}

/// Quantiles of a stream with their intervals, over a [`Selector`].
#[derive(Debug, Clone)]
pub(crate) struct Quantiles {
    selector: Selector,
    probabilities: Rc<[f64]>,
    /// Rows that a sampled point appears in.
    repeats: u64,
    /// Chance that a quantile is beyond an end of its interval.
    tail: f64,
}

impl Quantiles {
    /// Quantiles of values of which up to `repeats` come from the same sampled point.
    pub(crate) fn new(probabilities: Rc<[f64]>, repeats: u64) -> Self {
        Self::with_tail(probabilities, repeats, TAIL)
    }

    /// The same with another probability that the true value is beyond each end of an interval.
    pub(crate) fn with_tail(probabilities: Rc<[f64]>, repeats: u64, tail: f64) -> Self {
        Self {
            selector: Selector::new(),
            probabilities,
            repeats: repeats.max(1),
            tail,
        }
    }

    pub(crate) fn count(&self) -> u64 {
        self.selector.count()
    }

    pub(crate) fn push(&mut self, value: f32) {
        self.selector.push(value);
    }

    pub(crate) fn next_pass(&mut self) {
        let probabilities = Rc::clone(&self.probabilities);
        let (repeats, tail) = (self.repeats, self.tail);
        self.selector.next_pass(|count| {
            let mut ranks = Vec::new();
            for &p in probabilities.iter() {
                let (low, _) = quantile_position(count, p);
                ranks.extend([low, low + 1]);
                let (low, high) = interval_ranks(count, p, repeats, tail);
                ranks.extend([low, high].into_iter().flatten());
            }
            ranks
        });
    }

    /// The quantile of type 7, after all passes; none of no values.
    pub(crate) fn value(&self, p: f64) -> Option<f64> {
        let (low, share) = quantile_position(self.count(), p);
        let at = f64::from(self.selector.value(low)?);
        Some(match self.selector.value(low + 1) {
            Some(next) if share > 0.0 => at + share * (f64::from(next) - at),
            _ => at,
        })
    }

    /// Interval of a quantile; none where the sample is too small for one.
    pub(crate) fn interval(&self, p: f64) -> Option<Interval> {
        let (low, high) = interval_ranks(self.count(), p, self.repeats, self.tail);
        Some(Interval {
            low: f64::from(self.selector.value(low?)?),
            high: f64::from(self.selector.value(high?)?),
        })
    }
}

/// Ranks, from 0, of the ends of a quantile's interval. Values of one sampled point are counted as
/// one, which is as little as they can tell.
fn interval_ranks(count: u64, p: f64, repeats: u64, tail: f64) -> (Option<u64>, Option<u64>) {
    let points = count / repeats;
    if points == 0 {
        return (None, None);
    }
    let (low, high) = quantile_ranks(points, p, tail);
    let scaled = |rank: u64| u128::from(rank) * u128::from(count);
    let points = u128::from(points);
    let low = low.map(|low| u64::try_from(scaled(low) / points).unwrap_or(count) - 1);
    let high = high.map(|high| {
        let rank = u64::try_from(scaled(high).div_ceil(points)).unwrap_or(count);
        rank.min(count) - 1
    });
    (low, high)
}

#[cfg(test)]
mod tests {
    use super::*;
    use needlebench_numerics::random::SplitMix64;

    const PROBABILITIES: [f64; 9] = [0.0, 0.01, 0.05, 0.25, 0.5, 0.75, 0.95, 0.99, 1.0];

    fn quantiles(values: &[f32], repeats: u64) -> Quantiles {
        let mut found = Quantiles::new(Rc::from(PROBABILITIES), repeats);
        for _ in 0..PASSES {
            for value in values {
                found.push(*value);
            }
            found.next_pass();
        }
        found
    }

    /// By definition: sort, interpolate.
    fn sorted_quantile(values: &[f32], p: f64) -> f64 {
        let mut sorted = values.to_vec();
        sorted.sort_by(f32::total_cmp);
        let (low, share) = quantile_position(sorted.len() as u64, p);
        let at =
            |rank: u64| f64::from(sorted[usize::try_from(rank).unwrap().min(sorted.len() - 1)]);
        at(low) + share * (at(low + 1) - at(low))
    }

    #[test]
    fn quantiles_are_exact_on_whatever_comes() {
        let mut random = SplitMix64::new(7);
        let mut uniform = || random.uniform(-1.0, 1.0);
        #[expect(clippy::cast_possible_truncation, reason = "the values are f32")]
        let narrow: Vec<f32> = (0..10_001)
            .map(|_| (10.0 + 1e-3 * uniform()) as f32)
            .collect();
        #[expect(clippy::cast_possible_truncation, reason = "the values are f32")]
        let wide: Vec<f32> = (0..5_000)
            .map(|_| (uniform() * libm::pow(10.0_f64, 30.0 * uniform())) as f32)
            .collect();
        let ties: Vec<f32> = (0..999_u16).map(|i| f32::from(i % 3) - 1.0).collect();
        for values in [
            narrow,
            wide,
            ties,
            vec![3.0],
            vec![-0.0, f32::MIN, f32::MAX],
        ] {
            let found = quantiles(&values, 1);
            for p in PROBABILITIES {
                assert_eq!(found.value(p), Some(sorted_quantile(&values, p)), "{p}");
            }
        }
    }

    #[test]
    fn no_values_have_no_quantiles() {
        let found = quantiles(&[], 1);
        assert_eq!((found.value(0.5), found.interval(0.5)), (None, None));
    }

    #[test]
    fn interval_covers_the_quantile_as_often_as_it_says() {
        // Median of 201 uniform numbers in 2000 samples: 95 % are 1900, -3 standard errors of 9.7.
        let mut random = SplitMix64::new(1);
        let mut covered = 0;
        for _ in 0..2000 {
            #[expect(clippy::cast_possible_truncation, reason = "the values are f32")]
            let values: Vec<f32> = (0..201).map(|_| random.uniform(0.0, 1.0) as f32).collect();
            let interval = quantiles(&values, 1).interval(0.5).unwrap();
            covered += usize::from(interval.low <= 0.5 && 0.5 <= interval.high);
        }
        assert!((1870..=1990).contains(&covered), "{covered}");
    }

    #[test]
    fn repeated_points_widen_the_interval() {
        let once: Vec<f32> = (0..200_u16).map(f32::from).collect();
        let thrice: Vec<f32> = once.iter().flat_map(|value| [*value; 3]).collect();
        let (alone, repeated) = (quantiles(&once, 1), quantiles(&thrice, 3));
        let (a, b) = (
            alone.interval(0.5).unwrap(),
            repeated.interval(0.5).unwrap(),
        );
        assert!(b.low <= a.low && b.high >= a.high && b.high - b.low < 1.05 * (a.high - a.low));
        assert_eq!(quantiles(&once, 3).interval(0.01), None);
    }
}
