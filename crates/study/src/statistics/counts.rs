//! Cases, outcomes and success rates.

use std::collections::BTreeMap;

use needlebench_kinematics::ik::Configuration;
use serde::{Deserialize, Serialize};

use super::interval::{Rate, TAIL};
use super::layout::{CONFIGURATIONS, Layout};
use super::moments::Grouped;
use crate::{CaseResult, Outcome};

/// Most details that are counted separately for each configuration and outcome; the rest count as `other`.
const MOST_DETAILS: usize = 100;

/// Outcomes of cases and configurations: of all, or of one goal.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Counts {
    /// The goal; none of all.
    pub goal: Option<String>,
    /// Cases.
    pub cases: u64,
    /// Cases with an invalid layout, excluded from all rates.
    pub invalid: u64,
    /// Why they are invalid, by the key at fault; the most frequent first.
    pub invalid_details: Vec<DetailCount>,
    /// Valid layouts: cases that are not invalid.
    pub layouts: u64,
    /// Share of the valid layouts in which at least 1, 2, ... 8 configurations are ok. Those not evaluated count as not
    /// ok.
    pub at_least: Vec<Rate>,
    /// Layouts in which it is not known whether at least 1, 2, ... 8 configurations are ok, because some were not
    /// evaluated.
    #[serde(default)]
    pub undecided: Vec<u64>,
    /// The same including the needle path's clearance from bone, vessels and organs; none unless feasibility leaves it
    /// out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub with_route: Option<WithRoute>,
    /// Valid layouts in which exactly 0, 1, ... 8 configurations are ok.
    pub working: Vec<u64>,
    /// The eight configurations.
    pub configurations: Vec<ConfigurationCounts>,
}

/// Rates that include the needle path.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct WithRoute {
    /// Required clearance, mm.
    pub least_mm: f64,
    /// Valid layouts with a known needle-path clearance.
    pub known: u64,
    /// Those of them with the required clearance.
    pub kept: u64,
    /// Share of the known ones in which it does and at least 1, 2, ... 8 configurations are ok.
    pub at_least: Vec<Rate>,
    /// Share of the known ones in which it does and a configuration is ok, for each of the eight.
    pub configurations: Vec<Rate>,
}

/// Outcomes of a configuration.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ConfigurationCounts {
    /// Its label.
    pub label: String,
    /// Layouts in which it is ok.
    pub ok: u64,
    /// Layouts in which it fails a criterion.
    pub failed: u64,
    /// Layouts in which a rule rejects it.
    pub rejected: u64,
    /// Layouts in which it was not evaluated.
    #[serde(default)]
    pub not_judged: u64,
    /// Layouts in which it is the best: ok, with the largest clearance of those that are.
    pub best: u64,
    /// Share of the valid layouts in which it is ok.
    pub success: Rate,
    /// Reasons for failure and rejection, and for no evaluation, the most frequent first.
    pub details: Vec<DetailCount>,
}

/// How often a detail was the reason.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct DetailCount {
    /// The outcome that it explains.
    pub outcome: Outcome,
    /// The rule, criterion or key.
    pub detail: String,
    /// Rows, or cases of an invalid layout.
    pub count: u64,
}

impl Counts {
    /// How many motions were not evaluated, by reason: `engine_failure rapier`, or a criterion.
    pub fn not_judged(&self) -> BTreeMap<&str, u64> {
        let mut counts = BTreeMap::new();
        let details = self.configurations.iter().flat_map(|each| &each.details);
        for each in details.filter(|each| each.outcome == Outcome::NotJudged) {
            *counts.entry(each.detail.as_str()).or_default() += each.count;
        }
        counts
    }
}

/// Counters of one goal.
#[derive(Debug, Clone, Default)]
pub(crate) struct Counter {
    invalid: u64,
    outcomes: [[u64; CONFIGURATIONS]; Outcome::ALL.len()],
    best: [u64; CONFIGURATIONS],
    working: [u64; CONFIGURATIONS + 1],
    details: [BTreeMap<String, u64>; CONFIGURATIONS],
    failed_details: [BTreeMap<String, u64>; CONFIGURATIONS],
    open_details: [BTreeMap<String, u64>; CONFIGURATIONS],
    undecided: [u64; CONFIGURATIONS],
    invalid_details: BTreeMap<String, u64>,
    success: [Grouped; CONFIGURATIONS],
    at_least: [Grouped; CONFIGURATIONS],
    is_best: [Grouped; CONFIGURATIONS],
    route: RouteCounter,
}

