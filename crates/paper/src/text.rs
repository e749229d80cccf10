//! The results for a terminal.

use std::fmt::Write;

use super::PaperReport;
use super::free_space::Region;
use super::timing::TimeRow;
use needlebench_report::number::{duration, percent, short};
use needlebench_report::plain_table;

/// Everything as compact tables.
pub fn text(report: &PaperReport) -> String {
    let mut out = String::new();
    // Writing to a String cannot fail.
    let _ = write_report(&mut out, report);
    out
}

/// One time or a range.
pub(super) fn time_of(row: &TimeRow) -> String {
    match row.up_to_s {
        Some(up_to_s) => format!("{} to {}", duration(row.time_s), duration(up_to_s)),
        None => duration(row.time_s),
    }
}

fn write_report(out: &mut String, report: &PaperReport) -> std::fmt::Result {
    writeln!(out, "{}: {}\n", report.paper.authors, report.paper.title)?;
    table_3(out, report)?;
    equations(out, report)?;
    solver(out, report)?;
    accuracy_and_time(out, report)?;
    convergence(out, report)?;
    free_space(out, report)?;
    for check in &report.checks {
        let mark = if check.pass { "ok  " } else { "FAIL" };
        writeln!(out, "{mark} {} ({})", check.name, check.detail)?;
    }
    writeln!(out, "{}", if report.passes() { "PASS" } else { "FAIL" })
}

fn table_3(out: &mut String, report: &PaperReport) -> std::fmt::Result {
    writeln!(
        out,
        "Table 3 at the exact pose of row 1, and as printed, wrapped (rad)"
    )?;
    let mut table = plain_table(&[
        "configuration",
        "q1",
        "q2",
        "q3",
        "q4",
        "q5",
        "q6",
        "row",
        "printed label",
        "largest\ndifference",
        "row against\nprinted pose",
    ]);
    for row in &report.table_3.rows {
        let mut cells = vec![row.label.to_owned()];
        let pairs = row.joints_rad.iter().zip(&row.printed_joints_wrapped_rad);
        cells.extend(pairs.map(|(ours, printed)| {
            format!(
                "{ours:.6}
{printed:.6}"
            )
        }));
        let largest = row
            .difference_rad
            .iter()
            .fold(0.0, |most: f64, each| most.max(each.abs()));
        let swapped = if row.label_is_right { "" } else { " (swapped)" };
        cells.extend([
            row.printed_row.to_string(),
            format!("{}{swapped}", row.printed_label),
            short(largest),
            format!("{} m", short(row.residual_to_printed_pose_m)),
        ]);
        table.add_row(cells);
    }
    let pose = &report.table_3.pose;
    writeln!(out, "{table}")?;
    writeln!(
        out,
        "printed pose: orthonormality defect {}; made a rotation it moves joints by up to {} rad\n",
        short(pose.orthonormality_defect),
        short(pose.projection_moves_joints_rad)
    )
}

fn equations(out: &mut String, report: &PaperReport) -> std::fmt::Result {
    writeln!(
        out,
        "Equations against forward kinematics on {} random postures",
        report.solution_counts.poses
    )?;
    let mut table = plain_table(&[
        "equation",
        "what",
        "verdict",
        "printed\nlargest",
        "rms",
        "fails for",
        "corrected\nlargest",
        "rms",
        "unit",
    ]);
    for equation in &report.equations {
        table.add_row([
            equation.number.to_owned(),
            equation.name.to_owned(),
            equation.verdict.text().to_owned(),
            short(equation.printed.max),
            short(equation.printed.rms),
            percent(equation.printed.failing),
            short(equation.corrected.max),
            short(equation.corrected.rms),
            equation.unit.symbol().to_owned(),
        ]);
    }
    writeln!(out, "{table}\n")
}

fn solver(out: &mut String, report: &PaperReport) -> std::fmt::Result {
    writeln!(
        out,
        "Closed form as a whole: share of its answers that are right"
    )?;
    let mut table = plain_table(&["variant", "answers", "right", "finds the joints"]);
    for variant in &report.solver_variants {
        table.add_row([
            variant.name.to_owned(),
            variant.returned.to_string(),
            percent(variant.right),
            percent(variant.finds_the_joints),
        ]);
    }
    let counts: Vec<String> = report
        .solution_counts
        .share_by_count
        .iter()
        .rev()
        .map(|(count, share)| format!("{count} for {}", percent(*share)))
        .collect();
    writeln!(out, "{table}")?;
    writeln!(
        out,
        "solutions of a random pose: {}; mean {:.2}\n",
        counts.join(", "),
        report.solution_counts.mean
    )
}

