//! Which configuration is the best where.

use needlebench_kinematics::ik::Configuration;
use serde::{Deserialize, Serialize};

use super::axis::Axis;
use super::effects::{alike, pairs};
use super::interval::clopper_pearson;
use super::layout::{CONFIGURATIONS, Layout};
use crate::FactorValue;

/// Maps over each factor alone and over pairs of factors.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Regions {
    /// The factors that take more than one value, cut into at most 12 bins.
    pub axes: Vec<Axis>,
    /// First over each axis alone, then over pairs.
    pub maps: Vec<RegionMap>,
}

/// A map over one or two axes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RegionMap {
    /// Indices of one or two axes.
    pub axes: Vec<usize>,
    /// Cells, the last axis fastest.
    pub cells: Vec<RegionCell>,
}

/// A cell of a map.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RegionCell {
    /// Valid layouts in it.
    pub layouts: u64,
    /// Layouts in which at least one configuration is ok.
    pub working: u64,
    /// Layouts in which each configuration is ok.
    pub ok: [u64; CONFIGURATIONS],
    /// Layouts in which each configuration is the best: ok, with the largest clearance.
    pub best: [u64; CONFIGURATIONS],
    /// Label of the configuration that is the best more often than any other; none where its
    /// interval overlaps with the next one's, or where none is ever feasible.
    pub winner: Option<String>,
}

#[derive(Debug, Clone, Copy, Default)]
struct Counter {
    layouts: u64,
    working: u64,
    ok: [u64; CONFIGURATIONS],
    best: [u64; CONFIGURATIONS],
}

impl Counter {
    fn push(&mut self, layout: &Layout) {
        self.layouts += 1;
        self.working += u64::from(layout.ok != 0);
        for (index, ok) in self.ok.iter_mut().enumerate() {
            *ok += u64::from(layout.works(index));
        }
        if let Some(best) = layout.best {
            self.best[best] += 1;
        }
    }

    /// `most` layouts of a point are in the cell, and the effective sample size is that of the layouts
    /// over `design_effect`.
    fn winner(&self, design_effect: f64, most: f64) -> Option<String> {
        let mut order: Vec<usize> = (0..CONFIGURATIONS).collect();
        order.sort_by_key(|&index| std::cmp::Reverse(self.best[index]));
        let interval = |index: usize| {
            let layouts = self.layouts as f64;
            // Where it is all or none, nothing is seen of how alike they are.
            let extreme = self.best[index] == 0 || self.best[index] == self.layouts;
            let effect = if extreme {
                most
            } else {
                design_effect.min(most)
            };
            clopper_pearson(self.best[index] as f64 / layouts, layouts / effect)
        };
        let clear = self.best[order[0]] > 0 && !interval(order[0]).overlaps(interval(order[1]));
        clear.then(|| Configuration::ALL[order[0]].label().to_owned())
    }
}

/// Counts over the maps.
pub(crate) struct RegionCounter {
    axes: Vec<Axis>,
    /// Axes whose pairs have a map.
    paired: Vec<usize>,
    single: Vec<Vec<Counter>>,
    double: Vec<Vec<Counter>>,
    bins: Vec<usize>,
}

impl RegionCounter {
    pub(crate) fn new(axes: Vec<Axis>, paired: Vec<usize>) -> Self {
        let single = axes.iter().map(|axis| vec![Counter::default(); axis.len()]);
        let double = pairs(paired.len()).map(|(a, b)| {
            let size = axes[paired[a]].len() * axes[paired[b]].len();
            vec![Counter::default(); size]
        });
        Self {
            single: single.collect(),
            double: double.collect(),
            bins: vec![0; axes.len()],
            axes,
            paired,
        }
    }

    pub(crate) fn push(&mut self, values: &[FactorValue], layout: &Layout) {
        for ((axis, bin), cells) in self.axes.iter().zip(&mut self.bins).zip(&mut self.single) {
            *bin = axis.bin(values[axis.factor]);
            cells[*bin].push(layout);
        }
        for ((a, b), cells) in pairs(self.paired.len()).zip(&mut self.double) {
            let (a, b) = (self.paired[a], self.paired[b]);
            cells[self.bins[a] * self.axes[b].len() + self.bins[b]].push(layout);
        }
    }

    /// The maps; `repeats` layouts come from each sampled point, and layouts are `design_effect` times less
    /// worth than independent ones.
    pub(crate) fn finish(self, design_effect: f64, repeats: u64) -> Regions {
        let (kept, all) = (self.axes.clone(), &self.axes);
        let map = |axes: Vec<usize>, cells: Vec<Counter>| RegionMap {
            cells: cells
                .into_iter()
                .map(|cell| RegionCell {
                    layouts: cell.layouts,
                    working: cell.working,
                    ok: cell.ok,
                    best: cell.best,
                    winner: cell.winner(design_effect, {
                        let of_map: Vec<&Axis> = axes.iter().map(|&axis| &all[axis]).collect();
                        alike(repeats, &of_map)
                    }),
                })
                .collect(),
            axes,
        };
        let mut maps = Vec::new();
        for (axis, cells) in self.single.into_iter().enumerate() {
            maps.push(map(vec![axis], cells));
        }
        for ((a, b), cells) in pairs(self.paired.len()).zip(self.double) {
            maps.push(map(vec![self.paired[a], self.paired[b]], cells));
        }
        Regions { axes: kept, maps }
    }
}
