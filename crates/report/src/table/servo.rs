//! The servo's data sheet as text.

use std::fmt::Write;

use needlebench_bench::servo::experiment::JointResponse;
use needlebench_bench::servo::{JointReport, ServoReport};
use needlebench_show::number::rounded;
use needlebench_show::plain_table;

/// The whole report.
pub fn text(report: &ServoReport) -> String {
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
    let margins = &report.margins;
    let _ = writeln!(
        out,
        "{}: spectral radius {:.4} per step (all joints, sampled); stable up to {} these gains, or \
         for steps {}\n",
        if margins.spectral_radius < 1.0 {
            "STABLE"
        } else {
            "UNSTABLE"
        },
        margins.spectral_radius,
        margins
            .gain_factor
            .map_or("1000 times".to_owned(), |factor| format!(
                "{factor:.2} times"
            )),
        margins
            .timestep_s
            .map_or("of any length".to_owned(), |step_s| {
                format!("up to {:.3} ms", step_s * 1e3)
            })
    );
    let mut table = plain_table(&[
        "joint",
        "inertia (kg m^2)",
        "natural (Hz)",
        "damping",
        "bandwidth (Hz)",
        "gain margin\n(alone)",
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
        "saturated",
        "linear-loop deviation",
        "gain deviation (dB)",
        "phase deviation (deg)",
    ]);
    for joint in &report.joints {
        for response in &joint.responses {
            for row in rows(joint, response) {
                table.add_row(row);
            }
        }
    }
    let _ = writeln!(out, "{table}\n");
    let mut table = plain_table(&[
        "setting",
        "unit",
        "value, shoulder pan to wrist 3",
        "source",
    ]);
    for setting in &report.settings {
        // Standard gravity has five.
        let decimals = if setting.unit == "m/s^2" { 5 } else { 4 };
        let values: Vec<String> = setting
            .values
            .iter()
            .map(|value| rounded(*value, decimals))
            .collect();
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
                response.engine.to_owned(),
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
        let gain_db = 20.0 * libm::log10(point.gain / point.linear_gain);
        let turned = point.phase_rad - point.linear_phase_rad;
        let phase_deg = needlebench_kinematics::ik::wrap_angle(turned).to_degrees();
        worst = (worst.0.max(gain_db.abs()), worst.1.max(phase_deg.abs()));
    }
    worst
}
