//! A planned motion as points of a joint trajectory: JSON, YAML, CSV.
//!
//! Points are those of `trajectory_msgs/JointTrajectory`. Between them ROS's `joint_trajectory_controller` interpolates by
//! quintics where points have accelerations, and by cubics where they have velocities alone; how far both leave the planned
//! motion is measured between all points and said in the files.

use std::fmt::Write;

use needlebench_kinematics::trajectory::{JointState, JointTrajectory};
use needlebench_kinematics::{JOINT_COUNT, JOINT_NAMES, Joints, rotation_vector};
use serde::Serialize;
use serde_json::{Map, Value, json};

use crate::file::ExportedFile;
use crate::head::on_one_line;
use crate::motion::Motion;

/// Longest time between two points, ns.
const LONGEST_NS: u64 = 20_000_000;

/// Shortest time between two points that is chosen for the sake of accuracy, ns: a millisecond, as fast as controllers run.
const SHORTEST_NS: u64 = 1_000_000;

/// How far the quintics may leave a joint's planned position, rad: at 1 m from an axis a tenth of a micrometre.
const QUINTIC_RAD: f64 = 1e-7;

/// How far the quintics may leave a joint's planned acceleration, rad/s^2: a thousandth of what joints mostly use.
const QUINTIC_RAD_S2: f64 = 1e-3;

/// Places between two points at which the interpolations are compared with the plan.
const PLACES: u32 = 16;

/// Notation of a joint trajectory.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TrajectoryNotation {
    /// One document: what it is, then the message.
    Json,
    /// The message as `ros2 topic pub` takes it, what it is in comments.
    Yaml,
    /// A row for each point, what it is in comments.
    Csv,
}

/// What every trajectory says first.
pub(crate) const NEVER_RUN: &str =
    "generated from a simulation, never run on a robot; not claimed to be safe on any robot";

/// The planned motion as a joint trajectory in a file of this name.
pub fn trajectory(motion: &Motion<'_>, notation: TrajectoryNotation, name: &str) -> ExportedFile {
    let points = Points::of(motion.trajectory);
    let off = Interpolation::measured(motion, &points);
    let text = match notation {
        TrajectoryNotation::Json => in_json(motion, &points, &off),
        TrajectoryNotation::Yaml => in_yaml(motion, &points, &off),
        TrajectoryNotation::Csv => in_csv(motion, &points, &off),
    };
    ExportedFile::text(name, text)
}

/// Points of the plan, their times in whole nanoseconds.
struct Points {
    time_ns: Vec<u64>,
    state: Vec<JointState>,
}

impl Points {
    fn of(trajectory: &JointTrajectory) -> Self {
        let mut time_ns = vec![0];
        for (_, _, end_s) in trajectory.phases() {
            // The last time is not before the end, so that the arm stands there.
            let (from, to) = (time_ns[time_ns.len() - 1], up_to_ns(end_s));
            if to <= from {
                continue;
            }
            let parts = (to - from).div_ceil(LONGEST_NS);
            for part in 1..=parts {
                let next = from + (to - from) * part / parts;
                divide(trajectory, time_ns[time_ns.len() - 1], next, &mut time_ns);
            }
        }
        let state = time_ns.iter().map(|&ns| at(trajectory, ns)).collect();
        Self { time_ns, state }
    }
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "from 0 to some minutes"
)]
fn up_to_ns(time_s: f64) -> u64 {
    (time_s * 1e9).ceil() as u64
}

fn at(trajectory: &JointTrajectory, time_ns: u64) -> JointState {
    trajectory.sample(time_ns as f64 * 1e-9)
}

