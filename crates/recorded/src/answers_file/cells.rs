//! Answers as rows of columns.

use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use needlebench_input::{Finding, Separator};
use needlebench_kinematics::{JOINT_COUNT, JOINT_NAMES, Joints, Pose, pose_from_rotation_vector};

use super::{Asked, HINT, Made};
use crate::motion_file::{content_lines, position_of_joint};

/// A value of a table.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Cell {
    Number(f64),
    Text(String),
}

/// What a column holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Column {
    Joint(usize),
    Goal,
    /// Of `x, y, z, rx, ry, rz, qx, qy, qz, qw`.
    Pose(usize),
    Other,
}

/// Names of the numbers of a pose.
const POSE: [&str; 10] = ["x", "y", "z", "rx", "ry", "rz", "qx", "qy", "qz", "qw"];

/// Length of a quaternion may differ from 1 by what is written of it.
const UNIT_WITHIN: f64 = 1e-4;

/// Reads columns and rows.
pub(super) struct Columns<'a> {
    file: &'a str,
    meanings: Vec<Column>,
    names: Vec<String>,
    has_quaternion: bool,
    has_pose: bool,
}

impl<'a> Columns<'a> {
    /// # Errors
    /// Columns that are missing, twice, or in degrees; without a line.
    pub(super) fn of(file: &'a str, names: Vec<String>, made: &mut Made) -> Result<Self, Finding> {
        let is_zero_based = names.iter().any(|name| numbered(name) == Some(0));
        let mut columns = Vec::with_capacity(names.len());
        for name in &names {
            let column = column(name, is_zero_based).map_err(|unit| {
                let finding = Finding::new(file, format!("the column `{name}` is in {unit}"));
                finding.key(name).hint("joint positions are in radians")
            })?;
            if column != Column::Other && columns.contains(&column) {
                let finding = Finding::new(file, format!("a second column of what `{name}` is"));
                return Err(finding.key(name));
            }
            columns.push(column);
        }
        let missing: Vec<&str> = (0..JOINT_COUNT)
            .filter(|joint| !columns.contains(&Column::Joint(*joint)))
            .map(|joint| JOINT_NAMES[joint])
            .collect();
        if !missing.is_empty() {
            let message = format!("no column for {}", missing.join(", "));
            return Err(Finding::new(file, message).hint(HINT));
        }
        let has = |range: std::ops::Range<usize>| {
            let count = range.len();
            let found = range.filter(|part| columns.contains(&Column::Pose(*part)));
            (found.count(), count)
        };
        let (places, vector, quaternion) = (has(0..3), has(3..6), has(6..10));
        let has_pose = places.0 > 0 || vector.0 > 0 || quaternion.0 > 0;
        let has_quaternion = quaternion.0 > 0;
        let turn = if has_quaternion { quaternion } else { vector };
        if has_pose && (places.0 < places.1 || turn.0 < turn.1 || has_quaternion && vector.0 > 0) {
            let message = "the columns of the pose are not complete";
            let hint = "a pose has the columns x, y, z (m) and rx, ry, rz (rotation vector, rad) or qx, qy, qz, qw";
            return Err(Finding::new(file, message).hint(hint));
        }
        if has_pose && columns.contains(&Column::Goal) {
            let message = "the table has both a column `goal` and columns of a pose";
            let hint = "an answer is to one or the other; leave one out";
            return Err(Finding::new(file, message).key("goal").hint(hint));
        }
        let others: Vec<&str> = columns
            .iter()
            .zip(&names)
            .filter(|(column, _)| **column == Column::Other)
            .map(|(_, name)| name.as_str())
            .collect();
        if !others.is_empty() {
            let note = format!("columns that are not read: {}", others.join(", "));
            made.notes.push(note);
        }
        Ok(Self {
            file,
            meanings: columns,
            names,
            has_quaternion,
            has_pose,
        })
    }

    /// Takes a row.
    ///
    /// # Errors
    /// A value that is not what its column holds; without a line.
    pub(super) fn take(
        &self,
        row: &[Cell],
        line: Option<usize>,
        made: &mut Made,
    ) -> Result<(), Finding> {
        let mut joints = Joints::zeros();
        let mut pose = [0.0; POSE.len()];
        let mut asked = Asked::Goal;
        for ((cell, column), name) in row.iter().zip(&self.meanings).zip(&self.names) {
            let number = || match cell {
                Cell::Number(number) => Ok(*number),
                Cell::Text(text) => {
                    let message = format!("`{text}` is no number");
                    Err(Finding::new(self.file, message).key(name))
                }
            };
            match *column {
                Column::Joint(joint) => joints[joint] = number()?,
                Column::Pose(part) => pose[part] = number()?,
                Column::Goal => {
                    asked = Asked::NamedGoal(match cell {
                        Cell::Text(text) => text.clone(),
                        Cell::Number(number) => number.to_string(),
                    });
                }
                Column::Other => {}
            }
        }
        if self.has_pose {
            let place = Vector3::new(pose[0], pose[1], pose[2]);
            asked = Asked::BaseFromFlange(if self.has_quaternion {
                let [x, y, z, w] = [pose[6], pose[7], pose[8], pose[9]];
                of_quaternion(self.file, place, Quaternion::new(w, x, y, z))?
            } else {
                of_vector(self.file, place, Vector3::new(pose[3], pose[4], pose[5]))?
            });
        }
        made.answer(asked, line, joints);
        Ok(())
    }
}

