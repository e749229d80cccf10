//! Largest joint values, speeds, accelerations and torques of a motion, beside their limits.

use needlebench_evaluation::judged::PeakReport;
use needlebench_evaluation::report::CriterionResult;
use needlebench_kinematics::trajectory::JointTrajectory;
use needlebench_kinematics::{JOINT_COUNT, JOINT_LABELS, Joints};
use needlebench_scenario::ResolvedScenario;

use super::set_point_period_s;

/// Time between two looks at a motion, s, at most.
const LOOK_S: f64 = 2e-3;

/// Time between two set-points of a controller of which the arm's data do not say it, s: the e-Series'.
const PERIOD_S: f64 = 2e-3;

/// Differences that rounding makes, relative to the limit.
const ROUNDING: f64 = 1e-9;

/// By how much curves through the points of a motion at its limit overshoot the acceleration, relative: cubics through
/// set-points every 20 ms of planned motions do so by 1 %.
const OVERSHOOT: f64 = 0.02;

/// One quantity of one joint at one time.
#[derive(Debug, Clone, Copy)]
struct Peak {
    joint: usize,
    value: f64,
    limit: f64,
    time_s: f64,
}

impl Peak {
    fn ratio(&self) -> f64 {
        self.value.abs() / self.limit
    }
}

/// The peak of each quantity along a motion, from `times_s` (ascending, of its points) and at least every 2 ms between.
///
/// Velocities at the two sides of a point may differ; the jump counts as an acceleration over the time between two
/// set-points of the arm's controller, and so does motion at the ends, before and after which the arm stands. The limit of
/// accelerations is that of the scenario's `[motion]` and 2 % for curves that overshoot between points. Torques are those
/// of the rigid arm with its tool and its rotors, without friction.
pub(crate) fn peaks(
    resolved: &ResolvedScenario,
    motion: &JointTrajectory,
    points_s: &[f64],
    begins_s: f64,
) -> Vec<PeakReport> {
    let limits = &resolved.cell.robot.limits;
    let (speeds, torques) = (limits.velocities_rad_s(), limits.efforts_nm());
    let accelerations = resolved.motion.acceleration * (1.0 + OVERSHOOT);
    let period_s = set_point_period_s(resolved).unwrap_or(PERIOD_S);
    let dynamics = resolved.cell.dynamics();
    let mut least: Option<(f64, Peak)> = None;
    let [mut speed, mut acceleration, mut torque]: [Option<Peak>; 3] = [None; 3];
    let note = |peak: &mut Option<Peak>, values: &Joints, limits: &Joints, time_s: f64| {
        for joint in 0..JOINT_COUNT {
            let found = Peak {
                joint,
                value: values[joint],
                limit: limits[joint],
                time_s,
            };
            if peak.is_none_or(|known| found.ratio() > known.ratio()) {
                *peak = Some(found);
            }
        }
    };
    let duration_s = motion.duration_s();
    let mut before = Joints::zeros();
    for (time_s, is_point) in times_s(points_s, duration_s) {
        let state = motion.sample(time_s);
        for joint in 0..JOINT_COUNT {
            let (position, limit) = (state.position[joint], limits.0[joint]);
            for (margin, limit_rad) in [
                (position - limit.lower_rad, limit.lower_rad),
                (limit.upper_rad - position, limit.upper_rad),
            ] {
                if least.is_none_or(|(known, _)| margin < known) {
                    let found = Peak {
                        joint,
                        value: position,
                        limit: limit_rad,
                        time_s,
                    };
                    least = Some((margin, found));
                }
            }
        }
        note(&mut speed, &state.velocity, &speeds, time_s);
        note(
            &mut acceleration,
            &state.acceleration,
            &accelerations,
            time_s,
        );
        let jump = (state.velocity - before) / period_s;
        if is_point {
            note(&mut acceleration, &jump, &accelerations, time_s);
        }
        let needed =
            dynamics.inverse_dynamics(&state.position, &state.velocity, &state.acceleration);
        note(&mut torque, &needed, &torques, time_s);
        before = state.velocity;
    }
    note(
        &mut acceleration,
        &(before / period_s),
        &accelerations,
        duration_s,
    );
    let report = |peak: Peak, criterion, unit, of| PeakReport {
        criterion,
        joint: JOINT_LABELS[peak.joint],
        value: peak.value,
        limit: peak.limit,
        unit,
        time_s: begins_s + peak.time_s,
        of,
    };
    let mut found = Vec::new();
    found.extend(least.map(|(_, peak)| report(peak, "joint_range", "rad", "range of the joint")));
    found.extend(speed.map(|peak| report(peak, "joint_speed", "rad/s", "speed of the joint")));
    found.extend(acceleration.map(|peak| {
        report(
            peak,
            "joint_acceleration",
            "rad/s^2",
            "motion.joint_acceleration_deg_s2 and 2 % for curves through points",
        )
    }));
    found.extend(torque.map(|peak| report(peak, "joint_torque", "N m", "torque of the joint")));
    found
}

/// A criterion for each peak.
pub(super) fn results(
    peaks: &[PeakReport],
    goal: &str,
    label: Option<&str>,
) -> Vec<CriterionResult> {
    let all = peaks.iter().map(|peak| CriterionResult {
        goal: goal.to_owned(),
        label: label.map(str::to_owned),
        engine: None,
        criterion: peak.criterion.to_owned(),
        value: Some(peak.value),
        limit: Some(peak.limit),
        unit: peak.unit,
        pass: is_kept(peak),
        detail: format!(
            "{} at t = {:.3} s; limit: {}",
            peak.joint, peak.time_s, peak.of
        ),
        requirement: None,
    });
    all.collect()
}

/// Whether a peak is within its limit.
fn is_kept(peak: &PeakReport) -> bool {
    let slack = ROUNDING * peak.limit.abs();
    match peak.criterion {
        // Beyond the limit on its own side.
        "joint_range" if peak.limit < 0.0 => peak.value >= peak.limit - slack,
        "joint_range" => peak.value <= peak.limit + slack,
        _ => peak.value.abs() <= peak.limit + slack,
    }
}

/// Times of points, and evenly between them, each with whether it is one of a point.
fn times_s(points_s: &[f64], duration_s: f64) -> Vec<(f64, bool)> {
    let inside = |time_s: &f64| *time_s > 0.0 && *time_s < duration_s;
    let mut ends = vec![0.0];
    ends.extend(points_s.iter().copied().filter(inside));
    ends.push(duration_s);
    let mut all = Vec::new();
    for pair in ends.windows(2) {
        let parts = ((pair[1] - pair[0]) / LOOK_S).ceil().max(1.0);
        let mut part = 0.0;
        while part < parts {
            all.push((pair[0] + (pair[1] - pair[0]) * part / parts, part == 0.0));
            part += 1.0;
        }
    }
    all.push((duration_s, false));
    all
}