/// Counters of layouts with the required needle-path clearance.
#[derive(Debug, Clone, Default)]
struct RouteCounter {
    known: u64,
    kept: u64,
    at_least: [(u64, Grouped); CONFIGURATIONS],
    configurations: [(u64, Grouped); CONFIGURATIONS],
}

impl RouteCounter {
    fn push(&mut self, layout: &Layout, kept: bool, group: usize) {
        self.known += 1;
        self.kept += u64::from(kept);
        let count = |(count, grouped): &mut (u64, Grouped), holds: bool| {
            *count += u64::from(holds);
            grouped.push(group, f64::from(u8::from(holds)));
        };
        for index in 0..CONFIGURATIONS {
            count(&mut self.at_least[index], kept && layout.working() > index);
            count(&mut self.configurations[index], kept && layout.works(index));
        }
    }

    fn add(&mut self, other: &Self) {
        self.known += other.known;
        self.kept += other.kept;
        let to = self.at_least.iter_mut().chain(&mut self.configurations);
        let from = other.at_least.iter().chain(&other.configurations);
        for ((count, grouped), (more, others)) in to.zip(from) {
            *count += more;
            grouped.add(others);
        }
    }
}

/// Counts without allocating where the detail is known.
fn count_detail(details: &mut BTreeMap<String, u64>, detail: &str, by: u64) {
    if let Some(count) = details.get_mut(detail) {
        *count += by;
    } else if details.len() < MOST_DETAILS {
        details.insert(detail.to_owned(), by);
    } else {
        *details.entry("other".to_owned()).or_default() += by;
    }
}

impl Counter {
    pub(crate) fn push(&mut self, result: &CaseResult, layout: Option<&Layout>, group: usize) {
        let Some(layout) = layout else {
            self.invalid += 1;
            let rows = result.rows.iter();
            let detail = rows
                .filter(|row| row.outcome == Outcome::Invalid)
                .map(|row| row.detail.as_ref())
                .next();
            count_detail(&mut self.invalid_details, detail.unwrap_or_default(), 1);
            return;
        };
        for (index, row) in result.rows.iter().enumerate() {
            self.outcomes[row.outcome as usize][index] += 1;
            match row.outcome {
                Outcome::Failed => count_detail(&mut self.failed_details[index], &row.detail, 1),
                Outcome::Rejected => count_detail(&mut self.details[index], &row.detail, 1),
                Outcome::NotJudged => count_detail(&mut self.open_details[index], &row.detail, 1),
                Outcome::Ok | Outcome::Invalid => {}
            }
            self.success[index].push(group, f64::from(u8::from(layout.works(index))));
            let is_best = layout.best == Some(index);
            self.is_best[index].push(group, f64::from(u8::from(is_best)));
        }
        if let Some(best) = layout.best {
            self.best[best] += 1;
        }
        if let Some(kept) = layout.keeps_away {
            self.route.push(layout, kept, group);
        }
        self.working[layout.working()] += 1;
        for undecided in &mut self.undecided[layout.working()..layout.may_work()] {
            *undecided += 1;
        }
        for (index, grouped) in self.at_least.iter_mut().enumerate() {
            grouped.push(group, f64::from(u8::from(layout.working() > index)));
        }
    }

