//! Two studies of one design, case by case.

use std::rc::Rc;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};

use needlebench_kinematics::ik::Configuration;
use serde::Serialize;

use crate::column::{Measures, indices};
use crate::statistics::{
    BEST, CONFIGURATIONS, CaseValue, Grouped, Interval, Largest, Layout, MOST_CASES, PASSES,
    Points, QuantileValue, Quantiles, about_mean, has_numbers, mcnemar,
};
use crate::{CaseResult, FactorValue, MetricColumn, Results, ResultsError};

/// Shares of which the quantiles of the differences are given.
const PROBABILITIES: [f64; 7] = [0.0, 0.05, 0.25, 0.5, 0.75, 0.95, 1.0];

/// Cases that travel together.
const BLOCK: usize = 512;

/// Significance level.
const SIGNIFICANCE: f64 = 0.05;

/// The same cases in two studies.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Paired {
    /// Cases.
    pub cases: u64,
    /// Cases that are valid layouts in both; all else is of these.
    pub layouts: u64,
    /// Cases that are valid in the first study alone.
    pub became_invalid: u64,
    /// Cases that are valid in the second study alone.
    pub became_valid: u64,
    /// Layouts in which any configuration is ok.
    pub working: Transition,
    /// By configuration.
    pub configurations: Vec<ConfigurationTransition>,
    /// Second value minus first, by configuration and metric, the best configurations last.
    pub differences: Vec<PairedDifference>,
}

/// A configuration in both studies.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ConfigurationTransition {
    /// Its label.
    pub label: String,
    /// Layouts in which it is ok.
    #[serde(flatten)]
    pub success: Transition,
}

/// Change of a success between two studies.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Transition {
    /// Layouts in which it is so in both studies.
    pub kept: u64,
    /// Layouts in which it was so in the first study alone.
    pub lost: u64,
    /// Layouts in which it is so in the second study alone.
    pub gained: u64,
    /// `lost` over all layouts; none of no layouts.
    pub lost_share: Option<f64>,
    /// `gained` over all layouts.
    pub gained_share: Option<f64>,
    /// Exact two-sided McNemar test of `lost` against `gained`, as if layouts were independent.
    pub p: f64,
    /// 95 % interval of `gained_share - lost_share`, from random groups of the sampled points; none of
    /// a single point.
    pub change_interval: Option<Interval>,
    /// Whether it became significantly worse, by both the test and the interval.
    pub worse: bool,
    /// Whether it became significantly better.
    pub better: bool,
    /// First cases that were lost.
    pub lost_cases: Vec<u64>,
    /// First cases that were gained.
    pub gained_cases: Vec<u64>,
}

/// Differences of a metric between two studies.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PairedDifference {
    /// Label of the configuration, or `best`: in each study its own best one.
    pub of: String,
    /// Name of the metric's column, with the unit.
    pub metric: String,
    /// The metric in words.
    pub words: String,
    /// Unit of the differences.
    pub unit: String,
    /// Layouts in which both studies have it and neither rejects the configuration.
    pub count: u64,
    /// Mean of second minus first.
    pub mean: f64,
    /// 95 % interval of the mean, from random groups of the sampled points.
    pub mean_interval: Option<Interval>,
    /// Quantiles of second minus first.
    pub quantiles: Vec<QuantileValue>,
    /// Cases with the largest losses, and by how much the second is worse.
    pub losses: Vec<CaseValue>,
    /// Cases with the largest gains, and by how much the second is better.
    pub gains: Vec<CaseValue>,
}

/// Metrics that both studies compare case by case: indices of their columns in each.
fn shared(a: &[MetricColumn], b: &[MetricColumn]) -> [Vec<usize>; 2] {
    let in_b = |column: &MetricColumn| {
        let mut found = b.iter();
        found.position(|other| other.key == column.key && other.unit == column.unit)
    };
    let pairs = indices(a, |column| column.by_case)
        .into_iter()
        .filter_map(|index| Some((index, in_b(&a[index])?)));
    let (a, b) = pairs.unzip();
    [a, b]
}

