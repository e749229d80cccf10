//! The accuracy table of a run and of a study: which needles it is of, and how they are grouped.

use std::collections::{BTreeMap, BTreeSet};
use std::str::FromStr;

use needlebench_evaluation::accuracy::{
    AccuracyTable, Drawn, HitRadius, QUANTITIES, Sample, summarise,
};
use needlebench_evaluation::report::{ConfigurationReport, Report, Status};
use needlebench_input::{Finding, nearest_name};
use needlebench_kinematics::ik::Configuration;
use needlebench_scenario::ResolvedScenario;
use needlebench_scenario::study::FactorValues;
use needlebench_scenario::study_criteria::{BEST, EVERY};
use needlebench_study::statistics::BestConfiguration;
use needlebench_study::{
    CaseResult, Factor, FactorKind, FactorValue, Outcome, Results, ResultsError, Row,
};
use needlebench_uncertainty::Source;

use crate::study::PreparedStudy;

/// Name of the group of configurations.
pub const CONFIGURATION: &str = "configuration";
/// Name of the group of goals.
pub const GOAL: &str = "goal";

/// Which needles the table is of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Needles {
    /// Of each case one: that of the best configuration, of a run's goal that of the recommended one.
    Best,
    /// Of each configuration that is not rejected.
    Every,
    /// Of one configuration, where it is not rejected.
    Of(Configuration),
}

/// What [`Needles`] are called on a command line, and none of them was said.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("use `best`, `every` or a configuration's label, e.g. Right-Up-Fold")]
pub struct UnknownNeedles;

impl FromStr for Needles {
    type Err = UnknownNeedles;

    fn from_str(text: &str) -> Result<Self, UnknownNeedles> {
        match text {
            BEST => Ok(Self::Best),
            EVERY => Ok(Self::Every),
            label => Configuration::from_label(label)
                .map(Self::Of)
                .ok_or(UnknownNeedles),
        }
    }
}

impl Needles {
    /// In words.
    fn words(self, is_run: bool) -> String {
        match (self, is_run) {
            (Self::Best, true) => "the recommended configuration of each goal".to_owned(),
            (Self::Best, false) => {
                "in each case the feasible configuration with the largest clearance".to_owned()
            }
            (Self::Every, _) => "every configuration that is not rejected".to_owned(),
            (Self::Of(configuration), _) => {
                format!("{}, where it is not rejected", configuration.label())
            }
        }
    }
}

/// What the table is to be.
#[derive(Debug, Clone, PartialEq)]
pub struct AccuracyRequest {
    /// What groups are of; goals if empty.
    pub by: Vec<String>,
    /// Which needles; every one of a run and the best of a study's case if none is said.
    pub needles: Option<Needles>,
    /// Radius of a hit, mm; that of the criteria if none is said.
    pub hit_radius_mm: Option<f64>,
}

impl AccuracyRequest {
    fn groups(&self) -> Vec<String> {
        if self.by.is_empty() {
            vec![GOAL.to_owned()]
        } else {
            self.by.clone()
        }
    }
}

