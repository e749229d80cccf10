//! Ranking of candidates, such as base placements or tools.

use std::rc::Rc;

use serde::{Deserialize, Serialize};

use super::axis::Axis;
use super::evidence::push_first;
use super::interval::{Interval, Rate, TAIL, about_mean};
use super::layout::Layout;
use super::moments::{Grouped, Points, combinations};
use super::selection::Quantiles;
use super::spread::QuantileValue;
use crate::{CaseResult, Factor, FactorKind, FactorValue, Role};

/// Most candidates of sampled control factors, in bins, that are ranked.
const MOST_BINNED: usize = 256;

/// Most candidates of levels that are ranked.
const MOST_CHOICES: usize = 1024;

/// Bins of a sampled control factor, where there are few others.
const MOST_BINS: usize = 12;

/// Fewest layouts that two candidates must differ by: even if all of them favour one, an exact McNemar test of fewer
/// stays above 5 %.
const FEWEST_DIFFERENT: u64 = 6;

/// Share of the quantile of the best clearance.
const CLEARANCE_P: f64 = 0.05;

/// Candidates, best first.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ChoiceRanking {
    /// The control factors that take more than one value.
    pub axes: Vec<Axis>,
    /// Required feasible configurations, of [`Choice::works_k`].
    pub working_configurations: usize,
    /// The ranking criterion, in words.
    pub ranked_by: String,
    /// Split-half success rate: of a candidate selected on one half of the points, evaluated on the other half, free of
    /// selection bias. None where there are too few points.
    pub held_out: Option<f64>,
    /// Whether all candidates were evaluated on the same points of the noise factors.
    pub paired: bool,
    /// Whether the candidates differ in which layouts are valid, so that their rates are not of the same layouts.
    pub validity_differs: bool,
    /// By the share of feasible cases (invalid ones count as infeasible), then by P5 of the best clearance, then by the
    /// median tip error.
    pub choices: Vec<Choice>,
}

impl ChoiceRanking {
    /// Whether a case is one of the best candidate.
    pub fn is_best(&self, values: &[FactorValue]) -> bool {
        self.choices.first().is_some_and(|best| {
            let mut bins = self.axes.iter().zip(&best.bins);
            bins.all(|(axis, &bin)| axis.bin(values[axis.factor]) == bin)
        })
    }
}

/// One candidate: a combination of the control factors.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Choice {
    /// Bin of each axis.
    pub bins: Vec<usize>,
    /// In tables: the labels of its bins.
    pub label: String,
    /// Cases.
    pub cases: u64,
    /// Cases with an invalid layout.
    pub invalid: u64,
    /// Share of the valid layouts in which at least one configuration is ok.
    pub works: Rate,
    /// Share of the valid layouts in which at least [`ChoiceRanking::working_configurations`] are.
    pub works_k: Rate,
    /// P5 clearance of the best configuration, mm, over the layouts that have one.
    pub best_clearance_mm: Option<QuantileValue>,
    /// Median tip error of the best configuration, mm.
    pub tip_error_mm: Option<QuantileValue>,
    /// Difference of its success rate to the first; none of the first.
    pub against_first: Option<Difference>,
    /// First valid cases in which no configuration is ok.
    pub failing: Vec<u64>,
}

/// Difference of two success rates, paired where they are of the same points.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Difference {
    /// Rate of the first minus the rate of this one.
    pub difference: f64,
    /// Its interval; none where all layouts come from one sampled point.
    pub interval: Option<Interval>,
    /// Whether the difference is significant: its interval excludes 0 and at least 6 layouts differ.
    pub distinguishable: bool,
}

struct Counter {
    cases: u64,
    invalid: u64,
    /// Feasibility, case by case: invalid layouts count as infeasible.
    serves: Grouped,
    works: Grouped,
    works_k: Grouped,
    working: u64,
    working_k: u64,
    clearance: Quantiles,
    tip_error: Quantiles,
    failing: Vec<u64>,
    /// Sum that identifies the points of the noise factors, whatever their order.
    circumstances: u64,
}

/// Counts over the candidates.
pub(crate) struct ChoiceCounter {
    axes: Vec<Axis>,
    k: usize,
    /// Required feasible configurations for a layout to count as feasible.
    ranked_k: usize,
    repeats: u64,
    cells: Vec<Counter>,
    circumstances: Points,
}

