//! Main effects and interactions of the factors.

use needlebench_kinematics::ik::Configuration;
use serde::{Deserialize, Serialize};

use super::axis::Axis;
use super::interval::{Interval, TAIL, about_mean, clopper_pearson};
use super::layout::{CONFIGURATIONS, Layout};
use super::moments::{Grouped, Moments};
use crate::FactorValue;

/// Responses: four of the layout, then the success of each configuration.
const RESPONSES: usize = 4 + CONFIGURATIONS;

/// Effects of the factors on the responses.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Effects {
    /// The factors that take more than one value, cut into bins.
    pub axes: Vec<Axis>,
    /// One by one.
    pub responses: Vec<ResponseEffects>,
}

/// Effects of the factors on a response.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ResponseEffects {
    /// `any_works` (1 where at least one configuration is ok, else 0), `working` (how many are),
    /// `best_clearance_mm` and `least_tip_error_mm` of those that are, `success <label>`.
    pub response: String,
    /// Layouts that have it.
    pub count: u64,
    /// Mean over them.
    pub mean: Option<f64>,
    /// Standard deviation over them.
    pub standard_deviation: Option<f64>,
    /// Main effects, in the order of [`Effects::axes`].
    pub main: Vec<MainEffect>,
    /// Interactions; the largest first.
    pub interactions: Vec<Interaction>,
}

/// The main effect of a factor on a response.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MainEffect {
    /// Index of the axis.
    pub axis: usize,
    /// Share of the response's variance that the means of the bins explain, without what chance
    /// explains: epsilon squared. About 0 or below where it explains nothing.
    pub share: Option<f64>,
    /// Largest share that is not significant at the 5 % level.
    pub noise: Option<f64>,
    /// Mean in each bin.
    pub bins: Vec<BinMean>,
}

/// Mean of a response in a bin.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct BinMean {
    /// Layouts.
    pub count: u64,
    /// Mean; none of no layouts.
    pub mean: Option<f64>,
    /// Its interval: Clopper and Pearson's of a share, Student's of a mean; none of a single number.
    pub interval: Option<Interval>,
    /// Whether there are fewer than 30 independent layouts.
    pub small: bool,
}

/// The interaction of two factors.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Interaction {
    /// Indices of the axes.
    pub axes: [usize; 2],
    /// Share of the response's variance, without what chance explains.
    pub share: f64,
    /// Largest share that is not significant at the 5 % level.
    pub noise: f64,
}

/// Values of the responses in a layout; NaN where it has none.
fn responses(layout: &Layout) -> [f64; RESPONSES] {
    let mut values = [f64::NAN; RESPONSES];
    let working = layout.working();
    values[0] = f64::from(u8::from(working > 0));
    values[1] = working as f64;
    values[2] = layout.best_clearance.map_or(f64::NAN, f64::from);
    values[3] = layout.least_tip_error.map_or(f64::NAN, f64::from);
    for (index, value) in values[4..].iter_mut().enumerate() {
        *value = f64::from(u8::from(layout.works(index)));
    }
    values
}

fn name(response: usize) -> String {
    match response {
        0 => "any_works".to_owned(),
        1 => "working".to_owned(),
        2 => "best_clearance_mm".to_owned(),
        3 => "least_tip_error_mm".to_owned(),
        _ => format!("success {}", Configuration::ALL[response - 4].label()),
    }
}

fn is_rate(response: usize) -> bool {
    response == 0 || response >= 4
}

/// Effects of each factor alone: the first pass.
pub(crate) struct MainEffects {
    pub(crate) axes: Vec<Axis>,
    all: [Moments; RESPONSES],
    groups: Vec<Grouped>,
    /// By axis, then bin.
    bins: Vec<Vec<[Moments; RESPONSES]>>,
    repeats: u64,
}

impl MainEffects {
    pub(crate) fn new(axes: Vec<Axis>, repeats: u64) -> Self {
        let bins = axes
            .iter()
            .map(|axis| vec![[Moments::default(); RESPONSES]; axis.len()]);
        Self {
            bins: bins.collect(),
            axes,
            all: [Moments::default(); RESPONSES],
            groups: vec![Grouped::default(); RESPONSES],
            repeats,
        }
    }

    pub(crate) fn push(&mut self, values: &[FactorValue], layout: &Layout, group: usize) {
        let found = responses(layout);
        let push = |to: &mut [Moments; RESPONSES]| {
            for (moments, value) in to.iter_mut().zip(found) {
                if !value.is_nan() {
                    moments.push(value);
                }
            }
        };
        push(&mut self.all);
        for (grouped, value) in self.groups.iter_mut().zip(found) {
            if !value.is_nan() {
                grouped.push(group, value);
            }
        }
        for (axis, bins) in self.axes.iter().zip(&mut self.bins) {
            push(&mut bins[axis.bin(values[axis.factor])]);
        }
    }

