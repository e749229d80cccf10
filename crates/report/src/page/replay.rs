//! The page of a replay: tables and the chart; it needs no script to be read.

use std::fmt::Write;

use needlebench_bench::replay::ReplayReport;
use needlebench_evaluation::report::Verdict;
use needlebench_kinematics::JOINT_LABELS;
use needlebench_recorded::{Estimate, Tracking};
use needlebench_show::chart::Chart;
use needlebench_show::number::{rounded, value_and_limit};
use quick_xml::escape::escape;

use super::document::Document;
use crate::table::replay::{pose_errors, shown, small};

const STYLE: &str = concat!(
    include_str!("assets/page.css"),
    "\n.chart svg { width: 100%; min-width: 640px; height: auto; }\n\
     thead th.number { white-space: normal; min-width: 70px; max-width: 170px; }\n"
);

const CORE: &str = include_str!("assets/core.js");
/// Hints below boxes that scroll.
const HINTS: &str = "for (const box of document.querySelectorAll('.scroll')) NB.hint(box);\n\
                     document.documentElement.dataset.ready = 'true';\n";

/// The page of a recorded run.
pub(crate) fn replay_page(report: &ReplayReport, chart: Option<&Chart>) -> String {
    let mut out = String::new();
    // Writing to a text cannot fail.
    let _ = body(&mut out, report, chart);
    Document {
        title: &format!("{}: recorded run", report.log.source.file),
        style: STYLE,
        body: &out,
        scripts: &[CORE, HINTS],
    }
    .html()
}

fn body(out: &mut String, report: &ReplayReport, chart: Option<&Chart>) -> std::fmt::Result {
    let log = &report.log;
    let class = match report.verdict {
        Verdict::Pass => "good",
        Verdict::Fail | Verdict::Incomplete => "bad",
    };
    writeln!(
        out,
        "<main><header class=\"top\"><h1>{}</h1>",
        escape(&*log.source.file)
    )?;
    writeln!(
        out,
        "<p>Recorded run of {:.1} s ({} rows at {:.4} s) and its replay with a {} ({}).</p>",
        log.duration_s,
        log.source.rows,
        log.period_s,
        escape(&*report.arm.name),
        escape(&*report.arm.found)
    )?;
    if !report.criteria.is_empty() || !report.not_judged.is_empty() {
        writeln!(
            out,
            "<p><span class=\"chip {class}\">{}</span></p>",
            report.verdict.name()
        )?;
    }
    writeln!(out, "</header>")?;
    criteria(out, report)?;
    following(out, report)?;
    if let Some(chart) = chart {
        section(out, "Errors and torques over time", true)?;
        writeln!(
            out,
            "<div class=\"scrolled chart\"><div class=\"scroll\" tabindex=\"0\" role=\"region\" \
             aria-label=\"Errors and torques over time\">{}</div></div></details>",
            chart.to_inline_svg()
        )?;
    }
    calibration(out, report)?;
    identification(out, report)?;
    section(out, "Results and assumptions", true)?;
    writeln!(out, "<ul class=\"plain\">")?;
    for line in report.notes.iter().chain(&report.replayed) {
        writeln!(out, "<li>{}</li>", escape(&**line))?;
    }
    writeln!(out, "</ul></details>")?;
    section(out, "Provenance", false)?;
    let provenance = &report.provenance;
    writeln!(
        out,
        "<dl><dt>needlebench</dt><dd>{} ({})</dd><dt>log</dt><dd>{}, SHA-256 {}</dd>",
        escape(&*provenance.version),
        escape(&*provenance.git_revision),
        escape(&*log.source.file),
        escape(&*log.source.sha256)
    )?;
    for input in provenance
        .inputs
        .iter()
        .filter(|input| input.role != "scenario" || !input.file.is_empty())
    {
        writeln!(
            out,
            "<dt>{}</dt><dd>{}, SHA-256 {}</dd>",
            escape(input.role),
            escape(&*input.file),
            escape(&*input.sha256)
        )?;
    }
    writeln!(out, "</dl></details></main>")
}

fn section(out: &mut String, title: &str, open: bool) -> std::fmt::Result {
    let open = if open { " open" } else { "" };
    writeln!(
        out,
        "<details class=\"section\"{open}><summary><h2>{}</h2></summary>",
        escape(title)
    )
}

fn table(
    out: &mut String,
    header: &[&str],
    rows: impl IntoIterator<Item = Vec<String>>,
) -> std::fmt::Result {
    writeln!(
        out,
        "<div class=\"scrolled\"><div class=\"scroll\" tabindex=\"0\" role=\"region\" \
         aria-label=\"{}\"><table><thead><tr>",
        escape(header[0])
    )?;
    for (at, name) in header.iter().enumerate() {
        let class = if at > 0 { " class=\"number\"" } else { "" };
        writeln!(out, "<th scope=\"col\"{class}>{}</th>", escape(*name))?;
    }
    writeln!(out, "</tr></thead><tbody>")?;
    for row in rows {
        write!(out, "<tr>")?;
        for (at, cell) in row.iter().enumerate() {
            if at == 0 {
                write!(out, "<th scope=\"row\">{}</th>", escape(&**cell))?;
            } else {
                write!(out, "<td class=\"number\">{}</td>", escape(&**cell))?;
            }
        }
        writeln!(out, "</tr>")?;
    }
    writeln!(out, "</tbody></table></div></div>")
}

