//! Motions that others planned: set-points over time, or way points without times.

mod message;
mod of_log;
mod table;

pub(crate) use table::{lines as content_lines, position_of_joint};

use std::path::Path;

use needlebench_input::{Finding, read_data_text, sha256_hex};
use needlebench_kinematics::trajectory::{Between, JointState};
use needlebench_kinematics::{JOINT_NAMES, Joints};
use serde::Serialize;

use crate::joint_states::is_mcap;

/// A motion that somebody planned: points in the order in which they are passed, in the units and the order of joints
/// of needlebench (rad, rad/s, rad/s^2).
#[derive(Debug, Clone, PartialEq)]
pub struct MotionFile {
    /// Where it is from.
    pub source: MotionSource,
    /// Time of each point, s, increasing; none for way points without times.
    pub times_s: Option<Vec<f64>>,
    /// The points. Velocities and accelerations that the file does not have are zero.
    pub states: Vec<JointState>,
    /// What the file has besides positions.
    pub known: Known,
    /// Line of each point in the file, from 1; empty where points have none.
    pub lines: Vec<usize>,
    /// Notes from reading; belong in every report.
    pub notes: Vec<String>,
}

/// The file of a motion.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct MotionSource {
    /// File as the user named it.
    pub file: String,
    /// SHA-256 of its bytes.
    pub sha256: String,
    /// What it is, for people.
    pub format: &'static str,
    /// Points of the motion.
    pub points: usize,
}

/// What points have besides positions.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Known {
    /// Nothing.
    Positions,
    /// Velocities.
    Velocities,
    /// Velocities and accelerations.
    Accelerations,
}

impl Known {
    /// What joins points that have it, as ROS's `joint_trajectory_controller` does: quintics where there are
    /// accelerations, cubics where there are velocities, else straight lines.
    pub fn between(self) -> Between {
        match self {
            Self::Positions => Between::Lines,
            Self::Velocities => Between::Cubics,
            Self::Accelerations => Between::Quintics,
        }
    }
}

/// What a user says of a motion's file.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct MotionOptions {
    /// Measured positions of a log are judged, not its set-points.
    pub of_actual: bool,
    /// Which of a log's stretches, from 1.
    pub stretch: Option<usize>,
    /// Topic of the joint states in an MCAP file.
    pub topic: Option<String>,
}

/// No joint of a UR arm turns farther, rad: what is larger is in degrees. (Two revolutions would be refused by the range
/// of every joint.)
pub const MOST_JOINT_RAD: f64 = std::f64::consts::TAU + 1e-3;

/// Reads a motion: `trajectory_msgs/JointTrajectory` or MoveIt's `RobotTrajectory` as JSON or YAML, a table, or the
/// set-points of a log.
///
/// # Errors
/// What is wrong with the file, and a hint.
pub fn read_motion(path: &Path, options: &MotionOptions) -> Result<MotionFile, Vec<Finding>> {
    let file = path.display().to_string();
    if is_mcap(path) {
        return of_log::read(path, &file, options);
    }
    let extension = path.extension().and_then(|extension| extension.to_str());
    if let Some(kind @ ("script" | "urp" | "urscript")) = extension {
        let message = format!("a motion is not read from a program (.{kind})");
        let hint = if kind == "urp" {
            "judge the .script that PolyScope saves beside it, or an RTDE log of the controller's simulator"
        } else {
            "run the program in the controller's simulator, and judge its RTDE log: target_q is judged"
        };
        return Err(vec![Finding::new(&file, message).hint(hint)]);
    }
    let text = read_data_text(path).map_err(|error| {
        let hint = error
            .hint("the path is relative to the working directory")
            .to_owned();
        let message = format!("cannot read the motion: {error}");
        vec![Finding::new(&file, message).hint(hint)]
    })?;
    let is_table = is_table(path, &text);
    if is_table && table::is_log(&text) {
        return of_log::read(path, &file, options);
    }
    let refuse = |flag: &str| {
        let message = format!("{flag} is about logs, and this is no log");
        Err(vec![Finding::new(&file, message).key(flag)])
    };
    if options.of_actual {
        return refuse("--of");
    }
    if options.stretch.is_some() {
        return refuse("--stretch");
    }
    if options.topic.is_some() {
        return refuse("--topic");
    }
    let points = if is_table {
        table::read(&file, &text)?
    } else {
        message::read(&file, &text)?
    };
    points.checked(&file, &text, sha256_hex(text.as_bytes()))
}

/// A motion of points in memory: their times, s, and joint positions, velocities and accelerations; of the latter either
/// all or none. `name` stands for the file.
///
/// # Errors
/// What is wrong with a point, as of a file.
pub fn motion_of_points(
    name: &str,
    times_s: Vec<f64>,
    values: [Vec<Joints>; 3],
) -> Result<MotionFile, Vec<Finding>> {
    let of_joints = values.iter().flatten().flat_map(|joints| joints.iter());
    let numbers = times_s.iter().chain(of_joints);
    let bytes: Vec<u8> = numbers.flat_map(|number| number.to_le_bytes()).collect();
    let points = Points {
        format: "arrays",
        times_s,
        values,
        places: Vec::new(),
        notes: Vec::new(),
    };
    points.checked(name, "", sha256_hex(&bytes))
}

