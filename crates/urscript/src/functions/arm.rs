//! The arm: where it is, where it goes, and what it carries.

use needlebench_kinematics::{Joints, Pose};

use crate::call::Call;
use crate::host::Request;
use crate::live::{Live, Reply};
use crate::motion::{Belief, Motion, MotionKind, Pace};
use crate::place::ScriptError;
use crate::value::Value;

type Done = Result<Reply, ScriptError>;

/// Acceleration and speed where a program gives none, of joints (rad/s^2, rad/s) and of the tool (m/s^2, m/s): those
/// of UR's script manual.
const JOINT_PACE: [f64; 2] = [1.4, 1.05];
const TOOL_PACE: [f64; 2] = [1.2, 0.25];

/// Look-ahead (s) and gain of `servoj` where a program gives none: those of UR's script manual.
const SERVO: [f64; 2] = [0.1, 300.0];

#[expect(
    clippy::unnecessary_wraps,
    reason = "built-in functions have one signature"
)]
fn done(value: Value) -> Done {
    Ok(Reply::Value(value))
}

/// Where the set-point is.
fn target(live: &Live<'_>) -> Joints {
    live.host.state().target_joints
}

pub(crate) fn target_joints(live: &mut Live<'_>, _: &Call) -> Done {
    done(Value::numbers(target(live).as_slice()))
}

pub(crate) fn target_tcp(live: &mut Live<'_>, call: &Call) -> Done {
    let pose = live.host.base_from_flange(&target(live)) * live.tcp(call)?;
    done(Value::pose(&pose))
}

/// The tool's point of a call: its argument, else the program's.
fn tcp_of(live: &Live<'_>, call: &Call, index: usize) -> Result<Pose, ScriptError> {
    match call.get(index) {
        None => live.tcp(call),
        Some(Value::Text(name)) if **name == *"active_tcp" => live.tcp(call),
        Some(_) => call.pose(index),
    }
}

pub(crate) fn forward(live: &mut Live<'_>, call: &Call) -> Done {
    let joints = match call.get(0) {
        None => target(live),
        Some(_) => call.joints(0)?,
    };
    let tcp = tcp_of(live, call, 1)?;
    done(Value::pose(&(live.host.base_from_flange(&joints) * tcp)))
}

fn inverse_of(live: &mut Live<'_>, call: &Call) -> Result<Option<Joints>, ScriptError> {
    let pose = call.pose(0)?;
    let near = match call.get(1) {
        None => target(live),
        Some(_) => call.joints(1)?,
    };
    let tcp = tcp_of(live, call, 4)?;
    Ok(live.host.inverse(&(pose * tcp.inverse()), &near))
}

pub(crate) fn inverse(live: &mut Live<'_>, call: &Call) -> Done {
    match inverse_of(live, call)? {
        Some(joints) => done(Value::numbers(joints.as_slice())),
        None => Err(call.error("no joint positions bring the tool to the pose")),
    }
}

pub(crate) fn has_inverse(live: &mut Live<'_>, call: &Call) -> Done {
    done(Value::Truth(inverse_of(live, call)?.is_some()))
}

pub(crate) fn period(live: &mut Live<'_>, _: &Call) -> Done {
    done(Value::Number(live.host.period_s()))
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
fn joint_target(live: &mut Live<'_>, call: &Call) -> Result<Joints, ScriptError> {
    if let Value::Pose(_) = call.value(0)? {
        let pose = call.pose(0)?;
        let tcp = live.tcp(call)?;
        let near = target(live);
        let found = live.host.inverse(&(pose * tcp.inverse()), &near);
        return found.ok_or_else(|| call.error("no joint positions bring the tool to the pose"));
    }
    call.joints(0)
}

/// A pose that a move is given, or that of its joint positions.
fn tool_target(
    live: &mut Live<'_>,
    call: &Call,
    index: usize,
    tcp: &Pose,
) -> Result<Pose, ScriptError> {
    if let Value::Pose(_) = call.value(index)? {
        return call.pose(index);
    }
    let joints = call.joints(index)?;
    Ok(live.host.base_from_flange(&joints) * tcp)
}

fn perform(
    live: &mut Live<'_>,
    call: &Call,
    kind: MotionKind,
    flange_from_tcp: Option<Pose>,
) -> Done {
    let motion = Motion {
        place: call.place,
        kind,
        flange_from_tcp,
    };
    live.begin(&Request::Move(motion), call.place)
}

pub(crate) fn movej(live: &mut Live<'_>, call: &Call) -> Done {
    let to = joint_target(live, call)?;
    let pace = pace(call, JOINT_PACE, Some(3))?;
    let blend_m = bounded(call, 4, 0.0, Least::Zero)?;
    let tcp = if blend_m > 0.0 {
        Some(live.tcp(call)?)
    } else {
        None
    };
    perform(live, call, MotionKind::Joints { to, pace, blend_m }, tcp)
}

pub(crate) fn movel(live: &mut Live<'_>, call: &Call) -> Done {
    let tcp = live.tcp(call)?;
    let to = tool_target(live, call, 0, &tcp)?;
    let pace = pace(call, TOOL_PACE, Some(3))?;
    let blend_m = bounded(call, 4, 0.0, Least::Zero)?;
    perform(
        live,
        call,
        MotionKind::Line { to, pace, blend_m },
        Some(tcp),
    )
}

pub(crate) fn movep(live: &mut Live<'_>, call: &Call) -> Done {
    let tcp = live.tcp(call)?;
    let to = tool_target(live, call, 0, &tcp)?;
    let pace = pace(call, TOOL_PACE, None)?;
    let blend_m = call.number_or(3, 0.0)?;
    if blend_m < 0.0 {
        return Err(call.error(format!("r is {blend_m}, and has to be at least 0")));
    }
    perform(
        live,
        call,
        MotionKind::Process { to, pace, blend_m },
        Some(tcp),
    )
}

/// Mode 0: the tool turns evenly to its end, whatever it has at the place between.
pub(crate) fn movec(live: &mut Live<'_>, call: &Call) -> Done {
    let tcp = live.tcp(call)?;
    let via_m = tool_target(live, call, 0, &tcp)?.translation.vector;
    let to = tool_target(live, call, 1, &tcp)?;
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
        return Err(call.error(reason));
    }
    let kind = MotionKind::Circle {
        via_m,
        to,
        pace,
        blend_m,
    };
    perform(live, call, kind, Some(tcp))
}

