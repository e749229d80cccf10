//! The answer of a study: one sentence with its value and confidence interval.

use std::fmt::Write as _;

use needlebench_cell::reason_in_words;
use needlebench_show::number::{in_percent, measured, three_digits};
use needlebench_study::statistics::{
    BinMean, ChoiceRanking, ChosenChoice, Interval, Rate, Summary,
};
use needlebench_study::{Factor, FactorKind, Measure, Role};
use serde::Serialize;

use super::ROUNDING_MM;

/// Most levels of a factor that are compared: more are a range, not a question.
const MOST_LEVELS: usize = 16;
/// Levels named in the sentence; the table has all.
const NAMED_LEVELS: usize = 3;
/// Candidates tied with the first that are named; more are counted.
const NAMED_EQUALS: usize = 2;

/// What a study answers.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Answer {
    /// One sentence, with its value and confidence interval.
    pub sentence: String,
    /// Remarks, a sentence each.
    pub remarks: Vec<String>,
    /// Comparisons of named levels of noise factors, the factor that explains most first.
    pub compared: Vec<Comparison>,
}

/// A comparison of the levels of a factor.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Comparison {
    /// Name of the factor.
    pub factor: String,
    /// The compared quantity, in words.
    pub response: String,
    /// Unit of the values: `1` of shares, or `mm`.
    pub unit: String,
    /// Whether the levels differ significantly at the 5 % level.
    pub differs: bool,
    /// In the order of the study.
    pub levels: Vec<LevelValue>,
    /// Share of the variance that the factor explains.
    #[serde(skip)]
    share: f64,
}

/// A level of a factor.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct LevelValue {
    /// Its name.
    pub label: String,
    /// Layouts.
    pub layouts: u64,
    /// Mean over them; none without layouts.
    pub value: Option<f64>,
    /// Its 95 % confidence interval.
    pub interval: Option<Interval>,
    /// Whether there are fewer than 30 independent layouts.
    pub small: bool,
}

impl Comparison {
    /// A value with its interval, for a table.
    pub fn text(&self, level: &LevelValue) -> String {
        self.value_text(level, "", "..")
    }

    /// A value with its interval: `ci` before it, `to` between its ends.
    fn value_text(&self, level: &LevelValue, ci: &str, to: &str) -> String {
        let Some(value) = level.value else {
            return "no layouts".to_owned();
        };
        let interval = level.interval;
        if self.unit == "1" {
            let ends = |each: Interval| {
                format!(
                    " ({ci}{} {to} {} %)",
                    in_percent(each.low),
                    in_percent(each.high)
                )
            };
            return format!(
                "{} %{}",
                in_percent(value),
                interval.map_or(String::new(), ends)
            );
        }
        let ends = |each: Interval| {
            format!(
                " ({ci}{} {to} {})",
                three_digits(each.low),
                three_digits(each.high)
            )
        };
        format!(
            "{}{}",
            measured(value, &self.unit),
            interval.map_or(String::new(), ends)
        )
    }

    fn named(&self, level: &LevelValue) -> String {
        let text = self.value_text(level, "95 % CI ", "to");
        match level.label.as_str() {
            "true" => format!("{text} with it"),
            "false" => format!("{text} without"),
            label => format!("{text} with {label}"),
        }
    }

    /// The levels in a clause: all, or the first ones and the last.
    fn clause(&self) -> String {
        let mut levels: Vec<&LevelValue> = self
            .levels
            .iter()
            .filter(|each| each.value.is_some())
            .collect();
        levels.sort_by(|a, b| {
            b.value
                .unwrap_or_default()
                .total_cmp(&a.value.unwrap_or_default())
        });
        let mut texts: Vec<String> = levels
            .iter()
            .take(NAMED_LEVELS)
            .map(|each| self.named(each))
            .collect();
        if let Some(last) = levels.get(NAMED_LEVELS..).and_then(<[_]>::last) {
            let more = if levels.len() > NAMED_LEVELS + 1 {
                "... down to "
            } else {
                ""
            };
            texts.push(format!("{more}{}", self.named(last)));
        }
        format!(
            "{} by {}: {}",
            self.response,
            spaced(&self.factor),
            texts.join(", ")
        )
    }
}

