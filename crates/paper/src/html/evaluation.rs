//! The page's part on the evaluation: accuracy, time, Figure 6.

use std::fmt::Write;

use crate::PaperReport;
use crate::accuracy::Source as AccuracySource;
use crate::free_space::Region;
use crate::text::time_of;
use crate::timing::Source as TimeSource;
use needlebench_report::chart::{Axis, DotMark, DotRow, Marker, Paint, dot_plot};
use needlebench_report::number::{duration, power_of_ten, short};
use needlebench_report::page::document::png_address;
use quick_xml::escape::escape;

pub(super) fn accuracy(out: &mut String, report: &PaperReport) -> std::fmt::Result {
    out.write_str(
        "<h2 id=\"accuracy\">Accuracy</h2><p>The paper gives a largest absolute error of 0.2·10⁻⁷ for \
         the closed form and 0.6·10⁻⁷ for the numerical method, and concludes that the closed form is \
         more accurate. In double precision both end at rounding, eight to nine orders lower. Errors of 10⁻⁷ \
         are what <em>single</em> precision gives: its unit of rounding is 6·10⁻⁸.</p>",
    )?;
    let rows: Vec<DotRow> = report
        .accuracy
        .iter()
        .map(|row| {
            let paint = Paint::Series(match row.source {
                AccuracySource::ThisRun => 0,
                AccuracySource::Paper => 1,
                AccuracySource::Robot => 2,
                AccuracySource::Limit => 4,
            });
            let mark = |value: f64, marker, what: &str| DotMark {
                paint,
                marker,
                value,
                up_to: None,
                tip: format!("{}, {what}: {}", row.name, short(value)),
            };
            let mut marks = Vec::new();
            marks.extend(
                row.stated
                    .map(|value| mark(value, Marker::Diamond, "stated")),
            );
            marks.extend(
                row.position_median_m
                    .map(|value| mark(value, Marker::Disc, "median, m")),
            );
            marks.extend(
                row.position_max_m
                    .map(|value| mark(value, Marker::Square, "largest, m")),
            );
            DotRow {
                label: row.name.to_owned(),
                marks,
            }
        })
        .collect();
    let legend = [
        (Paint::Series(0), Marker::Disc, "median"),
        (Paint::Series(0), Marker::Square, "largest"),
        (Paint::Series(1), Marker::Diamond, "stated"),
    ];
    writeln!(
        out,
        "<figure>{}<figcaption>Position error over random poses, all solutions. Blue: this run; grey: \
         limits of rounding; orange: the paper; green: the robot.</figcaption></figure>",
        dot_plot(
            "Position errors",
            &rows,
            Axis::decades("position error (m)", [-18, 0], 3, power_of_ten),
            &legend
        )
        .to_inline_svg()
    )?;
    out.write_str(
        "<div class=\"scroll\"><table><thead><tr><th>what</th><th>position<br>median (m)</th>\
         <th>largest</th><th>orientation<br>median</th><th>largest</th><th>stated</th><th>samples</th>\
         <th class=\"wrap\">remark</th></tr></thead><tbody>",
    )?;
    let cell = |value: Option<f64>| value.map_or_else(String::new, short);
    for row in &report.accuracy {
        writeln!(
            out,
            "<tr><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td>\
             <td class=\"wrap\">{}</td></tr>",
            row.name,
            cell(row.position_median_m),
            cell(row.position_max_m),
            cell(row.orientation_median),
            cell(row.orientation_max),
            cell(row.stated),
            row.samples
                .map_or_else(String::new, |count| count.to_string()),
            row.remark
        )?;
    }
    out.write_str(
        "</tbody></table></div><p class=\"key\">None of this reaches the needle: the arm repeats a pose to \
         ±0.1 mm, some five thousand times the paper's 0.2·10⁻⁷ m. What matters there is whether the \
         robot is calibrated, not which method solved it.</p>\n",
    )
}

