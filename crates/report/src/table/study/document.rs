//! A study's statistics as headings, tables and lines, for terminals and for Markdown.

use needlebench_study::statistics::{
    BEST, BinMean, Choice, CriterionResult, Interval, Rate, RegionMap, Summary,
};
use needlebench_study::{Measure, MetricColumn};

use crate::number::{in_percent, three_digits};

/// One part of a document.
#[derive(Debug, Clone, PartialEq)]
pub enum Block {
    /// A heading.
    Heading(String),
    /// A table: its first column is text, the others are numbers unless their heading starts with `<`.
    Table {
        header: Vec<String>,
        rows: Vec<Vec<String>>,
    },
    /// Lines of text.
    Lines(Vec<String>),
}

/// Rows of the ranking of choices that are shown.
const MOST_CHOICES: usize = 12;
/// Reasons that are shown of each configuration.
const MOST_REASONS: usize = 3;
/// Lengths below a nanometre are rounding: an exact posture has no error. mm.
const ROUNDING_MM: f64 = 1e-6;
/// Interactions that are shown of each response.
const MOST_INTERACTIONS: usize = 3;

/// All blocks, the verdict last; `more` comes before the notes.
pub fn blocks(summary: &Summary, criteria: &[CriterionResult], more: Vec<Block>) -> Vec<Block> {
    let mut blocks = vec![Block::Lines(overview(summary))];
    if summary.overall.layouts > 0 {
        configurations(summary, &mut blocks);
        goals(summary, &mut blocks);
        effects(summary, &mut blocks);
        regions(summary, &mut blocks);
        choices(summary, &mut blocks);
        evidence(summary, &mut blocks);
    }
    blocks.extend(more);
    if !summary.notes.is_empty() {
        let notes = summary.notes.iter().map(|note| format!("note: {note}"));
        blocks.push(Block::Lines(notes.collect()));
    }
    if !criteria.is_empty() {
        blocks.push(Block::Heading("criteria".to_owned()));
        blocks.push(Block::Lines(criteria.iter().map(criterion).collect()));
    }
    blocks
}

pub fn table<const N: usize>(header: [&str; N], rows: Vec<Vec<String>>) -> Block {
    Block::Table {
        header: header.map(str::to_owned).to_vec(),
        rows,
    }
}

fn between(interval: Interval, text: impl Fn(f64) -> String) -> String {
    format!("{} .. {}", text(interval.low), text(interval.high))
}

/// `93.2 (92.1 .. 94.0)`.
pub fn rate_text(rate: &Rate) -> String {
    match (rate.rate, rate.interval) {
        (Some(share), Some(interval)) => {
            format!("{} ({})", in_percent(share), between(interval, in_percent))
        }
        _ => "-".to_owned(),
    }
}

fn or_dash(value: Option<f64>) -> String {
    value.map_or("-".to_owned(), three_digits)
}

fn case_list(cases: &[u64]) -> String {
    let cases: Vec<String> = cases.iter().map(ToString::to_string).collect();
    cases.join(", ")
}

fn overview(summary: &Summary) -> Vec<String> {
    let overall = &summary.overall;
    let mut lines = Vec::new();
    let of_choice = summary.of_choice.as_ref();
    if let (Some(best), Some(all)) = (of_choice, &summary.over_all_choices) {
        lines.push(format!(
            "{} cases with {} choices; rates, quantiles and criteria are of the best one: {}",
            all.cases, best.of, best.label
        ));
        lines.push(format!(
            "best by {}; {} others cannot be told apart from it",
            best.by, best.as_good
        ));
    }
    if let Some(why) = &summary.not_ranked {
        lines.push(format!(
            "NOT JUDGED: rates are of all choices together, which answers no question: {why}"
        ));
    }
    lines.push(format!(
        "{} cases: {} valid layouts, {} that cannot exist",
        overall.cases, overall.layouts, overall.invalid
    ));
    for detail in overall.invalid_details.iter().take(MOST_REASONS) {
        lines.push(format!("  {} because of {}", detail.count, detail.detail));
    }
    for (k, rate) in (1..).zip(&overall.at_least).take(3) {
        if rate.rate.is_none() {
            continue;
        }
        let configurations = if k == 1 {
            "configuration is"
        } else {
            "configurations are"
        };
        let remark = rate
            .remark
            .as_ref()
            .map_or(String::new(), |text| format!(", {text}"));
        lines.push(format!(
            "at least {k} {configurations} ok in {} % of the valid layouts{remark}",
            rate_text(rate)
        ));
    }
    match of_choice {
        Some(best) => {
            if let Some(share) = best.held_out {
                lines.push(format!(
                    "picked on the same layouts, which flatters it: picked on one half of the points, a choice \
                     works in {} % of the valid layouts of the other half",
                    in_percent(share)
                ));
            }
            lines.push(format!(
                "intervals: 95 % for all {} choices at once, {:.5} % each",
                best.of,
                100.0 * best.confidence_each
            ));
        }
        None => lines.push("intervals: 95 %".to_owned()),
    }
    lines
}

