//! What a controller offers to a program that runs in time.

use needlebench_kinematics::{Joints, Pose};

use crate::motion::{Belief, Motion};
use crate::place::Place;

/// The controller that a program runs on.
///
/// The program reads it and asks it for things; it never waits by itself: [`Run::step`](crate::Run::step) is called
/// once a cycle, and everything that takes time goes on in a later one.
pub trait Host {
    /// Length of a cycle, s.
    fn period_s(&self) -> f64;
    /// The controller's clock, s.
    fn time_s(&self) -> f64;
    /// The arm at the begin of this cycle.
    fn state(&self) -> &ArmState;
    /// Joint positions (rad) some cycles ago, if they are still known.
    fn joints_ago(&self, cycles: usize) -> Option<Joints>;
    /// What the controller believes of tool and payload: it outlives programs.
    fn belief(&self) -> &Belief;
    /// A program says otherwise.
    fn set_belief(&mut self, belief: Belief);
    /// Pose of the flange in the controller's base frame.
    fn base_from_flange(&self, joints: &Joints) -> Pose;
    /// Joint positions that bring the flange to a pose in the controller's base frame: those nearest to a posture.
    fn inverse(&mut self, base_from_flange: &Pose, near: &Joints) -> Option<Joints>;
    /// Joint positions are within the limits that the controller enforces.
    fn is_within_limits(&self, joints: &Joints) -> bool;

    /// Begins what moves the arm, in the place of whatever moved it before.
    ///
    /// # Errors
    /// Why the controller does not: the program ends with that as an exception at the call.
    fn begin(&mut self, request: &Request, place: Place) -> Result<(), String>;
    /// The call that began the last request has done its time: the arm arrived or stands, the time of `servoj` is
    /// over, `speedj` has its speed. Asked from the next cycle on, once a cycle while a thread waits.
    fn is_done(&mut self) -> bool;

    /// A register, an input, an output or a flag; the index is below [`Bank::size`]. One that was never written is
    /// zero.
    fn read(&self, bank: Bank, index: usize) -> Signal;
    /// Writes one, of the bank's kind.
    fn write(&mut self, bank: Bank, index: usize, signal: Signal);

    /// What the program says to people.
    fn message(&mut self, message: Message, place: Place);
    /// The force sensor reads zero from here on.
    fn zero_force(&mut self);
    /// The program is to be stopped where an input is written less often than this, Hz.
    ///
    /// # Errors
    /// What the controller knows no such input or action by.
    fn set_watchdog(&mut self, input: &str, frequency_hz: f64, action: &str) -> Result<(), String>;
    /// The program, or what it takes, calls for a protective stop; it has ended already.
    fn protective_stop(&mut self, reason: &str);

    /// Opens a connection; false if it cannot be made. Without sockets nothing is there.
    fn open_socket(&mut self, name: &str, address: &str, port: u16) -> bool {
        let _ = (name, address, port);
        false
    }
    /// Closes a connection.
    fn close_socket(&mut self, name: &str) {
        let _ = name;
    }
    /// Sends bytes; false if there is no such connection.
    fn send(&mut self, name: &str, bytes: &[u8]) -> bool {
        let _ = (name, bytes);
        false
    }
    /// Bytes that came and were not taken; none if there is no such connection.
    fn received(&self, name: &str) -> Option<&[u8]> {
        let _ = name;
        None
    }
    /// Takes the first of the bytes that came.
    fn take(&mut self, name: &str, count: usize) {
        let _ = (name, count);
    }
}

/// An arm at the begin of a cycle.
#[derive(Debug, Clone, PartialEq)]
pub struct ArmState {
    /// Measured joint positions, rad.
    pub joints: Joints,
    /// Measured joint speeds, rad/s.
    pub joint_speeds: Joints,
    /// Joint positions of the set-point, rad.
    pub target_joints: Joints,
    /// Joint speeds of the set-point, rad/s.
    pub target_joint_speeds: Joints,
    /// Measured speed of the tool's point in the base frame: m/s, then rad/s about the axes.
    pub tool_speed: [f64; 6],
    /// Speed of the tool's point of the set-point, likewise.
    pub target_tool_speed: [f64; 6],
    /// Force and torque at the tool's point in the base frame: N, then N m.
    pub tool_force: [f64; 6],
    /// Torques of the joints, N m.
    pub joint_torques: Joints,
    /// The arm stands, and its errors have settled.
    pub is_steady: bool,
    /// The mode of the robot, as RTDE numbers it: 7 is running.
    pub robot_mode: i32,
    /// The mode of its safety system, as RTDE numbers it: 1 is normal.
    pub safety_mode: i32,
}

