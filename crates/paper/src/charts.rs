//! The charts of the document, and tables that are not lists of the report.

use needlebench_show::Block;
use needlebench_show::chart::{
    Axis, Chart, Curve as Line, DotMark, DotRow, Entry, Marker, Paint, bar_plot, curve_plot,
    dot_plot,
};
use needlebench_show::number::{duration, percent, power_of_ten, rounded, short};

use super::accuracy::Source as AccuracySource;
use super::convergence::{Curve, Point};
use super::report::PaperReport;
use super::timing::{Source as TimeSource, TimeRow};

/// The table with a name; none if the name is that of a chart.
pub fn table(name: &str, report: &PaperReport) -> Option<Block> {
    match name {
        "well-conditioned poses" => Some(points(name, report, |curve| &curve.well_conditioned)),
        "all poses" => Some(points(name, report, |curve| &curve.all)),
        "starts" => Some(starts(report)),
        _ => None,
    }
}

/// The chart with a name.
pub fn chart(name: &str, report: &PaperReport) -> Chart {
    match name {
        "errors of equations" => equations(name, report),
        "right answers" => right_answers(name, report),
        "solutions" => solutions(name, report),
        "position errors" => accuracy(name, report),
        "time of the closed form" => time(name, false, report),
        "time of the numerical method" => time(name, true, report),
        "convergence" => convergence(name, report, |curve| &curve.well_conditioned),
        "convergence of all" => convergence(name, report, |curve| &curve.all),
        "steps" => steps(name, report),
        "order" => order(name, report),
        "branches" => branches(name, report),
        _ => unreachable!("{name} is no chart"),
    }
}

/// Exact zeros are at the left end of logarithmic axes.
const LEAST_POWER: i32 = -18;

/// A mark of a series; `tip` describes it.
fn dot(series: usize, marker: Marker, value: f64, tip: String) -> DotMark {
    let least = 10_f64.powi(LEAST_POWER);
    DotMark {
        paint: Paint::Series(series),
        marker,
        value: if value == 0.0 { least } else { value },
        up_to: None,
        tip,
    }
}

fn equations(name: &str, report: &PaperReport) -> Chart {
    let legend: [Entry<'_>; 2] = [
        (Paint::Series(1), Marker::Square, "as printed"),
        (Paint::Series(0), Marker::Disc, "as corrected"),
    ];
    let rows = report.equations.iter().map(|equation| {
        let tip = |form, error| {
            format!(
                "{} {form}: {} {}",
                equation.number,
                short(error),
                equation.unit
            )
        };
        let [printed, corrected] = [equation.printed.max, equation.corrected.max];
        DotRow {
            label: format!("{} · {}", equation.number, equation.name),
            marks: vec![
                dot(1, Marker::Square, printed, tip("as printed", printed)),
                dot(0, Marker::Disc, corrected, tip("as corrected", corrected)),
            ],
        }
    });
    let label = "largest error (m, rad or 1; exact zeros at the left end)";
    let axis = Axis::decades(label, [LEAST_POWER, 3], 3, power_of_ten);
    dot_plot(name, &rows.collect::<Vec<_>>(), axis, &legend)
}

fn right_answers(name: &str, report: &PaperReport) -> Chart {
    let groups = report.solver_variants.iter().map(|variant| {
        let label = variant.name.replace(" and ", "\nand ").replace(", ", ",\n");
        (
            label.replace(" corrected", "\ncorrected"),
            vec![variant.right],
        )
    });
    let legend = [(Paint::Series(0), Marker::Square, "correct")];
    let axis = Axis::percent("correct answers (%)", 1.0);
    bar_plot(name, &groups.collect::<Vec<_>>(), &legend, "", axis)
}

fn solutions(name: &str, report: &PaperReport) -> Chart {
    let groups = [0, 2, 4, 6, 8].map(|count| {
        let share = report.solution_counts.share_by_count.get(&count);
        let share = share.copied().unwrap_or(0.0);
        (format!("{count}\n{}", percent(share)), vec![share])
    });
    let legend = [(Paint::Series(2), Marker::Square, "poses")];
    let axis = Axis::percent("poses (%)", 1.0);
    bar_plot(name, &groups, &legend, "solutions of a pose", axis)
}

