//! The page's part on the closed form: Table 3, equations, the solver as a whole.

use std::fmt::Write;

use super::markup::formula;
use crate::PaperReport;
use crate::equations::{EquationReport, Sample, Verdict};
use needlebench_report::chart::{Axis, Chart, DotMark, DotRow, Marker, Paint, bar_plot, dot_plot};
use needlebench_report::number::{percent, power_of_ten, short};
use quick_xml::escape::escape;

/// Exact zeros stand at the left end of logarithmic axes.
const LEAST_POWER: i32 = -18;

pub(super) fn table_3(out: &mut String, report: &PaperReport) -> std::fmt::Result {
    let table = &report.table_3;
    out.write_str(
        "<h2 id=\"table3\">Table 3 under its true labels</h2>\
         <p>All eight configurations of the pose that row 1 makes, from the corrected equations. A \
         printed row is the configuration whose joints it has, whatever it is called: the labels of \
         rows 3 to 6 are swapped. Printed values are shown wrapped to ±π; † marks values printed \
         outside the joints' range of ±2π.</p><div class=\"scroll\"><table><caption>Joint positions \
         in rad; second line: printed minus ours</caption><thead><tr><th>configuration</th>\
         <th>q<sub>1</sub></th><th>q<sub>2</sub></th><th>q<sub>3</sub></th><th>q<sub>4</sub></th>\
         <th>q<sub>5</sub></th><th>q<sub>6</sub></th><th>row</th><th class=\"left\">printed label</th>\
         <th>off the<br>printed pose</th><th>off the<br>exact pose</th></tr></thead><tbody>",
    )?;
    for row in &table.rows {
        write!(out, "<tr><td>{}</td>", row.label)?;
        for joint in 0..6 {
            let mark = if row.printed_outside_two_turns.contains(&(joint + 1)) {
                "†"
            } else {
                ""
            };
            write!(
                out,
                "<td>{:.6}<span class=\"remark\">{:.6}{mark}<br>{:+.1e}</span></td>",
                row.joints_rad[joint],
                row.printed_joints_wrapped_rad[joint],
                row.difference_rad[joint]
            )?;
        }
        let class = if row.label_is_right { "right" } else { "wrong" };
        let swapped = if row.label_is_right {
            ""
        } else {
            "<span class=\"remark\">swapped</span>"
        };
        writeln!(
            out,
            "<td>{}</td><td class=\"left {class}\">{}{swapped}</td><td>{} m<br>{} rad</td>\
             <td>{} m<br>{} rad</td></tr>",
            row.printed_row,
            row.printed_label,
            short(row.residual_to_printed_pose_m),
            short(row.residual_to_printed_pose_rad),
            short(row.residual_to_exact_pose_m),
            short(row.residual_to_exact_pose_rad),
        )?;
    }
    let pose = &table.pose;
    writeln!(
        out,
        "</tbody></table></div><p>The printed pose has four decimals. Its rotation matrix misses \
         orthonormality by {}, it is {} rad and {} m from the pose of row 1, and its nearest rotation moves \
         the joints by up to {} rad, the matrix as it stands by up to {} rad. The printed rotation vector agrees with it to {} rad.</p>",
        short(pose.orthonormality_defect),
        short(pose.angle_to_exact_rad),
        short(pose.distance_to_exact_m),
        short(pose.projection_moves_joints_rad),
        short(pose.unprojected_moves_joints_rad),
        short(pose.rotation_vector_difference_rad),
    )
}

fn verdict_class(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Right => "right",
        Verdict::NeedsAnother => "care",
        Verdict::Typo => "typo",
        Verdict::Wrong => "wrong",
    }
}

pub(super) fn equations(out: &mut String, report: &PaperReport) -> std::fmt::Result {
    let poses = report.solution_counts.poses;
    writeln!(
        out,
        "<h2 id=\"equations\">Equations 1 to 47</h2><p>Each equation as printed and as corrected, both \
         evaluated on {poses} random joint vectors (every joint uniform in ±π) and compared with \
         forward kinematics in double precision. An equation is tried on its own: what it builds on is \
         given correctly. A form fails where its error exceeds its bound.</p>"
    )?;
    writeln!(
        out,
        "<figure>{}<figcaption>Largest error of each equation over all postures, in the equation's \
         own unit (m, rad or 1). Where only the blue disc shows, both forms coincide.</figcaption></figure>",
        error_plot(&report.equations).to_inline_svg()
    )?;
    out.write_str(
        "<div class=\"scroll\"><table><caption>Errors: the largest, and below it the root mean square</caption>\
         <thead><tr><th>equation</th><th class=\"wrap\">as printed</th><th class=\"wrap\">as corrected</th>\
         <th class=\"left\">verdict</th><th>printed:<br>error</th><th>fails for</th><th>corrected:<br>error</th>\
         <th>bound</th><th>unit</th></tr></thead><tbody>",
    )?;
    for equation in &report.equations {
        let sample = match equation.sample {
            Sample::Random => "",
            Sample::WellConditioned => "well-conditioned postures",
            Sample::Singular => "singular postures",
        };
        let separator = if sample.is_empty() || equation.remark.is_empty() {
            ""
        } else {
            "; "
        };
        let undefined = if equation.printed.undefined > 0.0 {
            format!(
                "<span class=\"remark\">undefined for {}</span>",
                percent(equation.printed.undefined)
            )
        } else {
            String::new()
        };
        writeln!(
            out,
            "<tr><td>{}<span class=\"remark\">{}</span></td><td class=\"formula\">{}</td>\
             <td class=\"formula\">{}<span class=\"remark\">{}{separator}{sample}</span></td>\
             <td class=\"left {}\">{}</td><td>{}<span class=\"remark\">{}</span></td><td>{}{undefined}</td>\
             <td>{}<span class=\"remark\">{}</span></td><td>{}</td><td>{}</td></tr>",
            escape(equation.number),
            escape(equation.name),
            formula(equation.as_printed),
            formula(equation.as_corrected),
            formula(equation.remark),
            verdict_class(equation.verdict),
            equation.verdict.text(),
            short(equation.printed.max),
            short(equation.printed.rms),
            percent(equation.printed.failing),
            short(equation.corrected.max),
            short(equation.corrected.rms),
            short(equation.tolerance),
            equation.unit.symbol(),
        )?;
    }
    out.write_str("</tbody></table></div>")?;
    out.write_str("<p>Equation 45 with the derivative read as the difference R<sub>d</sub> − R<sub>0</sub>, worst axis: ")?;
    for (index, turn) in report.equation_45.iter().enumerate() {
        let separator = if index == 0 { "" } else { "; " };
        write!(
            out,
            "{separator}{:.1} % off at {:.0}°, where it can be as short as {} rad",
            turn.worst_relative_error * 100.0,
            turn.angle_rad.to_degrees(),
            short(turn.least_length_rad)
        )?;
    }
    writeln!(
        out,
        ": a false zero. With the d<sub>6</sub> of Table 1, row 1 of Table 3 misses its pose by {:.0} mm ({:.0} mm in one \
         coordinate); with positive lengths by {:.0} mm.</p>",
        report.table_3.pose.without_d6_m * 1e3,
        report.table_3.pose.without_d6_largest_coordinate_m * 1e3,
        report.table_3.pose.with_positive_lengths_m * 1e3
    )?;
    out.write_str(
        "<p class=\"key\">The arm has three singularities, of which the paper names \
         one. Their distances multiply to the determinant of the Jacobian: |sin q<sub>5</sub>| (wrist), \
         |sin q<sub>3</sub>| (elbow) and √(ρ² − d<sub>4</sub>²), the distance of the wrist's centre from \
         the plane through the shoulder's axis (shoulder).</p>\n",
    )
}

