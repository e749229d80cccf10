//! The answer of a study: one sentence with its figure and interval.

use std::fmt::Write as _;

use needlebench_cell::reason_in_words;
use needlebench_study::statistics::{
    BinMean, ChoiceRanking, ChosenChoice, Interval, Rate, Summary,
};
use needlebench_study::{Factor, FactorKind, Measure, Role};
use serde::Serialize;

use super::ROUNDING_MM;
use crate::number::{in_percent, measured, three_digits};

/// Levels of a factor that are asked about, at most: more are a range and no question.
const MOST_LEVELS: usize = 16;
/// Levels that the sentence names; the table has all.
const NAMED_LEVELS: usize = 3;
/// Choices as good as the first that are named; more are counted.
const NAMED_EQUALS: usize = 2;

/// What a study answers.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Answer {
    /// One sentence, with its figure and interval.
    pub sentence: String,
    /// What has to be known beside it, a sentence each.
    pub remarks: Vec<String>,
    /// Named levels of circumstances held against each other, the factor that explains most first.
    pub compared: Vec<Comparison>,
}

/// The levels of a factor, held against each other.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Comparison {
    /// Name of the factor.
    pub factor: String,
    /// What they are compared by, in words.
    pub response: String,
    /// Unit of the values: `1` of shares, or `mm`.
    pub unit: String,
    /// Whether the levels differ by more than chance makes in 19 of 20 cases.
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
    /// Mean over them; none of no layouts.
    pub value: Option<f64>,
    /// Its 95 % interval.
    pub interval: Option<Interval>,
    /// Whether there are fewer than 30 independent layouts.
    pub small: bool,
}

impl Comparison {
    /// A value with its interval.
    pub fn text(&self, level: &LevelValue) -> String {
        let Some(value) = level.value else {
            return "no layouts".to_owned();
        };
        let interval = level.interval;
        if self.unit == "1" {
            let to = |each: Interval| format!(" ({})", percents(each));
            return format!(
                "{} %{}",
                in_percent(value),
                interval.map_or(String::new(), to)
            );
        }
        let to = |each: Interval| {
            format!(
                " ({} to {})",
                three_digits(each.low),
                three_digits(each.high)
            )
        };
        format!(
            "{}{}",
            measured(value, &self.unit),
            interval.map_or(String::new(), to)
        )
    }

