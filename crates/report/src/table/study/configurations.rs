//! Success rate of each configuration, its clearances and tip errors, and why it is infeasible.

use needlebench_cell::reason_in_words;
use needlebench_show::Block;
use needlebench_show::number::{in_percent, three_digits};
use needlebench_study::statistics::{BEST, ConfigurationCounts, Rate, Summary};
use needlebench_study::{Measure, MetricColumn};

use super::answer::{Answer, has_tip_errors, spaced};
use super::block::{MOST_REASONS, or_dash, rate_text};

/// Share of the layouts below which a reason is left out on the first screen.
const WORTH_A_WORD: f64 = 0.01;

fn quantile(summary: &Summary, of: &str, metric: &str, p: f64) -> String {
    let spread = summary.spread(of, metric);
    or_dash(spread.and_then(|spread| Some(spread.quantile(p)?.value)))
}

/// Of several kinds of cases, static and simulated ones, the column that most layouts have.
fn most_measured(summary: &Summary, measure: Measure) -> Option<&MetricColumn> {
    let count = |column: &&MetricColumn| {
        let spread = summary.spread(BEST, &column.name);
        spread.map_or(0, |spread| spread.count)
    };
    summary.measured(measure).max_by_key(count)
}

/// The eight configurations with their success rates and main failures.
pub(super) fn configurations_first(summary: &Summary, answer: &Answer, blocks: &mut Vec<Block>) {
    let layouts = summary.overall.layouts as f64;
    let clearance = most_measured(summary, Measure::Clearance);
    let error = most_measured(summary, Measure::TipError).filter(|_| has_tip_errors(summary));
    let mut header = vec!["configuration", "success\nrate (%)"];
    let route = summary.overall.with_route.as_ref();
    if route.is_some() {
        header.push("with needle\npath (%)");
    }
    if clearance.is_some() {
        header.push("P5\nclearance\n(mm)");
    }
    if error.is_some() {
        header.push("tip error,\nP95 of\nlayouts (mm)");
    }
    // The main failure, where errors and needle paths leave space for it.
    let with_reason = error.is_none() && route.is_none();
    if with_reason {
        header.push("<main failure");
    }
    let numbers = |of: &str| {
        let shown = [(clearance, 0.05), (error, 0.95)];
        let known = shown
            .into_iter()
            .filter_map(|(column, p)| Some((column?, p)));
        known
            .map(|(column, p)| quantile(summary, of, &column.name, p))
            .collect::<Vec<_>>()
    };
    let mut rows: Vec<Vec<String>> = summary
        .overall
        .configurations
        .iter()
        .enumerate()
        .map(|(index, each)| {
            let mut row = vec![
                each.label.clone(),
                known_rate(&each.success, each.not_judged),
            ];
            row.extend(route.map(|route| share(&route.configurations[index])));
            row.extend(numbers(&each.label));
            let mut most = each.details.first().into_iter();
            let most = most.find(|first| first.count as f64 >= WORTH_A_WORD * layouts);
            row.extend(with_reason.then(|| {
                most.map_or(String::new(), |first| {
                    reason(&first.detail, first.count, layouts)
                })
            }));
            row
        })
        .collect();
    let mut best = vec![
        "best per layout".to_owned(),
        known_rate(
            &summary.overall.at_least[0],
            summary
                .overall
                .undecided
                .first()
                .copied()
                .unwrap_or_default(),
        ),
    ];
    best.extend(route.map(|route| share(&route.at_least[0])));
    best.extend(numbers(BEST));
    best.extend(with_reason.then(String::new));
    rows.push(best);
    let together: Vec<String> = answer
        .compared
        .iter()
        .filter(|each| each.differs)
        .map(|each| spaced(&each.factor))
        .collect();
    blocks.push(Block::Heading(match &summary.of_choice {
        Some(best) => format!("configurations, with {}", best.label),
        // Pooled figures answer no question of a factor that makes a difference.
        None if !together.is_empty() => {
            format!("configurations, pooled over {}", together.join(" and "))
        }
        None => "configurations".to_owned(),
    }));
    blocks.push(Block::Table {
        header: header.into_iter().map(str::to_owned).collect(),
        rows,
    });
    let mut below = vec![
        "clearance: 5th percentile; best: the feasible configuration with the largest clearance"
            .to_owned(),
    ];
    below.extend(route.map(|route| {
        format!(
            "with needle path: feasible, and the needle path keeps {} mm from bone, vessels and organs",
            three_digits(route.least_mm)
        )
    }));
    blocks.push(Block::Lines(below));
}

