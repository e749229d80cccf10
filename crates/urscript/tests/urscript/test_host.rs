//! A controller that writes down what it is asked for, and moves in whole cycles.

use std::collections::BTreeMap;

use needlebench_kinematics::{Joints, Pose};
use needlebench_urscript::{
    ArmState, Bank, Belief, End, Host, Message, Motion, MotionKind, Place, Program, Progress,
    Request, Run, ScriptError, Signal,
};

use crate::test_arm::{TestArm, start};

/// Cycles of a move without a time, and of a stop.
pub const MOVE_CYCLES: u32 = 5;
pub const STOP_CYCLES: u32 = 2;

pub struct TestHost {
    pub cycle: u32,
    pub trace: Vec<String>,
    pub state: ArmState,
    pub belief: Belief,
    pub signals: BTreeMap<(Bank, usize), Signal>,
    /// What came through the socket `s`, and what was sent; none where it is not there.
    pub socket: Option<Vec<u8>>,
    pub sent: Vec<u8>,
    /// The moves, and the numbers written to registers.
    pub motions: Vec<Motion>,
    pub numbers: Vec<f64>,
    arm: TestArm,
    done_in: u32,
    goal: Joints,
}

impl TestHost {
    pub fn new() -> Self {
        let (still, rest) = (Joints::zeros(), [0.0; 6]);
        Self {
            cycle: 0,
            trace: Vec::new(),
            state: ArmState {
                joints: start(),
                joint_speeds: still,
                target_joints: start(),
                target_joint_speeds: still,
                tool_speed: rest,
                target_tool_speed: rest,
                tool_force: [3.0, 4.0, 0.0, 0.0, 0.0, 0.0],
                joint_torques: still,
                is_steady: true,
                robot_mode: 7,
                safety_mode: 1,
            },
            belief: Belief {
                flange_from_tcp: Some(Pose::translation(0.0, 0.0, 0.1)),
                ..Belief::default()
            },
            signals: BTreeMap::new(),
            socket: None,
            sent: Vec::new(),
            motions: Vec::new(),
            numbers: Vec::new(),
            arm: TestArm::new(),
            done_in: 0,
            goal: start(),
        }
    }

    fn note(&mut self, what: impl AsRef<str>) {
        // The first cycle is 0.
        self.trace
            .push(format!("{}: {}", self.cycle, what.as_ref()));
    }

    /// One cycle: the arm, then the program.
    pub fn step(&mut self, run: &mut Run) -> Progress {
        let progress = run.step(self);
        self.done_in = self.done_in.saturating_sub(1);
        if self.done_in == 0 {
            self.state.joints = self.goal;
            self.state.target_joints = self.goal;
            self.state.is_steady = true;
        }
        self.cycle += 1;
        progress
    }

    /// Runs a program to its end.
    pub fn run(&mut self, text: &str, most_cycles: u32) -> Option<End> {
        let program = Program::load(text).unwrap_or_else(|error| panic!("{error}\n{text}"));
        let mut run = Run::new(program);
        for _ in 0..most_cycles {
            if let Progress::Ended(end) = self.step(&mut run) {
                return Some(end);
            }
        }
        None
    }
}

/// What a program does on a controller whose TCP is as given.
pub fn done(text: &str, flange_from_tcp: Option<Pose>) -> Result<TestHost, ScriptError> {
    /// Far more than any of the programs here takes.
    const MOST_CYCLES: u32 = 20_000;
    let mut host = TestHost::new();
    host.belief.flange_from_tcp = flange_from_tcp;
    let mut run = Run::new(Program::load(text)?);
    for _ in 0..MOST_CYCLES {
        match host.step(&mut run) {
            Progress::Ended(End::Exception(error)) => return Err(error),
            Progress::Ended(_) => return Ok(host),
            Progress::Running => {}
        }
    }
    panic!("never ends: {text}")
}

fn cycles(time_s: f64) -> u32 {
    (1..100_000)
        .find(|cycles| f64::from(*cycles) * 2e-3 > time_s - 1e-9)
        .unwrap_or(100_000)
}

impl Host for TestHost {
    fn period_s(&self) -> f64 {
        2e-3
    }

    fn time_s(&self) -> f64 {
        f64::from(self.cycle) * 2e-3
    }

    fn state(&self) -> &ArmState {
        &self.state
    }

