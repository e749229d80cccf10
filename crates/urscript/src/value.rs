//! What expressions are worth.

use std::rc::Rc;

use nalgebra::{DMatrix, Vector3};
use needlebench_kinematics::{
    JOINT_COUNT, Joints, Pose, pose_from_rotation_vector, rotation_vector,
};

/// Most elements of a list, those of lists in it included: assumed, as a controller's is not known.
pub(crate) const MOST_ELEMENTS: usize = 10_000;

/// Most characters of a string: assumed likewise.
pub(crate) const MOST_CHARACTERS: usize = 1023;

/// Most levels of lists within lists: a matrix has two.
const MOST_LIST_LEVELS: usize = 8;

/// What an expression is worth.
#[derive(Debug, Clone, PartialEq)]
pub enum Value {
    /// What a function without `return` gives.
    Nothing,
    /// `True` or `False`.
    Truth(bool),
    /// A number; whole ones are no kind of their own.
    Number(f64),
    /// A string.
    Text(Rc<str>),
    /// A list; assigned as a copy.
    List(Rc<Vec<Value>>),
    /// A pose: position (m) and rotation vector (rad).
    Pose(Rc<[f64; 6]>),
    /// A struct: its members in their order; assigned as a copy.
    Struct(Rc<Vec<(Rc<str>, Value)>>),
}

impl Value {
    /// A list of numbers.
    pub fn numbers(numbers: &[f64]) -> Self {
        Self::List(Rc::new(numbers.iter().copied().map(Self::Number).collect()))
    }

    /// A rigid transform as a pose.
    pub fn pose(pose: &Pose) -> Self {
        let (place, turn) = (pose.translation.vector, rotation_vector(&pose.rotation));
        Self::Pose(Rc::new([place.x, place.y, place.z, turn.x, turn.y, turn.z]))
    }

    /// What it is, as errors say it.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Nothing => "nothing",
            Self::Truth(_) => "a truth value",
            Self::Number(_) => "a number",
            Self::Text(_) => "a string",
            Self::List(_) => "a list",
            Self::Pose(_) => "a pose",
            Self::Struct(_) => "a struct",
        }
    }

    /// As `to_str` and `textmsg` have it; whole numbers without a point. Cut where it is longer than any string may be.
    pub fn text(&self) -> String {
        let mut text = String::new();
        self.write(&mut text);
        text
    }

    fn write(&self, text: &mut String) {
        let numbers = |text: &mut String, numbers: &[f64]| {
            for (index, number) in numbers.iter().enumerate() {
                text.push_str(if index > 0 { ", " } else { "" });
                text.push_str(&number.to_string());
            }
        };
        match self {
            Self::Nothing => {}
            Self::Truth(true) => text.push_str("True"),
            Self::Truth(false) => text.push_str("False"),
            Self::Number(number) => numbers(text, &[*number]),
            Self::Text(part) => text.push_str(part),
            Self::List(all) => {
                text.push('[');
                for (index, value) in all.iter().enumerate() {
                    // Every element has a character at least.
                    if text.len() > 4 * MOST_CHARACTERS {
                        break;
                    }
                    text.push_str(if index > 0 { ", " } else { "" });
                    value.write(text);
                }
                text.push(']');
            }
            Self::Pose(all) => {
                text.push_str("p[");
                numbers(text, &**all);
                text.push(']');
            }
            Self::Struct(all) => {
                text.push_str("struct(");
                for (index, (name, value)) in all.iter().enumerate() {
                    if text.len() > 4 * MOST_CHARACTERS {
                        break;
                    }
                    text.push_str(if index > 0 { ", " } else { "" });
                    text.push_str(name);
                    text.push('=');
                    value.write(text);
                }
                text.push(')');
            }
        }
    }

    /// The numbers of a list, if it is one of numbers alone.
    pub(crate) fn list_of_numbers(&self) -> Option<Vec<f64>> {
        let Self::List(all) = self else {
            return None;
        };
        all.iter()
            .map(|each| match each {
                Self::Number(number) => Some(*number),
                _ => None,
            })
            .collect()
    }

    /// Six numbers of a list as joint positions.
    pub(crate) fn joints(&self) -> Option<Joints> {
        let numbers = self.list_of_numbers()?;
        (numbers.len() == JOINT_COUNT).then(|| Joints::from_column_slice(&numbers))
    }

    /// A pose as a rigid transform.
    pub(crate) fn transform(&self) -> Option<Pose> {
        let Self::Pose(all) = self else {
            return None;
        };
        let [x, y, z, rx, ry, rz] = **all;
        let found = pose_from_rotation_vector(Vector3::new(x, y, z), Vector3::new(rx, ry, rz));
        let is_finite = found.rotation.coords.iter().all(|part| part.is_finite());
        is_finite.then_some(found)
    }
}

