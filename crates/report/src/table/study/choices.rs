//! What a study compares: candidates, best first, or the levels of a factor.

use needlebench_show::Block;
use needlebench_show::number::in_percent;
use needlebench_study::statistics::{Choice, QuantileValue, Summary};

use super::answer::{Answer, Comparison, has_tip_errors, percents, spaced};
use super::block::{case_list, or_dash, rate_text};

/// Candidates on the first screen, and in the whole table.
const MOST_FIRST: usize = 5;
const MOST_IN_ALL: usize = 30;

/// The table that the answer rests on.
pub(super) fn compared_first(summary: &Summary, answer: &Answer, blocks: &mut Vec<Block>) {
    let Some(ranking) = &summary.choices else {
        for each in &answer.compared {
            levels(each, blocks);
        }
        return;
    };
    let names: Vec<String> = ranking.axes.iter().map(|axis| spaced(&axis.name)).collect();
    blocks.push(Block::Heading(format!("{}, best first", names.join(", "))));
    let quantile = |found: &Option<QuantileValue>| or_dash(found.as_ref().map(|found| found.value));
    let with_error = has_tip_errors(summary);
    let row = |(rank, choice): (usize, &Choice)| {
        let mut row = vec![
            format!("{rank}. {}", choice.label),
            rate_text(&choice.works),
            quantile(&choice.best_clearance_mm),
        ];
        if with_error {
            row.push(quantile(&choice.tip_error_mm));
        }
        row.push(points_behind(choice));
        row
    };
    let rows = (1..)
        .zip(&ranking.choices)
        .take(MOST_FIRST)
        .map(row)
        .collect();
    let mut header = vec!["<candidate", "success\nrate (%)", "P5\nclearance\n(mm)"];
    if with_error {
        header.push("median tip\nerror (mm)");
    }
    header.push("difference to\nno. 1 (pp)");
    blocks.push(Block::Table {
        header: header.into_iter().map(str::to_owned).collect(),
        rows,
    });
    let left = ranking.choices.len().saturating_sub(MOST_FIRST);
    let mut lines = vec![
        "in brackets: individual 95 % CI; =: not significantly different from no. 1".to_owned(),
    ];
    if left > 0 {
        lines.push(format!("{left} more candidates: --wide"));
    }
    blocks.push(Block::Lines(lines));
}

/// `-1.2`, or `=` where it does not differ significantly from the first.
fn points_behind(choice: &Choice) -> String {
    choice
        .against_first
        .as_ref()
        .map_or(String::new(), |found| {
            if found.distinguishable {
                signed(-found.difference)
            } else {
                "=".to_owned()
            }
        })
}

/// `-1.2 (-2.1 .. -0.3)`.
fn against_first(choice: &Choice) -> String {
    match &choice.against_first {
        None => String::new(),
        Some(found) if !found.distinguishable => "=".to_owned(),
        Some(found) => {
            let interval = found.interval.map_or(String::new(), |each| {
                format!(" ({} .. {})", signed(-each.high), signed(-each.low))
            });
            format!("{}{interval}", signed(-found.difference))
        }
    }
}

fn signed(share: f64) -> String {
    let text = in_percent(share);
    if share > 0.0 {
        format!("+{text}")
    } else {
        text
    }
}

fn levels(compared: &Comparison, blocks: &mut Vec<Block>) {
    let rows = compared.levels.iter().map(|level| {
        vec![
            level.label.clone(),
            level.layouts.to_string(),
            compared.text(level),
            if level.small {
                "small sample".to_owned()
            } else {
                String::new()
            },
        ]
    });
    blocks.push(Block::Heading(format!(
        "{}: {}",
        spaced(&compared.factor),
        compared.response
    )));
    let header = [
        spaced(&compared.factor),
        "layouts".to_owned(),
        format!("{} (95 % CI)", compared.response),
        "<".to_owned(),
    ];
    let any_small = compared.levels.iter().any(|level| level.small);
    let columns = if any_small { 4 } else { 3 };
    let rows: Vec<Vec<String>> = rows.map(|row| row[..columns].to_vec()).collect();
    blocks.push(Block::Table {
        header: header[..columns].to_vec(),
        rows,
    });
    if !compared.differs {
        blocks.push(Block::Lines(vec![
            "not significant at the 5 % level".to_owned(),
        ]));
    }
}

/// All candidates with all their statistics.
pub(super) fn all_choices(summary: &Summary, blocks: &mut Vec<Block>) {
    let Some(ranking) = &summary.choices else {
        return;
    };
    let row = |(rank, choice): (usize, &Choice)| {
        vec![
            format!("{rank}. {}", choice.label),
            choice.works.interval.map_or("-".to_owned(), percents),
            choice.works_k.rate.map_or("-".to_owned(), in_percent),
            choice.cases.to_string(),
            choice.invalid.to_string(),
            against_first(choice),
            case_list(&choice.failing),
        ]
    };
    let rows = (1..)
        .zip(&ranking.choices)
        .take(MOST_IN_ALL)
        .map(row)
        .collect();
    blocks.push(Block::Heading("all candidates".to_owned()));
    let more = format!("{} or more\nfeasible (%)", ranking.working_configurations);
    blocks.push(Block::Table {
        header: [
            "candidate",
            "success rate,\n95 % CI",
            more.as_str(),
            "cases",
            "invalid\nlayouts",
            "difference to\nno. 1 (pp)",
            "<first infeasible cases",
        ]
        .map(str::to_owned)
        .to_vec(),
        rows,
    });
    let left = ranking.choices.iter().skip(MOST_IN_ALL);
    let good = left.clone().filter(|choice| {
        let against = &choice.against_first;
        against.as_ref().is_some_and(|found| !found.distinguishable)
    });
    if left.len() > 0 {
        let lines = format!(
            "{} more candidates, {} of them not significantly different from no. 1",
            left.len(),
            good.count()
        );
        blocks.push(Block::Lines(vec![lines]));
    }
}
