//! The error budgets of a goal as a table by source, with what follows from it.

use std::fmt::Write;

use needlebench_evaluation::report::{ConfigurationReport, GoalReport};
use needlebench_show::{layout, plain_table};
use needlebench_uncertainty::budget::{ErrorBudget, Moments, SourceBudget};

/// Mean of the largest errors that 153 interventional radiologists allow, m.
pub(crate) const ALLOWED_M: f64 = 2.7e-3;

/// Distances from tip to target that needle robots reach with the needle in, m.
pub(crate) const CLINICAL_M: [f64; 2] = [1.2e-3, 2.8e-3];

/// Distances of the target from the needle's line that they reach before it goes in, m.
pub(crate) const CLINICAL_LATERAL_M: [f64; 2] = [0.7e-3, 1.4e-3];

/// Configurations that have a budget.
pub(crate) fn budgets(goal: &GoalReport) -> Vec<(&ConfigurationReport, &ErrorBudget)> {
    goal.configurations
        .iter()
        .filter_map(|each| Some((each, each.budget.as_ref()?)))
        .collect()
}

/// Millimetres with two decimals.
pub(crate) fn mm(metres: f64) -> String {
    format!("{:.2}", metres * 1e3)
}

/// Budgets as a table with remarks; none without imperfections.
pub(crate) fn budget_text(goal: &GoalReport) -> Option<String> {
    let budgets = budgets(goal);
    let (_, first) = budgets.first()?;
    let mut header = vec!["configuration".to_owned()];
    let named = first.sources.iter().map(SourceBudget::in_words);
    header.extend(named.map(|words| layout::in_lines(words, 13)));
    header.extend(
        [
            "total",
            "total:\nlateral",
            "total:\nbias",
            "total:\nspread",
            "total:\nat skin",
            "P95",
        ]
        .map(str::to_owned),
    );
    header.push("difference\nspread, bias".to_owned());
    let mut table = plain_table(&header.iter().map(String::as_str).collect::<Vec<_>>());
    for (configuration, budget) in &budgets {
        let mut row = vec![configuration.label.to_owned()];
        row.extend(
            budget
                .sources
                .iter()
                .map(|each| mm(each.at_target.analytic.rms_m)),
        );
        let total = &budget.total.at_target;
        let moments = &total.analytic;
        row.push(mm(moments.rms_m));
        row.push(mm(moments.lateral_rms_m));
        row.push(mm(moments.bias().norm()));
        row.push(mm(moments.covariance().trace().sqrt()));
        row.push(mm(budget.total.at_skin.analytic.rms_m));
        row.push(total.radius_95_m.map_or_else(|| "-".to_owned(), mm));
        row.push(largest_difference(budget));
        table.add_row(row);
    }
    for column in table.column_iter_mut().skip(1) {
        column.set_cell_alignment(needlebench_show::CellAlignment::Right);
    }
    let mut text = format!(
        "error budget of the needle tip over the arm and patient population (mm, RMS; from \
         Jacobians{})\n{table}\n",
        if first.samples > 0 {
            format!(", compared with {} draws", first.samples)
        } else {
            String::new()
        }
    );
    // Writing to a String cannot fail.
    let _ = write_stages(&mut text, goal, &budgets);
    let _ = write_remarks(&mut text, goal, &budgets);
    Some(text)
}

