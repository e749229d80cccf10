//! What the controller knows and does while it runs.
#![expect(
    clippy::unnecessary_wraps,
    reason = "built-in functions have one signature"
)]

use std::rc::Rc;

use needlebench_kinematics::{Joints, Pose};

use crate::call::Call;
use crate::host::{ArmState, Bank, Message, Request, Signal};
use crate::live::{Live, Reply};
use crate::place::ScriptError;
use crate::value::{Value, integer, text, whole};

type Done = Result<Reply, ScriptError>;

/// Acceleration of `speedj` (rad/s^2) and `speedl` (m/s^2) and shares of `optimovej` where a program gives none: those
/// of UR's script manual.
const SPEED_ACCELERATION: [f64; 2] = [1.4, 1.2];
const OPTIMISED_SHARE: f64 = 0.3;

/// Acceleration and speed of `servoc` likewise, m/s^2 and m/s.
const SERVO_CIRCLE: [f64; 2] = [1.2, 0.25];

/// An element of a bank that a call names by a number of its own, from 0.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Elements {
    pub bank: Bank,
    pub first: usize,
    pub count: usize,
}

impl Elements {
    pub const fn all(bank: Bank) -> Self {
        Self {
            bank,
            first: 0,
            count: bank.size(),
        }
    }

    fn index(self, call: &Call) -> Result<usize, ScriptError> {
        let number = call.number(0)?;
        match whole(number) {
            Some(index) if index < self.count => Ok(self.first + index),
            _ => {
                let last = self.count - 1;
                Err(call.error(format!("there is no number {number}: they are 0 to {last}")))
            }
        }
    }
}

pub(crate) fn read(live: &Live<'_>, call: &Call, of: Elements) -> Done {
    Ok(Reply::Value(
        match live.host.read(of.bank, of.index(call)?) {
            Signal::Integer(number) => Value::Number(f64::from(number)),
            Signal::Number(number) => Value::Number(number),
            Signal::Truth(truth) => Value::Truth(truth),
        },
    ))
}

pub(crate) fn write(live: &mut Live<'_>, call: &Call, of: Elements) -> Done {
    let index = of.index(call)?;
    let value = call.value(1)?;
    let signal = match (of.bank.zero(), value) {
        (Signal::Integer(_), Value::Number(number)) => {
            let fitting = integer(*number).map_err(|message| call.error(message))?;
            Signal::Integer(fitting)
        }
        (Signal::Number(_), Value::Number(number)) => Signal::Number(*number),
        (Signal::Truth(_), Value::Truth(truth)) => Signal::Truth(*truth),
        (zero, other) => {
            let wanted = match zero {
                Signal::Truth(_) => "a truth value",
                _ => "a number",
            };
            let found = other.kind();
            return Err(call.error(format!("the value is {found}, where {wanted} is needed")));
        }
    };
    live.host.write(of.bank, index, signal);
    Ok(Reply::Value(Value::Nothing))
}

fn numbers(all: &[f64]) -> Done {
    Ok(Reply::Value(Value::numbers(all)))
}

fn number(number: impl Into<f64>) -> Done {
    Ok(Reply::Value(Value::Number(number.into())))
}

fn truth(truth: bool) -> Done {
    Ok(Reply::Value(Value::Truth(truth)))
}

pub(crate) fn joints(live: &Live<'_>, of: fn(&ArmState) -> &Joints) -> Done {
    numbers(of(live.host.state()).as_slice())
}

pub(crate) fn six(live: &Live<'_>, of: fn(&ArmState) -> &[f64; 6]) -> Done {
    numbers(of(live.host.state()))
}

/// How hard the tool's point is pushed, N.
pub(crate) fn force(live: &mut Live<'_>, _: &Call) -> Done {
    let [x, y, z, ..] = live.host.state().tool_force;
    number((x * x + y * y + z * z).sqrt())
}