    pub(crate) fn add(&mut self, other: &Self) {
        fn add<const N: usize>(to: &mut [u64; N], from: &[u64; N]) {
            for (to, from) in to.iter_mut().zip(from) {
                *to += from;
            }
        }
        fn add_details(to: &mut BTreeMap<String, u64>, from: &BTreeMap<String, u64>) {
            for (detail, count) in from {
                count_detail(to, detail, *count);
            }
        }
        self.invalid += other.invalid;
        for (to, from) in self.outcomes.iter_mut().zip(&other.outcomes) {
            add(to, from);
        }
        add(&mut self.best, &other.best);
        add(&mut self.undecided, &other.undecided);
        add(&mut self.working, &other.working);
        self.route.add(&other.route);
        add_details(&mut self.invalid_details, &other.invalid_details);
        for index in 0..CONFIGURATIONS {
            add_details(&mut self.details[index], &other.details[index]);
            add_details(
                &mut self.failed_details[index],
                &other.failed_details[index],
            );
            add_details(&mut self.open_details[index], &other.open_details[index]);
            self.success[index].add(&other.success[index]);
            self.at_least[index].add(&other.at_least[index]);
            self.is_best[index].add(&other.is_best[index]);
        }
    }

    /// Largest design effect of the shares in which the configurations are the best.
    pub(crate) fn design_effect_of_best(&self, repeats: u64) -> f64 {
        let effects = self.is_best.iter();
        // Of those that ever are.
        let effects = effects.filter(|grouped| grouped.total() > 0.0);
        effects
            .map(|grouped| grouped.count() / grouped.effective_size(repeats, TAIL))
            .fold(1.0, f64::max)
    }

    /// The numbers of a goal, or of all; `repeats` cases come from each sampled point, and the true value is beyond
    /// an end of an interval with probability `tail`.
    pub(crate) fn finish(
        &self,
        goal: Option<String>,
        repeats: u64,
        tail: f64,
        route_mm: Option<f64>,
    ) -> Counts {
        let layouts: u64 = self.working.iter().sum();
        let rate_of = |successes, of, grouped: &Grouped| {
            let size = grouped.effective_size(repeats, tail);
            Rate::with_tail(successes, of, size, tail)
        };
        let rate = |successes, grouped: &Grouped| rate_of(successes, layouts, grouped);
        let rates = |all: &[(u64, Grouped)]| {
            all.iter()
                .map(|(successes, grouped)| rate_of(*successes, self.route.known, grouped))
                .collect()
        };
        let with_route = route_mm.filter(|_| self.route.known > 0);
        let with_route = with_route.map(|least_mm| WithRoute {
            least_mm,
            known: self.route.known,
            kept: self.route.kept,
            at_least: rates(&self.route.at_least),
            configurations: rates(&self.route.configurations),
        });
        let configurations = Configuration::ALL.iter().enumerate();
        Counts {
            goal,
            cases: layouts + self.invalid,
            invalid: self.invalid,
            invalid_details: sorted([(Outcome::Invalid, &self.invalid_details)]),
            layouts,
            at_least: (1..=CONFIGURATIONS)
                .map(|k| rate(self.working[k..].iter().sum(), &self.at_least[k - 1]))
                .collect(),
            undecided: self.undecided.to_vec(),
            with_route,
            working: self.working.to_vec(),
            configurations: configurations
                .map(|(index, configuration)| {
                    let outcome = |outcome: Outcome| self.outcomes[outcome as usize][index];
                    ConfigurationCounts {
                        label: configuration.label().to_owned(),
                        ok: outcome(Outcome::Ok),
                        failed: outcome(Outcome::Failed),
                        rejected: outcome(Outcome::Rejected),
                        not_judged: outcome(Outcome::NotJudged),
                        best: self.best[index],
                        success: rate(outcome(Outcome::Ok), &self.success[index]),
                        details: sorted([
                            (Outcome::Failed, &self.failed_details[index]),
                            (Outcome::Rejected, &self.details[index]),
                            (Outcome::NotJudged, &self.open_details[index]),
                        ]),
                    }
                })
                .collect(),
        }
    }
}

/// The most frequent first, equal ones in the order of their names.
fn sorted<const N: usize>(maps: [(Outcome, &BTreeMap<String, u64>); N]) -> Vec<DetailCount> {
    let mut found: Vec<DetailCount> = maps
        .into_iter()
        .flat_map(|(outcome, map)| {
            map.iter().map(move |(detail, count)| DetailCount {
                outcome,
                detail: detail.clone(),
                count: *count,
            })
        })
        .collect();
    found.sort_by_key(|each| std::cmp::Reverse(each.count));
    found
}