    fn joints_ago(&self, cycles: usize) -> Option<Joints> {
        (cycles < 2).then_some(self.state.joints)
    }

    fn belief(&self) -> &Belief {
        &self.belief
    }

    fn set_belief(&mut self, belief: Belief) {
        self.belief = belief;
        self.note("belief");
    }

    fn base_from_flange(&self, joints: &Joints) -> Pose {
        self.arm.base_from_flange(joints)
    }

    fn inverse(&mut self, base_from_flange: &Pose, near: &Joints) -> Option<Joints> {
        self.arm.inverse(base_from_flange, near)
    }

    fn is_within_limits(&self, joints: &Joints) -> bool {
        joints.amax() < 6.0
    }

    fn begin(&mut self, request: &Request, place: Place) -> Result<(), String> {
        if let Request::Move(motion) = request {
            self.motions.push(motion.clone());
        }
        let (what, cycles, goal) = match request {
            Request::Move(motion) => match &motion.kind {
                MotionKind::Joints { to, pace, .. } => {
                    ("movej", pace.time_s.map_or(MOVE_CYCLES, cycles), *to)
                }
                MotionKind::Line { to, pace, .. } => {
                    let flange = to * motion.flange_from_tcp.unwrap().inverse();
                    let found = self.arm.inverse(&flange, &self.state.target_joints);
                    let to = found.ok_or("out of reach")?;
                    ("movel", pace.time_s.map_or(MOVE_CYCLES, cycles), to)
                }
                MotionKind::Servo { to, time_s, .. } => ("servoj", cycles(*time_s), *to),
                MotionKind::Stop { .. } => ("stop", STOP_CYCLES, self.state.joints),
                _ => ("move", MOVE_CYCLES, self.state.joints),
            },
            Request::JointSpeeds { time_s, .. } => {
                ("speedj", time_s.map_or(1, cycles), self.state.joints)
            }
            Request::ToolSpeed { time_s, .. } => {
                ("speedl", time_s.map_or(1, cycles), self.state.joints)
            }
            Request::ServoCircle { .. } => ("servoc", 1, self.state.joints),
            Request::Optimised { to, .. } => ("optimove", MOVE_CYCLES, *to),
        };
        if goal.amax() > 6.3 {
            return Err("joint positions are out of their limits".to_owned());
        }
        self.note(format!("{what} [{:.2}] line {}", goal[0], place.line));
        self.done_in = cycles;
        self.goal = goal;
        self.state.is_steady = false;
        Ok(())
    }

    fn is_done(&mut self) -> bool {
        self.done_in == 0
    }

    fn read(&self, bank: Bank, index: usize) -> Signal {
        let known = self.signals.get(&(bank, index));
        known.copied().unwrap_or(bank.zero())
    }

    fn write(&mut self, bank: Bank, index: usize, signal: Signal) {
        self.signals.insert((bank, index), signal);
        if let Signal::Number(number) = signal {
            self.numbers.push(number);
        }
        self.note(format!("{bank:?}[{index}] = {signal:?}"));
    }

    fn message(&mut self, message: Message, _: Place) {
        self.note(match message {
            Message::Text(text) => text,
            Message::Popup { text, .. } => format!("popup {text}"),
            Message::NotSimulated(what) => format!("not simulated: {what}"),
        });
    }

    fn zero_force(&mut self) {
        self.note("zero force");
    }

    fn set_watchdog(&mut self, input: &str, frequency_hz: f64, action: &str) -> Result<(), String> {
        self.note(format!("watchdog {input} {frequency_hz} Hz {action}"));
        Ok(())
    }

    fn protective_stop(&mut self, reason: &str) {
        self.note(format!("protective stop: {reason}"));
    }

    fn open_socket(&mut self, name: &str, address: &str, port: u16) -> bool {
        self.note(format!("open {name} {address}:{port}"));
        name == "s" && self.socket.is_some()
    }

    fn close_socket(&mut self, _: &str) {
        self.socket = None;
    }

    fn send(&mut self, name: &str, bytes: &[u8]) -> bool {
        self.sent.extend_from_slice(bytes);
        name == "s" && self.socket.is_some()
    }

    fn received(&self, name: &str) -> Option<&[u8]> {
        self.socket.as_deref().filter(|_| name == "s")
    }

    fn take(&mut self, _: &str, count: usize) {
        if let Some(bytes) = &mut self.socket {
            bytes.drain(..count);
        }
    }
}