/// The list of some values, with the number of its elements, those of lists in it included.
///
/// # Errors
/// What is too large about it.
pub(crate) fn list(values: Vec<Value>) -> Result<(Value, usize), String> {
    let size = checked_size(&values)?;
    Ok((Value::List(Rc::new(values)), size))
}

/// Elements of a list, those of lists in it included, if it is none too many and none too deep.
pub(crate) fn checked_size(values: &[Value]) -> Result<usize, String> {
    fn measure(values: &[Value], levels: usize) -> Option<usize> {
        let left = levels.checked_sub(1)?;
        let mut sum = values.len();
        for value in values {
            sum += inside(value, left)?;
        }
        Some(sum)
    }
    fn inside(value: &Value, left: usize) -> Option<usize> {
        match value {
            Value::List(values) => measure(values, left),
            Value::Struct(members) => {
                let left = left.checked_sub(1)?;
                let mut sum = members.len();
                for (_, value) in members.iter() {
                    sum += inside(value, left)?;
                }
                Some(sum)
            }
            _ => Some(0),
        }
    }
    match measure(values, MOST_LIST_LEVELS) {
        None => Err(format!(
            "lists are nested more than {MOST_LIST_LEVELS} levels deep"
        )),
        Some(size) if size > MOST_ELEMENTS => Err(format!(
            "the list has {size} elements, {MOST_ELEMENTS} at most"
        )),
        Some(size) => Ok(size),
    }
}

/// A whole number from 0 that indices and counts may be.
pub(crate) fn whole(number: f64) -> Option<usize> {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "whole, and between 0 and 1e9"
    )]
    let found = number as usize;
    (number >= 0.0 && number.fract() == 0.0 && number < 1e9).then_some(found)
}

/// A whole number of 32 bits.
pub(crate) fn integer(number: f64) -> Result<i32, String> {
    let is_whole =
        number.fract() == 0.0 && number >= f64::from(i32::MIN) && number <= f64::from(i32::MAX);
    #[expect(clippy::cast_possible_truncation, reason = "whole, and of 32 bits")]
    let found = number as i32;
    if is_whole {
        Ok(found)
    } else {
        Err(format!("{number} is no whole number of 32 bits"))
    }
}

/// A matrix, if a value is one.
pub(crate) fn matrix(value: &Value) -> Option<DMatrix<f64>> {
    let Value::List(rows) = value else {
        return None;
    };
    let rows: Option<Vec<Vec<f64>>> = rows.iter().map(Value::list_of_numbers).collect();
    let rows = rows?;
    let columns = rows.first()?.len();
    if columns == 0 || rows.iter().any(|row| row.len() != columns) {
        return None;
    }
    let parts = rows.iter().flatten().copied();
    Some(DMatrix::from_row_iterator(rows.len(), columns, parts))
}

/// A matrix as a list of its rows.
///
/// # Errors
/// What is too large about it.
pub(crate) fn from_matrix(matrix: &DMatrix<f64>) -> Result<Value, String> {
    let rows = matrix.row_iter().map(|row| {
        let parts: Vec<f64> = row.iter().copied().collect();
        Value::numbers(&parts)
    });
    list(rows.collect()).map(|(value, _)| value)
}

/// A struct of members by name.
///
/// # Errors
/// What is too large about it.
pub(crate) fn structure(members: Vec<(Rc<str>, Value)>) -> Result<(Value, usize), String> {
    let made = Value::Struct(Rc::new(members));
    let size = checked_size(std::slice::from_ref(&made))?;
    Ok((made, size))
}

/// A string, if it is not too long.
pub(crate) fn text(text: &str) -> Result<Value, String> {
    let characters = text.chars().count();
    if characters > MOST_CHARACTERS {
        return Err(format!(
            "the string has {characters} characters, {MOST_CHARACTERS} at most"
        ));
    }
    Ok(Value::Text(text.into()))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A hundred roundings at one radian.
    const ROUNDING: f64 = 1e-14;

    #[test]
    fn poses_near_half_a_revolution_come_back() {
        for away in [0.0, 1e-9, 1e-6, 1e-3] {
            let turn = Vector3::new(1.0, 2.0, -2.0) / 3.0 * (std::f64::consts::PI - away);
            let pose = pose_from_rotation_vector(Vector3::new(0.1, 0.2, 0.3), turn);
            let back = Value::pose(&pose).transform().unwrap();
            assert!((back.translation.vector - pose.translation.vector).amax() < ROUNDING);
            let between = rotation_vector(&(back.rotation.inverse() * pose.rotation)).norm();
            assert!(between < ROUNDING, "{between:e}");
        }
    }

    #[test]
    fn whole_numbers_print_without_a_point() {
        assert_eq!(Value::numbers(&[1.0, -0.5, 1e3]).text(), "[1, -0.5, 1000]");
    }
}
