//! A study's statistics as headings, tables and lines, for terminals and for Markdown.

use needlebench_show::Block;
use needlebench_show::number::{in_percent, rounded, three_digits};
use needlebench_study::statistics::{BEST, BinMean, CriterionResult, RegionMap, Summary};

use super::ROUNDING_MM;
use super::answer::{Answer, has_tip_errors, spaced};
use super::block::{MOST_REASONS, case_list, rate_text};
use super::choices::{all_choices, compared_first};
use super::configurations::{all_configurations, configurations_first};
use super::criteria::{criteria_first, criteria_in_full};

/// Interactions that are shown of each response.
const MOST_INTERACTIONS: usize = 3;

/// A study's statistics: the answer on one screen, and everything else.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Document {
    /// Verdict, answer and the tables behind it.
    pub first: Vec<Block>,
    /// All other tables and notes.
    pub more: Vec<Block>,
}

/// The parts of a document.
pub struct Parts<'a> {
    /// The statistics.
    pub summary: &'a Summary,
    /// What they answer.
    pub answer: &'a Answer,
    /// Criteria with their verdicts.
    pub criteria: &'a [CriterionResult],
    /// The verdict with its counts.
    pub verdict: &'a str,
    /// The caveats of the study: postures only, needle path not checked.
    pub headline: Option<&'a str>,
}

impl Document {
    /// The first screen has the verdict, the answer with its remarks, the candidates or levels that it compares,
    /// the configurations, and the criteria.
    pub fn new(parts: &Parts<'_>) -> Self {
        let summary = parts.summary;
        let mut first = vec![
            Block::Lines(vec![parts.verdict.to_owned()]),
            Block::Answer(parts.answer.sentence.clone()),
        ];
        let beside: Vec<String> = parts
            .headline
            .map(str::to_owned)
            .into_iter()
            .chain(parts.answer.remarks.iter().cloned())
            .chain(invalid_layouts_remark(summary))
            .collect();
        if !beside.is_empty() {
            first.push(Block::Lines(beside));
        }
        let mut more = vec![
            Block::Heading("cases".to_owned()),
            Block::Lines(overview(summary)),
        ];
        if summary.overall.layouts > 0 {
            compared_first(summary, parts.answer, &mut first);
            configurations_first(summary, parts.answer, &mut first);
            all_choices(summary, &mut more);
            all_configurations(summary, &mut more);
            goals(summary, &mut more);
            effects(summary, &mut more);
            regions(summary, &mut more);
            evidence(summary, &mut more);
        }
        criteria_first(parts.criteria, &mut first);
        Self { first, more }
    }

    /// Adds the notes, and the criteria in full.
    pub fn finish(mut self, parts: &Parts<'_>) -> Self {
        let notes = &parts.summary.notes;
        if !notes.is_empty() {
            self.more.push(Block::Heading("notes".to_owned()));
            self.more.push(Block::Lines(notes.clone()));
        }
        criteria_in_full(parts.criteria, &mut self.more);
        self
    }
}

/// How many cases are excluded from all rates, and the main reason.
fn invalid_layouts_remark(summary: &Summary) -> Option<String> {
    let overall = &summary.overall;
    let mostly = overall.invalid_details.first();
    let mostly = mostly.map_or(String::new(), |detail| {
        format!(" (main reason: {})", detail.detail)
    });
    (overall.invalid > 0).then(|| {
        format!(
            "{} of {} cases are invalid layouts, excluded from all rates{mostly}",
            overall.invalid, overall.cases
        )
    })
}

fn overview(summary: &Summary) -> Vec<String> {
    let overall = &summary.overall;
    let mut lines = Vec::new();
    let of_choice = summary.of_choice.as_ref();
    if let (Some(best), Some(all)) = (of_choice, &summary.over_all_choices) {
        lines.push(format!(
            "{} cases with {} candidates; rates, percentiles and criteria refer to no. 1: {}",
            all.cases, best.of, best.label
        ));
        lines.push(format!("candidates are ranked by {}", best.by));
    }
    lines.push(format!(
        "{} cases: {} valid layouts, {} invalid layouts (excluded from all rates)",
        overall.cases, overall.layouts, overall.invalid
    ));
    for detail in overall.invalid_details.iter().take(MOST_REASONS) {
        lines.push(format!(
            "  {} invalid because of {}",
            detail.count, detail.detail
        ));
    }
    for (k, rate) in (1..).zip(&overall.at_least).take(3) {
        if rate.rate.is_none() {
            continue;
        }
        let configurations = if k == 1 {
            "configuration feasible"
        } else {
            "configurations feasible"
        };
        let remark = rate
            .remark
            .as_ref()
            .map_or(String::new(), |text| format!(", {text}"));
        lines.push(format!(
            "at least {k} {configurations} in {} % of the layouts{remark}",
            rate_text(rate)
        ));
    }
    lines.push(match of_choice {
        Some(best) => format!(
            "intervals of no. 1: simultaneous 95 % CI for all {} candidates ({} % each); all others: individual 95 % CI",
            best.of,
            rounded(100.0 * best.confidence_each, 3)
        ),
        None => "intervals: 95 % CI".to_owned(),
    });
    lines
}

