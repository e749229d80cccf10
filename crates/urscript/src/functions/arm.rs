//! The arm: where it is, where it goes, and what it carries.

use needlebench_kinematics::{Joints, Pose};

use crate::call::Call;
use crate::machine::Machine;
use crate::motion::{Motion, MotionKind, Pace};
use crate::place::ScriptError;
use crate::value::Value;

type Done = Result<Value, ScriptError>;

/// Acceleration and speed where a program gives none, of joints (rad/s^2, rad/s) and of the tool (m/s^2, m/s): those
/// of UR's script manual.
const JOINT_PACE: [f64; 2] = [1.4, 1.05];
const TOOL_PACE: [f64; 2] = [1.2, 0.25];

/// Look-ahead (s) and gain of `servoj` where a program gives none: those of UR's script manual.
const SERVO: [f64; 2] = [0.1, 300.0];

/// Joint positions that something measured: before the first motion those at which the arm stands, which are given.
fn measured(machine: &mut Machine<'_>, call: &Call) -> Result<Joints, ScriptError> {
    if machine.has_moved {
        return Err(machine.refused(call.place, call.name, "reads the arm's measured state"));
    }
    machine.note(
        call.place,
        &format!("{} is the start posture: nothing has moved yet", call.name),
    );
    Ok(machine.arm.joints())
}

pub(crate) fn joints_before_the_first_motion(machine: &mut Machine<'_>, call: &Call) -> Done {
    Ok(Value::numbers(measured(machine, call)?.as_slice()))
}

pub(crate) fn tcp_before_the_first_motion(machine: &mut Machine<'_>, call: &Call) -> Done {
    let joints = measured(machine, call)?;
    let tcp = machine.tcp(call.place)?;
    Ok(Value::pose(&(machine.arm.base_from_flange(&joints) * tcp)))
}

pub(crate) fn flange_before_the_first_motion(machine: &mut Machine<'_>, call: &Call) -> Done {
    let joints = measured(machine, call)?;
    Ok(Value::pose(&machine.arm.base_from_flange(&joints)))
}

/// Where the last motion ends; not known where the next one may begin before its end.
fn target(machine: &Machine<'_>, call: &Call) -> Result<Joints, ScriptError> {
    if machine.is_blended {
        return Err(
            call.error("the motion before has a blend radius: where the arm is then is not known")
        );
    }
    Ok(machine.arm.joints())
}

pub(crate) fn target_joints(machine: &mut Machine<'_>, call: &Call) -> Done {
    Ok(Value::numbers(target(machine, call)?.as_slice()))
}

pub(crate) fn target_tcp(machine: &mut Machine<'_>, call: &Call) -> Done {
    let joints = target(machine, call)?;
    let tcp = machine.tcp(call.place)?;
    Ok(Value::pose(&(machine.arm.base_from_flange(&joints) * tcp)))
}

/// The tool's point of a call: its argument, else the program's.
fn tcp_of(machine: &Machine<'_>, call: &Call, index: usize) -> Result<Pose, ScriptError> {
    match call.get(index) {
        None => machine.tcp(call.place),
        Some(Value::Text(name)) if **name == *"active_tcp" => machine.tcp(call.place),
        Some(_) => call.pose(index),
    }
}

pub(crate) fn forward(machine: &mut Machine<'_>, call: &Call) -> Done {
    let joints = match call.get(0) {
        None => target(machine, call)?,
        Some(_) => call.joints(0)?,
    };
    let tcp = tcp_of(machine, call, 1)?;
    Ok(Value::pose(&(machine.arm.base_from_flange(&joints) * tcp)))
}

fn inverse_of(machine: &mut Machine<'_>, call: &Call) -> Result<Option<Joints>, ScriptError> {
    let pose = call.pose(0)?;
    let near = match call.get(1) {
        None => target(machine, call)?,
        Some(_) => call.joints(1)?,
    };
    let tcp = tcp_of(machine, call, 4)?;
    Ok(machine.arm.inverse(&(pose * tcp.inverse()), &near))
}

pub(crate) fn inverse(machine: &mut Machine<'_>, call: &Call) -> Done {
    match inverse_of(machine, call)? {
        Some(joints) => Ok(Value::numbers(joints.as_slice())),
        None => Err(call.error("no joint positions bring the tool to the pose")),
    }
}

pub(crate) fn has_inverse(machine: &mut Machine<'_>, call: &Call) -> Done {
    Ok(Value::Truth(inverse_of(machine, call)?.is_some()))
}

#[expect(
    clippy::unnecessary_wraps,
    reason = "built-in functions have one signature"
)]
pub(crate) fn period(machine: &mut Machine<'_>, _: &Call) -> Done {
    Ok(Value::Number(machine.arm.period_s()))
}