    /// Design effect of the mean of a response.
    fn design_effect(&self, response: usize) -> f64 {
        let all = &self.all[response];
        if is_rate(response) {
            let groups = &self.groups[response];
            let size = groups.effective_size(self.repeats, TAIL);
            return if size > 0.0 {
                groups.count() / size
            } else {
                1.0
            };
        }
        let variance = all.deviations() / all.count().max(1) as f64;
        self.groups[response].design_effect(variance, self.repeats)
    }

    fn main_effect(&self, axis: usize, response: usize) -> MainEffect {
        let effect = self.design_effect(response);
        let bins = self.bins[axis].iter().map(|bin| &bin[response]);
        let all = &self.all[response];
        let table = Table {
            total: all.deviations(),
            mean: all.mean().unwrap_or_default(),
            cells: bins
                .clone()
                .filter_map(|each| Some((each.count(), each.mean()?)))
                .collect(),
        };
        // Crossed levels have the same points each, whose spread cancels between them, as far as the
        // points do the same to all levels: at worst, all layouts of a point in a level are one.
        let (inflation, worst) = if self.axes[axis].is_continuous() {
            (effect, effect)
        } else {
            (1.0, alike(self.repeats, &[&self.axes[axis]]))
        };
        let in_bin = alike(self.repeats, &[&self.axes[axis]]);
        let shares = table.share(inflation).map(|(share, unit, cells)| {
            let noise = noise(cells - 1.0, unit, worst / inflation);
            (share, noise)
        });
        MainEffect {
            axis,
            share: shares.map(|shares| shares.0),
            noise: shares.map(|shares| shares.1),
            bins: bins
                .map(|bin| bin_mean(bin, response, effect.min(in_bin), in_bin))
                .collect(),
        }
    }

    /// The axes that matter most to the layouts, at most `most`, in their order.
    pub(crate) fn strongest(&self, most: usize) -> Vec<usize> {
        let strength = |axis: usize| {
            let shares = (0..4).filter_map(|response| self.main_effect(axis, response).share);
            shares.fold(0.0, f64::max)
        };
        let mut axes: Vec<(usize, f64)> = (0..self.axes.len())
            .map(|axis| (axis, strength(axis)))
            .collect();
        axes.sort_by(|a, b| b.1.total_cmp(&a.1));
        axes.truncate(most);
        let mut axes: Vec<usize> = axes.into_iter().map(|(axis, _)| axis).collect();
        axes.sort_unstable();
        axes
    }

    pub(crate) fn finish(&self, interactions: &Interactions) -> Effects {
        let responses = (0..RESPONSES).map(|response| ResponseEffects {
            response: name(response),
            count: self.all[response].count(),
            mean: self.all[response].mean(),
            standard_deviation: self.all[response].standard_deviation(),
            main: (0..self.axes.len())
                .map(|axis| self.main_effect(axis, response))
                .collect(),
            interactions: interactions.finish(
                response,
                &self.all[response],
                self.design_effect(response),
                self.repeats,
            ),
        });
        Effects {
            axes: self.axes.clone(),
            responses: responses.collect(),
        }
    }
}

/// `most` layouts of a point are in the bin: where a share is 0 or 1 they count as one.
fn bin_mean(bin: &Moments, response: usize, effect: f64, most: f64) -> BinMean {
    let extreme = is_rate(response) && bin.mean().is_some_and(|mean| mean <= 0.0 || mean >= 1.0);
    let size = bin.count() as f64 / if extreme { most } else { effect };
    let interval = bin.mean().and_then(|mean| {
        if is_rate(response) {
            return Some(clopper_pearson(mean, size));
        }
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "not negative; many degrees of freedom are as good as infinitely many"
        )]
        let freedom = (size as usize).saturating_sub(1);
        let deviation = bin.standard_deviation().filter(|_| freedom > 0)?;
        Some(about_mean(mean, deviation / size.sqrt(), freedom))
    });
    BinMean {
        count: bin.count(),
        mean: bin.mean(),
        interval,
        small: size < super::interval::SMALL_SAMPLE,
    }
}

/// Layouts of a sampled point that fall into one cell of crossed factors, at most all alike.
pub(crate) fn alike(repeats: u64, axes: &[&Axis]) -> f64 {
    let told_apart: u64 = axes.iter().map(|axis| axis.crossed()).product();
    (repeats as f64 / told_apart as f64).max(1.0)
}

/// Largest share that chance makes in 19 of 20 cases: a chi-squared sum in its normal approximation,
/// of which `unit` per degree of freedom was taken off, and which may be `worst` times as large.
fn noise(freedom: f64, unit: f64, worst: f64) -> f64 {
    unit * ((worst - 1.0) * freedom + 1.645 * (2.0 * freedom).sqrt() * worst)
}

/// Counts and means of cells, with the sum of the squared deviations of all values.
struct Table {
    total: f64,
    mean: f64,
    cells: Vec<(u64, f64)>,
}

