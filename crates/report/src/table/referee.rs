//! The engines compared with the reference integrator, as a table.

use needlebench_evaluation::referee::RefereeComparison;
use needlebench_evaluation::report::GoalReport;
use needlebench_show::number::small_length;
use needlebench_show::{Cell, CellAlignment, Color, Table, plain_table};

/// One row for each configuration and engine; none without the reference integrator.
pub(super) fn referee_table(goal: &GoalReport) -> Option<Table> {
    let header = [
        "configuration",
        "engine",
        "closed loop\npeak",
        "\nsettled",
        "at smaller steps\npeak",
        "\norder",
        "held torques\nper window",
        "\norder",
        "documented\norder",
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
                smaller_steps(found),
            ];
            cells.extend(numbers.map(right));
            cells.push(order(found, found.order));
            let held = found.held_torques.as_ref();
            cells.push(right(held.map_or("-".to_owned(), |held| {
                format!(
                    "{} in {:.0} ms",
                    small_length(held.peak_tip_m),
                    held.window_s * 1e3
                )
            })));
            cells.push(order(found, held.and_then(|held| held.order)));
            cells.push(right(found.documented_order.to_string()));
            cells.push(right(format!("{:.2}", found.until_s)));
            table.add_row(cells);
        }
    }
    has_rows.then_some(table)
}

/// An order that was measured, marked where it is not the documented one.
fn order(found: &RefereeComparison, measured: Option<f64>) -> Cell {
    let text = measured.map_or("-".to_owned(), |order| format!("{order:.2}"));
    if found.is_documented(measured) {
        right(text)
    } else {
        right(format!("{text}*")).fg(Color::Red)
    }
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