/// A pose from its place, m, and its rotation vector, rad.
pub(super) fn of_vector(
    file: &str,
    place: Vector3<f64>,
    turn: Vector3<f64>,
) -> Result<Pose, Finding> {
    let is_finite = place
        .iter()
        .chain(turn.iter())
        .all(|value| value.is_finite());
    if !is_finite || turn.norm() > 2.0 * std::f64::consts::TAU {
        let message = format!(
            "the pose is {:?} m, {:?} rad",
            place.as_slice(),
            turn.as_slice()
        );
        let hint = "x, y, z are in metres; rx, ry, rz are axis times angle in radians, as the controller shows them";
        return Err(Finding::new(file, message).key("pose").hint(hint));
    }
    Ok(pose_from_rotation_vector(place, turn))
}

/// A pose from its place, m, and a quaternion of length 1.
pub(super) fn of_quaternion(
    file: &str,
    place: Vector3<f64>,
    turn: Quaternion<f64>,
) -> Result<Pose, Finding> {
    let is_finite = place.iter().all(|value| value.is_finite());
    if !is_finite || (turn.norm() - 1.0).abs().is_nan() || (turn.norm() - 1.0).abs() > UNIT_WITHIN {
        let message = format!("the quaternion has the length {}", turn.norm());
        let hint = "qx, qy, qz, qw are of length 1";
        return Err(Finding::new(file, message).key("pose").hint(hint));
    }
    let turn = UnitQuaternion::from_quaternion(turn);
    Ok(Pose::from_parts(place.into(), turn))
}

/// The number in a name such as `q3`, `joint_0` or `j1`.
fn numbered(name: &str) -> Option<usize> {
    let name = name.trim().to_ascii_lowercase();
    let rest = ["joints_", "joints", "joint_", "joint", "q_", "q", "j"]
        .iter()
        .find_map(|prefix| name.strip_prefix(prefix))?;
    let rest = rest.strip_suffix("_rad").unwrap_or(rest);
    let rest = rest.trim_matches(['[', ']']);
    rest.parse().ok()
}

/// What a column is by its name; the error is a unit that is refused.
fn column(name: &str, is_zero_based: bool) -> Result<Column, &'static str> {
    if let Some(joint) = position_of_joint(name)? {
        return Ok(Column::Joint(joint));
    }
    if let Some(number) = numbered(name) {
        let joint = number.checked_sub(usize::from(!is_zero_based));
        return Ok(match joint.filter(|joint| *joint < JOINT_COUNT) {
            Some(joint) => Column::Joint(joint),
            None => Column::Other,
        });
    }
    let name = name.trim().to_ascii_lowercase();
    if name.ends_with("deg") {
        return Err("degrees");
    }
    if name.ends_with("_mm") && POSE[..3].contains(&name.trim_end_matches("_mm")) {
        return Err("millimetres");
    }
    if name == "goal" {
        return Ok(Column::Goal);
    }
    let name = name.strip_prefix("pose_").unwrap_or(&name);
    let name = name.strip_suffix("_m").unwrap_or(name);
    let name = name.strip_suffix("_rad").unwrap_or(name);
    let part = POSE.iter().position(|part| *part == name);
    Ok(part.map_or(Column::Other, Column::Pose))
}

/// Reads a table with a header, or six numbers a line.
pub(super) fn table(file: &str, text: &str) -> Result<Made, Finding> {
    let mut made = Made::default();
    let mut lines = content_lines(text).peekable();
    let Some((place, first)) = lines.peek().copied() else {
        return Err(Finding::new(file, "the file is empty").hint(HINT));
    };
    let at = |place: usize, finding: Finding| finding.at(text, place..place);
    let separator = Separator::of_header(first);
    let cell = |text: &str| {
        let number = if separator.allows_decimal_comma() {
            text.replace(',', ".").parse()
        } else {
            text.parse()
        };
        number.map_or_else(|_| Cell::Text(text.to_owned()), Cell::Number)
    };
    let names: Vec<String> = separator.cells(first).map(str::to_owned).collect();
    let is_bare = names
        .iter()
        .all(|name| matches!(cell(name), Cell::Number(_)));
    let names = if is_bare {
        if names.len() != JOINT_COUNT {
            let message = format!("{} numbers a line, and no names of columns", names.len());
            return Err(at(place, Finding::new(file, message).hint(HINT)));
        }
        made.notes.push(
            "the table has no names of columns: its numbers are taken from shoulder pan to wrist 3"
                .to_owned(),
        );
        JOINT_NAMES.map(str::to_owned).to_vec()
    } else {
        lines.next();
        names
    };
    let columns = Columns::of(file, names, &mut made).map_err(|finding| at(place, finding))?;
    let mut line = 1;
    let mut from = 0;
    for (place, text_of_line) in lines {
        line += text[from..place].matches('\n').count();
        from = place;
        let row: Vec<Cell> = separator.cells(text_of_line).map(cell).collect();
        if row.len() != columns.names.len() {
            let message = format!("{} values for {} columns", row.len(), columns.names.len());
            return Err(at(
                place,
                Finding::new(file, message).hint("is the line cut off?"),
            ));
        }
        columns
            .take(&row, Some(line), &mut made)
            .map_err(|finding| at(place, finding))?;
    }
    Ok(made)
}
