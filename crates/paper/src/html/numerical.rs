//! The page's part on the numerical method: convergence, branches, steering.

use std::fmt::Write;

use crate::PaperReport;
use crate::convergence::{Curve, Method, Point, StartReport};
use needlebench_report::chart::{Axis, Chart, Curve as Line, Marker, Paint, bar_plot, curve_plot};
use needlebench_report::number::{percent, power_of_ten};

/// Colours of the methods: the paper's own is the second, as in all plots.
const SERIES: [usize; 5] = [1, 0, 2, 3, 4];

pub(super) fn convergence(out: &mut String, report: &PaperReport) -> std::fmt::Result {
    let convergence = &report.convergence;
    writeln!(
        out,
        "<h2 id=\"convergence\">The numerical method against its guess</h2><p>Guesses with every joint off by \
         up to <i>d</i>, {} poses each; converged means 10⁻⁹ m and rad within 200 steps; \
         within 50 steps the undamped method comes to {} at π. \
         Well-conditioned: |sin q<sub>3</sub>| and |sin q<sub>5</sub>| at least 0.3, 80 mm from the shoulder's \
         singularity.</p><div class=\"pair\">",
        convergence.poses,
        percent(early(&convergence.curves))
    )?;
    for (name, points) in [
        (
            "well-conditioned poses",
            (|curve| &curve.well_conditioned) as fn(&Curve) -> &Vec<Point>,
        ),
        ("all poses", |curve| &curve.all),
    ] {
        writeln!(
            out,
            "<figure>{}<figcaption>Convergence, {name}. Solid: converges; dashed: ends in the branch that the \
             guess was near to.</figcaption></figure>",
            convergence_plot(&convergence.curves, name, points).to_inline_svg()
        )?;
    }
    out.write_str("</div><div class=\"pair\">")?;
    writeln!(
        out,
        "<figure>{}<figcaption>Steps of the mended, undamped method, of guesses that converge.</figcaption></figure>",
        iteration_plot(report).to_inline_svg()
    )?;
    writeln!(
        out,
        "<figure>{}<figcaption>Median joint error after each step from guesses 0.1 rad off: order of \
         convergence {:.2} (median of {}).</figcaption></figure></div>",
        order_plot(report).to_inline_svg(),
        convergence.order.median,
        convergence.order.samples
    )?;
    convergence_table(out, report)?;
    starts(out, report)?;
    steering(out, report)
}

/// Share that the undamped method reaches in few steps from the farthest guesses.
fn early(curves: &[Curve]) -> f64 {
    curves
        .iter()
        .find(|curve| curve.method == Method::Mended)
        .and_then(|curve| curve.well_conditioned.last())
        .map_or(f64::NAN, |point| point.converged_in_50_steps)
}

fn convergence_plot(curves: &[Curve], name: &str, points: fn(&Curve) -> &Vec<Point>) -> Chart {
    let mut series = Vec::new();
    let mut legend = Vec::new();
    for (index, curve) in curves.iter().enumerate() {
        let paint = Paint::Series(SERIES[index % SERIES.len()]);
        let marker = Marker::of(index);
        legend.push((paint, marker, curve.name));
        for dashed in [false, true] {
            let value = |point: &Point| {
                if dashed {
                    point.same_branch
                } else {
                    point.converged
                }
            };
            series.push(Line {
                paint,
                marker,
                dashed,
                points: points(curve)
                    .iter()
                    .map(|each| [each.distance_rad, value(each)])
                    .collect(),
                name: curve.name,
            });
        }
    }
    let ticks = [0.01, 0.03, 0.1, 0.3, 1.0, 3.0].map(|each| (each, each.to_string()));
    let horizontal = Axis::logarithmic("distance of the guess d (rad)", 0.009, 3.6);
    curve_plot(
        &format!("Convergence against the distance of the guess, {name}"),
        &series,
        horizontal.with_ticks(ticks.into()),
        Axis::percent("guesses (%)", 1.0),
        &legend,
    )
}

/// Steps from here on share a bar.
const MANY_STEPS: u32 = 14;

fn iteration_plot(report: &PaperReport) -> Chart {
    let histograms = &report.convergence.iterations;
    let names: Vec<String> = histograms
        .iter()
        .map(|each| format!("d = {} rad", each.distance_rad))
        .collect();
    let series: Vec<_> = names
        .iter()
        .enumerate()
        .map(|(index, name)| (Paint::Series(index), Marker::Square, name.as_str()))
        .collect();
    let groups: Vec<(String, Vec<f64>)> = (2..=MANY_STEPS)
        .map(|steps| {
            let shares = histograms.iter().map(|each| {
                let total: usize = each.count_by_iterations.values().sum();
                let here: usize = each
                    .count_by_iterations
                    .iter()
                    .filter(|(count, _)| {
                        **count == steps
                            || steps == MANY_STEPS && **count > steps
                            || steps == 2 && **count < steps
                    })
                    .map(|(_, guesses)| guesses)
                    .sum();
                here as f64 / total.max(1) as f64
            });
            let label = match steps {
                2 => "≤2".to_owned(),
                MANY_STEPS => format!("≥{MANY_STEPS}"),
                _ => steps.to_string(),
            };
            (label, shares.collect())
        })
        .collect();
    bar_plot(
        "Steps to convergence",
        &groups,
        &series,
        "steps",
        Axis::percent("guesses (%)", 1.0),
    )
}