/// Adds `to`, and before it what keeps the quintics on the plan.
fn divide(trajectory: &JointTrajectory, from: u64, to: u64, times: &mut Vec<u64>) {
    let ends = [from, to].map(|ns| at(trajectory, ns));
    let off = off_between(trajectory, [from, to], &ends);
    let is_near = off.quintic.amax() <= QUINTIC_RAD && off.acceleration <= QUINTIC_RAD_S2;
    if !is_near && to - from >= 2 * SHORTEST_NS {
        let middle = from.midpoint(to);
        divide(trajectory, from, middle, times);
        divide(trajectory, middle, to, times);
    } else {
        times.push(to);
    }
}

/// Largest differences from the plan between two points.
struct Between {
    /// Of each joint's position by a quintic, rad.
    quintic: Joints,
    /// Of each joint's position by a cubic, rad.
    cubic: Joints,
    /// Of any joint's acceleration by a quintic, rad/s^2.
    acceleration: f64,
}

fn off_between(
    trajectory: &JointTrajectory,
    [from, to]: [u64; 2],
    ends: &[JointState; 2],
) -> Between {
    let mut worst = Between {
        quintic: Joints::zeros(),
        cubic: Joints::zeros(),
        acceleration: 0.0,
    };
    for place in 1..PLACES {
        let share = f64::from(place) / f64::from(PLACES);
        let planned = trajectory.sample((from as f64 + (to - from) as f64 * share) * 1e-9);
        let span_s = (to - from) as f64 * 1e-9;
        let [position, acceleration] = quintic(ends, span_s, share);
        worst.quintic = worst.quintic.sup(&(position - planned.position).abs());
        let off = (cubic(ends, span_s, share) - planned.position).abs();
        worst.cubic = worst.cubic.sup(&off);
        let off = (acceleration - planned.acceleration).amax();
        worst.acceleration = worst.acceleration.max(off);
    }
    worst
}

/// Position and acceleration of the quintic with the positions, velocities and accelerations of both ends.
fn quintic([a, b]: &[JointState; 2], span_s: f64, share: f64) -> [Joints; 2] {
    let (v0, v1) = (a.velocity * span_s, b.velocity * span_s);
    let (w0, w1) = (
        a.acceleration * span_s.powi(2),
        b.acceleration * span_s.powi(2),
    );
    let d = b.position - a.position;
    let c3 = d * 10.0 - v0 * 6.0 - v1 * 4.0 - w0 * 1.5 + w1 * 0.5;
    let c4 = d * -15.0 + v0 * 8.0 + v1 * 7.0 + w0 * 1.5 - w1;
    let c5 = d * 6.0 - v0 * 3.0 - v1 * 3.0 - w0 * 0.5 + w1 * 0.5;
    let position =
        a.position + (v0 + (w0 * 0.5 + (c3 + (c4 + c5 * share) * share) * share) * share) * share;
    let acceleration = w0 + (c3 * 6.0 + (c4 * 12.0 + c5 * (20.0 * share)) * share) * share;
    [position, acceleration / span_s.powi(2)]
}

/// The cubic with the positions and velocities of both ends.
fn cubic([a, b]: &[JointState; 2], span_s: f64, share: f64) -> Joints {
    let (v0, v1) = (a.velocity * span_s, b.velocity * span_s);
    let d = b.position - a.position;
    let c2 = d * 3.0 - v0 * 2.0 - v1;
    let c3 = d * -2.0 + v0 + v1;
    a.position + (v0 + (c2 + c3 * share) * share) * share
}

/// How far interpolations leave the plan.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
struct Off {
    /// Largest of any joint, rad.
    joint_rad: f64,
    /// Largest that anything of arm and tool can be off by it, m.
    arm_m: f64,
}

struct Interpolation {
    quintic: Off,
    cubic: Off,
    /// Of accelerations by quintics, rad/s^2.
    acceleration: f64,
}