impl ChoiceCounter {
    /// None without control factors; an error in words where there are too many candidates.
    pub(crate) fn new(
        factors: &[Factor],
        k: usize,
        ranked_k: usize,
    ) -> Option<Result<Self, String>> {
        let chosen: Vec<(usize, &Factor)> = factors
            .iter()
            .enumerate()
            .filter(|(_, factor)| factor.role == Role::Control)
            .filter(|(_, factor)| match &factor.kind {
                FactorKind::Levels(levels) => levels.len() > 1,
                FactorKind::Continuous { low, high } => high > low,
            })
            .collect();
        if chosen.is_empty() {
            return None;
        }
        let levels = combinations(factors, |factor| factor.role == Role::Control);
        let sampled = chosen
            .iter()
            .filter(|(_, factor)| matches!(factor.kind, FactorKind::Continuous { .. }))
            .count();
        let cells = |bins: usize| {
            let bins = u32::try_from(sampled)
                .ok()
                .and_then(|n| (bins as u64).checked_pow(n));
            bins.and_then(|bins| bins.checked_mul(levels))
                .unwrap_or(u64::MAX)
        };
        let bins = (2..=MOST_BINS)
            .rev()
            .find(|&bins| cells(bins) <= MOST_BINNED as u64)
            .unwrap_or(2);
        let size = cells(bins);
        if size > MOST_CHOICES as u64 {
            return Some(Err(format!(
                "{size} candidates exceed the limit of {MOST_CHOICES}: not ranked"
            )));
        }
        let axes: Vec<Axis> = chosen
            .into_iter()
            .map(|(index, factor)| match factor.kind {
                FactorKind::Levels(_) => Axis::new(index, factor, usize::MAX),
                FactorKind::Continuous { .. } => Axis::new(index, factor, bins),
            })
            .collect();
        let repeats = Points::of_one_choice(factors).repeats;
        let count = axes.iter().map(Axis::len).product();
        let quantiles = |p: f64| Quantiles::new(Rc::from([p]), repeats);
        let counter = || Counter {
            cases: 0,
            invalid: 0,
            serves: Grouped::default(),
            works: Grouped::default(),
            works_k: Grouped::default(),
            working: 0,
            working_k: 0,
            clearance: quantiles(CLEARANCE_P),
            tip_error: quantiles(0.5),
            failing: Vec::new(),
            circumstances: 0,
        };
        Some(Ok(Self {
            axes,
            k,
            ranked_k,
            repeats,
            cells: std::iter::repeat_with(counter).take(count).collect(),
            circumstances: Points::of_circumstances(factors),
        }))
    }

    /// Index of the candidate of a case.
    pub(crate) fn cell(&self, values: &[FactorValue]) -> usize {
        self.axes.iter().fold(0, |index, axis| {
            index * axis.len() + axis.bin(values[axis.factor])
        })
    }

    pub(crate) fn push(
        &mut self,
        values: &[FactorValue],
        result: &CaseResult,
        layout: Option<&Layout>,
        group: usize,
        pass: usize,
    ) {
        let cell = self.cell(values);
        let circumstances = self.circumstances.hash(values);
        let (k, ranked_k, cell) = (self.k, self.ranked_k, &mut self.cells[cell]);
        if pass == 0 {
            let serves = layout.is_some_and(|layout| layout.working() >= ranked_k);
            cell.serves.push(group, f64::from(u8::from(serves)));
            cell.cases += 1;
            cell.circumstances = cell.circumstances.wrapping_add(circumstances);
        }
        let Some(layout) = layout else {
            cell.invalid += u64::from(pass == 0);
            return;
        };
        if pass == 0 {
            let (works, works_k) = (layout.ok != 0, layout.working() >= k);
            cell.works.push(group, f64::from(u8::from(works)));
            cell.works_k.push(group, f64::from(u8::from(works_k)));
            cell.working += u64::from(works);
            cell.working_k += u64::from(works_k);
            if !works {
                push_first(&mut cell.failing, result.case);
            }
        }
        if let Some(clearance) = layout.best_clearance {
            cell.clearance.push(clearance);
        }
        if let Some(error) = layout.best_tip_error {
            cell.tip_error.push(error);
        }
    }

    pub(crate) fn next_pass(&mut self) {
        for cell in &mut self.cells {
            cell.clearance.next_pass();
            cell.tip_error.next_pass();
        }
    }

    fn choice(&self, index: usize) -> Choice {
        let cell = &self.cells[index];
        let mut bins = Vec::new();
        let mut left = index;
        for axis in self.axes.iter().rev() {
            bins.push(left % axis.len());
            left /= axis.len();
        }
        bins.reverse();
        let labels = self.axes.iter().zip(&bins).map(|(axis, &bin)| {
            let label = &axis.bins[bin].label;
            let unit = if axis.unit.is_empty() { "" } else { " " };
            // A name needs no factor before it, a number does.
            if axis.bins[bin].low.is_some() {
                format!("{} = {label}{unit}{}", axis.name, axis.unit)
            } else {
                label.clone()
            }
        });
        let rate = |successes, grouped: &Grouped| {
            let size = grouped.effective_size(self.repeats, TAIL);
            Rate::new(successes, cell.cases - cell.invalid, size)
        };
        let quantile = |quantiles: &Quantiles, p: f64| {
            let interval = quantiles.interval(p);
            Some(QuantileValue {
                p,
                value: quantiles.value(p)?,
                interval,
                remark: interval
                    .is_none()
                    .then(|| "sample too small for an interval".to_owned()),
            })
        };
        Choice {
            label: labels.collect::<Vec<_>>().join(", "),
            bins,
            cases: cell.cases,
            invalid: cell.invalid,
            works: rate(cell.working, &cell.works),
            works_k: rate(cell.working_k, &cell.works_k),
            best_clearance_mm: quantile(&cell.clearance, CLEARANCE_P),
            tip_error_mm: quantile(&cell.tip_error, 0.5),
            against_first: None,
            failing: cell.failing.clone(),
        }
    }

