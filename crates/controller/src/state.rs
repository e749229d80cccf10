//! States of a controller, what may be asked of it, and the one table of what follows.

/// What a controller is doing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum State {
    /// Without power, braked.
    PowerOff,
    /// Powering on, which takes [`POWER_ON_S`]; braked.
    PoweringOn,
    /// The same, and the brakes are released behind it.
    Starting,
    /// With power, braked.
    Idle,
    /// The brakes are being released, which takes [`BRAKE_RELEASE_S`] or longer: the set-point moves to where the arm
    /// is.
    Releasing,
    /// Running; no program.
    Stopped,
    /// Running; a program moves the arm.
    Playing,
    /// Running; the program and its motion are paused.
    Paused,
    /// Protective stop; the program has ended.
    Protective,
    /// The safeguard is open; no program.
    Safeguard,
    /// The safeguard is open; the program is paused.
    SafeguardPaused,
    /// Emergency stop: without power, braked.
    Emergency,
}

/// Kinds of requests.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Order {
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
    /// Set the speed slider.
    SetSpeed,
    /// Move the arm.
    Move,
}

/// Time from power off to power on, s (assumed).
pub const POWER_ON_S: f64 = 0.3;
/// Least time of the release of the brakes, s (assumed).
pub const BRAKE_RELEASE_S: f64 = 0.3;
/// Time before a protective stop can be unlocked, s of robot time or of wall time, whichever passes first.
pub const UNLOCK_S: f64 = 5.0;

/// What follows from a request.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// Carried out; the state is then another one.
    To(State),
    /// Carried out, or so already; the state remains.
    Stay,
    /// As [`Outcome::To`], once [`UNLOCK_S`] have passed and the arm stands. Refused before.
    Unlock(State),
    /// As [`Outcome::To`], where the arm stands. Refused while it is being braked.
    AtRest(State),
    /// Refused in this state.
    No,
}

impl State {
    /// All states, in the order of [`TABLE`].
    pub const ALL: [Self; 12] = [
        Self::PowerOff,
        Self::PoweringOn,
        Self::Starting,
        Self::Idle,
        Self::Releasing,
        Self::Stopped,
        Self::Playing,
        Self::Paused,
        Self::Protective,
        Self::Safeguard,
        Self::SafeguardPaused,
        Self::Emergency,
    ];

    /// What follows from a request in this state.
    pub fn outcome(self, order: Order) -> Outcome {
        TABLE[self as usize].1[order as usize]
    }

    /// `robot_mode` of the real-time data exchange: 3 power off, 4 power on, 5 idle, 7 running.
    pub fn robot_mode(self) -> i32 {
        match self {
            Self::PowerOff | Self::Emergency => 3,
            Self::PoweringOn | Self::Starting => 4,
            Self::Idle | Self::Releasing => 5,
            _ => 7,
        }
    }

    /// `safety_mode`: 1 normal, 3 protective stop, 5 safeguard stop, 7 robot emergency stop.
    pub fn safety_mode(self) -> i32 {
        match self {
            Self::Protective => 3,
            Self::Safeguard | Self::SafeguardPaused => 5,
            Self::Emergency => 7,
            _ => 1,
        }
    }

    /// `runtime_state`: 1 stopped, 2 playing, 4 paused.
    pub fn runtime_state(self) -> u32 {
        match self {
            Self::Playing => 2,
            Self::Paused | Self::SafeguardPaused => 4,
            _ => 1,
        }
    }

    /// `robot_status_bits`: 1 power, 2 program running. The power button (8) is never pressed.
    pub fn robot_status_bits(self) -> u32 {
        match self {
            Self::PowerOff | Self::PoweringOn | Self::Starting | Self::Emergency => 0,
            Self::Playing => 1 | 2,
            _ => 1,
        }
    }

    /// `safety_status_bits`: 1 normal, 4 protective, 16 safeguard, 64 robot emergency with 128 emergency; 1024 with
    /// each stop.
    pub fn safety_status_bits(self) -> u32 {
        match self {
            Self::Protective => 4 | 1024,
            Self::Safeguard | Self::SafeguardPaused => 16 | 1024,
            Self::Emergency => 64 | 128 | 1024,
            _ => 1,
        }
    }