fn configurations(summary: &Summary, blocks: &mut Vec<Block>) {
    let layouts = summary.overall.layouts as f64;
    let quantile = |of: &str, metric: &str, p: f64| {
        let spread = summary.spread(of, metric);
        or_dash(spread.and_then(|spread| Some(spread.quantile(p)?.value)))
    };
    // One of each kind of cases: most studies have one.
    let several = |measure| summary.measured(measure).count() > 1;
    let clearances = summary.measured(Measure::Clearance);
    let errors = summary.measured(Measure::TipError);
    let columns: Vec<(&MetricColumn, [f64; 2], String)> = clearances
        .map(|column| (column, [0.05, 0.5], "clearance"))
        .chain(errors.map(|column| (column, [0.5, 0.95], "tip error")))
        .map(|(column, shares, words)| {
            let words = if column.measure.is_some_and(several) {
                &column.words
            } else {
                words
            };
            (column, shares, words.to_owned())
        })
        .collect();
    let numbers = |of: &str| {
        let of_column = |(column, shares, _): &(&MetricColumn, [f64; 2], String)| {
            shares.map(|p| quantile(of, &column.name, p))
        };
        columns.iter().flat_map(of_column).collect::<Vec<String>>()
    };
    let mut header = ["configuration", "ok, of valid\nlayouts (%)", "best\n(%)"]
        .map(str::to_owned)
        .to_vec();
    for (column, [first, second], words) in &columns {
        let unit = &column.unit;
        header.push(format!("{words}\n({unit}) {} %", 100.0 * first));
        header.push(format!("\n{} %", 100.0 * second));
    }
    let mut rows = Vec::new();
    for each in &summary.overall.configurations {
        let mut row = vec![
            each.label.clone(),
            rate_text(&each.success),
            in_percent(each.best as f64 / layouts),
        ];
        row.extend(numbers(&each.label));
        rows.push(row);
    }
    let mut best = vec![
        BEST.to_owned(),
        rate_text(&summary.overall.at_least[0]),
        String::new(),
    ];
    best.extend(numbers(BEST));
    rows.push(best);
    blocks.push(Block::Heading("configurations".to_owned()));
    blocks.push(Block::Table { header, rows });
    blocks.push(Block::Lines(vec![
        "quantiles: of the configurations over layouts in which they are not rejected; of the best, \
         which is ok and has the largest clearance, over layouts that work"
            .to_owned(),
    ]));
    let rows: Vec<Vec<String>> = summary
        .overall
        .configurations
        .iter()
        .filter(|each| !each.details.is_empty())
        .map(|each| {
            let reasons = each.details.iter().take(MOST_REASONS).map(|detail| {
                let share = in_percent(detail.count as f64 / layouts);
                format!("{} {share} %", detail.detail)
            });
            vec![each.label.clone(), reasons.collect::<Vec<_>>().join(", ")]
        })
        .collect();
    if !rows.is_empty() {
        blocks.push(table(["configuration", "<not ok because of"], rows));
    }
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
            goal.goal.clone().unwrap_or_default(),
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
    blocks.push(table(
        [
            "goal",
            "valid\nlayouts",
            "cannot\nexist",
            "work (%)",
            "<most often ok (%)",
        ],
        rows.collect(),
    ));
}

fn effects(summary: &Summary, blocks: &mut Vec<Block>) {
    let effects = &summary.effects;
    if effects.axes.is_empty() {
        return;
    }
    let responses = effects.responses.get(..4).unwrap_or_default();
    let share = |share: Option<f64>, noise: Option<f64>| match (share, noise) {
        (Some(share), Some(noise)) if share > noise => in_percent(share),
        (Some(_), Some(noise)) => format!("< {}", in_percent(noise)),
        _ => "-".to_owned(),
    };
    let rows = effects.axes.iter().enumerate().map(|(axis, each)| {
        let mut row = vec![each.name.clone()];
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
        "share of the variance that each factor explains (%)",
    )));
    blocks.push(table(
        [
            "factor",
            "any\nworks",
            "how many\nwork",
            "best\nclearance",
            "least\ntip error",
            "works, worst .. best\nlevel or range (%)",
        ],
        rows.collect(),
    ));
    let mut lines = Vec::new();
    for response in responses {
        if response.mean.is_none_or(|mean| mean.abs() < ROUNDING_MM) {
            continue;
        }
        let found = response.interactions.iter();
        let clear: Vec<String> = found
            .filter(|each| each.share > each.noise && each.share > 0.01)
            .take(MOST_INTERACTIONS)
            .map(|each| {
                let [a, b] = each.axes.map(|axis| effects.axes[axis].name.as_str());
                format!("{a} x {b} {}", in_percent(each.share))
            })
            .collect();
        if !clear.is_empty() {
            lines.push(format!(
                "together, beyond each alone, of {} (%): {}",
                response.response,
                clear.join(", ")
            ));
        }
    }
    if !lines.is_empty() {
        blocks.push(Block::Lines(lines));
    }
}