/// A name with spaces.
pub(crate) fn spaced(name: &str) -> String {
    name.replace('_', " ")
}

/// `95.0 to 99.6 %`.
pub(crate) fn percents(interval: Interval) -> String {
    format!(
        "{} to {} %",
        in_percent(interval.low),
        in_percent(interval.high)
    )
}

impl Answer {
    /// From the statistics of a study; a layout is feasible with at least `working` feasible configurations.
    pub fn new(summary: &Summary, factors: &[Factor], working: usize) -> Self {
        let compared = if summary.choices.is_some() {
            Vec::new()
        } else {
            comparisons(summary, factors)
        };
        let mut remarks = Vec::new();
        let mut sentence = if summary.overall.layouts == 0 {
            format!(
                "no answer: all {} layouts are invalid",
                summary.overall.cases
            )
        } else if let Some(why) = nothing_judged(summary, working) {
            why
        } else if let Some(why) = &summary.not_ranked {
            format!("no answer: {why}")
        } else if let (Some(ranking), Some(best)) = (&summary.choices, &summary.of_choice) {
            remarks.extend(beside_the_first(ranking, best));
            of_choice(summary, ranking, best, working)
        } else {
            of_circumstances(summary, &compared, working, &mut remarks)
        };
        if !sentence.starts_with("no answer") {
            remarks.splice(0..0, not_judged_in_words(summary, working));
            if let Some(with_route) = with_route_in_words(summary, working) {
                let _ = write!(sentence, "; {with_route}");
            }
        }
        remarks.extend(small(&summary.overall.at_least[working - 1]));
        Self {
            sentence,
            remarks,
            compared,
        }
    }
}

/// Why there is no answer where no layout could be evaluated.
fn nothing_judged(summary: &Summary, working: usize) -> Option<String> {
    let undecided = undecided(summary, working);
    let mut configurations = summary.overall.configurations.iter();
    let judged = configurations.any(|each| each.ok > 0 || each.failed > 0);
    (undecided > 0 && !judged).then(|| {
        format!(
            "no answer: none of the {undecided} possibly feasible layouts could be evaluated ({})",
            open_reasons(summary)
        )
    })
}

/// Layouts whose feasibility is not known.
fn undecided(summary: &Summary, working: usize) -> u64 {
    let undecided = &summary.overall.undecided;
    undecided.get(working - 1).copied().unwrap_or_default()
}

/// Why motions were not evaluated, the most frequent reason first: `engine failure rapier`.
fn open_reasons(summary: &Summary) -> String {
    let mut counts: Vec<(&str, u64)> = summary.overall.not_judged().into_iter().collect();
    counts.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
    let texts: Vec<String> = counts
        .into_iter()
        .take(NAMED_EQUALS)
        .map(|(detail, count)| format!("{}: {count} motions", reason_in_words(detail)))
        .collect();
    texts.join(", ")
}

/// The upper limit of the share of feasible layouts where some were not evaluated.
fn not_judged_in_words(summary: &Summary, working: usize) -> Option<String> {
    let undecided = undecided(summary, working);
    let layouts = summary.overall.layouts;
    (undecided > 0).then(|| {
        let most = summary.overall.at_least[working - 1].successes + undecided;
        format!(
            "{undecided} of {layouts} layouts were not evaluated ({}) and count as infeasible; if all were feasible, \
             the rate would be {} %",
            open_reasons(summary),
            in_percent(most as f64 / layouts as f64)
        )
    })
}

/// `at least one configuration is feasible`.
fn works_in_words(working: usize) -> String {
    match working {
        1 => "at least one configuration is feasible".to_owned(),
        count => format!("at least {count} configurations are feasible"),
    }
}