impl Table {
    /// Epsilon squared, what a degree of freedom adds to it by chance, and the number of cells:
    /// `(SSB - (k - 1) MSW) / SST`.
    fn share(&self, inflation: f64) -> Option<(f64, f64, f64)> {
        let count: u64 = self.cells.iter().map(|(count, _)| count).sum();
        let cells = self.cells.len() as f64;
        let left = count as f64 - cells;
        if self.total <= 0.0 || left < 1.0 {
            return None;
        }
        let between: f64 = self
            .cells
            .iter()
            .map(|(count, mean)| *count as f64 * (mean - self.mean).powi(2))
            .sum();
        let within = (self.total - between).max(0.0) / left;
        let unit = inflation * within / self.total;
        let share = between / self.total - (cells - 1.0) * unit;
        Some((share, unit, cells))
    }
}

/// One cell of two axes.
#[derive(Debug, Clone, Copy, Default)]
struct Cell {
    /// Layouts; layouts with a best clearance; with a least tip error.
    count: [u64; 3],
    /// About the means of the first pass.
    sum: [f64; RESPONSES],
}

/// Which count a response has.
fn count_of(response: usize) -> usize {
    match response {
        2 => 1,
        3 => 2,
        _ => 0,
    }
}

/// What pairs of factors do: the second pass.
pub(crate) struct Interactions {
    axes: Vec<(usize, Axis)>,
    shift: [f64; RESPONSES],
    /// By pair, then cell.
    cells: Vec<Vec<Cell>>,
    bins: Vec<usize>,
}

/// All pairs of numbers below `count`.
pub(crate) fn pairs(count: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..count).flat_map(move |a| (a + 1..count).map(move |b| (a, b)))
}

impl Interactions {
    /// Of axes, each with its index among those of the main effects.
    pub(crate) fn new(axes: Vec<(usize, Axis)>, main: &MainEffects) -> Self {
        let cells = pairs(axes.len())
            .map(|(a, b)| vec![Cell::default(); axes[a].1.len() * axes[b].1.len()])
            .collect();
        Self {
            bins: vec![0; axes.len()],
            axes,
            shift: main.all.map(|moments| moments.mean().unwrap_or_default()),
            cells,
        }
    }

    pub(crate) fn push(&mut self, values: &[FactorValue], layout: &Layout) {
        let mut found = responses(layout);
        let count = [
            1,
            u64::from(!found[2].is_nan()),
            u64::from(!found[3].is_nan()),
        ];
        for (value, shift) in found.iter_mut().zip(self.shift) {
            *value = if value.is_nan() { 0.0 } else { *value - shift };
        }
        for (bin, (_, axis)) in self.bins.iter_mut().zip(&self.axes) {
            *bin = axis.bin(values[axis.factor]);
        }
        for ((a, b), cells) in pairs(self.axes.len()).zip(&mut self.cells) {
            let cell = &mut cells[self.bins[a] * self.axes[b].1.len() + self.bins[b]];
            for (to, count) in cell.count.iter_mut().zip(count) {
                *to += count;
            }
            for (to, value) in cell.sum.iter_mut().zip(found) {
                *to += value;
            }
        }
    }

    fn finish(
        &self,
        response: usize,
        all: &Moments,
        effect: f64,
        repeats: u64,
    ) -> Vec<Interaction> {
        let of_pairs = pairs(self.axes.len()).zip(&self.cells);
        let mut found: Vec<Interaction> = of_pairs
            .filter_map(|((a, b), cells)| {
                let sums: Vec<(u64, f64)> = cells
                    .iter()
                    .map(|cell| (cell.count[count_of(response)], cell.sum[response]))
                    .collect();
                let across = self.axes[b].1.len();
                let row = |at: usize| at / across;
                let column = |at: usize| at % across;
                let table = |bins: usize, bin: &dyn Fn(usize) -> usize| {
                    let mut merged = vec![(0, 0.0); bins];
                    for (at, (count, sum)) in sums.iter().enumerate() {
                        merged[bin(at)].0 += count;
                        merged[bin(at)].1 += sum;
                    }
                    Table {
                        total: all.deviations(),
                        mean: 0.0,
                        cells: merged
                            .into_iter()
                            .filter(|(count, _)| *count > 0)
                            .map(|(count, sum)| (count, sum / count as f64))
                            .collect(),
                    }
                };
                let inflation = |continuous: bool| if continuous { effect } else { 1.0 };
                let continuous = [a, b].map(|each| self.axes[each].1.is_continuous());
                let both = inflation(continuous.contains(&true));
                let (share, unit, count) = table(sums.len(), &|at| at).share(both)?;
                let (first, _, rows) =
                    table(self.axes[a].1.len(), &row).share(inflation(continuous[0]))?;
                let (second, _, columns) =
                    table(across, &column).share(inflation(continuous[1]))?;
                let worst = if continuous == [true, true] {
                    both
                } else {
                    alike(repeats, &[&self.axes[a].1, &self.axes[b].1]).max(both)
                };
                let freedom = (count - rows - columns + 1.0).max(1.0);
                Some(Interaction {
                    axes: [self.axes[a].0, self.axes[b].0],
                    share: share - first - second,
                    noise: noise(freedom, unit, worst / both),
                })
            })
            .collect();
        found.sort_by(|a, b| b.share.total_cmp(&a.share));
        found
    }
}