/// A number that has to be positive, or at least not negative.
fn bounded(call: &Call, index: usize, otherwise: f64, least: Least) -> Result<f64, ScriptError> {
    let number = call.number_or(index, otherwise)?;
    let name = ["q", "a", "v", "t", "r"];
    let is_wrong = match least {
        Least::Zero => number < 0.0,
        Least::AboveZero => number <= 0.0,
    };
    if is_wrong || !number.is_finite() {
        let name = name.get(index).copied().unwrap_or("argument");
        let wanted = match least {
            Least::Zero => "at least 0",
            Least::AboveZero => "more than 0",
        };
        return Err(call.error(format!("{name} is {number}, and has to be {wanted}")));
    }
    Ok(number)
}

#[derive(Clone, Copy)]
enum Least {
    Zero,
    AboveZero,
}

/// Acceleration, speed and time of a move; with a time the others do not count.
fn pace(call: &Call, [a, v]: [f64; 2], time: Option<usize>) -> Result<Pace, ScriptError> {
    let time_s = match time {
        Some(index) => bounded(call, index, 0.0, Least::Zero)?,
        None => 0.0,
    };
    let time_s = (time_s > 0.0).then_some(time_s);
    let least = if time_s.is_some() {
        Least::Zero
    } else {
        Least::AboveZero
    };
    Ok(Pace {
        acceleration: bounded(call, 1, a, least)?,
        speed: bounded(call, 2, v, least)?,
        time_s,
    })
}

/// Joint positions that a move is given, or those of its pose that are nearest to where it begins.
fn joint_target(machine: &mut Machine<'_>, call: &Call) -> Result<Joints, ScriptError> {
    if let Value::Pose(_) = call.value(0)? {
        let pose = call.pose(0)?;
        let tcp = machine.tcp(call.place)?;
        let near = machine.arm.joints();
        let found = machine.arm.inverse(&(pose * tcp.inverse()), &near);
        return found.ok_or_else(|| call.error("no joint positions bring the tool to the pose"));
    }
    call.joints(0)
}

/// A pose that a move is given, or that of its joint positions.
fn tool_target(
    machine: &mut Machine<'_>,
    call: &Call,
    index: usize,
    tcp: &Pose,
) -> Result<Pose, ScriptError> {
    if let Value::Pose(_) = call.value(index)? {
        return call.pose(index);
    }
    let joints = call.joints(index)?;
    Ok(machine.arm.base_from_flange(&joints) * tcp)
}

fn perform(
    machine: &mut Machine<'_>,
    call: &Call,
    kind: MotionKind,
    flange_from_tcp: Option<Pose>,
) -> Done {
    machine.perform(&Motion {
        place: call.place,
        kind,
        flange_from_tcp,
    })?;
    Ok(Value::Nothing)
}

pub(crate) fn movej(machine: &mut Machine<'_>, call: &Call) -> Done {
    let to = joint_target(machine, call)?;
    let pace = pace(call, JOINT_PACE, Some(3))?;
    let blend_m = bounded(call, 4, 0.0, Least::Zero)?;
    let tcp = if blend_m > 0.0 {
        Some(machine.tcp(call.place)?)
    } else {
        None
    };
    perform(machine, call, MotionKind::Joints { to, pace, blend_m }, tcp)
}

pub(crate) fn movel(machine: &mut Machine<'_>, call: &Call) -> Done {
    let tcp = machine.tcp(call.place)?;
    let to = tool_target(machine, call, 0, &tcp)?;
    let pace = pace(call, TOOL_PACE, Some(3))?;
    let blend_m = bounded(call, 4, 0.0, Least::Zero)?;
    perform(
        machine,
        call,
        MotionKind::Line { to, pace, blend_m },
        Some(tcp),
    )
}

pub(crate) fn movep(machine: &mut Machine<'_>, call: &Call) -> Done {
    let tcp = machine.tcp(call.place)?;
    let to = tool_target(machine, call, 0, &tcp)?;
    let pace = pace(call, TOOL_PACE, None)?;
    let blend_m = call.number_or(3, 0.0)?;
    if blend_m < 0.0 {
        return Err(call.error(format!("r is {blend_m}, and has to be at least 0")));
    }
    perform(
        machine,
        call,
        MotionKind::Process { to, pace, blend_m },
        Some(tcp),
    )
}