/// What is taken of the cases of a study.
struct Taken {
    identities: Points,
    measures: Measures,
    /// Indices of the columns that are compared.
    columns: Vec<usize>,
}

/// What is compared of a case.
#[derive(Debug, Clone)]
struct Brief {
    identity: u64,
    layout: Option<Layout>,
    /// Values of the compared columns, configuration by configuration.
    values: Vec<f32>,
}

impl Brief {
    fn new(taken: &Taken, values: &[FactorValue], result: &CaseResult) -> Self {
        let of_row = |row: &crate::Row| {
            let known = has_numbers(row);
            let value = |column: usize| row.get(column).filter(|_| known).unwrap_or(f32::NAN);
            taken
                .columns
                .iter()
                .map(|&column| value(column))
                .collect::<Vec<f32>>()
        };
        Self {
            identity: taken.identities.hash(values),
            layout: Layout::of(result, &taken.measures),
            values: result.rows.iter().flat_map(of_row).collect(),
        }
    }

    fn value(&self, configuration: usize, metric: usize) -> f32 {
        let index = if configuration == CONFIGURATIONS {
            self.layout.and_then(|layout| layout.best)
        } else {
            Some(configuration)
        };
        let width = self.values.len() / CONFIGURATIONS;
        index.map_or(f32::NAN, |index| self.values[index * width + metric])
    }
}

#[derive(Debug, Clone, Default)]
struct Successes {
    kept: u64,
    lost: u64,
    gained: u64,
    change: Grouped,
    lost_cases: Vec<u64>,
    gained_cases: Vec<u64>,
}

impl Successes {
    fn push(&mut self, case: u64, group: usize, a: bool, b: bool) {
        self.kept += u64::from(a && b);
        self.change
            .push(group, f64::from(u8::from(b)) - f64::from(u8::from(a)));
        let (count, cases) = match (a, b) {
            (true, false) => (&mut self.lost, &mut self.lost_cases),
            (false, true) => (&mut self.gained, &mut self.gained_cases),
            _ => return,
        };
        *count += 1;
        if cases.len() < MOST_CASES {
            cases.push(case);
        }
    }

    fn finish(self, layouts: u64) -> Transition {
        let share = |count: u64| (layouts > 0).then(|| count as f64 / layouts as f64);
        let p = mcnemar(self.lost, self.gained);
        let change = share(self.gained).zip(share(self.lost)).map(|(a, b)| a - b);
        let interval = change.and_then(|change| {
            let (square, freedom) = self.change.squared_error()?;
            Some(about_mean(change, square.sqrt(), freedom))
        });
        let by_chance = p >= SIGNIFICANCE;
        Transition {
            kept: self.kept,
            lost: self.lost,
            gained: self.gained,
            lost_share: share(self.lost),
            gained_share: share(self.gained),
            p,
            change_interval: interval,
            worse: !by_chance && interval.is_some_and(|interval| interval.high < 0.0),
            better: !by_chance && interval.is_some_and(|interval| interval.low > 0.0),
            lost_cases: self.lost_cases,
            gained_cases: self.gained_cases,
        }
    }
}

struct Stream {
    sum: f64,
    groups: Grouped,
    quantiles: Quantiles,
    losses: Largest,
    gains: Largest,
}

