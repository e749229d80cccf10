//! Logs by the names of UR's real-time data exchange, as its recorder writes them.

use std::fmt::Write;

use needlebench_bench::RtdeLog;

/// A robot that runs.
const ROBOT_MODE: u32 = 7;
/// Nothing is stopped or reduced.
const SAFETY_MODE: u32 = 1;
/// A joint that runs.
const JOINT_MODE: u32 = 253;

/// A log as comma-separated values with the recorder's names: seconds, radians, N m, A, metres, kg; poses are
/// position and rotation vector of the flange in the controller's `base` frame. Columns of current are left out
/// where the arm's data have no torque constants.
///
/// Robot, safety and joint modes are those of an arm that runs, and the speed is not scaled.
pub(crate) fn rtde_csv(log: &RtdeLog) -> String {
    let has_currents = log
        .rows
        .first()
        .is_some_and(|row| row.target_current_a.is_some() && row.actual_current_a.is_some());
    let mut out = String::from("timestamp");
    for (name, is_there) in [
        ("target_q", true),
        ("target_qd", true),
        ("target_qdd", true),
        ("target_current", has_currents),
        ("target_moment", true),
        ("actual_q", true),
        ("actual_qd", true),
        ("actual_current", has_currents),
        ("actual_TCP_pose", true),
        ("target_TCP_pose", true),
    ] {
        for index in (0..6).filter(|_| is_there) {
            // Writing to a String cannot fail.
            let _ = write!(out, ",{name}_{index}");
        }
    }
    out.push_str(",robot_mode");
    for index in 0..6 {
        let _ = write!(out, ",joint_mode_{index}");
    }
    out.push_str(",safety_mode,speed_scaling,payload,payload_cog_0,payload_cog_1,payload_cog_2");
    for index in 0..6 {
        let _ = write!(out, ",payload_inertia_{index}");
    }
    out.push('\n');
    let mut end = format!(",{ROBOT_MODE}");
    for _ in 0..6 {
        let _ = write!(end, ",{JOINT_MODE}");
    }
    let _ = write!(end, ",{SAFETY_MODE},1,{}", number(log.payload_kg, 9));
    for value in log
        .payload_cog_m
        .into_iter()
        .chain(log.payload_inertia_kgm2)
    {
        let _ = write!(end, ",{}", number(value, 9));
    }
    for row in &log.rows {
        let _ = write!(out, "{:.6}", row.time_s);
        let currents = row.target_current_a.zip(row.actual_current_a);
        let currents = currents.filter(|_| has_currents);
        let parts = [
            Some((row.target.position.as_slice(), 10)),
            Some((row.target.velocity.as_slice(), 9)),
            Some((row.target.acceleration.as_slice(), 9)),
            currents.as_ref().map(|(target, _)| (target.as_slice(), 9)),
            Some((row.target_moment_nm.as_slice(), 9)),
            Some((row.actual_q.as_slice(), 10)),
            Some((row.actual_qd.as_slice(), 9)),
            currents.as_ref().map(|(_, actual)| (actual.as_slice(), 9)),
            Some((row.actual_tcp.as_slice(), 10)),
            Some((row.target_tcp.as_slice(), 10)),
        ];
        for (values, decimals) in parts.into_iter().flatten() {
            for value in values {
                out.push(',');
                out.push_str(&number(*value, decimals));
            }
        }
        out.push_str(&end);
        out.push('\n');
    }
    out
}

/// A number without zeros at its end.
fn number(value: f64, decimals: usize) -> String {
    let mut text = format!("{value:.decimals$}");
    text.truncate(text.trim_end_matches('0').trim_end_matches('.').len());
    if text == "-0" {
        text.remove(0);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_no_zeros_at_their_end() {
        for (value, text) in [
            (0.0, "0"),
            (-1e-12, "0"),
            (1.5, "1.5"),
            (-20.0, "-20"),
            (1.0 / 3.0, "0.333333333"),
        ] {
            assert_eq!(number(value, 9), text);
        }
    }
}