impl Interpolation {
    fn measured(motion: &Motion<'_>, points: &Points) -> Self {
        let reach = Joints::from(motion.reach_m());
        let mut worst = [Off {
            joint_rad: 0.0,
            arm_m: 0.0,
        }; 2];
        let mut acceleration = 0.0_f64;
        for index in 1..points.time_ns.len() {
            let times = [points.time_ns[index - 1], points.time_ns[index]];
            let ends = [points.state[index - 1], points.state[index]];
            let both = off_between(motion.trajectory, times, &ends);
            acceleration = acceleration.max(both.acceleration);
            for (worst, off) in worst.iter_mut().zip([both.quintic, both.cubic]) {
                worst.joint_rad = worst.joint_rad.max(off.amax());
                worst.arm_m = worst.arm_m.max(off.dot(&reach));
            }
        }
        let [quintic, cubic] = worst;
        Self {
            quintic,
            cubic,
            acceleration,
        }
    }

    fn in_words(&self) -> [String; 3] {
        let [quintics, cubics] = [("quintics", self.quintic), ("cubics", self.cubic)].map(|(what, off)| {
            format!(
                "interpolated by {what}: joints within {:.1e} rad of the planned motion, arm and \
                 tool within {:.1e} m, measured at {} positions between consecutive points",
                off.joint_rad,
                off.arm_m,
                PLACES - 1
            )
        });
        let accelerations = format!(
            "interpolated by quintics: accelerations within {:.1e} rad/s^2 of the planned ones",
            self.acceleration
        );
        [quintics, cubics, accelerations]
    }
}

/// What it is, where it comes from, what it presumes and what is certified.
fn head(motion: &Motion<'_>, off: &Interpolation) -> Vec<String> {
    let (resolved, limits) = (motion.resolved, &motion.resolved.motion);
    let tool = &resolved.cell.tool;
    let tcp = &tool.flange_from_guide_exit;
    let degrees = |joints: &Joints| {
        let all: Vec<String> = joints
            .iter()
            .map(|rad| format!("{:.2}", rad.to_degrees()))
            .collect();
        all.join(", ")
    };
    // Not "-0".
    let not_minus = |value: f64| if value.abs() < 1e-6 { 0.0 } else { value };
    let three = |[x, y, z]: [f64; 3], scale: f64, decimals: usize| {
        format!(
            "({:.decimals$}, {:.decimals$}, {:.decimals$})",
            not_minus(x * scale),
            not_minus(y * scale),
            not_minus(z * scale)
        )
    };
    let mut lines = vec![
        "Planned motion of a needle guide to the insertion pose, at rest at both ends.".to_owned(),
        format!("NEVER RUN ON A ROBOT: {NEVER_RUN}."),
    ];
    let origin = motion.origin().into_iter();
    lines.extend(origin.map(|(name, value)| format!("{name}: {value}")));
    lines.push(format!(
        "payload: {:.4} kg, centre at {} mm from the flange",
        tool.body.mass_kg,
        three(tool.body.com_m.into(), 1e3, 2)
    ));
    lines.push(format!(
        "TCP (guide exit in the flange frame): {} mm, rotation vector {} rad",
        three(tcp.translation.vector.into(), 1e3, 3),
        three(rotation_vector(&tcp.rotation).into(), 1.0, 6)
    ));
    lines.push(format!(
        "limits of speed (deg/s): {}; of acceleration (deg/s^2): {}",
        degrees(&limits.velocity),
        degrees(&limits.acceleration)
    ));
    lines.push(format!("start posture (deg): {}", degrees(&resolved.start)));
    for (phase, start_s, end_s) in motion.trajectory.phases() {
        lines.push(format!(
            "phase {}: {start_s:.6} s to {end_s:.6} s",
            phase.name()
        ));
    }
    lines.extend(off.in_words());
    lines.push(
        "certified minimum clearance of the nominal arm along the planned path, at any speed:"
            .to_owned(),
    );
    let proven = motion.proven_in_words(off.quintic.arm_m);
    lines.extend(proven.into_iter().map(|line| format!("  {line}")));
    lines.push("(minus the deviation due to interpolation by quintics)".to_owned());
    lines
}