/// Mode 0: the tool turns evenly to its end, whatever it has at the place between.
pub(crate) fn movec(machine: &mut Machine<'_>, call: &Call) -> Done {
    let tcp = machine.tcp(call.place)?;
    let via_m = tool_target(machine, call, 0, &tcp)?.translation.vector;
    let to = tool_target(machine, call, 1, &tcp)?;
    let [acceleration, speed] =
        [(2, "a", TOOL_PACE[0]), (3, "v", TOOL_PACE[1])].map(|(index, name, otherwise)| {
            let number = call.number_or(index, otherwise)?;
            if number > 0.0 {
                return Ok(number);
            }
            Err(call.error(format!("{name} is {number}, and has to be more than 0")))
        });
    let pace = Pace {
        acceleration: acceleration?,
        speed: speed?,
        time_s: None,
    };
    let blend_m = call.number_or(4, 0.0)?;
    if blend_m < 0.0 {
        return Err(call.error(format!("r is {blend_m}, and has to be at least 0")));
    }
    if call.number_or(5, 0.0)? != 0.0 {
        let reason = "turns the tool with the circle in that mode, which is not simulated";
        return Err(machine.refused(call.place, call.name, reason));
    }
    let kind = MotionKind::Circle {
        via_m,
        to,
        pace,
        blend_m,
    };
    perform(machine, call, kind, Some(tcp))
}

/// Acceleration and speed of `servoj` do not count.
pub(crate) fn servoj(machine: &mut Machine<'_>, call: &Call) -> Done {
    let to = call.joints(0)?;
    let time_s = bounded(call, 3, machine.arm.period_s(), Least::AboveZero)?;
    let kind = MotionKind::Servo {
        to,
        time_s,
        lookahead_s: call.number_or(4, SERVO[0])?,
        gain: call.number_or(5, SERVO[1])?,
    };
    perform(machine, call, kind, None)
}

pub(crate) fn sleep(machine: &mut Machine<'_>, call: &Call) -> Done {
    let time_s = call.number(0)?;
    if time_s < 0.0 {
        return Err(call.error(format!("t is {time_s}, and has to be at least 0")));
    }
    if time_s <= 0.0 {
        return Ok(Value::Nothing);
    }
    perform(machine, call, MotionKind::Stand { time_s }, None)
}

/// Ends a thread's share of a cycle; the arm goes on as it does.
#[expect(
    clippy::unnecessary_wraps,
    reason = "built-in functions have one signature"
)]
pub(crate) fn sync(_: &mut Machine<'_>, _: &Call) -> Done {
    Ok(Value::Nothing)
}

fn stop(machine: &mut Machine<'_>, call: &Call, is_linear: bool) -> Done {
    let deceleration = call.number(0)?;
    if deceleration <= 0.0 {
        return Err(call.error(format!("a is {deceleration}, and has to be more than 0")));
    }
    let kind = MotionKind::Stop {
        deceleration,
        is_linear,
    };
    perform(machine, call, kind, None)
}

pub(crate) fn stopj(machine: &mut Machine<'_>, call: &Call) -> Done {
    stop(machine, call, false)
}

pub(crate) fn stopl(machine: &mut Machine<'_>, call: &Call) -> Done {
    stop(machine, call, true)
}

pub(crate) fn set_tcp(machine: &mut Machine<'_>, call: &Call) -> Done {
    machine.belief.flange_from_tcp = Some(call.pose(0)?);
    Ok(Value::Nothing)
}

pub(crate) fn tcp_offset(machine: &mut Machine<'_>, call: &Call) -> Done {
    Ok(Value::pose(&machine.tcp(call.place)?))
}

pub(crate) fn set_payload(machine: &mut Machine<'_>, call: &Call) -> Done {
    set_mass(machine, call)?;
    if call.get(1).is_some() {
        machine.belief.centre_m = Some(call.numbers(1)?);
    }
    Ok(Value::Nothing)
}

pub(crate) fn set_mass(machine: &mut Machine<'_>, call: &Call) -> Done {
    let mass_kg = call.number(0)?;
    if mass_kg < 0.0 {
        return Err(call.error(format!("m is {mass_kg} kg, and has to be at least 0")));
    }
    machine.belief.payload_kg = Some(mass_kg);
    Ok(Value::Nothing)
}

pub(crate) fn set_centre(machine: &mut Machine<'_>, call: &Call) -> Done {
    machine.belief.centre_m = Some(call.numbers(0)?);
    Ok(Value::Nothing)
}

pub(crate) fn payload(machine: &mut Machine<'_>, call: &Call) -> Done {
    match machine.belief.payload_kg {
        Some(mass_kg) => Ok(Value::Number(mass_kg)),
        None => {
            Err(call.error("the program has set no payload, and the installation's is not known"))
        }
    }
}

pub(crate) fn set_gravity(machine: &mut Machine<'_>, call: &Call) -> Done {
    machine.belief.gravity_m_s2 = Some(call.numbers(0)?);
    Ok(Value::Nothing)
}