pub(crate) fn flange_pose(live: &mut Live<'_>, _: &Call) -> Done {
    let joints = live.host.state().joints;
    Ok(Reply::Value(Value::pose(
        &live.host.base_from_flange(&joints),
    )))
}

pub(crate) fn tcp_pose(live: &mut Live<'_>, call: &Call) -> Done {
    let joints = live.host.state().joints;
    let pose = live.host.base_from_flange(&joints) * live.tcp(call)?;
    Ok(Reply::Value(Value::pose(&pose)))
}

pub(crate) fn joints_ago(live: &mut Live<'_>, call: &Call) -> Done {
    let steps = call.number_or(0, 0.0)?;
    let joints = whole(steps).and_then(|steps| live.host.joints_ago(steps));
    match joints {
        Some(joints) => numbers(joints.as_slice()),
        None => Err(call.error(format!(
            "the joint positions of {steps} cycles ago are not known"
        ))),
    }
}

pub(crate) fn is_steady(live: &mut Live<'_>, _: &Call) -> Done {
    truth(live.host.state().is_steady)
}

pub(crate) fn robot_mode(live: &mut Live<'_>, _: &Call) -> Done {
    number(live.host.state().robot_mode)
}

pub(crate) fn safety_mode(live: &mut Live<'_>, _: &Call) -> Done {
    number(live.host.state().safety_mode)
}

/// The joint positions that a call means: its own, or those of its pose; none where the pose has none.
fn posture(live: &mut Live<'_>, call: &Call) -> Result<Option<Joints>, ScriptError> {
    if !matches!(call.value(0)?, Value::Pose(_)) {
        return Ok(Some(call.joints(0)?));
    }
    let flange: Pose = call.pose(0)? * live.tcp(call)?.inverse();
    let near = live.host.state().target_joints;
    Ok(live.host.inverse(&flange, &near))
}

pub(crate) fn is_within_limits(live: &mut Live<'_>, call: &Call) -> Done {
    let posture = posture(live, call)?;
    truth(posture.is_some_and(|joints| live.host.is_within_limits(&joints)))
}

/// The clock as a struct of whole seconds and nanoseconds.
pub(crate) fn time(live: &mut Live<'_>, _: &Call) -> Done {
    let time_s = live.host.time_s();
    let seconds = time_s.floor();
    let nanoseconds = ((time_s - seconds) * 1e9).floor();
    let parts = [("sec", seconds), ("nanosec", nanoseconds)];
    let parts = parts.map(|(name, number)| (Rc::from(name), Value::Number(number)));
    Ok(Reply::Value(Value::Struct(Rc::new(parts.into()))))
}

pub(crate) fn sync(_: &mut Live<'_>, _: &Call) -> Done {
    Ok(Reply::NextCycle)
}

pub(crate) fn sleep(_: &mut Live<'_>, call: &Call) -> Done {
    let time_s = call.number(0)?;
    if time_s < 0.0 {
        return Err(call.error(format!("t is {time_s}, and has to be at least 0")));
    }
    Ok(Reply::Sleep(time_s))
}

/// A number that is more than 0.
fn positive(call: &Call, index: usize, otherwise: f64) -> Result<f64, ScriptError> {
    let number = call.number_or(index, otherwise)?;
    if number > 0.0 {
        return Ok(number);
    }
    let name = call.parameters.get(index).copied().unwrap_or("argument");
    Err(call.error(format!("{name} is {number}, and has to be more than 0")))
}

/// A time where one above 0 is given.
fn time_of(call: &Call, index: usize) -> Result<Option<f64>, ScriptError> {
    let time_s = call.number_or(index, 0.0)?;
    Ok((time_s > 0.0).then_some(time_s))
}

pub(crate) fn speedj(live: &mut Live<'_>, call: &Call) -> Done {
    let request = Request::JointSpeeds {
        speeds: call.joints(0)?,
        acceleration: positive(call, 1, SPEED_ACCELERATION[0])?,
        time_s: time_of(call, 2)?,
    };
    live.begin(&request, call.place)
}