fn accuracy_and_time(out: &mut String, report: &PaperReport) -> std::fmt::Result {
    let mut table = plain_table(&[
        "accuracy (largest entry)",
        "position\nmedian (m)",
        "largest",
        "orientation\nmedian",
        "largest",
        "stated",
    ]);
    let cell = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), short);
    for row in &report.accuracy {
        table.add_row([
            row.name.to_owned(),
            cell(row.position_median_m),
            cell(row.position_max_m),
            cell(row.orientation_median),
            cell(row.orientation_max),
            cell(row.stated),
        ]);
    }
    writeln!(out, "{table}\n")?;
    let mut table = plain_table(&[
        "time of one pose",
        "time",
        "least",
        "90th percentile",
        "repetitions",
    ]);
    let cell = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), duration);
    for row in &report.timings.rows {
        let repetitions = row.repetitions.zip(row.poses_per_repetition).map_or_else(
            || "published".to_owned(),
            |(times, poses)| format!("{times} x {poses}"),
        );
        table.add_row([
            row.name.to_owned(),
            time_of(row),
            cell(row.least_s),
            cell(row.p90_s),
            repetitions,
        ]);
    }
    let build = if report.timings.optimised_build {
        ""
    } else {
        "; not an optimised build"
    };
    let cpu = report.timings.cpu.as_deref().unwrap_or("unknown processor");
    writeln!(out, "{table}\nmedians on {cpu}{build}\n")
}

fn convergence(out: &mut String, report: &PaperReport) -> std::fmt::Result {
    let convergence = &report.convergence;
    writeln!(
        out,
        "Numerical method from guesses off by up to d, {} well-conditioned poses: converged / same branch (%), mean steps",
        convergence.poses
    )?;
    let distances: Vec<String> = convergence
        .curves
        .first()
        .map_or(&[][..], |curve| &curve.well_conditioned[..])
        .iter()
        .map(|point| format!("{:.2}", point.distance_rad))
        .collect();
    let mut header = vec!["d (rad)"];
    header.extend(distances.iter().map(String::as_str));
    let mut table = plain_table(&header);
    for curve in &convergence.curves {
        let mut cells = vec![curve.name.to_owned()];
        cells.extend(curve.well_conditioned.iter().map(|point| {
            let steps = if point.mean_iterations.is_nan() {
                "-".to_owned()
            } else {
                format!("{:.1}", point.mean_iterations)
            };
            format!(
                "{:.0}/{:.0}\n{steps}",
                point.converged * 100.0,
                point.same_branch * 100.0
            )
        }));
        table.add_row(cells);
    }
    writeln!(
        out,
        "{table}\norder of convergence {:.2}\n",
        convergence.order.median
    )?;

    let labels: Vec<&str> = report.table_3.rows.iter().map(|row| row.label).collect();
    let mut header = vec!["ends in, from"];
    header.extend(convergence.starts.iter().map(|start| start.name));
    let mut table = plain_table(&header);
    for (index, label) in labels.iter().enumerate() {
        let mut cells = vec![(*label).to_owned()];
        cells.extend(convergence.starts.iter().map(|start| {
            percent(
                start
                    .share_by_configuration
                    .get(&index)
                    .copied()
                    .unwrap_or(0.0),
            )
        }));
        table.add_row(cells);
    }
    let mut cells = vec!["does not converge".to_owned()];
    cells.extend(
        convergence
            .starts
            .iter()
            .map(|start| percent(start.not_converged)),
    );
    table.add_row(cells);
    writeln!(out, "{table}\n")?;

    let mut table = plain_table(&[
        "guess",
        "converged",
        "shoulder",
        "elbow",
        "wrist",
        "branch as wanted",
    ]);
    for row in &convergence.steering {
        table.add_row([
            row.guess.to_owned(),
            percent(row.converged),
            percent(row.wanted_shoulder),
            percent(row.wanted_elbow),
            percent(row.wanted_wrist),
            percent(row.wanted_configuration),
        ]);
    }
    writeln!(out, "{table}\n")
}

fn free_space(out: &mut String, report: &PaperReport) -> std::fmt::Result {
    let space = &report.free_space;
    writeln!(
        out,
        "Figure 6 in numbers: heights over the base plane, and volume gained (litres)"
    )?;
    let mut header = vec![
        "configuration",
        "elbow (m)",
        "lowest\njoint (m)",
        "surface (m)",
    ];
    header.extend(Region::ALL.map(Region::name));
    header.push("room is left");
    let mut table = plain_table(&header);
    for each in &space.configurations {
        let mut cells = vec![
            each.label.to_owned(),
            format!("{:+.3}", each.elbow_m),
            format!("{:+.3}", each.lowest_joint_m),
            format!(
                "{:+.2} to {:+.2}",
                each.lowest_surface_m, each.highest_surface_m
            ),
        ];
        cells.extend(
            Region::ALL
                .iter()
                .map(|region| format!("{:.1}", each.gained_m3[region] * 1e3)),
        );
        cells.push(each.room());
        table.add_row(cells);
    }
    writeln!(out, "{table}")?;
    for roll in &space.roll {
        let effect = if roll.roll_is_wrist_3 {
            "roll turns wrist 3 alone".to_owned()
        } else {
            format!(
                "lowest joint {:+.3} to {:+.3} m",
                roll.lowest_joint_worst_m, roll.lowest_joint_best_m
            )
        };
        writeln!(
            out,
            "roll about the needle, guide {}: {} to {} solutions, {effect}",
            roll.tool, roll.fewest_solutions, roll.most_solutions
        )?;
    }
    writeln!(out)
}