/// A heading of what is of all choices together, as factors.
fn over_all_choices(summary: &Summary, heading: &str) -> String {
    match &summary.of_choice {
        Some(_) => format!("{heading}, over all choices"),
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
        "where another configuration is the best",
    )));
    blocks.push(table(
        [
            "factor",
            "<from .. to",
            "valid\nlayouts",
            "work (%)",
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
                axis.name.clone()
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
            winner.clone().unwrap_or("no winner".to_owned()),
        ]);
        at += run;
    }
    rows
}

fn choices(summary: &Summary, blocks: &mut Vec<Block>) {
    let Some(ranking) = &summary.choices else {
        return;
    };
    let row = |(rank, choice): (usize, &Choice)| {
        let quantile = |found: &Option<needlebench_study::statistics::QuantileValue>| {
            or_dash(found.as_ref().map(|found| found.value))
        };
        vec![
            format!("{rank}. {}", choice.label),
            rate_text(&choice.works),
            choice.works_k.rate.map_or("-".to_owned(), in_percent),
            quantile(&choice.best_clearance_mm),
            quantile(&choice.tip_error_mm),
            choice.invalid.to_string(),
            match &choice.against_first {
                None => String::new(),
                Some(found) if found.distinguishable => {
                    format!("-{}", in_percent(found.difference))
                }
                Some(_) => "as good".to_owned(),
            },
        ]
    };
    let rows = (1..).zip(&ranking.choices).take(MOST_CHOICES).map(row);
    blocks.push(Block::Heading(
        "what is ours to choose, best first".to_owned(),
    ));
    let more = format!("{} or more\n(%)", ranking.working_configurations);
    blocks.push(Block::Table {
        header: [
            "choice",
            "works (%)",
            more.as_str(),
            "clearance\n5 % (mm)",
            "tip error\n50 % (mm)",
            "cannot\nexist",
            "against\n1. (%)",
        ]
        .map(str::to_owned)
        .to_vec(),
        rows: rows.collect(),
    });
    let mut lines = vec![
        "works: of the valid layouts; its interval is 95 % for this choice alone".to_owned(),
        "against 1.: points fewer layouts; `as good` where they cannot be told apart".to_owned(),
    ];
    if ranking.choices.len() > MOST_CHOICES {
        let good = ranking.choices.iter().skip(MOST_CHOICES).filter(|choice| {
            let against = &choice.against_first;
            against.as_ref().is_some_and(|found| !found.distinguishable)
        });
        lines.push(format!(
            "{} more choices, of which {} are as good as the first",
            ranking.choices.len() - MOST_CHOICES,
            good.count()
        ));
    }
    if let Some(first) = ranking.choices.first()
        && !first.failing.is_empty()
    {
        lines.push(format!(
            "first cases in which none works with 1.: {}",
            case_list(&first.failing)
        ));
    }
    blocks.push(Block::Lines(lines));
}

fn evidence(summary: &Summary, blocks: &mut Vec<Block>) {
    let mut lines = Vec::new();
    let none = &summary.evidence.fewer_than[0];
    if !none.is_empty() {
        lines.push(format!(
            "no configuration is ok in cases {}, ...",
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
        blocks.push(Block::Heading("cases worth a look".to_owned()));
        blocks.push(Block::Lines(lines));
    }
}

/// A criterion's verdict in a line.
fn criterion(result: &CriterionResult) -> String {
    let text = |value: f64| match result.unit.as_str() {
        "1" => format!("{} %", in_percent(value)),
        unit => format!("{} {unit}", three_digits(value)),
    };
    let value = result.value.map_or("none".to_owned(), text);
    let interval = result.interval.map_or(String::new(), |interval| {
        format!(" ({} .. {})", text(interval.low), text(interval.high))
    });
    let of = result
        .of
        .as_ref()
        .map_or(String::new(), |of| format!(" {of}"));
    let judged = if result.confidence {
        ", judged by the interval"
    } else {
        ""
    };
    let cases = if result.pass || result.cases.is_empty() {
        String::new()
    } else {
        format!("; see cases {}", case_list(&result.cases))
    };
    format!(
        "{} {}{of}: {value}{interval}, limit {}{judged}: {}{cases}",
        match (result.pass, result.is_judged()) {
            (true, _) => "met",
            (false, true) => "FAILED",
            (false, false) => "not judged",
        },
        result.criterion,
        text(result.limit),
        result.detail
    )
}