fn criteria(out: &mut String, report: &ReplayReport) -> std::fmt::Result {
    if report.criteria.is_empty() && report.not_judged.is_empty() {
        return Ok(());
    }
    section(out, "Criteria", true)?;
    let engine = |engine: &Option<String>| engine.clone().unwrap_or_else(|| "-".to_owned());
    let judged = report.criteria.iter().map(|result| {
        let of = |value: Option<f64>| value.unwrap_or(f64::NAN);
        let (value, limit) = value_and_limit(of(result.value), of(result.limit), result.unit);
        let verdict = if result.pass { "met" } else { "failed" };
        vec![
            result.criterion.clone(),
            engine(&result.engine),
            value,
            limit,
            verdict.to_owned(),
        ]
    });
    let open = report.not_judged.iter().map(|open| {
        let reason = format!("not evaluated: {}", open.reason);
        vec![
            open.criterion.clone(),
            engine(&open.engine),
            "-".to_owned(),
            "-".to_owned(),
            reason,
        ]
    });
    table(
        out,
        &["criterion", "engine", "value", "limit", "result"],
        judged.chain(open),
    )?;
    writeln!(out, "</details>")
}

fn following(out: &mut String, report: &ReplayReport) -> std::fmt::Result {
    let mut columns: Vec<(&str, &Tracking)> = Vec::new();
    columns.extend(report.real.as_ref().map(|real| ("real arm", real)));
    columns.extend(
        report
            .engines
            .iter()
            .map(|(name, replay)| (*name, &replay.tracking)),
    );
    if columns.is_empty() {
        return Ok(());
    }
    section(out, "Real arm and engines", true)?;
    let mut header = vec!["tracking of the set-points"];
    header.extend(columns.iter().map(|(name, _)| *name));
    let row = |name: String, of: &dyn Fn(&Tracking) -> String| {
        let mut cells = vec![name];
        cells.extend(columns.iter().map(|(_, tracking)| of(tracking)));
        cells
    };
    let millimetres =
        |value: Option<f64>| value.map_or("-".to_owned(), |value| rounded(value * 1e3, 4));
    let mut rows = vec![row("lag (ms)".to_owned(), &|each| {
        shown(&each.lag_of_all_s, 1e3)
    })];
    for (joint, label) in JOINT_LABELS.iter().enumerate() {
        rows.push(row(format!("{label}, RMS and maximum (mrad)"), &|each| {
            format!(
                "{}, {}",
                rounded(each.rms_rad[joint] * 1e3, 3),
                rounded(each.largest_rad[joint] * 1e3, 3)
            )
        }));
    }
    rows.push(row(
        "tip 200 mm beyond the flange, RMS and maximum (mm)".to_owned(),
        &|each| {
            format!(
                "{}, {}",
                millimetres(Some(each.tip_rms_m)),
                millimetres(Some(each.tip_largest_m))
            )
        },
    ));
    rows.push(row(
        "the same tip at rest, RMS and maximum (mm)".to_owned(),
        &|each| {
            format!(
                "{}, {}",
                millimetres(each.standing_tip_rms_m),
                millimetres(each.standing_tip_largest_m)
            )
        },
    ));
    table(out, &header, rows)?;
    if !report.engines.is_empty() {
        let mut header = vec!["joint"];
        let names: Vec<String> = report
            .engines
            .keys()
            .flat_map(|name| {
                [
                    format!("{name}: torque minus target_moment, RMS (N m)"),
                    format!("{name}: current minus actual_current, RMS (A)"),
                ]
            })
            .collect();
        header.extend(names.iter().map(String::as_str));
        let rows = JOINT_LABELS.iter().enumerate().map(|(joint, label)| {
            let mut cells = vec![(*label).to_owned()];
            for replay in report.engines.values() {
                let torque = replay.torque_rms_nm.map(|rms| rounded(rms[joint], 4));
                let current = replay.current_rms_a[joint].map(|rms| rounded(rms, 3));
                cells.extend([torque, current].map(|cell| cell.unwrap_or_else(|| "-".to_owned())));
            }
            cells
        });
        table(out, &header, rows)?;
    }
    writeln!(out, "</details>")
}