fn accuracy(name: &str, report: &PaperReport) -> Chart {
    let legend = [
        (Paint::Series(0), Marker::Disc, "median"),
        (Paint::Series(0), Marker::Square, "largest"),
        (Paint::Series(1), Marker::Diamond, "stated"),
    ];
    let rows = report.accuracy.iter().map(|row| {
        let series = match row.source {
            AccuracySource::ThisRun => 0,
            AccuracySource::Paper => 1,
            AccuracySource::Robot => 2,
            AccuracySource::Limit => 4,
        };
        let values = [row.position_median_m, row.position_max_m, row.stated];
        let marks = values
            .into_iter()
            .zip(&legend)
            .filter_map(|(value, (_, marker, what))| {
                let tip = format!("{}, {what}: {}", row.name, short(value?));
                Some(dot(series, *marker, value?, tip))
            });
        DotRow {
            label: row.name.to_owned(),
            marks: marks.collect(),
        }
    });
    let axis = Axis::decades("position error (m)", [LEAST_POWER, 0], 3, power_of_ten);
    dot_plot(name, &rows.collect::<Vec<_>>(), axis, &legend)
}

/// One time or a range.
fn time_of(row: &TimeRow) -> String {
    match row.up_to_s {
        Some(up_to_s) => format!("{} to {}", duration(row.time_s), duration(up_to_s)),
        None => duration(row.time_s),
    }
}

fn time(name: &str, numerical: bool, report: &PaperReport) -> Chart {
    let legend = [
        (Paint::Series(1), Marker::Diamond, "paper"),
        (Paint::Series(0), Marker::Disc, "this run"),
        (Paint::Series(4), Marker::Square, "recorded elsewhere"),
    ];
    let rows = report
        .timings
        .rows
        .iter()
        .filter(|row| row.numerical == numerical);
    let rows = rows.map(|row| {
        let (series, marker) = match row.source {
            TimeSource::Paper => (1, Marker::Diamond),
            TimeSource::ThisRun => (0, Marker::Disc),
            TimeSource::Peer => (4, Marker::Square),
        };
        let tip = format!("{}: {}", row.name, time_of(row));
        let mark = DotMark {
            up_to: row.up_to_s.map(|up_to_s| up_to_s * 1e9),
            ..dot(series, marker, row.time_s * 1e9, tip)
        };
        DotRow {
            label: row.name.to_owned(),
            marks: vec![mark],
        }
    });
    let axis = Axis::decades("time of one pose (ns)", [1, 8], 1, power_of_ten);
    dot_plot(name, &rows.collect::<Vec<_>>(), axis, &legend)
}

/// Colours of the methods: the paper's own is the second, as in all charts.
const SERIES: [usize; 5] = [1, 0, 2, 3, 4];

fn convergence(name: &str, report: &PaperReport, points: fn(&Curve) -> &Vec<Point>) -> Chart {
    let curves = report.convergence.curves.iter().zip(SERIES).enumerate();
    let legend: Vec<Entry<'_>> = curves
        .clone()
        .map(|(index, (curve, series))| (Paint::Series(series), Marker::of(index), curve.name))
        .collect();
    let lines = curves.flat_map(|(index, (curve, series))| {
        [false, true].map(|dashed| {
            let share = |each: &Point| {
                if dashed {
                    each.same_branch
                } else {
                    each.converged
                }
            };
            Line {
                paint: Paint::Series(series),
                marker: Marker::of(index),
                dashed,
                points: points(curve)
                    .iter()
                    .map(|each| [each.distance_rad, share(each)])
                    .collect(),
                name: curve.name,
            }
        })
    });
    let ticks = [0.01, 0.03, 0.1, 0.3, 1.0, 3.0].map(|each| (each, each.to_string()));
    let horizontal = Axis::logarithmic("distance of the guess d (rad)", 0.009, 3.6);
    let horizontal = horizontal.with_ticks(ticks.into());
    let vertical = Axis::percent("guesses (%)", 1.0);
    curve_plot(
        name,
        &lines.collect::<Vec<_>>(),
        horizontal,
        vertical,
        &legend,
    )
}