fn order_plot(report: &PaperReport) -> Chart {
    let points = report
        .convergence
        .order
        .median_error_rad
        .iter()
        .enumerate()
        .map(|(step, error)| [step as f64, *error])
        .collect();
    let ticks = [0, 1, 2, 3, 4].map(|each| (f64::from(each), each.to_string()));
    let horizontal = Axis::linear("steps", 0.0, 4.0).with_ticks(ticks.into());
    let series = [Line {
        paint: Paint::Series(0),
        marker: Marker::Disc,
        dashed: false,
        points,
        name: "median error",
    }];
    curve_plot(
        "Joint error after each step",
        &series,
        horizontal,
        Axis::decades("joint error (rad)", [-16, 0], 2, power_of_ten),
        &[],
    )
}

fn convergence_table(out: &mut String, report: &PaperReport) -> std::fmt::Result {
    out.write_str(
        "<div class=\"scroll\"><table><caption>Converged / same branch (%), and mean steps; well-conditioned \
         poses, then all</caption><thead><tr><th>d (rad)</th>",
    )?;
    let curves = &report.convergence.curves;
    if let Some(curve) = curves.first() {
        for point in &curve.all {
            write!(out, "<th>{:.2}</th>", point.distance_rad)?;
        }
    }
    out.write_str("</tr></thead><tbody>")?;
    for (set, points) in [
        (
            "well-conditioned",
            (|curve| &curve.well_conditioned) as fn(&Curve) -> &Vec<Point>,
        ),
        ("all", |curve| &curve.all),
    ] {
        for curve in curves {
            write!(
                out,
                "<tr><td>{}<span class=\"remark\">{set}</span></td>",
                curve.name
            )?;
            for point in points(curve) {
                let steps = if point.mean_iterations.is_nan() {
                    "–".to_owned()
                } else {
                    format!("{:.1}", point.mean_iterations)
                };
                write!(
                    out,
                    "<td>{:.1}/{:.1}<span class=\"remark\">{steps}</span></td>",
                    point.converged * 100.0,
                    point.same_branch * 100.0
                )?;
            }
            out.write_str("</tr>")?;
        }
    }
    out.write_str("</tbody></table></div>\n")
}

fn starts(out: &mut String, report: &PaperReport) -> std::fmt::Result {
    let starts = &report.convergence.starts;
    let poses = starts.first().map_or(0, |start| start.poses);
    writeln!(
        out,
        "<h3>“One solution, with a surprising configuration”</h3><p>Where the mended, undamped method ends when \
         it always starts from the same posture, over {poses} random poses. Every branch comes up: the pose \
         decides, not the start. Zeros and the upright home are singular at elbow and wrist.</p>"
    )?;
    let series: Vec<_> = starts
        .iter()
        .enumerate()
        .map(|(index, start)| (Paint::Series(index), Marker::Square, start.name))
        .collect();
    let mut groups: Vec<(String, Vec<f64>)> = report
        .table_3
        .rows
        .iter()
        .enumerate()
        .map(|(index, row)| {
            let share = |start: &StartReport| {
                start
                    .share_by_configuration
                    .get(&index)
                    .copied()
                    .unwrap_or(0.0)
            };
            (
                row.label.replace('-', "\n"),
                starts.iter().map(share).collect(),
            )
        })
        .collect();
    groups.push((
        "none".to_owned(),
        starts.iter().map(|start| start.not_converged).collect(),
    ));
    let most = groups
        .iter()
        .flat_map(|(_, shares)| shares)
        .copied()
        .fold(0.1, f64::max);
    let high = (most * 10.0).ceil() / 10.0;
    writeln!(
        out,
        "<figure>{}<figcaption>Branch in which the method ends, by start; “none”: does not converge in 200 \
         steps.</figcaption></figure>",
        bar_plot(
            "Branch by start",
            &groups,
            &series,
            "",
            Axis::percent("poses (%)", high)
        )
        .to_inline_svg()
    )
}

fn steering(out: &mut String, report: &PaperReport) -> std::fmt::Result {
    writeln!(
        out,
        "<h3>“We can control over the output … by setting the initial conditions”</h3><p>For {} poses, one of \
         their solutions drawn at random is wanted. The named joints of the guess are set to the wanted \
         solution's own values, the most that choosing a “range” can give; the others stay at the regular start. \
         Shares are of the guesses that converge.</p><div class=\"scroll\"><table><thead><tr><th>guess</th>\
         <th>converged</th><th>shoulder<br>as wanted</th><th>elbow<br>as wanted</th><th>wrist<br>as wanted</th>\
         <th>branch<br>as wanted</th></tr></thead><tbody>",
        report.convergence.steering_trials
    )?;
    for row in &report.convergence.steering {
        writeln!(
            out,
            "<tr><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td></tr>",
            row.guess,
            percent(row.converged),
            percent(row.wanted_shoulder),
            percent(row.wanted_elbow),
            percent(row.wanted_wrist),
            percent(row.wanted_configuration)
        )?;
    }
    out.write_str("</tbody></table></div>")?;
    let with = |guess: &str| {
        let mut rows = report.convergence.steering.iter();
        rows.find(|row| row.guess == guess)
    };
    if let (Some(q1), Some(q2), Some(near)) = (
        with("q1 as wanted"),
        with("q2 as wanted"),
        with("all six within 0.5 rad"),
    ) {
        writeln!(
            out,
            "<p class=\"key\">The paper sets q<sub>2</sub> to choose the elbow and q<sub>1</sub> to choose the \
             shoulder. Setting q<sub>2</sub> gives the wanted elbow in {} of cases and setting q<sub>1</sub> the wanted \
             shoulder in {}: hardly more than a coin does. A guess that is near in every joint gives the wanted \
             branch in {}.</p>",
            percent(q2.wanted_elbow),
            percent(q1.wanted_shoulder),
            percent(near.wanted_configuration)
        )?;
    }
    Ok(())
}