/// Acceleration and speed of `servoj` do not count.
pub(crate) fn servoj(live: &mut Live<'_>, call: &Call) -> Done {
    let to = call.joints(0)?;
    let time_s = bounded(call, 3, live.host.period_s(), Least::AboveZero)?;
    let kind = MotionKind::Servo {
        to,
        time_s,
        lookahead_s: call.number_or(4, SERVO[0])?,
        gain: call.number_or(5, SERVO[1])?,
    };
    perform(live, call, kind, None)
}

fn stop(live: &mut Live<'_>, call: &Call, is_linear: bool) -> Done {
    let deceleration = call.number(0)?;
    if deceleration <= 0.0 {
        return Err(call.error(format!("a is {deceleration}, and has to be more than 0")));
    }
    let kind = MotionKind::Stop {
        deceleration,
        is_linear,
    };
    perform(live, call, kind, None)
}

pub(crate) fn stopj(live: &mut Live<'_>, call: &Call) -> Done {
    stop(live, call, false)
}

pub(crate) fn stopl(live: &mut Live<'_>, call: &Call) -> Done {
    stop(live, call, true)
}

/// Changes what the controller believes.
fn believe(live: &mut Live<'_>, change: impl FnOnce(&mut Belief)) -> Done {
    let before = live.host.belief();
    let mut belief = before.clone();
    change(&mut belief);
    if belief != *before {
        live.host.set_belief(belief);
    }
    done(Value::Nothing)
}

pub(crate) fn set_tcp(live: &mut Live<'_>, call: &Call) -> Done {
    let tcp = call.pose(0)?;
    believe(live, |belief| belief.flange_from_tcp = Some(tcp))
}

pub(crate) fn tcp_offset(live: &mut Live<'_>, call: &Call) -> Done {
    done(Value::pose(&live.tcp(call)?))
}

fn mass_kg(call: &Call) -> Result<f64, ScriptError> {
    let mass_kg = call.number(0)?;
    if mass_kg < 0.0 {
        return Err(call.error(format!("m is {mass_kg} kg, and has to be at least 0")));
    }
    Ok(mass_kg)
}

pub(crate) fn set_payload(live: &mut Live<'_>, call: &Call) -> Done {
    let mass_kg = mass_kg(call)?;
    let centre_m = match call.get(1) {
        Some(_) => Some(call.numbers(1)?),
        None => live.host.belief().centre_m,
    };
    believe(live, |belief| {
        belief.payload_kg = Some(mass_kg);
        belief.centre_m = centre_m;
    })
}

pub(crate) fn set_mass(live: &mut Live<'_>, call: &Call) -> Done {
    let mass_kg = mass_kg(call)?;
    believe(live, |belief| belief.payload_kg = Some(mass_kg))
}

pub(crate) fn set_centre(live: &mut Live<'_>, call: &Call) -> Done {
    let centre_m = call.numbers(0)?;
    believe(live, |belief| belief.centre_m = Some(centre_m))
}

pub(crate) fn payload(live: &mut Live<'_>, call: &Call) -> Done {
    match live.host.belief().payload_kg {
        Some(mass_kg) => done(Value::Number(mass_kg)),
        None => {
            Err(call.error("the program has set no payload, and the installation's is not known"))
        }
    }
}

pub(crate) fn set_gravity(live: &mut Live<'_>, call: &Call) -> Done {
    let gravity_m_s2 = call.numbers(0)?;
    believe(live, |belief| belief.gravity_m_s2 = Some(gravity_m_s2))
}