pub(crate) fn speedl(live: &mut Live<'_>, call: &Call) -> Done {
    let turning_acceleration = match call.get(3) {
        Some(Value::Number(number)) if *number > 0.0 => Some(*number),
        _ => None,
    };
    let request = Request::ToolSpeed {
        speed: call.numbers(0)?,
        acceleration: positive(call, 1, SPEED_ACCELERATION[1])?,
        turning_acceleration,
        time_s: time_of(call, 2)?,
        flange_from_tcp: live.tcp(call)?,
    };
    live.begin(&request, call.place)
}

pub(crate) fn servoc(live: &mut Live<'_>, call: &Call) -> Done {
    let flange_from_tcp = live.tcp(call)?;
    let to = match call.value(0)? {
        Value::Pose(_) => call.pose(0)?,
        _ => live.host.base_from_flange(&call.joints(0)?) * flange_from_tcp,
    };
    let request = Request::ServoCircle {
        to,
        acceleration: positive(call, 1, SERVO_CIRCLE[0])?,
        speed: positive(call, 2, SERVO_CIRCLE[1])?,
        blend_m: call.number_or(3, 0.0)?.max(0.0),
        flange_from_tcp,
    };
    live.begin(&request, call.place)
}

fn optimised(live: &mut Live<'_>, call: &Call, is_linear: bool) -> Done {
    let to = posture(live, call)?;
    let to = to.ok_or_else(|| call.error("no joint positions bring the tool to the pose"))?;
    let request = Request::Optimised {
        to,
        is_linear,
        acceleration_share: positive(call, 1, OPTIMISED_SHARE)?.min(1.0),
        speed_share: positive(call, 2, OPTIMISED_SHARE)?.min(1.0),
        blend_m: call.number_or(3, 0.0)?.max(0.0),
    };
    live.begin(&request, call.place)
}

pub(crate) fn optimovej(live: &mut Live<'_>, call: &Call) -> Done {
    optimised(live, call, false)
}

pub(crate) fn optimovel(live: &mut Live<'_>, call: &Call) -> Done {
    optimised(live, call, true)
}

pub(crate) fn message(live: &mut Live<'_>, call: &Call) -> Done {
    let all: Vec<String> = call.values.iter().flatten().map(Value::text).collect();
    let said = text(&all.concat()).map_err(|message| call.error(message))?;
    live.host.message(Message::Text(said.text()), call.place);
    Ok(Reply::Value(Value::Nothing))
}

pub(crate) fn popup(live: &mut Live<'_>, call: &Call) -> Done {
    let message = Message::Popup {
        text: call.value(0)?.text(),
        title: call.get(1).map(Value::text).unwrap_or_default(),
        is_blocking: matches!(call.get(4), Some(Value::Truth(true))),
    };
    live.host.message(message, call.place);
    Ok(Reply::Value(Value::Nothing))
}

pub(crate) fn zero_force(live: &mut Live<'_>, _: &Call) -> Done {
    live.host.zero_force();
    Ok(Reply::Value(Value::Nothing))
}

pub(crate) fn set_watchdog(live: &mut Live<'_>, call: &Call) -> Done {
    let frequency_hz = positive(call, 1, 1.0)?;
    let action = match call.get(2) {
        None => "pause",
        Some(_) => call.text(2)?,
    };
    let done = live.host.set_watchdog(call.text(0)?, frequency_hz, action);
    done.map_err(|reason| call.error(reason))?;
    Ok(Reply::Value(Value::Nothing))
}

pub(crate) fn protective_stop(_: &mut Live<'_>, _: &Call) -> Done {
    Ok(Reply::ProtectiveStop)
}

/// Nothing is ever touched: contacts are not simulated for the controller.
pub(crate) fn tool_contact(_: &mut Live<'_>, _: &Call) -> Done {
    number(0.0)
}