/// How many layouts are feasible including the needle path, where feasibility does not include it.
fn with_route_in_words(summary: &Summary, working: usize) -> Option<String> {
    let route = summary.overall.with_route.as_ref()?;
    let rate = &route.at_least[working - 1];
    let interval = rate.interval.map_or(String::new(), |each| {
        format!(" (95 % CI {})", percents(each))
    });
    Some(format!(
        "in {} %{interval} the needle path also keeps {} mm from bone, vessels and organs; {} of {} needle paths \
         pass closer",
        rate.rate.map_or("-".to_owned(), in_percent),
        three_digits(route.least_mm),
        route.known - route.kept,
        route.known
    ))
}

/// `in 98.2 % of 512 layouts (95 % CI 95.0 to 99.6 %)`.
fn share_of_layouts(rate: &Rate, ci: &str) -> String {
    let share = rate
        .rate
        .map_or("no".to_owned(), |share| format!("{} %", in_percent(share)));
    let interval = rate.interval.map_or("no CI".to_owned(), |each| {
        format!("{ci} {}", percents(each))
    });
    format!("in {share} of {} layouts ({interval})", rate.of)
}

fn of_choice(
    summary: &Summary,
    ranking: &ChoiceRanking,
    best: &ChosenChoice,
    working: usize,
) -> String {
    let rate = &summary.overall.at_least[working - 1];
    if rate.successes == 0 {
        let names: Vec<String> = ranking.axes.iter().map(|axis| spaced(&axis.name)).collect();
        let required = match working {
            1 => "at least one feasible configuration".to_owned(),
            count => format!("at least {count} feasible configurations"),
        };
        return format!(
            "none of the {} candidates ({}) is feasible in any layout; required: {required}",
            best.of,
            names.join(", ")
        );
    }
    format!(
        "best of {} candidates: {}; {} {}",
        best.of,
        best.label,
        works_in_words(working),
        share_of_layouts(rate, "simultaneous 95 % CI")
    )
}

/// Candidates not significantly different from the first, the first that is, and the split-half rate.
fn beside_the_first(ranking: &ChoiceRanking, best: &ChosenChoice) -> Vec<String> {
    let mut remarks = Vec::new();
    let others = || {
        ranking
            .choices
            .iter()
            .filter_map(|each| Some((each, each.against_first?)))
    };
    let equals: Vec<&str> = others()
        .filter(|(_, found)| !found.distinguishable)
        .map(|(each, _)| each.label.as_str())
        .collect();
    match equals.len() {
        0 => {}
        count if count <= NAMED_EQUALS => {
            remarks.push(format!(
                "not significantly different: {}",
                equals.join("; ")
            ));
        }
        count => remarks.push(format!(
            "{count} other candidates are not significantly different"
        )),
    }
    if let Some((next, found)) = others().find(|(_, found)| found.distinguishable) {
        let interval = found.interval.map_or(String::new(), |each| {
            format!(
                " (95 % CI {} to {})",
                in_percent(each.low),
                in_percent(each.high)
            )
        });
        remarks.push(format!(
            "next: {}, {} percentage points lower{interval}",
            next.label,
            in_percent(found.difference)
        ));
    }
    if let Some(share) = best.held_out {
        remarks.push(format!(
            "split-half validation (selected on one half, evaluated on the other): {} %",
            in_percent(share)
        ));
    }
    remarks
}

fn of_circumstances(
    summary: &Summary,
    compared: &[Comparison],
    working: usize,
    remarks: &mut Vec<String>,
) -> String {
    let rate = &summary.overall.at_least[working - 1];
    let mut works = format!(
        "{} {}",
        works_in_words(working),
        share_of_layouts(rate, "95 % CI")
    );
    let configurations = summary.overall.configurations.iter();
    let most = configurations.reduce(|a, b| if b.ok > a.ok { b } else { a });
    if let Some(most) = most.filter(|each| each.ok > 0) {
        let interval = most.success.interval.map_or(String::new(), |each| {
            format!(" (95 % CI {})", percents(each))
        });
        let _ = write!(
            works,
            "; most often {}, in {} %{interval}",
            most.label,
            most.success.rate.map_or(String::new(), in_percent)
        );
    }
    let mut telling = compared.iter().filter(|each| each.differs);
    let Some(first) = telling.next() else {
        return works;
    };
    remarks.extend(telling.map(Comparison::clause));
    if first.unit == "1" {
        return format!("{works}; {}", first.clause());
    }
    remarks.insert(0, works);
    first.clause()
}