/// Whether a text is a table: its name says so, or its first line is a header of columns.
fn is_table(path: &Path, text: &str) -> bool {
    let extension = path.extension().and_then(|extension| extension.to_str());
    match extension.map(str::to_ascii_lowercase).as_deref() {
        Some("csv" | "tsv") => true,
        Some("json" | "yaml" | "yml") => false,
        _ => table::header(text)
            .is_some_and(|(_, header)| !header.contains(':') && !header.starts_with('{')),
    }
}

/// Points as they stand in a text.
struct Points {
    format: &'static str,
    /// Time of each, s; empty if there are none.
    times_s: Vec<f64>,
    /// Positions, velocities, accelerations; the latter empty if there are none.
    values: [Vec<Joints>; 3],
    /// Place of each point in the text, bytes.
    places: Vec<usize>,
    notes: Vec<String>,
}

/// A number of the controller for times that nobody set: MoveIt's, before times are given to a path.
const ALL_AT_ONCE: &str =
    "all points have the time 0: they are way points, and get times from the arm's limits";

impl Points {
    fn checked(
        mut self,
        file: &str,
        text: &str,
        sha256: String,
    ) -> Result<MotionFile, Vec<Finding>> {
        let at = |point: usize, message: String| {
            let finding = Finding::new(file, format!("point {}: {message}", point + 1));
            match self.places.get(point) {
                Some(place) => finding.at(text, *place..*place),
                None => finding,
            }
        };
        if self.values[0].len() < 2 {
            let message = format!(
                "{} point{}: a motion has at least two",
                self.values[0].len(),
                if self.values[0].len() == 1 { "" } else { "s" }
            );
            let hint = "a single posture is judged with --answers";
            return Err(vec![Finding::new(file, message).hint(hint)]);
        }
        let [positions, velocities, accelerations] = &self.values;
        let units = ["rad", "rad/s", "rad/s^2"];
        for (values, unit) in self.values.iter().zip(units) {
            for (point, joints) in values.iter().enumerate() {
                if let Some(joint) = joints.iter().position(|value| !value.is_finite()) {
                    let name = JOINT_NAMES[joint];
                    let message = format!("{name} is {} {unit}", joints[joint]);
                    let hint = "every value has to be a finite number";
                    return Err(vec![at(point, message).key(name).hint(hint)]);
                }
            }
        }
        for (point, joints) in positions.iter().enumerate() {
            if let Some(joint) = joints.iter().position(|value| value.abs() > MOST_JOINT_RAD) {
                let name = JOINT_NAMES[joint];
                let message = format!("{name} is {} rad, more than a revolution", joints[joint]);
                let hint = "joint positions are in radians; are these degrees?";
                return Err(vec![at(point, message).key(name).hint(hint)]);
            }
        }
        let are_way_points =
            !self.times_s.is_empty() && self.times_s.iter().all(|time_s| *time_s == 0.0);
        for (point, pair) in self.times_s.windows(2).enumerate() {
            if are_way_points || pair[1] > pair[0] {
                continue;
            }
            let message = format!(
                "its time is {} s, {} that of the point before it, {} s",
                pair[1],
                if pair[1] == pair[0] {
                    "the same as"
                } else {
                    "not after"
                },
                pair[0]
            );
            let hint = "times have to increase from point to point; leave repeated points out";
            return Err(vec![
                at(point + 1, message).key("time_from_start").hint(hint),
            ]);
        }
        let known = match (velocities.is_empty(), accelerations.is_empty()) {
            (true, true) => Known::Positions,
            (false, true) => Known::Velocities,
            (false, false) => Known::Accelerations,
            (true, false) => {
                let message = "the points have accelerations, but no velocities";
                let hint = "write both, or neither";
                return Err(vec![Finding::new(file, message).hint(hint)]);
            }
        };
        let zero = Joints::zeros();
        let states = positions
            .iter()
            .enumerate()
            .map(|(point, position)| JointState {
                position: *position,
                velocity: velocities.get(point).copied().unwrap_or(zero),
                acceleration: accelerations.get(point).copied().unwrap_or(zero),
            });
        let states: Vec<JointState> = states.collect();
        if are_way_points {
            self.times_s.clear();
            self.notes.push(ALL_AT_ONCE.to_owned());
        }
        Ok(MotionFile {
            source: MotionSource {
                file: file.to_owned(),
                sha256,
                format: self.format,
                points: states.len(),
            },
            times_s: (!self.times_s.is_empty()).then_some(self.times_s),
            states,
            known,
            lines: lines_of(text, &self.places),
            notes: self.notes,
        })
    }
}

/// Lines of places in ascending order, from 1.
fn lines_of(text: &str, places: &[usize]) -> Vec<usize> {
    let (mut line, mut from) = (1, 0);
    let lines = places.iter().map(|&place| {
        let place = place.clamp(from, text.len());
        line += text[from..place].matches('\n').count();
        from = place;
        line
    });
    lines.collect()
}