/// Lines as comments.
fn comments(lines: &[String]) -> String {
    lines
        .iter()
        .map(|line| format!("# {}", on_one_line(line)))
        .chain([String::new()])
        .collect::<Vec<String>>()
        .join("\n")
}

/// Seconds and nanoseconds besides.
fn split(time_ns: u64) -> [u64; 2] {
    [time_ns / 1_000_000_000, time_ns % 1_000_000_000]
}

fn in_json(motion: &Motion<'_>, points: &Points, off: &Interpolation) -> String {
    let numbers = |joints: &Joints| joints.iter().copied().collect::<Vec<f64>>();
    let limits = &motion.resolved.motion;
    let tool = &motion.resolved.cell.tool;
    let tcp = &tool.flange_from_guide_exit;
    let mut about = Map::new();
    about.insert("schema_version".to_owned(), json!(1));
    about.insert("warning".to_owned(), json!(NEVER_RUN));
    for (name, value) in motion.origin() {
        about.insert(name.to_owned(), json!(value));
    }
    let phases: Vec<Value> = motion
        .trajectory
        .phases()
        .iter()
        .map(|(phase, start_s, end_s)| {
            json!({"phase": phase.name(), "start_s": start_s, "end_s": end_s})
        })
        .collect();
    let proven = motion.proven_m().map(|proven| {
        let class = |each: &crate::motion::Proven| {
            let value = json!({
                "certified_lower_bound_m": each.lower_bound_m,
                "pair": each.pair,
            });
            (each.class.name().to_owned(), value)
        };
        proven.iter().map(class).collect::<Map<String, Value>>()
    });
    let rest = json!({
        "payload": {
            "mass_kg": tool.body.mass_kg,
            "com_in_flange_m": [tool.body.com_m.x, tool.body.com_m.y, tool.body.com_m.z],
        },
        "tcp": {
            "what": "guide exit, z along the insertion",
            "position_in_flange_m": numbers3(&tcp.translation.vector),
            "rotvec_in_flange_rad": numbers3(&rotation_vector(&tcp.rotation)),
        },
        "limits": {
            "velocity_rad_s": numbers(&limits.velocity),
            "acceleration_rad_s2": numbers(&limits.acceleration),
            "jerk_rad_s3": numbers(&limits.jerk),
        },
        "phases": phases,
        "interpolation": {
            "places_between_points": PLACES - 1,
            "quintic": off.quintic,
            "cubic": off.cubic,
            "quintic_acceleration_rad_s2": off.acceleration,
        },
        // None: not certified.
        "clearance": proven,
    });
    if let Value::Object(rest) = rest {
        about.extend(rest);
    }
    let document = json!({
        "about": about,
        "joint_trajectory": message(points),
    });
    serde_json::to_string_pretty(&document).expect("numbers are finite") + "\n"
}

fn numbers3(of: &nalgebra::Vector3<f64>) -> [f64; 3] {
    (*of).into()
}

fn message(points: &Points) -> Value {
    let numbers = |joints: &Joints| joints.iter().copied().collect::<Vec<f64>>();
    let of_point = |(&time_ns, state): (&u64, &JointState)| {
        let [sec, nanosec] = split(time_ns);
        json!({
            "positions": numbers(&state.position),
            "velocities": numbers(&state.velocity),
            "accelerations": numbers(&state.acceleration),
            "effort": [],
            "time_from_start": {"sec": sec, "nanosec": nanosec},
        })
    };
    let all = points.time_ns.iter().zip(&points.state).map(of_point);
    json!({
        "header": {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""},
        "joint_names": JOINT_NAMES,
        "points": all.collect::<Vec<Value>>(),
    })
}

/// A number as YAML 1.1 reads it: with a point, where it has an exponent.
fn yaml_number(value: f64) -> String {
    let text = format!("{value:?}");
    match text.split_once('e') {
        Some((digits, exponent)) => {
            let digits = if digits.contains('.') {
                digits.to_owned()
            } else {
                format!("{digits}.0")
            };
            let sign = if exponent.starts_with('-') { "" } else { "+" };
            format!("{digits}e{sign}{exponent}")
        }
        None => text,
    }
}

