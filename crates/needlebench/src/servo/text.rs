//! The servo's data sheet as text, and its courses as CSV.

use std::fmt::Write;

use needlebench_kinematics::JOINT_LABELS;

use super::experiment::{Course, JointResponse};
use super::{JointReport, ServoReport};
use crate::output::plain_table;

/// The whole report.
pub(crate) fn text(report: &ServoReport) -> String {
    let mut out = String::new();
    let posture: Vec<String> = report
        .posture_rad
        .iter()
        .map(|q| format!("{q:.4}"))
        .collect();
    let _ = writeln!(
        out,
        "servo of {} at {}: {} rad, step {} ms\n",
        report.scenario,
        report.posture,
        posture.join(", "),
        report.timestep_s * 1e3
    );
    let mut table = plain_table(&[
        "setting",
        "unit",
        "value, shoulder pan to wrist 3",
        "source",
    ]);
    for setting in &report.settings {
        let values: Vec<String> = setting.values.iter().map(|value| short(*value)).collect();
        let same = values.iter().all(|value| *value == values[0]);
        table.add_row([
            setting.name.to_owned(),
            setting.unit.to_owned(),
            if same {
                values[0].clone()
            } else {
                values.join(", ")
            },
            setting.source.clone(),
        ]);
    }
    let _ = writeln!(out, "{table}\n");
    let margins = &report.margins;
    let _ = writeln!(
        out,
        "all joints together: the slowest motion shrinks to {:.4} in a step; stable up to {} these \
         gains, or steps {}",
        margins.spectral_radius,
        margins
            .gain_factor
            .map_or("1000 times".to_owned(), |factor| format!(
                "{factor:.2} times"
            )),
        margins
            .timestep_s
            .map_or("without bound".to_owned(), |step_s| {
                format!("up to {:.3} ms", step_s * 1e3)
            })
    );
    let mut table = plain_table(&[
        "joint",
        "inertia (kg m^2)",
        "natural (Hz)",
        "damping",
        "bandwidth (Hz)",
        "gain margin",
    ]);
    for joint in &report.joints {
        let closed = &joint.closed_loop;
        table.add_row([
            joint.joint.to_owned(),
            format!("{:.4}", closed.inertia_kgm2),
            format!("{:.2}", closed.natural_frequency_hz),
            format!("{:.3}", closed.damping_ratio),
            closed
                .bandwidth_hz
                .map_or("-".into(), |hz| format!("{hz:.2}")),
            format!("{:.2}", closed.gain_margin),
        ]);
    }
    let _ = writeln!(out, "{table}\n");
    let mut table = plain_table(&[
        "joint",
        "engine",
        "step (mrad)",
        "rise (ms)",
        "overshoot",
        "settled (ms)",
        "at the limit",
        "off the linear loop",
        "gain off by (dB)",
        "phase off by (deg)",
    ]);
    for joint in &report.joints {
        for response in &joint.responses {
            for row in rows(joint, response) {
                table.add_row(row);
            }
        }
    }
    let _ = write!(out, "{table}");
    out
}

fn rows(joint: &JointReport, response: &JointResponse) -> Vec<Vec<String>> {
    let milliseconds = |time_s: Option<f64>| {
        time_s.map_or_else(|| "-".to_owned(), |time_s| format!("{:.0}", time_s * 1e3))
    };
    let steps = [(&response.small_step, true), (&response.large_step, false)];
    steps
        .iter()
        .map(|(step, small)| {
            let [deviation, gain, phase] = if *small {
                let (gain_db, phase_deg) = worst_deviation(response);
                [
                    format!("{:.1e}", response.step_deviation),
                    format!("{gain_db:.1e}"),
                    format!("{phase_deg:.1e}"),
                ]
            } else {
                ["-", "-", "-"].map(str::to_owned)
            };
            vec![
                joint.joint.to_owned(),
                response.engine.clone(),
                format!("{:.1}", step.height_rad * 1e3),
                milliseconds(step.rise_time_s),
                format!("{:.1} %", 100.0 * step.overshoot),
                milliseconds(step.settling_time_s),
                if step.saturated_steps == 0 {
                    "never".to_owned()
                } else {
                    format!("{} steps", step.saturated_steps)
                },
                deviation,
                gain,
                phase,
            ]
        })
        .collect()
}

/// Largest difference of gain (dB) and phase (deg) from the linear closed loop.
pub(crate) fn worst_deviation(response: &JointResponse) -> (f64, f64) {
    let mut worst = (0.0_f64, 0.0_f64);
    for point in &response.frequencies {
        let gain_db = 20.0 * (point.gain / point.linear_gain).log10();
        let turned = point.phase_rad - point.linear_phase_rad;
        let phase_deg = needlebench_kinematics::ik::wrap_angle(turned).to_degrees();
        worst = (worst.0.max(gain_db.abs()), worst.1.max(phase_deg.abs()));
    }
    worst
}

fn short(value: f64) -> String {
    let text = format!("{value:.4}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

/// A course in all engines: time, set-point, then motion, torque and saturation per engine.
pub(crate) fn course_csv(
    joint: &JointReport,
    timestep_s: f64,
    which: impl Fn(&JointResponse) -> &Course,
) -> String {
    let mut csv = String::from("time_s,reference_rad");
    for JointResponse { engine, .. } in &joint.responses {
        let _ = write!(
            csv,
            ",{engine}_motion_rad,{engine}_torque_nm,{engine}_saturated"
        );
    }
    csv.push('\n');
    let courses: Vec<&Course> = joint.responses.iter().map(which).collect();
    let length = courses.first().map_or(0, |course| course.motion_rad.len());
    for step in 0..length {
        let reference = courses[0].reference_rad[step];
        let _ = write!(csv, "{:.6},{reference:.12}", step as f64 * timestep_s);
        for course in &courses {
            let _ = write!(csv, ",{:.12}", course.motion_rad[step]);
            // The last state has no step after it.
            match (course.torque_nm.get(step), course.saturated.get(step)) {
                (Some(torque), Some(cut)) => {
                    let _ = write!(csv, ",{torque:.9},{}", u8::from(*cut));
                }
                _ => csv.push_str(",,"),
            }
        }
        csv.push('\n');
    }
    csv
}

/// Gain and phase over frequency of all joints and engines.
pub(crate) fn frequency_csv(report: &ServoReport) -> String {
    let mut csv =
        String::from("joint,engine,frequency_hz,gain,phase_rad,linear_gain,linear_phase_rad\n");
    for joint in &report.joints {
        debug_assert!(JOINT_LABELS.contains(&joint.joint), "a joint's label");
        for response in &joint.responses {
            for point in &response.frequencies {
                let _ = writeln!(
                    csv,
                    "{},{},{:.6},{:.9},{:.9},{:.9},{:.9}",
                    joint.joint,
                    response.engine,
                    point.frequency_hz,
                    point.gain,
                    point.phase_rad,
                    point.linear_gain,
                    point.linear_phase_rad
                );
            }
        }
    }
    csv
}
