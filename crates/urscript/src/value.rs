//! What expressions are worth.

use std::rc::Rc;

use nalgebra::Vector3;
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
        }
    }

    /// As `to_str` and `textmsg` have it; whole numbers without a point.
    pub fn text(&self) -> String {
        match self {
            Self::Nothing => String::new(),
            Self::Truth(true) => "True".to_owned(),
            Self::Truth(false) => "False".to_owned(),
            Self::Number(number) => number.to_string(),
            Self::Text(text) => text.to_string(),
            Self::List(all) => {
                // Longer than any string may be.
                let some = all.iter().take(MOST_CHARACTERS);
                let texts: Vec<String> = some.map(Self::text).collect();
                format!("[{}]", texts.join(", "))
            }
            Self::Pose(all) => {
                let texts: Vec<String> = all.iter().map(f64::to_string).collect();
                format!("p[{}]", texts.join(", "))
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
            if let Value::List(inside) = value {
                sum += measure(inside, left)?;
            }
        }
        Some(sum)
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