pub(super) fn time(out: &mut String, report: &PaperReport) -> std::fmt::Result {
    let timings = &report.timings;
    writeln!(
        out,
        "<h2 id=\"time\">Time</h2><p>One pose, measured on {}, one core{}; medians. Published solvers were \
         measured on another machine: all solutions of 100 000 random poses for the closed forms, random \
         starts to 10⁻⁶ for the numerical ones.</p>",
        escape(timings.cpu.as_deref().unwrap_or("an unnamed processor")),
        if timings.optimised_build {
            ""
        } else {
            " (a debug build: slower than it has to be)"
        }
    )?;
    for (numerical, name) in [
        (false, "Closed form, all solutions"),
        (true, "Numerical, one solution"),
    ] {
        let rows: Vec<DotRow> = timings
            .rows
            .iter()
            .filter(|row| row.numerical == numerical)
            .map(|row| {
                let (series, marker) = match row.source {
                    TimeSource::ThisRun => (0, Marker::Disc),
                    TimeSource::Paper => (1, Marker::Diamond),
                    TimeSource::Peer => (4, Marker::Square),
                };
                DotRow {
                    label: row.name.to_owned(),
                    marks: vec![DotMark {
                        paint: Paint::Series(series),
                        marker,
                        value: row.time_s * 1e9,
                        up_to: row.up_to_s.map(|up_to_s| up_to_s * 1e9),
                        tip: format!("{}: {}", row.name, time_of(row)),
                    }],
                }
            })
            .collect();
        let legend = [
            (Paint::Series(1), Marker::Diamond, "paper"),
            (Paint::Series(0), Marker::Disc, "this run"),
            (Paint::Series(4), Marker::Square, "recorded elsewhere"),
        ];
        writeln!(
            out,
            "<figure>{}<figcaption>{name}.</figcaption></figure>",
            dot_plot(
                name,
                &rows,
                Axis::decades("time of one pose (ns)", [1, 8], 1, power_of_ten),
                &legend
            )
            .to_inline_svg()
        )?;
    }
    out.write_str(
        "<div class=\"scroll\"><table><thead><tr><th>what</th><th>time</th><th>least</th>\
         <th>90th percentile</th><th>repetitions × poses</th></tr></thead><tbody>",
    )?;
    let cell = |value: Option<f64>| value.map_or_else(String::new, duration);
    for row in &timings.rows {
        let repetitions = row.repetitions.zip(row.poses_per_repetition).map_or_else(
            || "published".to_owned(),
            |(times, poses)| format!("{times} × {poses}"),
        );
        writeln!(
            out,
            "<tr><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{repetitions}</td></tr>",
            row.name,
            time_of(row),
            cell(row.least_s),
            cell(row.p90_s)
        )?;
    }
    out.write_str("</tbody></table></div>\n")
}

pub(super) fn free_space(
    out: &mut String,
    report: &PaperReport,
    pictures: &[(String, Vec<u8>)],
) -> std::fmt::Result {
    let space = &report.free_space;
    writeln!(
        out,
        "<h2 id=\"figure6\">Figure 6: where each configuration leaves room</h2><p>The shipped UR3 and needle guide \
         at the pose of Table 3, patient lying across in front of the robot, head towards the base's +x. A point is \
         taken if it is within {:.0} mm of arm or tool. The box reaches {:.1} m either way from the guide's exit and \
         {:.1} m up from the base plane; regions are its parts on one side of the guide's exit, “above” what is higher \
         than the guide's entry. Green: room that this configuration leaves and at least half of the others \
         take.</p>",
        space.margin_m * 1e3,
        space.box_half_width_m,
        space.box_height_m
    )?;
    if !pictures.is_empty() {
        out.write_str("<div class=\"pictures\">")?;
        for (each, (_, bytes)) in space.configurations.iter().zip(pictures) {
            writeln!(
                out,
                "<figure><img alt=\"UR3 in configuration {0}\" src=\"{1}\">\
                 <figcaption><b>{0}</b> (6{2}): elbow {3:+.2} m, room at {4}</figcaption></figure>",
                each.label,
                png_address(bytes),
                each.figure_6,
                each.elbow_m,
                each.room()
            )?;
        }
        out.write_str("</div>")?;
    }
    out.write_str(
        "<div class=\"scroll\"><table><caption>Heights over the base plane (m); free share of each region (%), \
         and in grey the volume gained (litres)</caption><thead><tr><th>configuration</th><th>elbow</th>\
         <th>lowest<br>joint</th><th>surface<br>from</th><th>to</th>",
    )?;
    for region in Region::ALL {
        write!(out, "<th>{}</th>", region.name())?;
    }
    out.write_str("<th class=\"left\">room is left</th></tr></thead><tbody>")?;
    for each in &space.configurations {
        write!(
            out,
            "<tr><td>{}</td><td>{:+.3}</td><td>{:+.3}</td><td>{:+.3}</td><td>{:+.3}</td>",
            each.label,
            each.elbow_m,
            each.lowest_joint_m,
            each.lowest_surface_m,
            each.highest_surface_m
        )?;
        for region in Region::ALL {
            write!(
                out,
                "<td>{:.1}<span class=\"remark\">{:.1}</span></td>",
                each.free[&region] * 100.0,
                each.gained_m3[&region] * 1e3
            )?;
        }
        writeln!(out, "<td class=\"left\">{}</td></tr>", each.room())?;
    }
    writeln!(
        out,
        "</tbody></table></div><p>In two configurations the elbow's axis lies below the base plane: a table top \
         under the base would be hit.</p><h3>Roll about the needle</h3><p>{}</p><div class=\"scroll\"><table><thead>\
         <tr><th>guide</th><th>fewest solutions</th><th>most</th><th>lowest joint, worst (m)</th><th>best (m)</th>\
         <th>joints 1 to 5 move by (rad)</th></tr></thead><tbody>",
        space.roll_remark
    )?;
    for roll in &space.roll {
        writeln!(
            out,
            "<tr><td>{}</td><td>{}</td><td>{}</td><td>{:+.3}</td><td>{:+.3}</td><td>{}</td></tr>",
            escape(&roll.tool),
            roll.fewest_solutions,
            roll.most_solutions,
            roll.lowest_joint_worst_m,
            roll.lowest_joint_best_m,
            short(roll.other_joints_move_rad)
        )?;
    }
    out.write_str("</tbody></table></div>\n")
}