fn goals(summary: &Summary, blocks: &mut Vec<Block>) {
    if summary.goals.len() < 2 {
        return;
    }
    let rows = summary.goals.iter().map(|goal| {
        let mut configurations: Vec<_> = goal.configurations.iter().collect();
        configurations.sort_by_key(|each| std::cmp::Reverse(each.ok));
        let best = configurations.first().filter(|each| each.ok > 0);
        vec![
            goal.goal.as_deref().map(spaced).unwrap_or_default(),
            goal.layouts.to_string(),
            goal.invalid.to_string(),
            rate_text(&goal.at_least[0]),
            best.map_or("none".to_owned(), |each| {
                let rate = each.success.rate.map_or(String::new(), in_percent);
                format!("{} {rate}", each.label)
            }),
        ]
    });
    blocks.push(Block::Heading("goals".to_owned()));
    blocks.push(Block::table(
        [
            "goal",
            "valid\nlayouts",
            "invalid\nlayouts",
            "success\nrate (%)",
            "<most often feasible (%)",
        ],
        rows.collect(),
    ));
}

fn effects(summary: &Summary, blocks: &mut Vec<Block>) {
    let effects = &summary.effects;
    if effects.axes.is_empty() {
        return;
    }
    // Of the layout, not of single configurations; the last is the tip error.
    let shown = if has_tip_errors(summary) { 4 } else { 3 };
    let responses = effects.responses.get(..shown).unwrap_or_default();
    let share = |share: Option<f64>, noise: Option<f64>| match (share, noise) {
        (Some(share), Some(noise)) if share > noise => in_percent(share),
        (Some(_), Some(noise)) => format!("< {}", in_percent(noise)),
        _ => "-".to_owned(),
    };
    let rows = effects.axes.iter().enumerate().map(|(axis, each)| {
        let mut row = vec![spaced(&each.name)];
        for response in responses {
            let main = &response.main[axis];
            let means_something = response.mean.is_some_and(|mean| mean.abs() >= ROUNDING_MM);
            row.push(if means_something {
                share(main.share, main.noise)
            } else {
                "-".to_owned()
            });
        }
        let range = responses
            .first()
            .and_then(|response| spread_of_bins(&response.main[axis].bins));
        row.push(range.unwrap_or("-".to_owned()));
        row
    });
    blocks.push(Block::Heading(over_all_choices(
        summary,
        "main effects: share of variance explained (%)",
    )));
    let mut header = vec![
        "factor",
        "any\nfeasible",
        "number\nfeasible",
        "best\nclearance",
        "least\ntip error",
    ];
    header.truncate(1 + shown);
    header.push("success rate (%),\nworst .. best level");
    blocks.push(Block::Table {
        header: header.into_iter().map(str::to_owned).collect(),
        rows: rows.collect(),
    });
    let mut lines = Vec::new();
    let names = [
        "any feasible",
        "number feasible",
        "best clearance",
        "least tip error",
    ];
    for (name, response) in names.into_iter().zip(responses) {
        if response.mean.is_none_or(|mean| mean.abs() < ROUNDING_MM) {
            continue;
        }
        let found = response.interactions.iter();
        let clear: Vec<String> = found
            .filter(|each| each.share > each.noise && each.share > 0.01)
            .take(MOST_INTERACTIONS)
            .map(|each| {
                let [a, b] = each.axes.map(|axis| spaced(&effects.axes[axis].name));
                format!("{a} x {b} {}", in_percent(each.share))
            })
            .collect();
        if !clear.is_empty() {
            lines.push(format!("interactions, {name} (%): {}", clear.join(", ")));
        }
    }
    if !lines.is_empty() {
        blocks.push(Block::Lines(lines));
    }
}