fn in_yaml(motion: &Motion<'_>, points: &Points, off: &Interpolation) -> String {
    let mut out = comments(&head(motion, off));
    out.push_str("header: {stamp: {sec: 0, nanosec: 0}, frame_id: ''}\njoint_names:\n");
    for joint in JOINT_NAMES {
        // Writing to a String cannot fail.
        let _ = writeln!(out, "- {joint}");
    }
    out.push_str("points:\n");
    for (&time_ns, state) in points.time_ns.iter().zip(&points.state) {
        let [sec, nanosec] = split(time_ns);
        let row = |joints: &Joints| {
            let all: Vec<String> = joints.iter().map(|value| yaml_number(*value)).collect();
            all.join(", ")
        };
        let _ = writeln!(
            out,
            "- positions: [{}]\n  velocities: [{}]\n  accelerations: [{}]\n  \
             time_from_start: {{sec: {sec}, nanosec: {nanosec}}}",
            row(&state.position),
            row(&state.velocity),
            row(&state.acceleration)
        );
    }
    out
}

fn in_csv(motion: &Motion<'_>, points: &Points, off: &Interpolation) -> String {
    let mut out = comments(&head(motion, off));
    out.push_str("time_from_start_sec,time_from_start_nanosec");
    for quantity in ["position_rad", "velocity_rad_s", "acceleration_rad_s2"] {
        for joint in JOINT_NAMES {
            // Writing to a String cannot fail.
            let _ = write!(out, ",{joint}_{quantity}");
        }
    }
    out.push('\n');
    for (&time_ns, state) in points.time_ns.iter().zip(&points.state) {
        let [sec, nanosec] = split(time_ns);
        let _ = write!(out, "{sec},{nanosec}");
        for joints in [&state.position, &state.velocity, &state.acceleration] {
            for joint in 0..JOINT_COUNT {
                let _ = write!(out, ",{:?}", joints[joint]);
            }
        }
        out.push('\n');
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn yaml_reads_every_number_as_one() {
        for (value, text) in [
            (0.0, "0.0"),
            (-1.5, "-1.5"),
            (1e-20, "1.0e-20"),
            (2.5e-9, "2.5e-9"),
            (1e300, "1.0e+300"),
        ] {
            assert_eq!(yaml_number(value), text);
        }
    }

    #[test]
    fn polynomials_have_the_values_of_both_ends() {
        let state = |value: f64| JointState {
            position: Joints::repeat(value),
            velocity: Joints::repeat(-2.0 * value),
            acceleration: Joints::repeat(3.0 * value),
        };
        let ends = [state(1.0), state(-0.5)];
        let step = 1e-5;
        let five: fn(&_, _, _) -> Joints = |ends, span_s, share| quintic(ends, span_s, share)[0];
        for (of, has_acceleration) in [(five, true), (cubic as fn(&_, _, _) -> Joints, false)] {
            for (share, end, sign) in [(0.0, &ends[0], 1.0), (1.0, &ends[1], -1.0)] {
                let value = |by: f64| of(&ends, 2.0, share + sign * by)[0];
                assert!((value(0.0) - end.position[0]).abs() < 1e-14);
                // Half a second of the share is one of time.
                let first = (value(step) - value(0.0)) / (2.0 * step * sign);
                assert!((first - end.velocity[0]).abs() < 1e-3);
                let said = quintic(&ends, 2.0, share)[1][0];
                assert!((said - end.acceleration[0]).abs() < 1e-12);
                let second =
                    (value(2.0 * step) - 2.0 * value(step) + value(0.0)) / (2.0 * step).powi(2);
                assert_eq!(
                    (second - end.acceleration[0]).abs() < 2e-2,
                    has_acceleration
                );
            }
        }
    }
}
