//! Courses and frequency responses of a servo.

use std::fmt::Write;

use needlebench_bench::servo::experiment::{Course, JointResponse};
use needlebench_bench::servo::{JointReport, ServoReport};
use needlebench_kinematics::JOINT_LABELS;

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