    fn difference(&self, first: usize, other: usize) -> Option<Difference> {
        let (a, b) = (&self.cells[first].serves, &self.cells[other].serves);
        let (size_a, size_b) = (a.count(), b.count());
        if size_a == 0.0 || size_b == 0.0 {
            return None;
        }
        let (share_a, share_b) = (a.total() / size_a, b.total() / size_b);
        let difference = share_a - share_b;
        let spread = Grouped::squared_error_of_difference(a, b);
        let interval =
            spread.map(|(square, freedom)| about_mean(difference, square.sqrt(), freedom));
        let layouts = difference.abs() * size_a.min(size_b);
        Some(Difference {
            difference,
            interval,
            distinguishable: interval.is_some_and(|interval| interval.low > 0.0)
                && layouts.round() >= FEWEST_DIFFERENT as f64,
        })
    }

    /// Share of the feasible cases of a candidate.
    fn share(&self, index: usize) -> f64 {
        let serves = &self.cells[index].serves;
        serves.total() / serves.count().max(1.0)
    }

    /// Split-half success rate: selected on one half of the points, evaluated on the other, and vice versa.
    fn held_out(&self) -> Option<f64> {
        let (mut working, mut of) = (0.0, 0.0);
        for half in 0..2 {
            let share = |index: usize, half: usize| {
                let [count, sum] = self.cells[index].serves.of_half(half);
                (count > 0.0).then(|| sum / count)
            };
            // The first of equal ones: their order knows nothing of the other half.
            let picked = (0..self.cells.len())
                .filter_map(|index| Some((index, share(index, half)?)))
                .reduce(|best, other| if other.1 > best.1 { other } else { best })?;
            let cell = &self.cells[picked.0];
            let grouped = if self.ranked_k > 1 {
                &cell.works_k
            } else {
                &cell.works
            };
            let [count, sum] = grouped.of_half(1 - half);
            working += sum;
            of += count;
        }
        (of > 0.0).then(|| working / of)
    }

    /// The ranking, and the index of its first candidate.
    pub(crate) fn finish(&self) -> (ChoiceRanking, Option<usize>) {
        let used = (0..self.cells.len()).filter(|&index| self.cells[index].cases > 0);
        let mut choices: Vec<(usize, Choice)> =
            used.map(|index| (index, self.choice(index))).collect();
        let quantile = |found: &Option<QuantileValue>, none: f64| {
            found.as_ref().map_or(none, |found| found.value)
        };
        choices.sort_by(|(i, a), (j, b)| {
            let clearance =
                |choice: &Choice| quantile(&choice.best_clearance_mm, f64::NEG_INFINITY);
            let error = |choice: &Choice| quantile(&choice.tip_error_mm, f64::INFINITY);
            self.share(*j)
                .total_cmp(&self.share(*i))
                .then(clearance(b).total_cmp(&clearance(a)))
                .then(error(a).total_cmp(&error(b)))
        });
        let first = choices.first().map(|(index, _)| *index);
        for (index, choice) in choices.iter_mut().skip(1) {
            choice.against_first = first.and_then(|first| self.difference(first, *index));
        }
        let mut used = self.cells.iter().filter(|cell| cell.cases > 0);
        let paired = used.next().is_some_and(|first| {
            used.all(|each| each.cases == first.cases && each.circumstances == first.circumstances)
        });
        let invalid = |choice: &Choice| choice.invalid as f64 / choice.cases as f64;
        let validity_differs = choices
            .iter()
            .any(|(_, choice)| invalid(choice) != invalid(&choices[0].1));
        let works = match self.ranked_k {
            1 => "one feasible configuration".to_owned(),
            k => format!("{k} feasible configurations"),
        };
        let ranking = ChoiceRanking {
            axes: self.axes.clone(),
            working_configurations: self.k,
            ranked_by: format!(
                "the share of cases with at least {works} (invalid layouts count as infeasible); ties by P5 of the best \
                 clearance, then by the median tip error"
            ),
            held_out: self.held_out(),
            paired,
            validity_differs,
            choices: choices.into_iter().map(|(_, choice)| choice).collect(),
        };
        (ranking, first)
    }

    /// Cases of a candidate, with the points that they repeat.
    pub(crate) fn cases(&self, index: usize) -> u64 {
        self.cells[index].cases
    }
}