/// Why there is no table.
#[derive(Debug, thiserror::Error)]
pub enum AccuracyError {
    /// The request does not fit.
    #[error(transparent)]
    Request(#[from] Finding),
    /// The table of results cannot be read.
    #[error(transparent)]
    Results(#[from] ResultsError),
}

/// The groups that a name may stand for, and which one it is.
///
/// # Errors
/// A [`Finding`] with the nearest name.
fn place_of(name: &str, known: &[&str], file: &str) -> Result<usize, Finding> {
    known.iter().position(|each| *each == name).ok_or_else(|| {
        let finding = Finding::new(file, format!("cannot group by `{name}`: unknown name"));
        let hint = match nearest_name(name, known.iter().copied()) {
            Some(nearest) => format!("did you mean `{nearest}`?"),
            None => format!("group by {}", known.join(", ")),
        };
        finding.key("--by").hint(hint)
    })
}

/// Whether the request is possible for a run, before the run is made.
///
/// # Errors
/// A group that runs do not have, or a run without needles.
pub fn check_run(request: &AccuracyRequest, resolved: &ResolvedScenario) -> Result<(), Finding> {
    let file = &resolved.source.file;
    for name in request.groups() {
        place_of(&name, &[GOAL, CONFIGURATION], file)?;
    }
    if resolved.goals.is_empty() {
        let finding = Finding::new(file, "no needle to tabulate the accuracy of");
        return Err(finding
            .key("--table")
            .hint("an accuracy table requires goals; an ISO 9283 test has none"));
    }
    Ok(())
}

/// The same of a study.
///
/// # Errors
/// A factor that there is not, or that is a continuum.
pub fn check_study(request: &AccuracyRequest, prepared: &PreparedStudy) -> Result<(), Finding> {
    let file = &prepared.study.source.file;
    group_factors(&request.groups(), prepared.design.factors(), file).map(|_| ())
}

/// Effects of the scenario that act on the needle only while it is inserted.
fn insertion_effects(resolved: &ResolvedScenario) -> Vec<String> {
    let Some(all) = &resolved.imperfections else {
        return Vec::new();
    };
    let sources = Source::ALL.iter();
    let later = sources.filter(|each| !each.is_before_insertion() && each.is_in(all));
    later.map(|each| each.name().to_owned()).collect()
}

fn radius(
    request: &AccuracyRequest,
    of_study: Option<f64>,
    resolved: &ResolvedScenario,
) -> Option<HitRadius> {
    let of_scenario = resolved.scenario.criteria.max_tip_position_error_mm;
    let found = [
        (request.hit_radius_mm, "--hit-radius"),
        (of_study, "the study's max_tip_error_mm"),
        (of_scenario, "the scenario's max_tip_position_error_mm"),
    ];
    found.into_iter().find_map(|(radius_mm, source)| {
        Some(HitRadius {
            radius_mm: radius_mm?,
            source: source.to_owned(),
        })
    })
}

/// Numbers the groups in the order in which they are first named.
#[derive(Default)]
struct Groups {
    labels: Vec<String>,
    numbers: BTreeMap<Vec<usize>, usize>,
}

impl Groups {
    fn number(&mut self, key: Vec<usize>, label: impl FnOnce() -> String) -> usize {
        *self.numbers.entry(key).or_insert_with(|| {
            self.labels.push(label());
            self.labels.len() - 1
        })
    }

    /// Groups in the order of their keys; what was numbered before is numbered anew.
    fn in_order(self, samples: &mut [Sample]) -> Vec<String> {
        let mut new_of = vec![0; self.labels.len()];
        let mut labels = Vec::new();
        for old in self.numbers.into_values() {
            new_of[old] = labels.len();
            labels.push(self.labels[old].clone());
        }
        for sample in samples {
            sample.group = new_of[sample.group];
        }
        labels
    }
}

/// The accuracy table of a run.
pub fn accuracy_of_run(
    report: &Report,
    resolved: &ResolvedScenario,
    request: &AccuracyRequest,
) -> AccuracyTable {
    let by = request.groups();
    let needles = request.needles.unwrap_or(Needles::Every);
    let hit_radius = radius(request, None, resolved);
    let mut groups = Groups::default();
    let mut samples = Vec::new();
    let mut columns: [BTreeSet<String>; QUANTITIES.len()] = Default::default();
    let mut is_simulated = false;
    for (at, goal) in report.goals.iter().enumerate() {
        let recommended = goal.recommended.as_ref().map(|found| found.label.as_str());
        for (index, each) in goal.configurations.iter().enumerate() {
            let wanted = match needles {
                Needles::Best => recommended == Some(each.label),
                Needles::Every => true,
                Needles::Of(configuration) => each.label == configuration.label(),
            };
            if each.status == Status::Rejected || !wanted {
                continue;
            }
            is_simulated |= !each.engines.is_empty();
            let place = |name: &str| if name == GOAL { at } else { index };
            let name_of = |name: &str| {
                if name == GOAL {
                    goal.name.as_str()
                } else {
                    each.label
                }
            };
            let key = by.iter().map(|name| place(name)).collect();
            let group = groups.number(key, || {
                let names: Vec<&str> = by.iter().map(|name| name_of(name)).collect();
                names.join(", ")
            });
            samples.push(Sample {
                group,
                block: None,
                values: std::array::from_fn(|quantity| of_run(each, quantity, &mut columns)),
            });
        }
    }
    let labels = groups.in_order(&mut samples);
    let drawn = Drawn::Nothing(if report.truth.is_some() {
        "a run is one draw of arm and patient".to_owned()
    } else {
        "nothing is sampled".to_owned()
    });
    let radius_mm = hit_radius.as_ref().map(|found| found.radius_mm);
    let (groups, all, tests) = summarise(&labels, &samples, radius_mm, &drawn);
    let mut notes = vec![format!("Needles: {}.", needles.words(true))];
    notes.push(match (&report.truth, is_simulated) {
        (None, true) => {
            "The simulated arm has no imperfections: values are simulation residuals (control and \
             integration errors), not the accuracy of a real arm."
                .to_owned()
        }
        (None, false) => {
            "The arm has no imperfections: values are residuals of the inverse kinematics, not the accuracy \
             of a real arm."
                .to_owned()
        }
        (Some(truth), _) => format!(
            "All needles are of the one arm and patient sampled by seed {}; a study covers many.",
            truth.seed
        ),
    });
    if is_simulated && report.provenance.engines.len() > 1 {
        notes.push("Simulated values are those of the worse engine.".to_owned());
    }
    AccuracyTable {
        name: report.scenario.name.clone(),
        by,
        groups,
        all,
        tests,
        hit_radius,
        columns,
        insertion_effects: insertion_effects(resolved),
        notes,
    }
}

/// Value of a quantity of a configuration of a run, in its unit.
fn of_run(
    configuration: &ConfigurationReport,
    quantity: usize,
    columns: &mut [BTreeSet<String>; QUANTITIES.len()],
) -> Option<f64> {
    QUANTITIES[quantity].keys().into_iter().find_map(|key| {
        let value = key.read_column(configuration)?;
        columns[quantity].insert(key.key().into_owned());
        Some(value)
    })
}

/// Factors that groups are of: their indices, and none for configurations.
fn group_factors(
    by: &[String],
    factors: &[Factor],
    file: &str,
) -> Result<Vec<Option<usize>>, Finding> {
    let mut names: Vec<&str> = factors.iter().map(|each| each.name.as_str()).collect();
    names.push(CONFIGURATION);
    by.iter()
        .map(|name| {
            let at = place_of(name, &names, file)?;
            let Some(factor) = factors.get(at) else {
                return Ok(None);
            };
            if matches!(factor.kind, FactorKind::Continuous { .. }) {
                return Err(Finding::new(
                    file,
                    format!("`{name}` is continuous: it has no groups"),
                )
                .key("--by")
                .hint("group by a factor with `values`, `levels` or `grid`"));
            }
            Ok(Some(at))
        })
        .collect()
}

/// The accuracy table of a study's results.
///
/// # Errors
/// A factor that there is not, or a table that cannot be read.
pub fn accuracy_of_study(
    prepared: &PreparedStudy,
    results: &dyn Results,
    request: &AccuracyRequest,
) -> Result<AccuracyTable, AccuracyError> {
    let by = request.groups();
    let needles = request.needles.unwrap_or(Needles::Best);
    let factors = results.factors();
    let of_groups = group_factors(&by, factors, &prepared.study.source.file)?;
    let base = prepared.study.family.base();
    let of_study = prepared.study.file.criteria.max_tip_error_mm.as_ref();
    let hit_radius = radius(request, of_study.map(|limit| limit.at_most), base);
    // Indices of the columns of each quantity, first come first served.
    let places: Vec<Vec<usize>> = QUANTITIES
        .iter()
        .map(|quantity| {
            let names = quantity.keys_of_cases();
            let place = |name: &str| results.columns().iter().position(|each| each.name == name);
            names
                .iter()
                .filter_map(|key| place(&key.column()))
                .collect()
        })
        .collect();
    let sampled: Vec<usize> = (0..factors.len())
        .filter(|&at| factors[at].is_sampled() && !of_groups.contains(&Some(at)))
        .collect();
    let best = BestConfiguration::new(results.columns());
    let mut groups = Groups::default();
    let mut blocks: BTreeMap<Vec<u64>, u64> = BTreeMap::new();
    let mut samples: Vec<Sample> = Vec::new();
    let mut columns: [BTreeSet<String>; QUANTITIES.len()] = Default::default();
    results.visit(&mut |values, result| {
        for (index, row) in chosen(needles, &best, result) {
            let key = of_groups.iter().map(|factor| match factor {
                Some(at) => level(values[*at]),
                None => index,
            });
            let group = groups.number(key.collect(), || {
                let names: Vec<&str> = of_groups
                    .iter()
                    .map(|factor| match factor {
                        Some(at) => label_of(&factors[*at], values[*at]),
                        None => Configuration::ALL[index].label(),
                    })
                    .collect();
                names.join(", ")
            });
            let block: Vec<u64> = sampled
                .iter()
                .map(|at| match values[*at] {
                    FactorValue::Level(level) => level as u64,
                    FactorValue::Number(number) => number.to_bits(),
                })
                .collect();
            let next = blocks.len() as u64;
            samples.push(Sample {
                group,
                block: Some(*blocks.entry(block).or_insert(next)),
                values: std::array::from_fn(|quantity| {
                    places[quantity].iter().find_map(|&column| {
                        let value = f64::from(row.get(column)?);
                        let name = &results.columns()[column].name;
                        if !columns[quantity].contains(name) {
                            columns[quantity].insert(name.clone());
                        }
                        Some(value)
                    })
                }),
            });
        }
    })?;
    let labels = groups.in_order(&mut samples);
    let drawn = if factors.iter().any(Factor::is_sampled) {
        Drawn::Blocks
    } else {
        Drawn::Nothing("no factor is sampled at random".to_owned())
    };
    let radius_mm = hit_radius.as_ref().map(|found| found.radius_mm);
    let (groups, all, tests) = summarise(&labels, &samples, radius_mm, &drawn);
    Ok(AccuracyTable {
        name: prepared.study.file.name.clone(),
        by,
        groups,
        all,
        tests,
        hit_radius,
        columns,
        insertion_effects: insertion_effects(base),
        notes: notes_of_study(prepared, needles),
    })
}

fn notes_of_study(prepared: &PreparedStudy, needles: Needles) -> Vec<String> {
    let mut notes = vec![format!("Needles: {}.", needles.words(false))];
    let changing = prepared.study.factors.iter().filter(|factor| {
        let starts = |key: &dyn ToString| key.to_string().starts_with("imperfections");
        match &factor.values {
            FactorValues::Levels(levels) => {
                let mut changes = levels.iter().flat_map(|level| &level.changes);
                changes.any(|(key, _)| starts(key))
            }
            FactorValues::Continuum { key, .. } => starts(key),
        }
    });
    notes.extend(changing.map(|factor| {
        format!(
            "The factor `{}` changes [imperfections]: the errors of a group follow its level.",
            factor.name
        )
    }));
    if prepared.study.family.base().imperfections.is_none() && notes.len() == 1 {
        notes.push(
            "The arm has no imperfections: values are residuals, not the accuracy of a real arm."
                .to_owned(),
        );
    }
    let choices = prepared.design.factors().iter();
    let choices = choices.filter(|each| each.role == needlebench_study::Role::Control);
    let names: Vec<&str> = choices.map(|each| each.name.as_str()).collect();
    if !names.is_empty() {
        notes.push(format!(
            "Includes all candidates ({}), not only the best one.",
            names.join(", ")
        ));
    }
    notes
}

/// Rows of a case that the table is of.
fn chosen<'a>(
    needles: Needles,
    best: &BestConfiguration,
    result: &'a CaseResult,
) -> impl Iterator<Item = (usize, &'a Row)> {
    let best = (needles == Needles::Best)
        .then(|| best.of(result))
        .flatten();
    result.rows.iter().enumerate().filter(move |(index, row)| {
        let has_numbers = matches!(row.outcome, Outcome::Ok | Outcome::Failed);
        has_numbers
            && match needles {
                Needles::Best => best == Some(*index),
                Needles::Every => true,
                Needles::Of(configuration) => Configuration::ALL[*index] == configuration,
            }
    })
}

fn level(value: FactorValue) -> usize {
    match value {
        FactorValue::Level(level) => level,
        FactorValue::Number(_) => 0,
    }
}

fn label_of(factor: &Factor, value: FactorValue) -> &str {
    match (&factor.kind, value) {
        (FactorKind::Levels(levels), FactorValue::Level(level)) => &levels[level].label,
        _ => "",
    }
}
