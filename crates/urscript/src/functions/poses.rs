//! Poses: position and rotation vector.

use nalgebra::{UnitQuaternion, Vector3};
use needlebench_kinematics::{Pose, rotation_vector};

use crate::call::Call;
use crate::place::ScriptError;
use crate::value::Value;

type Done = Result<Value, ScriptError>;

/// A pose, if its numbers are finite.
fn finite(call: &Call, pose: &Pose) -> Done {
    let value = Value::pose(pose);
    match &value {
        Value::Pose(parts) if parts.iter().all(|part| part.is_finite()) => Ok(value),
        _ => Err(call.error("there is no pose for these arguments")),
    }
}

/// Positions are added, rotations multiplied.
pub(crate) fn add(call: &Call) -> Done {
    let (first, second) = (call.pose(0)?, call.pose(1)?);
    let place = first.translation.vector + second.translation.vector;
    let turn = first.rotation * second.rotation;
    finite(call, &Pose::from_parts(place.into(), turn))
}

/// What [`add`] adds to `p_from` to get `p_to`.
pub(crate) fn subtract(call: &Call) -> Done {
    let (to, from) = (call.pose(0)?, call.pose(1)?);
    let place = to.translation.vector - from.translation.vector;
    let turn = to.rotation * from.rotation.inverse();
    finite(call, &Pose::from_parts(place.into(), turn))
}

pub(crate) fn transform(call: &Call) -> Done {
    finite(call, &(call.pose(0)? * call.pose(1)?))
}

pub(crate) fn inverse(call: &Call) -> Done {
    finite(call, &call.pose(0)?.inverse())
}

pub(crate) fn distance(call: &Call) -> Done {
    let (from, to) = (call.pose(0)?, call.pose(1)?);
    let distance_m = (from.translation.vector - to.translation.vector).norm();
    Ok(Value::Number(distance_m))
}

/// Straight in position, and about one axis the shorter way round in rotation.
pub(crate) fn interpolate(call: &Call) -> Done {
    let (from, to, share) = (call.pose(0)?, call.pose(1)?, call.number(2)?);
    let (start, end) = (from.translation.vector, to.translation.vector);
    let place = start + (end - start) * share;
    let turn = rotation_vector(&(from.rotation.inverse() * to.rotation));
    let rotation = from.rotation * UnitQuaternion::from_scaled_axis(turn * share);
    finite(call, &Pose::from_parts(place.into(), rotation))
}

pub(crate) fn vector_from_rpy(call: &Call) -> Done {
    let [roll, pitch, yaw] = call.numbers(0)?;
    let rotation = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
    let turn = rotation_vector(&rotation);
    Ok(Value::numbers(turn.as_slice()))
}

pub(crate) fn rpy_from_vector(call: &Call) -> Done {
    let turn: [f64; 3] = call.numbers(0)?;
    let rotation = UnitQuaternion::from_scaled_axis(Vector3::from(turn));
    let (roll, pitch, yaw) = rotation.euler_angles();
    Ok(Value::numbers(&[roll, pitch, yaw]))
}