/// Compares the same cases; none, with the reason, where the cases are not the same.
pub(super) fn paired(
    a: &(dyn Results + Sync),
    b: &(dyn Results + Sync),
) -> Result<Result<Paired, String>, ResultsError> {
    if let Some(reason) = different_design(a, b) {
        return Ok(Err(reason));
    }
    let points = Points::new(a.factors());
    let mut working = Successes::default();
    let mut success = vec![Successes::default(); CONFIGURATIONS];
    let (mut layouts, mut became_invalid, mut became_valid) = (0, 0, 0);
    let [in_a, in_b] = shared(a.columns(), b.columns());
    let width = in_a.len();
    let compared: Vec<&MetricColumn> = in_a.iter().map(|&index| &a.columns()[index]).collect();
    let stream = || Stream {
        sum: 0.0,
        groups: Grouped::default(),
        quantiles: Quantiles::new(Rc::from(PROBABILITIES), points.repeats),
        losses: Largest::default(),
        gains: Largest::default(),
    };
    let mut streams: Vec<Stream> = std::iter::repeat_with(stream)
        .take((CONFIGURATIONS + 1) * width)
        .collect();
    for pass in 0..PASSES {
        let different = zipped(a, b, [&in_a, &in_b], |case, group, a, b| {
            let (layout_a, layout_b) = match (a.layout, b.layout) {
                (Some(a), Some(b)) => (a, b),
                (Some(_), None) if pass == 0 => return became_invalid += 1,
                (None, Some(_)) if pass == 0 => return became_valid += 1,
                _ => return,
            };
            if pass == 0 {
                layouts += 1;
                working.push(case, group, layout_a.ok != 0, layout_b.ok != 0);
                for (index, success) in success.iter_mut().enumerate() {
                    success.push(case, group, layout_a.works(index), layout_b.works(index));
                }
            }
            for (at, stream) in streams.iter_mut().enumerate() {
                let (index, metric) = (at / width, at % width);
                let difference = b.value(index, metric) - a.value(index, metric);
                if difference.is_nan() {
                    continue;
                }
                stream.quantiles.push(difference);
                if pass == 0 {
                    let difference = f64::from(difference);
                    stream.sum += difference;
                    stream.groups.push(group, difference);
                    let gain = if compared[metric].more_is_better == Some(true) {
                        difference
                    } else {
                        -difference
                    };
                    if gain < 0.0 {
                        stream.losses.push(case, -gain);
                    } else if gain > 0.0 {
                        stream.gains.push(case, gain);
                    }
                }
            }
        })?;
        if let Some(case) = different {
            return Ok(Err(format!("factor values of case {case} differ")));
        }
        for stream in &mut streams {
            stream.quantiles.next_pass();
        }
    }
    let labels = Configuration::ALL.map(Configuration::label);
    Ok(Ok(Paired {
        cases: a.cases(),
        layouts,
        became_invalid,
        became_valid,
        working: working.finish(layouts),
        configurations: labels
            .into_iter()
            .zip(success)
            .map(|(label, success)| ConfigurationTransition {
                label: label.to_owned(),
                success: success.finish(layouts),
            })
            .collect(),
        differences: streams
            .iter()
            .enumerate()
            .filter(|(_, stream)| stream.quantiles.count() > 0)
            .map(|(at, stream)| {
                let of = labels.get(at / width).copied().unwrap_or(BEST);
                stream.finish(of, compared[at % width])
            })
            .collect(),
    }))
}

impl Stream {
    fn finish(&self, of: &str, column: &MetricColumn) -> PairedDifference {
        let count = self.quantiles.count();
        let mean = self.sum / count as f64;
        let error = self.groups.squared_error();
        let quantile = |p: f64| {
            let interval = self.quantiles.interval(p);
            let inner = p > 0.0 && p < 1.0;
            Some(QuantileValue {
                p,
                value: self.quantiles.value(p)?,
                interval,
                remark: (inner && interval.is_none())
                    .then(|| "sample too small for an interval".to_owned()),
            })
        };
        PairedDifference {
            of: of.to_owned(),
            metric: column.name.clone(),
            words: column.words.clone(),
            unit: column.unit.clone(),
            count,
            mean,
            mean_interval: error.map(|(square, freedom)| about_mean(mean, square.sqrt(), freedom)),
            quantiles: PROBABILITIES.into_iter().filter_map(quantile).collect(),
            losses: self.losses.finish(1.0),
            gains: self.gains.finish(1.0),
        }
    }
}