    /// The brakes hold the arm, and not its drives.
    pub fn is_braked(self) -> bool {
        self.robot_mode() != 7
    }
}

impl Order {
    /// All kinds, in the order of the columns of [`TABLE`].
    pub const ALL: [Self; 14] = [
        Self::PowerOn,
        Self::ReleaseBrakes,
        Self::PowerOff,
        Self::ProtectiveStop,
        Self::Unlock,
        Self::PressEmergencyStop,
        Self::ReleaseEmergencyStop,
        Self::OpenSafeguard,
        Self::CloseSafeguard,
        Self::Play,
        Self::Pause,
        Self::Stop,
        Self::SetSpeed,
        Self::Move,
    ];
}

use Outcome::{AtRest, No, Stay, To, Unlock};
use State::{
    Emergency, Idle, Paused, Playing, PowerOff, PoweringOn, Protective, Releasing, Safeguard,
    SafeguardPaused, Starting, Stopped,
};

/// What follows from every request (columns, as [`Order::ALL`]) in every state (rows).
///
/// Beside it time passes: powering on ends in idle, or releasing where it is wanted; releasing ends in stopped.
/// A motion out of limits is a protective stop as if one were requested.
#[rustfmt::skip]
pub const TABLE: [(State, [Outcome; 14]); 12] = [
    //  power on        brakes             power off     protective      unlock           emergency      released
    //  open                 closed       play         pause       stop           speed  move
    (PowerOff, [
        To(PoweringOn), To(Starting),      Stay,         No,             Stay,            To(Emergency), Stay,
        No,                  Stay,        No,          No,         No,            Stay,  No,
    ]),
    (PoweringOn, [
        Stay,           To(Starting),      To(PowerOff), No,             Stay,            To(Emergency), Stay,
        No,                  Stay,        No,          No,         No,            Stay,  No,
    ]),
    (Starting, [
        Stay,           Stay,              To(PowerOff), No,             Stay,            To(Emergency), Stay,
        No,                  Stay,        No,          No,         No,            Stay,  No,
    ]),
    (Idle, [
        Stay,           AtRest(Releasing), To(PowerOff), No,             Stay,            To(Emergency), Stay,
        No,                  Stay,        No,          No,         No,            Stay,  No,
    ]),
    (Releasing, [
        Stay,           Stay,              To(PowerOff), No,             Stay,            To(Emergency), Stay,
        No,                  Stay,        No,          No,         No,            Stay,  No,
    ]),
    (Stopped, [
        Stay,           Stay,              To(PowerOff), To(Protective), Stay,            To(Emergency), Stay,
        To(Safeguard),       Stay,        To(Playing), No,         No,            Stay,  No,
    ]),
    (Playing, [
        Stay,           Stay,              To(PowerOff), To(Protective), Stay,            To(Emergency), Stay,
        To(SafeguardPaused), Stay,        Stay,        To(Paused), To(Stopped),   Stay,  Stay,
    ]),
    (Paused, [
        Stay,           Stay,              To(PowerOff), To(Protective), Stay,            To(Emergency), Stay,
        To(SafeguardPaused), Stay,        To(Playing), Stay,       To(Stopped),   Stay,  Stay,
    ]),
    (Protective, [
        Stay,           Stay,              To(PowerOff), Stay,           Unlock(Stopped), To(Emergency), Stay,
        No,                  Stay,        No,          No,         No,            Stay,  No,
    ]),
    (Safeguard, [
        Stay,           Stay,              To(PowerOff), To(Protective), Stay,            To(Emergency), Stay,
        Stay,                To(Stopped), No,          No,         No,            Stay,  No,
    ]),
    (SafeguardPaused, [
        Stay,           Stay,              To(PowerOff), To(Protective), Stay,            To(Emergency), Stay,
        Stay,                To(Paused),  No,          Stay,       To(Safeguard), Stay,  Stay,
    ]),
    (Emergency, [
        No,             No,                Stay,         No,             Stay,            Stay,          To(PowerOff),
        No,                  Stay,        No,          No,         No,            Stay,  No,
    ]),
];