/// The curves of convergence as a table.
fn points(set: &str, report: &PaperReport, points: fn(&Curve) -> &Vec<Point>) -> Block {
    let curves = &report.convergence.curves;
    let distances = curves.first().into_iter().flat_map(points);
    let mut header = vec![format!("{set}, d (rad)")];
    header.extend(distances.map(|point| format!("{:.2}", point.distance_rad)));
    let rows = curves.iter().map(|curve| {
        let mut cells = vec![curve.name.to_owned()];
        cells.extend(points(curve).iter().map(|point| {
            let [converged, same] =
                [point.converged, point.same_branch].map(|share| rounded(share * 100.0, 1));
            let steps = if point.mean_iterations.is_nan() {
                "-".to_owned()
            } else {
                format!("{:.1}", point.mean_iterations)
            };
            format!("{converged}/{same}\n{steps}")
        }));
        cells
    });
    let rows = rows.collect();
    Block::Table { header, rows }
}

/// Steps from here on share a bar, and so do those up to the first.
const STEPS: [u32; 2] = [2, 14];

fn steps(name: &str, report: &PaperReport) -> Chart {
    let [few, many] = STEPS;
    let histograms = &report.convergence.iterations;
    let names = histograms
        .iter()
        .map(|each| format!("d = {} rad", each.distance_rad));
    let names: Vec<String> = names.collect();
    let groups = (few..=many).map(|steps| {
        let shares = histograms.iter().map(|each| {
            let counts = || each.count_by_iterations.iter();
            let total: usize = counts().map(|(_, guesses)| guesses).sum();
            let here = counts().filter(|(count, _)| (**count).clamp(few, many) == steps);
            here.map(|(_, guesses)| guesses).sum::<usize>() as f64 / total.max(1) as f64
        });
        let mark = if steps == few {
            "≤"
        } else if steps == many {
            "≥"
        } else {
            ""
        };
        (format!("{mark}{steps}"), shares.collect())
    });
    let axis = Axis::percent("guesses (%)", 1.0);
    bar_plot(
        name,
        &groups.collect::<Vec<_>>(),
        &squares(names.iter().map(String::as_str)),
        "steps",
        axis,
    )
}

/// Legend of bars.
fn squares<'n>(names: impl IntoIterator<Item = &'n str>) -> Vec<Entry<'n>> {
    let names = names.into_iter().enumerate();
    names
        .map(|(index, name)| (Paint::Series(index), Marker::Square, name))
        .collect()
}

fn order(name: &str, report: &PaperReport) -> Chart {
    let errors = report.convergence.order.median_error_rad.iter().enumerate();
    let curve = Line {
        paint: Paint::Series(0),
        marker: Marker::Disc,
        dashed: false,
        points: errors.map(|(step, error)| [step as f64, *error]).collect(),
        name: "median error",
    };
    let ticks = [0, 1, 2, 3, 4].map(|each| (f64::from(each), each.to_string()));
    let horizontal = Axis::linear("steps", 0.0, 4.0).with_ticks(ticks.into());
    let vertical = Axis::decades("joint error (rad)", [-16, 0], 2, power_of_ten);
    curve_plot(name, &[curve], horizontal, vertical, &[])
}

/// Shares of poses that end in each configuration, and in none, from each start.
fn ends(report: &PaperReport) -> Vec<(&'static str, Vec<f64>)> {
    let starts = || report.convergence.starts.iter();
    let labels = report.table_3.rows.iter().map(|row| row.label);
    let ends = labels.enumerate().map(|(index, label)| {
        let of = starts().map(|start| start.share_by_configuration[&index]);
        (label, of.collect())
    });
    let none = starts().map(|start| start.not_converged).collect();
    ends.chain([("does not converge", none)]).collect()
}

fn starts(report: &PaperReport) -> Block {
    let names = report.convergence.starts.iter().map(|start| start.name);
    let rows = ends(report).into_iter().map(|(name, shares)| {
        let shares = shares.into_iter().map(percent);
        std::iter::once(name.to_owned()).chain(shares).collect()
    });
    Block::Table {
        header: std::iter::once("ends in, from")
            .chain(names)
            .map(str::to_owned)
            .collect(),
        rows: rows.collect(),
    }
}

fn branches(name: &str, report: &PaperReport) -> Chart {
    let starts = report.convergence.starts.iter().map(|start| start.name);
    let ends = ends(report).into_iter();
    let ends = ends.map(|(name, shares)| (name.replace(['-', ' '], "\n"), shares));
    let groups: Vec<(String, Vec<f64>)> = ends.collect();
    let shares = groups.iter().flat_map(|(_, shares)| shares);
    let most = shares.copied().fold(0.1, f64::max);
    let axis = Axis::percent("poses (%)", (most * 10.0).ceil() / 10.0);
    bar_plot(name, &groups, &squares(starts), "", axis)
}