/// What moves an arm. Lengths in m, angles in rad; poses are `base_from_tcp`, in the controller's base frame.
#[derive(Debug, Clone, PartialEq)]
pub enum Request {
    /// Moves, `servoj` and stops.
    Move(Motion),
    /// `speedj`: joint speeds until something else is begun.
    JointSpeeds {
        /// Speeds, rad/s.
        speeds: Joints,
        /// Acceleration of the leading joint, rad/s^2.
        acceleration: f64,
        /// The call is done after this, s; else when the speeds are reached.
        time_s: Option<f64>,
    },
    /// `speedl`: a speed of the tool's point until something else is begun.
    ToolSpeed {
        /// m/s along, then rad/s about the axes of the base frame.
        speed: [f64; 6],
        /// Acceleration of the tool's point, m/s^2.
        acceleration: f64,
        /// Acceleration of its rotation, rad/s^2; the controller's own otherwise.
        turning_acceleration: Option<f64>,
        /// As of `JointSpeeds`.
        time_s: Option<f64>,
        /// The tool's point in the flange's frame.
        flange_from_tcp: Pose,
    },
    /// `servoc`: a pose of one moment, reached on a circle.
    ServoCircle {
        /// Where to.
        to: Pose,
        /// Acceleration of the tool's point, m/s^2.
        acceleration: f64,
        /// Speed of the tool's point, m/s.
        speed: f64,
        /// Distance from the end at which the next one may begin, m.
        blend_m: f64,
        /// The tool's point in the flange's frame.
        flange_from_tcp: Pose,
    },
    /// `optimovej`, `optimovel`: as fast as shares of the arm's limits allow.
    Optimised {
        /// Where to, rad.
        to: Joints,
        /// The tool's point goes along a straight line.
        is_linear: bool,
        /// Share of the largest acceleration, over 0 to 1.
        acceleration_share: f64,
        /// Share of the largest speed, over 0 to 1.
        speed_share: f64,
        /// Distance of the tool's point from the end at which the next motion may begin, m.
        blend_m: f64,
    },
}

/// Registers, inputs, outputs and flags.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Bank {
    /// Written from outside, whole numbers.
    InputInteger,
    /// Written from outside, numbers.
    InputFloat,
    /// Written from outside, truth values.
    InputBoolean,
    /// Written by programs, whole numbers.
    OutputInteger,
    /// Written by programs, numbers.
    OutputFloat,
    /// Written by programs, truth values.
    OutputBoolean,
    /// 8 standard inputs, 8 configurable ones, 2 of the tool.
    DigitalInput,
    /// 8 standard outputs, 8 configurable ones, 2 of the tool.
    DigitalOutput,
    /// 2 standard inputs, 2 of the tool, V or A.
    AnalogInput,
    /// 2 standard outputs, share of the range.
    AnalogOutput,
    /// Flags that programs leave for each other.
    Flag,
}

impl Bank {
    /// How many there are.
    pub const fn size(self) -> usize {
        match self {
            Self::InputInteger | Self::InputFloat | Self::OutputInteger | Self::OutputFloat => 48,
            Self::InputBoolean | Self::OutputBoolean => 128,
            Self::DigitalInput | Self::DigitalOutput => 18,
            Self::AnalogInput => 4,
            Self::AnalogOutput => 2,
            Self::Flag => 32,
        }
    }

    /// What an element is before anything is written.
    pub const fn zero(self) -> Signal {
        match self {
            Self::InputInteger | Self::OutputInteger => Signal::Integer(0),
            Self::InputFloat | Self::OutputFloat | Self::AnalogInput | Self::AnalogOutput => {
                Signal::Number(0.0)
            }
            Self::InputBoolean
            | Self::OutputBoolean
            | Self::DigitalInput
            | Self::DigitalOutput
            | Self::Flag => Signal::Truth(false),
        }
    }
}

/// An element of a [`Bank`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Signal {
    /// A whole number.
    Integer(i32),
    /// A number.
    Number(f64),
    /// On or off.
    Truth(bool),
}

/// What a program says to people.
#[derive(Debug, Clone, PartialEq)]
pub enum Message {
    /// `textmsg`.
    Text(String),
    /// `popup`, which is answered at once.
    Popup {
        /// What it says.
        text: String,
        /// What stands above.
        title: String,
        /// On a real controller the program waits for a person here.
        is_blocking: bool,
    },
    /// A call that changes nothing here; said once for each line.
    NotSimulated(&'static str),
}