    fn named(&self, level: &LevelValue) -> String {
        let text = self.text(level);
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
    /// Of the statistics of a study; `working` configurations have to be ok for a layout to work.
    pub fn new(summary: &Summary, factors: &[Factor], working: usize) -> Self {
        let compared = if summary.choices.is_some() {
            Vec::new()
        } else {
            comparisons(summary, factors)
        };
        let mut remarks = Vec::new();
        let mut sentence = if summary.overall.layouts == 0 {
            format!(
                "no answer: none of the {} layouts can exist",
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

/// Why there is no answer where no layout could be judged.
fn nothing_judged(summary: &Summary, working: usize) -> Option<String> {
    let undecided = undecided(summary, working);
    let mut configurations = summary.overall.configurations.iter();
    let judged = configurations.any(|each| each.ok > 0 || each.failed > 0);
    (undecided > 0 && !judged).then(|| {
        format!(
            "no answer: none of the {undecided} layouts in which something may work could be judged ({})",
            open_reasons(summary)
        )
    })
}

/// Layouts of which it is not known whether they work.
fn undecided(summary: &Summary, working: usize) -> u64 {
    let undecided = &summary.overall.undecided;
    undecided.get(working - 1).copied().unwrap_or_default()
}

/// What was not judged, the most frequent first: `engine failure rapier`.
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

/// What a share of layouts leaves out where some were not judged.
fn not_judged_in_words(summary: &Summary, working: usize) -> Option<String> {
    let undecided = undecided(summary, working);
    let layouts = summary.overall.layouts;
    (undecided > 0).then(|| {
        let most = summary.overall.at_least[working - 1].successes + undecided;
        format!(
            "{undecided} of {layouts} layouts were not judged ({}) and count as not working: were they all to work, \
             it would be {} %",
            open_reasons(summary),
            in_percent(most as f64 / layouts as f64)
        )
    })
}

/// `at least one configuration works`.
fn works_in_words(working: usize) -> String {
    match working {
        1 => "at least one configuration works".to_owned(),
        count => format!("at least {count} configurations work"),
    }
}

/// How many layouts work whose needle keeps away too, where that is left out of what works.
fn with_route_in_words(summary: &Summary, working: usize) -> Option<String> {
    let route = summary.overall.with_route.as_ref()?;
    let rate = &route.at_least[working - 1];
    let interval = rate
        .interval
        .map_or(String::new(), |each| format!(" ({})", percents(each)));
    Some(format!(
        "in {} %{interval} the needle keeps {} mm from bone, vessel and organ too, and {} of {} pass nearer",
        rate.rate.map_or("-".to_owned(), in_percent),
        three_digits(route.least_mm),
        route.known - route.kept,
        route.known
    ))
}

/// `in 98.2 % of 512 layouts (95 % interval 95.0 to 99.6 %`, without the last bracket.
fn share_of_layouts(rate: &Rate) -> String {
    let share = rate
        .rate
        .map_or("no".to_owned(), |share| format!("{} %", in_percent(share)));
    let interval = rate.interval.map_or("no interval".to_owned(), |each| {
        format!("95 % interval {}", percents(each))
    });
    format!("in {share} of {} layouts ({interval}", rate.of)
}

fn of_choice(
    summary: &Summary,
    ranking: &ChoiceRanking,
    best: &ChosenChoice,
    working: usize,
) -> String {
    let names: Vec<String> = ranking.axes.iter().map(|axis| spaced(&axis.name)).collect();
    let rate = &summary.overall.at_least[working - 1];
    if rate.successes == 0 {
        return format!(
            "none of the {} choices of {} works: in none of the layouts {}",
            best.of,
            names.join(", "),
            works_in_words(working)
        );
    }
    format!(
        "best {} of {}: {}; with it {} {}, which holds for all {} at once)",
        names.join(", "),
        best.of,
        best.label,
        works_in_words(working),
        share_of_layouts(rate),
        best.of
    )
}

/// What cannot be told apart from the first choice, the first that can, and what picking it is worth.
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
            remarks.push(format!("not told apart from it: {}", equals.join("; ")));
        }
        count => remarks.push(format!("{count} others cannot be told apart from it")),
    }
    if let Some((next, found)) = others().find(|(_, found)| found.distinguishable) {
        let interval = found.interval.map_or(String::new(), |each| {
            format!(
                " (95 % interval {} to {})",
                in_percent(each.low),
                in_percent(each.high)
            )
        });
        remarks.push(format!(
            "the next, {}, works in {} points fewer{interval}",
            next.label,
            in_percent(found.difference)
        ));
    }
    if let Some(share) = best.held_out {
        remarks.push(format!(
            "chosen on one half of the sampled points and judged on the other half, the best choice works in {} %",
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
    let mut works = format!("{} {})", works_in_words(working), share_of_layouts(rate));
    let configurations = summary.overall.configurations.iter();
    let most = configurations.reduce(|a, b| if b.ok > a.ok { b } else { a });
    if let Some(most) = most.filter(|each| each.ok > 0) {
        let interval = most
            .success
            .interval
            .map_or(String::new(), |each| format!(" ({})", percents(each)));
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

/// Whether a factor's levels are what a study asks about: named ones, each crossed with all the others.
fn is_question(factor: &Factor) -> bool {
    match &factor.kind {
        FactorKind::Levels(levels) => {
            factor.role == Role::Circumstance
                && !factor.sampled
                && (2..=MOST_LEVELS).contains(&levels.len())
                && levels.iter().all(|level| level.number.is_none())
        }
        FactorKind::Continuous { .. } => false,
    }
}

/// By the rate of layouts that work, or where that tells nothing by the tip error, then the clearance.
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
    ("any_works", "layouts that work", "1"),
    // Of each layout the least of those that work, whichever that turned out to be.
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
