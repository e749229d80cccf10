//! What is asked of a controller, and why it refuses.

use nalgebra::Vector6;
use needlebench_kinematics::{JOINT_LABELS, Joints, Pose};
use needlebench_urscript::{MotionKind, Pace};

use crate::state::{Order, State};

/// Who asks: requests of one cycle take effect in this order, which is that of the fields.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Origin {
    /// The door: an interface, or the program.
    pub door: u32,
    /// Which of its clients.
    pub client: u32,
    /// Which of that client's requests; no two of them have the same.
    pub arrival: u64,
}

/// A request.
#[derive(Debug, Clone, PartialEq)]
pub struct Request {
    /// Who asks.
    pub from: Origin,
    /// For what.
    pub what: Command,
}

/// What is asked for; what follows is in [`TABLE`](crate::TABLE).
#[derive(Debug, Clone, PartialEq)]
pub enum Command {
    /// Power on.
    PowerOn,
    /// Release the brakes; from power off, power on before.
    ReleaseBrakes,
    /// Power off, and brake.
    PowerOff,
    /// Make a protective stop.
    ProtectiveStop,
    /// Leave the protective stop.
    Unlock,
    /// Press the emergency stop.
    PressEmergencyStop,
    /// Release the emergency stop.
    ReleaseEmergencyStop,
    /// Open the safeguard: stops the motion, and pauses the program.
    OpenSafeguard,
    /// Close the safeguard: the program stays paused.
    CloseSafeguard,
    /// Start a program, or go on with the paused one.
    Play,
    /// Pause the program.
    Pause,
    /// End the program.
    Stop,
    /// The speed slider, from more than 0 to 1: the rate at which motions along a path go. Not of those by speed, nor
    /// of `servoj` (assumed).
    SetSpeed(f64),
    /// Move the arm, for the program.
    Move(Box<Move>),
}

impl Command {
    /// Its kind.
    pub fn order(&self) -> Order {
        match self {
            Self::PowerOn => Order::PowerOn,
            Self::ReleaseBrakes => Order::ReleaseBrakes,
            Self::PowerOff => Order::PowerOff,
            Self::ProtectiveStop => Order::ProtectiveStop,
            Self::Unlock => Order::Unlock,
            Self::PressEmergencyStop => Order::PressEmergencyStop,
            Self::ReleaseEmergencyStop => Order::ReleaseEmergencyStop,
            Self::OpenSafeguard => Order::OpenSafeguard,
            Self::CloseSafeguard => Order::CloseSafeguard,
            Self::Play => Order::Play,
            Self::Pause => Order::Pause,
            Self::Stop => Order::Stop,
            Self::SetSpeed(_) => Order::SetSpeed,
            Self::Move(_) => Order::Move,
        }
    }
}

/// A motion of a program.
#[derive(Debug, Clone, PartialEq)]
pub struct Move {
    /// The tool's point in the flange's frame that the program believes in.
    pub flange_from_tcp: Pose,
    /// What moves.
    pub goal: Goal,
}

/// Kinds of motions. Poses and speeds of the tool are in the controller's base frame.
#[derive(Debug, Clone, PartialEq)]
pub enum Goal {
    /// As a program has them.
    Motion(MotionKind),
    /// `speedj`: joint speeds, until the next motion.
    JointSpeed {
        /// rad/s.
        speed: Joints,
        /// Of the joint whose speed changes most, rad/s^2.
        acceleration: f64,
        /// Time after which the program goes on, s; without it once the speed is reached.
        time_s: Option<f64>,
    },
    /// `speedl`: velocity of the tool's point and of the tool's rotation, until the next motion.
    ToolSpeed {
        /// m/s and rad/s.
        speed: Vector6<f64>,
        /// Of the tool's point, m/s^2, and of the rotation, rad/s^2; what changes more has it.
        acceleration: f64,
        /// As of [`Goal::JointSpeed`].
        time_s: Option<f64>,
    },
}

/// Why a request is refused.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum Refusal {
    /// Not in this state.
    #[error("{order:?} is refused in the state {state:?}")]
    State {
        /// The state.
        state: State,
        /// What was asked for.
        order: Order,
    },
    /// A protective stop is too young.
    #[error("a protective stop cannot be unlocked before 5 s: {left_s:.3} s left")]
    TooEarly {
        /// Until it can be, s of robot time.
        left_s: f64,
    },
    /// The arm is still being stopped.
    #[error("the arm does not stand yet")]
    StillMoving,
    /// A value that is not finite, or out of the range that any arm could make use of.
    #[error("{what} is {value} {unit}, outside [{least}, {most}] {unit}")]
    Value {
        /// What it is of.
        what: &'static str,
        /// The value.
        value: f64,
        /// The least that is taken.
        least: f64,
        /// The most that is taken.
        most: f64,
        /// Unit of these.
        unit: &'static str,
    },
    /// A joint position that is not finite or more than a hundred revolutions.
    #[error("{} is {value_rad} rad; are these radians?", JOINT_LABELS[*.joint])]
    Joint {
        /// Index of the joint.
        joint: usize,
        /// The value, rad.
        value_rad: f64,
    },
    /// The tool's frame or a pose is no rigid transform.
    #[error("{what} is no pose within 100 m")]
    Pose {
        /// What it is of.
        what: &'static str,
    },
    /// Begin, place between and end of a circle lie on a line.
    #[error("begin, place between and end of the circle lie on a line")]
    NoCircle,
    /// A move that would take no time, or longer than a day.
    #[error("a, v or t of the move give no course")]
    Pace,
}

