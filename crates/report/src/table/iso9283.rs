//! A test by ISO 9283 as text.

use std::fmt::Write;

use needlebench_evaluation::iso9283::{Iso9283Report, StabilisationReport};
use needlebench_iso9283::{Drift, MeasuredReport, ProtocolStatistics};
use needlebench_show::number::{LengthUnit, small_length_or_zero, unit_of_length};
use needlebench_show::{CellAlignment, plain_table};

/// What a run prints of its test.
pub fn report_text(report: &Iso9283Report) -> String {
    let mut text = String::new();
    // Writing to a String cannot fail.
    let _ = write_report(&mut text, report);
    text
}

fn write_report(out: &mut String, report: &Iso9283Report) -> std::fmt::Result {
    let protocol = &report.protocol;
    writeln!(
        out,
        "\nISO 9283 in {}: load {} kg, {:.0} % of the rated speed, {} cycles of {:.2} s",
        protocol.configuration,
        protocol.load_kg,
        100.0 * protocol.speed_share,
        protocol.cycles,
        protocol.cycle_s
    )?;
    for (engine, measured) in &report.engines {
        let effort = &measured.effort;
        writeln!(
            out,
            "{engine}: {} cycles simulated, torque up to {:.0} % and joint speed up to {:.0} % of \
             their limits{}",
            measured.cycles_simulated,
            100.0 * effort.peak_torque_ratio,
            100.0 * effort.peak_speed_ratio,
            if effort.saturated_steps > 0 {
                format!(", torque saturated in {} steps", effort.saturated_steps)
            } else {
                String::new()
            }
        )?;
        out.push_str(&statistics_text(
            &measured.statistics,
            &measured.stabilisation,
            measured.drift.as_ref(),
        ));
        if let Some(remark) = &measured.remark {
            writeln!(out, "{remark}")?;
        }
    }
    if let Some(difference) = report.engine_difference {
        writeln!(
            out,
            "engine difference: at most {} in motion, {} in attained positions",
            small_length_or_zero(difference.peak_tip_m),
            small_length_or_zero(difference.settled_tip_m)
        )?;
    }
    Ok(())
}

/// What the analysis of a tracker's log prints.
pub fn measured_text(report: &MeasuredReport) -> String {
    let mut text = format!(
        "ISO 9283: {} compared with {}\n",
        report.log, report.commanded
    );
    if let Some(fit) = &report.frame_fit {
        let [x, y, z] = fit.position_m.map(|metres| metres * 1e3);
        let angle_deg = fit
            .rotvec_rad
            .iter()
            .map(|each| each * each)
            .sum::<f64>()
            .sqrt();
        let _ = writeln!(
            text,
            "tracker's frame fitted to {} poses: at ({x:.3}, {y:.3}, {z:.3}) mm in base, turned by \
             {:.4} deg; {} rms left",
            fit.poses,
            angle_deg.to_degrees(),
            small_length_or_zero(fit.residual_rms_m)
        );
    }
    text.push_str(&statistics_text(
        &report.statistics,
        &[],
        report.drift.as_ref(),
    ));
    for note in &report.notes {
        let _ = writeln!(text, "note: {note}");
    }
    text
}

/// The unit that all lengths of a table have, so that a column can be read down.
fn shared_unit(
    statistics: &ProtocolStatistics,
    stabilisation: &[StabilisationReport],
) -> LengthUnit {
    let poses = statistics.poses.iter();
    let lengths = poses.flat_map(|each| [each.ap_m, each.rp_m]);
    let overshoots = stabilisation.iter().filter_map(|each| each.overshoot_m);
    unit_of_length(lengths.chain(overshoots).fold(0.0, f64::max))
}

/// AP, RP, vAP, stabilisation and drift as tables and lines.
fn statistics_text(
    statistics: &ProtocolStatistics,
    stabilisation: &[StabilisationReport],
    drift: Option<&Drift>,
) -> String {
    let unit = shared_unit(statistics, stabilisation);
    let headed = |name: &str| format!("{name}\n({})", unit.name);
    // No minus before what rounds to zero.
    let text = |metres: f64| format!("{:.2}", metres * unit.per_metre).replace("-0.00", "0.00");
    let (ap, mean, rp, overshoot) = (
        headed("AP"),
        format!("mean minus command\nx, y, z ({})", unit.name),
        headed("RP"),
        headed("overshoot"),
    );
    let mut table = plain_table(&[
        "pose",
        "n",
        &ap,
        &mean,
        &rp,
        "AP a, b, c\n(mdeg)",
        "RP a, b, c\n(mdeg)",
        "stabilisation\n(s)",
        "after motion\n(s)",
        &overshoot,
    ]);
    for each in &statistics.poses {
        let settled = stabilisation.iter().find(|found| found.pose == each.pose);
        let seconds =
            |value: Option<f64>| value.map_or("-".to_owned(), |value| format!("{value:.3}"));
        let angles = |value: Option<[f64; 3]>| {
            value.map_or("-".to_owned(), |value| {
                value
                    // No minus before what rounds to zero.
                    .map(|rad| format!("{:.2}", rad.to_degrees() * 1e3).replace("-0.00", "0.00"))
                    .join(", ")
            })
        };
        table.add_row([
            format!("P{}", each.pose),
            each.count.to_string(),
            text(each.ap_m),
            each.ap_xyz_m.map(text).join(", "),
            text(each.rp_m),
            angles(each.angles.map(|angles| angles.ap_rad)),
            angles(each.angles.map(|angles| angles.rp_rad)),
            seconds(settled.and_then(|each| each.time_s)),
            seconds(settled.and_then(|each| each.after_motion_s)),
            settled
                .and_then(|each| each.overshoot_m)
                .map_or("-".to_owned(), |metres| {
                    if metres == 0.0 {
                        "none".to_owned()
                    } else {
                        text(metres)
                    }
                }),
        ]);
    }
    for column in table.column_iter_mut().skip(1) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    let mut text = format!("{table}\n");
    for each in &statistics.directional {
        let _ = writeln!(
            text,
            "vAP at P{}: {} between approaches along {} and {}, {} of each",
            each.pose,
            small_length_or_zero(each.vap_m),
            each.between[0],
            each.between[1],
            each.count.iter().min().unwrap_or(&0)
        );
    }
    if let Some(drift) = drift {
        let _ = writeln!(
            text,
            "drift at P{} over {} blocks of ten cycles: AP {}, RP {}",
            drift.pose,
            drift.blocks.len(),
            small_length_or_zero(drift.dap_m),
            small_length_or_zero(drift.drp_m)
        );
    }
    text
}
