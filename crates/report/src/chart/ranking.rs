//! The ranking of a goal: what each score is made of.

use needlebench_evaluation::report::GoalReport;
use needlebench_show::chart::{Chart, WeightedBars, WeightedRow, weighted_bars};

use crate::table::ranking::{counted, rows, value_and_contribution, words};

/// The ranking as a chart; none if fewer than two configurations were ranked.
pub(crate) fn ranking_chart(goal: &GoalReport) -> Option<Chart> {
    let rows = rows(goal);
    let ranking = goal.ranking.as_ref().filter(|_| rows.len() > 1)?;
    let metrics = counted(ranking);
    let bars = WeightedBars {
        title: format!("{}: ranking", goal.name),
        remark:
            "column width: weight of the metric; fill: utility of the value; filled area of a row: \
             its score"
                .to_owned(),
        columns: metrics
            .iter()
            .map(|metric| (words(metric.name).to_owned(), metric.weight))
            .collect(),
        rows: rows
            .iter()
            .map(|row| WeightedRow {
                label: format!("{} {}", row.ranking.rank, row.configuration.label),
                note: format!(
                    "{:.1}{}",
                    row.ranking.score * 100.0,
                    if row.configuration.pareto {
                        " Pareto"
                    } else {
                        ""
                    }
                ),
                cells: metrics
                    .iter()
                    .map(|metric| {
                        let mut terms = row.ranking.terms.iter();
                        let utility = terms.find(|term| term.metric == metric.name);
                        let (value, _) = value_and_contribution(row, metric.name);
                        (utility.map_or(0.0, |term| term.utility), value)
                    })
                    .collect(),
            })
            .collect(),
    };
    Some(weighted_bars(&bars))
}