/// A rate with its interval, or where some were not evaluated its least and largest possible value.
fn known_rate(rate: &Rate, not_judged: u64) -> String {
    if not_judged == 0 || rate.of == 0 {
        return rate_text(rate);
    }
    let [low, high] = [rate.successes, rate.successes + not_judged]
        .map(|count| in_percent(count as f64 / rate.of as f64));
    format!("{low} to {high}, not evaluated")
}

fn share(rate: &Rate) -> String {
    rate.rate.map_or("-".to_owned(), in_percent)
}

fn reason(detail: &str, count: u64, layouts: f64) -> String {
    let share = 100.0 * count as f64 / layouts;
    let digits = usize::from(share < 1.0);
    format!("{} {share:.digits$} %", reason_in_words(detail))
}

/// Percentiles of clearances and tip errors, and all reasons for infeasibility.
pub(super) fn all_configurations(summary: &Summary, blocks: &mut Vec<Block>) {
    let several = |measure| summary.measured(measure).count() > 1;
    let clearances = summary.measured(Measure::Clearance);
    let errors = summary
        .measured(Measure::TipError)
        .filter(|_| has_tip_errors(summary));
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
    if columns.is_empty() {
        return;
    }
    let mut header = vec!["configuration".to_owned()];
    for (column, [first, second], words) in &columns {
        header.push(format!("{words}\n({}), P{}", column.unit, 100.0 * first));
        header.push(format!("\nP{}", 100.0 * second));
    }
    header.push("best\n(%)".to_owned());
    let layouts = summary.overall.layouts as f64;
    let each = summary.overall.configurations.iter();
    let labels = each.map(|each| (each.label.as_str(), in_percent(each.best as f64 / layouts)));
    let rows = labels.chain([(BEST, String::new())]).map(|(of, best)| {
        let numbers = columns
            .iter()
            .flat_map(|(column, shares, _)| shares.map(|p| quantile(summary, of, &column.name, p)));
        std::iter::once(of.to_owned())
            .chain(numbers)
            .chain([best])
            .collect()
    });
    blocks.push(Block::Heading(
        "clearance and tip error, percentiles".to_owned(),
    ));
    blocks.push(Block::Table {
        header,
        rows: rows.collect(),
    });
    blocks.push(Block::Lines(vec![
        "configurations: over the layouts in which they are not rejected; best: over the feasible layouts"
            .to_owned(),
    ]));
    reasons(summary, blocks);
}

fn reasons(summary: &Summary, blocks: &mut Vec<Block>) {
    let layouts = summary.overall.layouts as f64;
    let with_reasons = summary
        .overall
        .configurations
        .iter()
        .filter(|each| !each.details.is_empty());
    let row = |each: &ConfigurationCounts| {
        let shown = each.details.iter().take(MOST_REASONS);
        let texts: Vec<String> = shown
            .map(|detail| reason(&detail.detail, detail.count, layouts))
            .collect();
        vec![each.label.clone(), texts.join(", ")]
    };
    let rows: Vec<Vec<String>> = with_reasons.map(row).collect();
    if !rows.is_empty() {
        blocks.push(Block::Heading(
            "reasons for rejection or failure, % of layouts".to_owned(),
        ));
        blocks.push(Block::table(["configuration", "<reasons"], rows));
    }
}