const MOST_JOINT_RAD: f64 = 700.0;
const MOST_M: f64 = 100.0;
/// Speeds, accelerations, times: beyond these nothing is meant.
const LEAST: f64 = 1e-9;
const MOST: f64 = 1e6;

fn value(what: &'static str, unit: &'static str, value: f64, least: f64) -> Result<(), Refusal> {
    if value >= least && value <= MOST {
        return Ok(());
    }
    Err(Refusal::Value {
        what,
        value,
        least,
        most: MOST,
        unit,
    })
}

fn joints(joints: &Joints, most: f64) -> Result<(), Refusal> {
    match joints
        .iter()
        .position(|value| !value.is_finite() || value.abs() > most)
    {
        Some(joint) => Err(Refusal::Joint {
            joint,
            value_rad: joints[joint],
        }),
        None => Ok(()),
    }
}

fn pose(what: &'static str, pose: &Pose) -> Result<(), Refusal> {
    let near = pose.translation.vector.norm() <= MOST_M;
    let unit = (pose.rotation.coords.norm() - 1.0).abs() < 1e-6;
    if near && unit {
        Ok(())
    } else {
        Err(Refusal::Pose { what })
    }
}

fn pace(pace: &Pace, (speed, acceleration): (&'static str, &'static str)) -> Result<(), Refusal> {
    if let Some(time_s) = pace.time_s {
        return value("t", "s", time_s, LEAST);
    }
    value("v", speed, pace.speed, LEAST)?;
    value("a", acceleration, pace.acceleration, LEAST)
}

const OF_JOINTS: (&str, &str) = ("rad/s", "rad/s^2");
const OF_TOOL: (&str, &str) = ("m/s", "m/s^2");

impl Move {
    /// Whether its values could be meant.
    pub(crate) fn check(&self) -> Result<(), Refusal> {
        pose("the tool's point", &self.flange_from_tcp)?;
        match &self.goal {
            Goal::Motion(kind) => match kind {
                MotionKind::Joints {
                    to,
                    pace: of,
                    blend_m,
                } => {
                    joints(to, MOST_JOINT_RAD)?;
                    pace(of, OF_JOINTS)?;
                    value("r", "m", *blend_m, 0.0)
                }
                MotionKind::Line {
                    to,
                    pace: of,
                    blend_m,
                }
                | MotionKind::Process {
                    to,
                    pace: of,
                    blend_m,
                } => {
                    pose("the end", to)?;
                    pace(of, OF_TOOL)?;
                    value("r", "m", *blend_m, 0.0)
                }
                MotionKind::Circle {
                    via_m,
                    to,
                    pace: of,
                    blend_m,
                } => {
                    pose("the end", to)?;
                    value("the place between", "m", via_m.norm(), 0.0)?;
                    pace(of, OF_TOOL)?;
                    value("r", "m", *blend_m, 0.0)
                }
                MotionKind::Servo {
                    to,
                    time_s,
                    lookahead_s,
                    gain,
                } => {
                    joints(to, MOST_JOINT_RAD)?;
                    value("t", "s", *time_s, 0.0)?;
                    within("lookahead_time", "s", *lookahead_s, [0.03, 0.2])?;
                    within("gain", "1/s^2", *gain, [100.0, 2000.0])
                }
                MotionKind::Stop { deceleration, .. } => {
                    value("a", "rad/s^2 or m/s^2", *deceleration, LEAST)
                }
            },
            Goal::JointSpeed {
                speed,
                acceleration,
                time_s,
            } => {
                joints(speed, MOST)?;
                value("a", OF_JOINTS.1, *acceleration, LEAST)?;
                value("t", "s", time_s.unwrap_or(0.0), 0.0)
            }
            Goal::ToolSpeed {
                speed,
                acceleration,
                time_s,
            } => {
                value("the speed of the tool", OF_TOOL.0, speed.norm(), 0.0)?;
                value("a", OF_TOOL.1, *acceleration, LEAST)?;
                value("t", "s", time_s.unwrap_or(0.0), 0.0)
            }
        }
    }
}

/// The controller's own ranges (script manual, `servoj`), and the slider's.
pub(crate) fn within(
    what: &'static str,
    unit: &'static str,
    value: f64,
    [least, most]: [f64; 2],
) -> Result<(), Refusal> {
    if value >= least && value <= most {
        return Ok(());
    }
    Err(Refusal::Value {
        what,
        value,
        least,
        most,
        unit,
    })
}