fn error_plot(equations: &[EquationReport]) -> Chart {
    let least = 10_f64.powi(LEAST_POWER);
    let rows: Vec<DotRow> = equations
        .iter()
        .map(|equation| {
            let mark = |series, marker, value: f64, form: &str| DotMark {
                paint: Paint::Series(series),
                marker,
                value: if value == 0.0 { least } else { value },
                up_to: None,
                tip: format!(
                    "{} {form}: {} {}",
                    equation.number,
                    short(value),
                    equation.unit.symbol()
                ),
            };
            DotRow {
                label: format!("{} · {}", equation.number, equation.name),
                marks: vec![
                    mark(1, Marker::Square, equation.printed.max, "as printed"),
                    mark(0, Marker::Disc, equation.corrected.max, "as corrected"),
                ],
            }
        })
        .collect();
    let axis = Axis::decades(
        "largest error (m, rad or 1; exact zeros at the left end)",
        [LEAST_POWER, 3],
        3,
        power_of_ten,
    );
    let legend = [
        (Paint::Series(1), Marker::Square, "as printed"),
        (Paint::Series(0), Marker::Disc, "as corrected"),
    ];
    dot_plot(
        "Largest error of each equation, printed and corrected",
        &rows,
        axis,
        &legend,
    )
}

pub(super) fn solver(out: &mut String, report: &PaperReport) -> std::fmt::Result {
    out.write_str("<h2 id=\"solver\">The closed form as a whole</h2><div class=\"pair\">")?;
    let groups: Vec<(String, Vec<f64>)> = report
        .solver_variants
        .iter()
        .map(|variant| {
            let label = variant.name.replace(" and ", "\nand ").replace(", ", ",\n");
            (label.replace(" mended", "\nmended"), vec![variant.right])
        })
        .collect();
    let series = [(Paint::Series(0), Marker::Square, "right")];
    writeln!(
        out,
        "<figure>{}<figcaption>Share of returned joint vectors that reproduce the pose.</figcaption></figure>",
        bar_plot(
            "Share of right answers by variant",
            &groups,
            &series,
            "",
            Axis::percent("answers that are right (%)", 1.0)
        )
        .to_inline_svg()
    )?;
    let counts = &report.solution_counts;
    let groups: Vec<(String, Vec<f64>)> = [0, 2, 4, 6, 8]
        .map(|count| {
            let share = counts.share_by_count.get(&count).copied().unwrap_or(0.0);
            (format!("{count}\n{}", percent(share)), vec![share])
        })
        .into();
    writeln!(
        out,
        "<figure>{}<figcaption>Eight solutions are a maximum: how many a random reachable pose has; {:.2} \
         on average.</figcaption></figure></div>",
        bar_plot(
            "Number of solutions of random poses",
            &groups,
            &[(Paint::Series(2), Marker::Square, "poses")],
            "solutions of a pose",
            Axis::percent("poses (%)", 1.0)
        )
        .to_inline_svg(),
        counts.mean
    )?;
    out.write_str(
        "<div class=\"scroll\"><table><thead><tr><th>variant</th><th>answers</th><th>right</th>\
         <th>poses for which the joints that made it are found</th></tr></thead><tbody>",
    )?;
    for variant in &report.solver_variants {
        writeln!(
            out,
            "<tr><td>{}</td><td>{}</td><td>{}</td><td>{}</td></tr>",
            escape(variant.name),
            variant.returned,
            percent(variant.right),
            percent(variant.finds_the_joints)
        )?;
    }
    out.write_str(
        "</tbody></table></div><p>With the sign of r<sub>1</sub> kept, the mirror of equation 37 and the \
         indices of equation 36 are no longer needed, and every answer is right.</p>\n",
    )
}
