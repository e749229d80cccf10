//! The engines beside the referee, as a table.

use comfy_table::{Cell, CellAlignment, Color, Table};
use needlebench_evaluation::referee::RefereeComparison;
use needlebench_evaluation::report::GoalReport;

use super::plain_table;
use crate::number::small_length;

/// One row for each configuration and engine; none unless the referee was called.
pub(super) fn referee_table(goal: &GoalReport) -> Option<Table> {
    let header = [
        "configuration",
        "engine",
        "closed loop\npeak",
        "\nsettled",
        "same torques\npeak",
        "unaided\nlost after",
        "at smaller steps\npeak",
        "order\n(documented)",
        "compared\nto (s)",
    ];
    let mut table = plain_table(&header);
    let mut has_rows = false;
    for configuration in &goal.configurations {
        for (engine, found) in configuration.referee.iter().flat_map(|each| &each.engines) {
            has_rows = true;
            let mut cells = vec![Cell::new(configuration.label), Cell::new(engine)];
            let numbers = [
                small_length(found.closed_loop.peak_tip_m),
                found
                    .closed_loop
                    .settled_tip_m
                    .map_or("-".to_owned(), small_length),
                small_length(found.same_torques.peak_tip_m),
                found
                    .unaided_until_s
                    .map_or("-".to_owned(), |time_s| format!("{time_s:.2} s")),
                smaller_steps(found),
            ];
            cells.extend(numbers.map(right));
            let order = found.order.map_or("-".to_owned(), |order| {
                format!("{order:.2} ({})", found.documented_order)
            });
            cells.push(if found.order_is_documented() {
                right(order)
            } else {
                right(format!("{order}*")).fg(Color::Red)
            });
            cells.push(right(format!("{:.2}", found.until_s)));
            table.add_row(cells);
        }
    }
    has_rows.then_some(table)
}

fn right(text: String) -> Cell {
    Cell::new(text).set_alignment(CellAlignment::Right)
}

fn smaller_steps(found: &RefereeComparison) -> String {
    let steps: Vec<String> = found
        .convergence
        .iter()
        .skip(1)
        .map(|step| {
            format!(
                "{} at {} ms",
                small_length(step.peak_tip_m),
                step.timestep_s * 1e3
            )
        })
        .collect();
    steps.join(", ")
}