/// A heading of a table over all candidates together, as factors.
pub(super) fn over_all_choices(summary: &Summary, heading: &str) -> String {
    match &summary.of_choice {
        Some(_) => format!("{heading}, over all candidates"),
        None => heading.to_owned(),
    }
}

/// Least and largest mean of bins.
fn spread_of_bins(bins: &[BinMean]) -> Option<String> {
    let means = || bins.iter().filter_map(|bin| bin.mean);
    let least = means().reduce(f64::min)?;
    let most = means().reduce(f64::max)?;
    Some(format!("{} .. {}", in_percent(least), in_percent(most)))
}

/// Runs of neighbouring bins with the same winner, of factors where it changes.
fn regions(summary: &Summary, blocks: &mut Vec<Block>) {
    let regions = &summary.regions;
    let rows: Vec<Vec<String>> = regions
        .maps
        .iter()
        .filter(|map| map.axes.len() == 1)
        .filter(|map| {
            let mut winners = map.cells.iter().filter_map(|cell| cell.winner.as_deref());
            let first = winners.next();
            winners.any(|winner| Some(winner) != first)
        })
        .flat_map(|map| winners_of(summary, map))
        .collect();
    if rows.is_empty() {
        return;
    }
    blocks.push(Block::Heading(over_all_choices(
        summary,
        "best configuration by range",
    )));
    blocks.push(Block::table(
        [
            "factor",
            "<from .. to",
            "valid\nlayouts",
            "success\nrate (%)",
            "<most often best",
        ],
        rows,
    ));
}

fn winners_of(summary: &Summary, map: &RegionMap) -> Vec<Vec<String>> {
    let axis = &summary.regions.axes[map.axes[0]];
    let mut rows: Vec<Vec<String>> = Vec::new();
    let mut at = 0;
    while at < map.cells.len() {
        let winner = &map.cells[at].winner;
        let same = map.cells[at..]
            .iter()
            .take_while(|cell| cell.winner == *winner);
        let run = same.count();
        let cells = &map.cells[at..at + run];
        let layouts: u64 = cells.iter().map(|cell| cell.layouts).sum();
        let working: u64 = cells.iter().map(|cell| cell.working).sum();
        let (first, last) = (&axis.bins[at], &axis.bins[at + run - 1]);
        let range = if run == 1 {
            first.label.clone()
        } else {
            let low = first.label.split(" .. ").next().unwrap_or_default();
            let high = last.label.rsplit(" .. ").next().unwrap_or_default();
            format!("{low} .. {high}")
        };
        rows.push(vec![
            if at == 0 {
                spaced(&axis.name)
            } else {
                String::new()
            },
            format!("{range} {}", axis.unit).trim_end().to_owned(),
            layouts.to_string(),
            if layouts == 0 {
                "-".to_owned()
            } else {
                in_percent(working as f64 / layouts as f64)
            },
            winner.clone().unwrap_or("none".to_owned()),
        ]);
        at += run;
    }
    rows
}

fn evidence(summary: &Summary, blocks: &mut Vec<Block>) {
    let mut lines = Vec::new();
    let none = &summary.evidence.fewer_than[0];
    if !none.is_empty() {
        lines.push(format!(
            "no feasible configuration in cases {}, ...",
            case_list(none)
        ));
    }
    let mut best = summary.evidence.configurations.iter();
    for worst in best
        .find(|each| each.of == BEST)
        .iter()
        .flat_map(|each| &each.worst)
    {
        if worst
            .cases
            .iter()
            .all(|each| each.value.abs() < ROUNDING_MM)
        {
            continue;
        }
        let cases: Vec<String> = worst
            .cases
            .iter()
            .map(|each| format!("{} ({})", each.case, three_digits(each.value)))
            .collect();
        let mut metrics = summary.metrics.iter();
        let metric = metrics.find(|column| column.name == worst.metric);
        let words = metric.map_or_else(
            || worst.metric.clone(),
            |column| format!("{} ({})", column.words, column.unit),
        );
        lines.push(format!(
            "worst {words} of the best configuration in cases {}",
            cases.join(", ")
        ));
    }
    if !lines.is_empty() {
        blocks.push(Block::Heading("cases to inspect".to_owned()));
        blocks.push(Block::Lines(lines));
    }
}