fn small(rate: &Rate) -> Option<String> {
    rate.remark.clone().filter(|_| rate.of > 0)
}

/// Whether a study compares a factor's levels: named ones, each crossed with all the others.
fn is_question(factor: &Factor) -> bool {
    match &factor.kind {
        FactorKind::Levels(levels) => {
            factor.role == Role::Noise
                && !factor.sampled
                && (2..=MOST_LEVELS).contains(&levels.len())
                && levels.iter().all(|level| level.number.is_none())
        }
        FactorKind::Continuous { .. } => false,
    }
}

/// By the rate of feasible layouts, or where that does not differ by the tip error, then the clearance.
fn comparisons(summary: &Summary, factors: &[Factor]) -> Vec<Comparison> {
    let axes = summary.effects.axes.iter().enumerate();
    // The first factor is the goal.
    let asked = axes
        .filter(|(_, axis)| axis.factor > 0 && !axis.coarse && is_question(&factors[axis.factor]));
    let mut found: Vec<Comparison> = asked
        .filter_map(|(axis, _)| comparison(summary, axis))
        .collect();
    found.sort_by(|a, b| b.differs.cmp(&a.differs).then(b.share.total_cmp(&a.share)));
    found
}

const RESPONSES: [(&str, &str, &str); 3] = [
    ("any_works", "feasible layouts", "1"),
    // Of each layout the least of the feasible configurations, whichever that turned out to be.
    (
        "least_tip_error_mm",
        "mean tip error of the most accurate configuration",
        "mm",
    ),
    (
        "best_clearance_mm",
        "mean clearance of the best configuration",
        "mm",
    ),
];

fn comparison(summary: &Summary, axis: usize) -> Option<Comparison> {
    let mut all = RESPONSES
        .iter()
        .filter_map(|response| by_response(summary, axis, *response));
    let first = all.next()?;
    if first.differs {
        return Some(first);
    }
    Some(all.find(|each| each.differs).unwrap_or(first))
}

fn by_response(
    summary: &Summary,
    axis: usize,
    (key, words, unit): (&str, &str, &str),
) -> Option<Comparison> {
    let mut responses = summary.effects.responses.iter();
    let response = responses.find(|each| each.response == key)?;
    if unit == "mm" && response.mean.is_none_or(|mean| mean.abs() < ROUNDING_MM) {
        return None;
    }
    let (effect, bins) = (&response.main[axis], &summary.effects.axes[axis].bins);
    let level = |(bin, found): (&needlebench_study::statistics::Bin, &BinMean)| LevelValue {
        label: bin.label.clone(),
        layouts: found.count,
        value: found.mean,
        interval: found.interval,
        small: found.small,
    };
    Some(Comparison {
        factor: summary.effects.axes[axis].name.clone(),
        response: words.to_owned(),
        unit: unit.to_owned(),
        differs: effect
            .share
            .zip(effect.noise)
            .is_some_and(|(share, noise)| share > noise),
        levels: bins.iter().zip(&effect.bins).map(level).collect(),
        share: effect.share.unwrap_or_default(),
    })
}

/// Whether a study has tip errors at all: an exact arm's are rounding.
pub(crate) fn has_tip_errors(summary: &Summary) -> bool {
    let mut responses = summary.effects.responses.iter();
    let response = responses.find(|each| each.response == "least_tip_error_mm");
    let exact = response.is_some_and(|each| each.mean.is_none_or(|mean| mean.abs() < ROUNDING_MM));
    !exact && summary.measured(Measure::TipError).next().is_some()
}