fn calibration(out: &mut String, report: &ReplayReport) -> std::fmt::Result {
    let Some(fit) = &report.calibration else {
        return Ok(());
    };
    section(out, "Calibration", true)?;
    writeln!(
        out,
        "<p>{}, by the error on held-out poses.</p>",
        if fit.is_worth { "Accepted" } else { "Rejected" }
    )?;
    let rows = pose_errors(fit).map(|(name, error)| {
        vec![
            name.to_owned(),
            small(error.rms_m * 1e3),
            small(error.largest_m * 1e3),
            small(error.rms_rad * 1e3),
        ]
    });
    table(
        out,
        &[
            "poses of the tool point",
            "RMS (mm)",
            "maximum (mm)",
            "RMS (mrad)",
        ],
        rows,
    )?;
    let number = |value: f64, half: Option<f64>| {
        half.map_or("-".to_owned(), |half| {
            let estimate = Estimate {
                value: Some(value),
                half_width: Some(half),
                identifiable: true,
            };
            shown(&estimate, 1e3)
        })
    };
    let rows = fit.links.iter().map(|link| {
        let mut cells = vec![link.link.to_owned()];
        cells.extend((0..3).map(|k| number(link.shift_m[k], link.shift_half_width_m[k])));
        cells.extend((0..3).map(|k| number(link.turn_rad[k], link.turn_half_width_rad[k])));
        cells
    });
    let header = [
        "origin minus nominal",
        "x (mm)",
        "y (mm)",
        "z (mm)",
        "about x (mrad)",
        "about y (mrad)",
        "about z (mrad)",
    ];
    table(out, &header, rows)?;
    writeln!(
        out,
        "<p class=\"soft\">-: not identifiable from these poses, such as a shift along an axis of \
         rotation.</p></details>"
    )
}

fn identification(out: &mut String, report: &ReplayReport) -> std::fmt::Result {
    let found = &report.identification;
    if found.controller.is_none() && found.current.is_none() && found.measured.is_none() {
        return Ok(());
    }
    section(out, "Identification", true)?;
    writeln!(
        out,
        "<p class=\"soft\">+-: half-width of the 95 % CI; in parentheses: not identified well enough by this \
         run to be used.</p>"
    )?;
    if let Some(fit) = &found.controller {
        writeln!(
            out,
            "<h3>Controller model, from target_moment</h3><p>Gravity {} m/s\u{b2}; links {}.</p>",
            escape(shown(&fit.gravity_m_s2, 1.0)),
            if fit.has_tensors {
                "with their inertia tensors"
            } else {
                "as points at their centres of mass"
            }
        )?;
        let rows = JOINT_LABELS.iter().enumerate().map(|(joint, label)| {
            vec![
                (*label).to_owned(),
                shown(&fit.rotor_inertia_kgm2[joint], 1.0),
                rounded(fit.rms_nm[joint], 5),
                rounded(fit.held_out_rms_nm[joint], 5),
            ]
        });
        table(
            out,
            &[
                "joint",
                "rotor (kg m\u{b2})",
                "residual, RMS (N m)",
                "held out, RMS (N m)",
            ],
            rows,
        )?;
        loads(out, &fit.loads)?;
    }
    if let Some(law) = &found.current {
        writeln!(out, "<h3>Currents: {}</h3>", escape(law.of))?;
        let rows = JOINT_LABELS.iter().enumerate().map(|(joint, label)| {
            let drive = &law.joints[joint];
            vec![
                (*label).to_owned(),
                shown(&drive.torque_constant_nm_a, 1.0),
                shown(&drive.coulomb_nm, 1.0),
                shown(&drive.viscous_nms_rad, 1.0),
                rounded(drive.held_out_rms_a, 4),
                law.actual_rms_a
                    .map_or("-".to_owned(), |rms| rounded(rms[joint], 3)),
            ]
        });
        let header = [
            "joint",
            "torque constant (N m/A)",
            "Coulomb friction (N m)",
            "viscous friction (N m s/rad)",
            "held out, RMS (A)",
            "measured current, RMS (A)",
        ];
        table(out, &header, rows)?;
    }
    if let Some(fit) = &found.measured {
        writeln!(out, "<h3>The arm, from {}</h3>", escape(&*fit.source))?;
        let rows = JOINT_LABELS.iter().enumerate().map(|(joint, label)| {
            vec![
                (*label).to_owned(),
                shown(&fit.rotor_inertia_kgm2[joint], 1.0),
                shown(&fit.coulomb_nm[joint], 1.0),
                shown(&fit.viscous_nms_rad[joint], 1.0),
                rounded(fit.held_out_rms_nm[joint], 3),
            ]
        });
        let header = [
            "joint",
            "rotor (kg m\u{b2})",
            "Coulomb friction (N m)",
            "viscous friction (N m s/rad)",
            "held out, RMS (N m)",
        ];
        table(out, &header, rows)?;
        loads(out, &fit.loads)?;
    }
    writeln!(out, "</details>")
}

fn loads(out: &mut String, loads: &[needlebench_recorded::IdentifiedLoad]) -> std::fmt::Result {
    let rows = loads.iter().map(|load| {
        let mut cells = vec![load.logged.map_or("not in the log".to_owned(), |logged| {
            let [x, y, z] = logged.centre_m.map(|each| rounded(each * 1e3, 2));
            format!("{} kg at ({x}, {y}, {z}) mm", logged.mass_kg)
        })];
        cells.push(shown(&load.mass_kg, 1.0));
        cells.extend(load.centre_m.iter().map(|centre| shown(centre, 1e3)));
        cells
    });
    table(
        out,
        &["load in the log", "mass (kg)", "x (mm)", "y (mm)", "z (mm)"],
        rows,
    )
}
