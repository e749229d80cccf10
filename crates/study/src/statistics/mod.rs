//! Statistics of a table of results.
//!
//! [`summarise`] reads the table from the first case to the last, three times, and keeps counters
//! alone: its memory does not grow with the number of cases, and the result depends on the table
//! alone. Lengths are in mm and angles in degrees, as in the table; shares are 0 to 1.

mod axis;
mod choices;
mod counts;
#[cfg(test)]
mod coverage;
mod effects;
mod evidence;
mod gap;
mod interval;
mod judge;
mod layout;
mod methods;
mod moments;
mod regions;
mod selection;
mod spread;
#[cfg(test)]
pub(crate) mod synthetic;
#[cfg(test)]
mod tests;

use std::rc::Rc;

use needlebench_scenario::study_criteria::StudyCriteria;
use serde::{Deserialize, Serialize};

pub use axis::{Axis, Bin};
pub use choices::{Choice, ChoiceRanking, Difference};
pub use counts::{ConfigurationCounts, Counts, DetailCount, WithRoute};
pub use effects::{BinMean, Effects, Interaction, MainEffect, ResponseEffects};
pub use evidence::{CaseValue, ConfigurationEvidence, Evidence, MOST_CASES, WorstCases};
pub use gap::{ANY, Gap, ReplannedCase, gaps};
pub use interval::{CONFIDENCE, Interval, Rate, clopper_pearson, mcnemar};
pub use judge::{CriterionResult, judge_study};
pub use layout::BestConfiguration;
pub use methods::Method;
pub use regions::{RegionCell, RegionMap, Regions};
pub use spread::{BEST, PROBABILITIES, QuantileValue, Spread};

pub(crate) use evidence::Largest;
use interval::TAIL;
pub(crate) use interval::{about_mean, clopper_pearson_with, quantile_ranks};
pub(crate) use layout::{CONFIGURATIONS, Layout, has_numbers};
pub(crate) use moments::{Grouped, Points};
pub(crate) use selection::{PASSES, Quantiles};

use crate::column::Measures;
use crate::{Factor, FactorKind, FactorValue, Measure, MetricColumn, Results, ResultsError};
use choices::ChoiceCounter;
use counts::Counter;
use effects::{Interactions, MainEffects};
use evidence::Collector;
use regions::RegionCounter;
use spread::Spreads;

/// Version of the keys of a [`Summary`].
pub const SUMMARY_VERSION: u32 = 2;

/// Bins of a factor in its effects, at most.
const MOST_EFFECT_BINS: usize = 16;
/// Bins of a factor in maps, at most.
const MOST_MAP_BINS: usize = 12;
/// Factors whose pairs are looked at, at most.
const MOST_PAIRED: usize = 10;

pub use needlebench_scenario::study::SamplingMethod as Sampling;

/// What to sum up.
#[derive(Debug, Clone, PartialEq)]
pub struct SummaryOptions {
    /// Sampling method, which the remarks on intervals depend on.
    pub sampling: Sampling,
    /// Required feasible configurations in [`Choice::works_k`], 1 to 8.
    pub working_configurations: usize,
    /// Required feasible configurations in the ranking of candidates, 1 to 8.
    pub ranked_configurations: usize,
    /// Quantiles to give beside [`PROBABILITIES`], such as those of criteria.
    pub more_quantiles: Vec<f64>,
    /// Whether to give effects, maps and the ranking of candidates.
    pub factors: bool,
    /// Required clearance of the needle path from bone, vessels and organs, mm, where feasibility does not include it:
    /// rates are then given with it and without.
    pub route_mm: Option<f64>,
}

impl Default for SummaryOptions {
    fn default() -> Self {
        Self {
            sampling: Sampling::Random,
            working_configurations: 2,
            ranked_configurations: 1,
            more_quantiles: Vec::new(),
            factors: true,
            route_mm: None,
        }
    }
}

impl SummaryOptions {
    /// With the options that criteria require.
    #[must_use]
    pub fn judged_by(mut self, criteria: &StudyCriteria) -> Self {
        if let Some(count) = criteria.working_configurations.filter(|count| *count > 1) {
            self.working_configurations = count as usize;
            self.ranked_configurations = count as usize;
        }
        let quantiles = criteria.quantiles().into_iter();
        self.more_quantiles
            .extend(quantiles.map(|each| each.quantile));
        self
    }
}