/// What is off before the needle goes in, what tissue does to it, and what the breath does: sums by stage, of the feasible
/// configurations.
fn write_stages(
    out: &mut String,
    goal: &GoalReport,
    budgets: &[(&ConfigurationReport, &ErrorBudget)],
) -> std::fmt::Result {
    let is_feasible = |each: &&(&ConfigurationReport, &ErrorBudget)| each.0.rejections.is_empty();
    let range = |stage: &dyn Fn(&ErrorBudget) -> Option<Moments>| {
        let values = budgets.iter().filter(is_feasible);
        let values: Vec<f64> = values
            .filter_map(|(_, budget)| Some(stage(budget)?.rms_m))
            .collect();
        let least_m = values.iter().copied().reduce(f64::min)?;
        let most_m = values.iter().copied().reduce(f64::max)?;
        Some(if mm(least_m) == mm(most_m) {
            mm(most_m)
        } else {
            format!("{} to {}", mm(least_m), mm(most_m))
        })
    };
    let stages = [
        range(&|budget| budget.before_insertion),
        range(&|budget| budget.in_tissue),
        range(&|budget| budget.of_breath),
    ];
    if let [Some(before), Some(tissue), Some(breath)] = stages {
        let play = if goal.needle.is_some() {
            "needle with play"
        } else {
            "needle"
        };
        writeln!(
            out,
            "at the target, mm RMS: before insertion {before} | in tissue ({play}, indentation) {tissue} | breath {breath}"
        )?;
    }
    Ok(())
}

/// The largest differences between Jacobians and draws over all sources: covariance in per cent, bias in um.
fn largest_difference(budget: &ErrorBudget) -> String {
    let all = || budget.sources.iter().chain([&budget.total]);
    let points = || all().flat_map(|each| [each.at_skin, each.at_target]);
    let covariance = points()
        .filter_map(|point| point.covariance_difference)
        .reduce(f64::max);
    let bias = points()
        .filter_map(|point| point.bias_difference_m)
        .reduce(f64::max);
    match (covariance, bias) {
        (Some(covariance), Some(bias_m)) => {
            format!("{:.1} %, {:.1} um", covariance * 100.0, bias_m * 1e6)
        }
        (None, Some(bias_m)) => format!("-, {:.1} um", bias_m * 1e6),
        _ => "-".to_owned(),
    }
}

fn write_remarks(
    out: &mut String,
    goal: &GoalReport,
    budgets: &[(&ConfigurationReport, &ErrorBudget)],
) -> std::fmt::Result {
    let rms = |budget: &ErrorBudget| budget.total.at_target.analytic.rms_m;
    let best = budgets
        .iter()
        .filter(|(configuration, _)| configuration.rejections.is_empty())
        .min_by(|(_, a), (_, b)| rms(a).total_cmp(&rms(b)));
    if let Some((configuration, budget)) = best {
        let dominant = budget.dominant_in_words().unwrap_or("nothing");
        writeln!(
            out,
            "smallest RMS tip error of the feasible configurations: {}, {} mm, main source {dominant}",
            configuration.label,
            mm(rms(budget))
        )?;
        for own in &budget.sources {
            let of = |each: &SourceBudget| each.at_target.analytic.rms_m;
            let value = |budget: &ErrorBudget| {
                let found = budget.sources.iter().find(|each| each.source == own.source);
                found.map_or(f64::NAN, of)
            };
            let mut order: Vec<_> = budgets
                .iter()
                .filter(|(configuration, _)| configuration.rejections.is_empty())
                .collect();
            order.sort_by(|(_, a), (_, b)| value(a).total_cmp(&value(b)));
            if let ([least, .., most], true) = (&order[..], order.len() > 1) {
                let (low, high) = (value(least.1), value(most.1));
                if high > 1.2 * low && high > 0.1e-3 {
                    writeln!(
                        out,
                        "{}: least sensitive {} ({} mm), most sensitive {} ({} mm)",
                        own.in_words(),
                        least.0.label,
                        mm(low),
                        most.0.label,
                        mm(high)
                    )?;
                }
            }
        }
    }
    for configuration in &goal.configurations {
        if let Some(why) = &configuration.budget_failure {
            writeln!(out, "{}: no error budget: {why}", configuration.label)?;
        }
        for (engine, report) in &configuration.engines {
            if let Some(off_m) = report
                .unexplained_tip_m
                .filter(|off_m| *off_m > UNEXPLAINED_M)
            {
                writeln!(
                    out,
                    "{}: tip in {engine} deviates {} mm from static equilibrium",
                    configuration.label,
                    mm(off_m)
                )?;
            }
        }
    }
    Ok(())
}

/// Distance from the prediction above which a line is printed, m.
const UNEXPLAINED_M: f64 = 0.1e-3;