/// Why the cases of two studies cannot be the same.
fn different_design(a: &dyn Results, b: &dyn Results) -> Option<String> {
    if a.cases() != b.cases() {
        return Some(format!("{} and {} cases", a.cases(), b.cases()));
    }
    let (first, second) = (a.factors(), b.factors());
    if first.len() != second.len() {
        let names = |factors: &[crate::Factor]| {
            let names: Vec<&str> = factors.iter().map(|each| each.name.as_str()).collect();
            names.join(", ")
        };
        return Some(format!(
            "factors differ: {} and {}",
            names(first),
            names(second)
        ));
    }
    let other = first.iter().zip(second).find(|(a, b)| a != b)?;
    Some(if other.0.name == other.1.name {
        format!("values of factor `{}` differ", other.0.name)
    } else {
        format!("factors `{}` and `{}`", other.0.name, other.1.name)
    })
}

/// Visits the cases of both side by side; the second study is read by a thread of its own, a few
/// blocks ahead. Gives the first case whose factors have other values.
fn zipped(
    a: &(dyn Results + Sync),
    b: &(dyn Results + Sync),
    columns: [&[usize]; 2],
    mut visit: impl FnMut(u64, usize, &Brief, &Brief),
) -> Result<Option<u64>, ResultsError> {
    let points = Points::new(a.factors());
    let taken = |results: &(dyn Results + Sync), columns: &[usize]| Taken {
        // Both are of one design.
        identities: Points::of_everything(a.factors()),
        measures: Measures::new(results.columns()),
        columns: columns.to_vec(),
    };
    let (of_a, of_b) = (taken(a, columns[0]), taken(b, columns[1]));
    std::thread::scope(|scope| {
        let (sender, receiver) = sync_channel(4);
        let reader = scope.spawn(move || send(b, &of_b, &sender));
        let mut blocks = Blocks {
            receiver,
            block: Vec::new(),
            at: 0,
        };
        let mut different = None;
        let read = a.visit(&mut |values: &[FactorValue], result: &CaseResult| {
            if different.is_some() {
                return;
            }
            let first = Brief::new(&of_a, values, result);
            match blocks.next() {
                Some(second) if second.identity == first.identity => {
                    visit(result.case, points.group(values), &first, second);
                }
                _ => different = Some(result.case),
            }
        });
        // A reader that nobody listens to ends by itself.
        drop(blocks);
        let sent = reader.join().unwrap_or_else(|_| {
            Err(ResultsError {
                file: "results".to_owned(),
                message: "reading them failed".to_owned(),
            })
        });
        read?;
        sent?;
        Ok(different)
    })
}

fn send(
    results: &dyn Results,
    taken: &Taken,
    sender: &SyncSender<Vec<Brief>>,
) -> Result<(), ResultsError> {
    let mut block = Vec::with_capacity(BLOCK);
    let mut heard = true;
    results.visit(&mut |values, result| {
        if !heard {
            return;
        }
        block.push(Brief::new(taken, values, result));
        if block.len() == BLOCK {
            let full = std::mem::replace(&mut block, Vec::with_capacity(BLOCK));
            heard = sender.send(full).is_ok();
        }
    })?;
    if heard && !block.is_empty() {
        // Whoever has left needs no more.
        let _ = sender.send(block);
    }
    Ok(())
}

struct Blocks {
    receiver: Receiver<Vec<Brief>>,
    block: Vec<Brief>,
    at: usize,
}

impl Blocks {
    fn next(&mut self) -> Option<&Brief> {
        if self.at == self.block.len() {
            self.block = self.receiver.recv().ok()?;
            self.at = 0;
        }
        self.at += 1;
        self.block.get(self.at - 1)
    }
}