/// Statistics of a table of results.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Summary {
    /// Version of the keys.
    pub schema_version: u32,
    /// Confidence of every interval, 0 to 1.
    pub confidence: f64,
    /// How the sampled factors' points were chosen.
    pub sampling: Sampling,
    /// Cases that each sampled point appears in: once in each combination of the crossed factors.
    pub repeats: u64,
    /// The candidate that `overall`, `goals`, `spreads` and `evidence` refer to; none without control factors, or where
    /// there are too many candidates to be ranked.
    pub of_choice: Option<ChosenChoice>,
    /// Why candidates are not ranked, in words: `overall` and the others are then of all candidates together, and no
    /// criterion is evaluated on them.
    pub not_ranked: Option<String>,
    /// Outcomes of all cases, or of those of the best candidate.
    pub overall: Counts,
    /// The same by goal.
    pub goals: Vec<Counts>,
    /// Outcomes of the cases of all candidates together; none without control factors.
    pub over_all_choices: Option<Counts>,
    /// The metrics that are summed up.
    pub metrics: Vec<MetricColumn>,
    /// Their spread, configuration by configuration, the best of each layout last.
    pub spreads: Vec<Spread>,
    /// Effects of the factors.
    pub effects: Effects,
    /// Which configuration is the best where.
    pub regions: Regions,
    /// Ranking of the candidates; none without control factors.
    pub choices: Option<ChoiceRanking>,
    /// Cases to inspect.
    pub evidence: Evidence,
    /// Notes, in words.
    pub notes: Vec<String>,
    /// Methods, with sources.
    pub methods: Vec<Method>,
}

/// The candidate that a summary refers to.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ChosenChoice {
    /// In tables.
    pub label: String,
    /// Number of candidates that it is the best of.
    pub of: u64,
    /// Candidates not significantly different from it.
    pub as_good: u64,
    /// Individual confidence of its intervals: simultaneously 95 % for all candidates (Bonferroni), which accounts for
    /// the selection of the best.
    pub confidence_each: f64,
    /// As [`ChoiceRanking::ranked_by`].
    pub by: String,
    /// As [`ChoiceRanking::held_out`].
    pub held_out: Option<f64>,
}

impl Summary {
    /// Spread of a metric's column over a configuration, by label, or [`BEST`].
    pub fn spread(&self, of: &str, metric: &str) -> Option<&Spread> {
        let mut all = self.spreads.iter();
        all.find(|each| each.of == of && each.metric == metric)
    }

    /// The metrics of a measure that have values: one of each kind of cases.
    pub fn measured(&self, measure: Measure) -> impl Iterator<Item = &MetricColumn> {
        let of_measure = move |column: &&MetricColumn| column.measure == Some(measure);
        self.metrics.iter().filter(of_measure).filter(|column| {
            let mut all = self.spreads.iter();
            all.any(|spread| spread.metric == column.name)
        })
    }
}

/// Whether a factor takes more than one value.
fn varies(factor: &Factor) -> bool {
    match &factor.kind {
        FactorKind::Levels(levels) => levels.len() > 1,
        FactorKind::Continuous { low, high } => high > low,
    }
}

/// Cuts all factors that vary.
fn axes(factors: &[Factor], bins: usize) -> Vec<Axis> {
    let varying = factors.iter().enumerate().filter(|(_, each)| varies(each));
    varying
        .map(|(index, factor)| Axis::new(index, factor, bins))
        .collect()
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "clamped"
)]
fn bins(wanted: f64, most: usize) -> usize {
    (wanted.min(most as f64) as usize).max(2)
}

/// Sums up a table of results.
///
/// # Errors
/// If it cannot be read, or if its cases do not fit its factors.
pub fn summarise(results: &dyn Results, options: &SummaryOptions) -> Result<Summary, ResultsError> {
    let factors = results.factors();
    let points = Points::new(factors);
    let independent = results.cases() as f64 / points.repeats as f64;
    let goals = match factors.first().map(|factor| &factor.kind) {
        Some(FactorKind::Levels(levels)) => {
            levels.iter().map(|level| level.label.clone()).collect()
        }
        _ => vec![String::new()],
    };
    let mut counters = vec![Counter::default(); goals.len()];
    let mut probabilities = PROBABILITIES.to_vec();
    probabilities.extend(&options.more_quantiles);
    probabilities.sort_by(f64::total_cmp);
    probabilities.dedup_by(|a, b| (*a - *b).abs() < 1e-9);
    let columns = results.columns();
    let mut spreads = Spreads::new(
        Rc::from(probabilities.clone()),
        points.repeats,
        TAIL,
        columns,
    );
    let mut evidence = Collector::new(columns);
    let considered = if options.factors { factors } else { &[] };
    let mut main = MainEffects::new(
        // Ten layouts or more in a bin, on average.
        axes(considered, bins(independent / 10.0, MOST_EFFECT_BINS)),
        points.repeats,
    );
    let k = options.working_configurations.clamp(1, CONFIGURATIONS);
    let (mut choices, too_many) = match ChoiceCounter::new(
        considered,
        k,
        options.ranked_configurations.clamp(1, CONFIGURATIONS),
    ) {
        None => (None, None),
        Some(Ok(choices)) => (Some(choices), None),
        Some(Err(message)) => (None, Some(message)),
    };

    let measures = Measures::new(columns).with_route(columns, options.route_mm);
    visit_goals(results, &measures, |goal, values, result, layout| {
        let group = points.group(values);
        counters[goal].push(result, layout, group);
        evidence.push(result, layout);
        if let Some(choices) = &mut choices {
            choices.push(values, result, layout, group, 0);
        }
        if let Some(layout) = layout {
            spreads.push(result, layout, 0);
            main.push(values, layout, group);
        }
    })?;
    spreads.next_pass();
    if let Some(choices) = &mut choices {
        choices.next_pass();
    }

    let strongest = main.strongest(MOST_PAIRED);
    // Five layouts or more in a cell of an interaction, twenty in one of a map, on average.
    let fine = axes(
        considered,
        bins((independent / 5.0).sqrt(), MOST_EFFECT_BINS),
    );
    let coarse = axes(considered, bins((independent / 20.0).sqrt(), MOST_MAP_BINS));
    let paired = strongest.iter().map(|&axis| (axis, fine[axis].clone()));
    let mut interactions = Interactions::new(paired.collect(), &main);
    let mut regions = RegionCounter::new(coarse, strongest.clone());
    for pass in 1..PASSES {
        visit_goals(results, &measures, |_, values, result, layout| {
            if let Some(choices) = &mut choices {
                choices.push(values, result, layout, 0, pass);
            }
            if let Some(layout) = layout {
                spreads.push(result, layout, pass);
                if pass == 1 {
                    interactions.push(values, layout);
                    regions.push(values, layout);
                }
            }
        })?;
        spreads.next_pass();
        if let Some(choices) = &mut choices {
            choices.next_pass();
        }
    }

    let mut all = Counter::default();
    for counter in &counters {
        all.add(counter);
    }
    let effect = all.design_effect_of_best(points.repeats);
    let mut summary = Summary {
        schema_version: SUMMARY_VERSION,
        confidence: CONFIDENCE,
        sampling: options.sampling,
        repeats: points.repeats,
        of_choice: None,
        not_ranked: too_many,
        overall: all.finish(None, points.repeats, TAIL, options.route_mm),
        goals: by_goal(
            goals.clone(),
            &counters,
            points.repeats,
            TAIL,
            options.route_mm,
        ),
        over_all_choices: None,
        metrics: columns.iter().filter(|each| each.spread).cloned().collect(),
        spreads: spreads.finish(columns),
        effects: main.finish(&interactions),
        regions: regions.finish(effect, points.repeats),
        choices: None,
        evidence: evidence.finish(),
        notes: Vec::new(),
        methods: methods::methods(),
    };
    if let Some(counter) = &choices {
        let (ranking, first) = counter.finish();
        if let Some(first) = first {
            let of_best = OneChoice {
                results,
                counter,
                cell: first,
            };
            narrow(
                &mut summary,
                &of_best,
                &ranking,
                goals,
                probabilities,
                options.route_mm,
            )?;
        }
        summary.choices = Some(ranking);
    }
    summary.notes = methods::notes(&summary, factors, strongest.len());
    let not_ranked = summary.not_ranked.clone();
    summary.notes.extend(not_ranked);
    Ok(summary)
}

fn by_goal(
    goals: Vec<String>,
    counters: &[Counter],
    repeats: u64,
    tail: f64,
    route_mm: Option<f64>,
) -> Vec<Counts> {
    let per_goal = repeats / goals.len().max(1) as u64;
    let goals = goals.into_iter().zip(counters);
    goals
        .map(|(goal, counter)| counter.finish(Some(goal), per_goal, tail, route_mm))
        .collect()
}

/// The cases of one candidate.
struct OneChoice<'a> {
    results: &'a dyn Results,
    counter: &'a ChoiceCounter,
    cell: usize,
}

impl Results for OneChoice<'_> {
    fn factors(&self) -> &[Factor] {
        self.results.factors()
    }

    fn columns(&self) -> &[MetricColumn] {
        self.results.columns()
    }

    fn cases(&self) -> u64 {
        self.counter.cases(self.cell)
    }

    fn visit(
        &self,
        visit: &mut dyn FnMut(&[FactorValue], &crate::CaseResult),
    ) -> Result<(), ResultsError> {
        self.results.visit(&mut |values, result| {
            if self.counter.cell(values) == self.cell {
                visit(values, result);
            }
        })
    }
}

/// Makes the head of a summary that of the best candidate.
fn narrow(
    summary: &mut Summary,
    results: &OneChoice<'_>,
    ranking: &ChoiceRanking,
    goals: Vec<String>,
    probabilities: Vec<f64>,
    route_mm: Option<f64>,
) -> Result<(), ResultsError> {
    let number = ranking.choices.len() as u64;
    let tail = TAIL / number as f64;
    let points = Points::of_one_choice(results.factors());
    let columns = results.columns();
    let mut counters = vec![Counter::default(); goals.len()];
    let mut spreads = Spreads::new(Rc::from(probabilities), points.repeats, tail, columns);
    let mut evidence = Collector::new(columns);
    let measures = Measures::new(columns).with_route(columns, route_mm);
    for pass in 0..PASSES {
        visit_goals(results, &measures, |goal, values, result, layout| {
            if pass == 0 {
                counters[goal].push(result, layout, points.group(values));
                evidence.push(result, layout);
            }
            if let Some(layout) = layout {
                spreads.push(result, layout, pass);
            }
        })?;
        spreads.next_pass();
    }
    let mut all = Counter::default();
    for counter in &counters {
        all.add(counter);
    }
    let as_good = ranking.choices.iter().filter(|choice| {
        let against = &choice.against_first;
        against.as_ref().is_some_and(|found| !found.distinguishable)
    });
    let overall = all.finish(None, points.repeats, tail, route_mm);
    summary.over_all_choices = Some(std::mem::replace(&mut summary.overall, overall));
    summary.goals = by_goal(goals, &counters, points.repeats, tail, route_mm);
    summary.spreads = spreads.finish(columns);
    summary.evidence = evidence.finish();
    summary.repeats = points.repeats;
    summary.of_choice = ranking.choices.first().map(|first| ChosenChoice {
        label: first.label.clone(),
        of: number,
        as_good: as_good.count() as u64,
        confidence_each: 1.0 - 2.0 * tail,
        by: ranking.ranked_by.clone(),
        held_out: ranking.held_out,
    });
    Ok(())
}

/// Visits all cases with their goals.
fn visit_goals(
    results: &dyn Results,
    measures: &Measures,
    mut visit: impl FnMut(usize, &[FactorValue], &crate::CaseResult, Option<&Layout>),
) -> Result<(), ResultsError> {
    layout::visit_checked(results, |values, result| {
        let goal = match values.first() {
            Some(FactorValue::Level(level)) => *level,
            _ => 0,
        };
        let layout = Layout::of(result, measures);
        visit(goal, values, result, layout.as_ref());
    })
}
