//! The controller as its callers see it: states, motions against closed forms, and what holds of any requests.

mod motions;
mod random;
mod states;
mod stops;

use needlebench_controller::{
    ArmData, Command, Controller, Cycle, Event, Goal, Measured, Move, Origin, Request, SetPoints,
    StopData,
};
use needlebench_kinematics::ik::Kinematics;
use needlebench_kinematics::{Joints, LimitPolicy, Pose, UrModel, base_from_base_link};
use needlebench_urscript::{MotionKind, Pace};

const RAMP_S: f64 = 0.14;
const STOP: StopData = StopData {
    deceleration_rad_s2: 15.0,
    ramp_s: 0.04,
};
const MOST_RAD_S2: f64 = 16.0;

fn arm(period_s: f64) -> ArmData {
    ArmData {
        kinematics: Kinematics::new(UrModel::Ur3e.geometry().chain()).unwrap(),
        limits: LimitPolicy::FULL_TURNS.limits_of(UrModel::Ur3e),
        acceleration_rad_s2: Joints::repeat(MOST_RAD_S2),
        period_s,
        ramp_s: RAMP_S,
        servo_delay_s: 0.004,
        stop: STOP,
    }
}

fn start() -> Joints {
    Joints::from([0.1, -1.7, 1.9, -1.8, -1.4, 0.2])
}

/// The tool's point in the flange's frame.
fn tcp() -> Pose {
    Pose::new(
        nalgebra::Vector3::new(0.02, -0.03, 0.12),
        nalgebra::Vector3::new(0.3, 0.1, -0.2),
    )
}

fn pace(acceleration: f64, speed: f64) -> Pace {
    Pace {
        acceleration,
        speed,
        time_s: None,
    }
}

fn within(time_s: f64) -> Pace {
    Pace {
        time_s: Some(time_s),
        ..pace(1.0, 1.0)
    }
}

fn goal(goal: Goal) -> Command {
    Command::Move(Box::new(Move {
        flange_from_tcp: tcp(),
        goal,
    }))
}

fn motion(kind: MotionKind) -> Command {
    goal(Goal::Motion(kind))
}

fn movej(to: Joints, pace: Pace, blend_m: f64) -> Command {
    motion(MotionKind::Joints { to, pace, blend_m })
}

fn movel(to: Pose, pace: Pace, blend_m: f64) -> Command {
    motion(MotionKind::Line { to, pace, blend_m })
}

fn speedj(speed: Joints, acceleration: f64, time_s: Option<f64>) -> Command {
    goal(Goal::JointSpeed {
        speed,
        acceleration,
        time_s,
    })
}

fn stopj(deceleration: f64) -> Command {
    motion(MotionKind::Stop {
        deceleration,
        is_linear: false,
    })
}

fn servoj(to: Joints, time_s: f64) -> Command {
    motion(MotionKind::Servo {
        to,
        time_s,
        lookahead_s: 0.1,
        gain: 300.0,
    })
}

/// A controller with its record, and an arm.
struct Cell {
    arm: ArmData,
    controller: Controller,
    record: SetPoints,
    events: Vec<Event>,
    wall_s: f64,
    /// Where the arm is off its set-points.
    off: Joints,
    arrival: u64,
    /// The last move.
    moving: Option<Origin>,
}

impl Cell {
    fn new(period_s: f64) -> Self {
        Self::of(&arm(period_s))
    }

    fn of(arm: &ArmData) -> Self {
        let period_s = arm.period_s;
        let controller = Controller::new(arm, start(), true).unwrap();
        Self {
            arm: *arm,
            record: SetPoints::new(period_s, *controller.set_point()),
            controller,
            events: Vec::new(),
            wall_s: f64::NAN,
            off: Joints::zeros(),
            arrival: 0,
            moving: None,
        }
    }

    /// With a program that plays.
    fn playing(period_s: f64) -> Self {
        let mut cell = Self::new(period_s);
        cell.ask(Command::Play);
        cell
    }

    fn cycle(&mut self, requests: &[Request]) -> Cycle {
        let measured = Measured {
            position: self.position() + self.off,
            wall_s: self.wall_s,
        };
        let cycle = self.controller.cycle(&measured, requests);
        self.record.push(cycle.set_point);
        self.events.extend(&cycle.events);
        cycle
    }

    fn origin(&mut self) -> Origin {
        self.arrival += 1;
        Origin {
            door: 0,
            client: 0,
            arrival: self.arrival,
        }
    }

    /// One cycle with a request.
    fn ask(&mut self, what: Command) -> Cycle {
        let from = self.origin();
        if matches!(what, Command::Move(_)) {
            self.moving = Some(from);
        }
        self.cycle(&[Request { from, what }])
    }

    fn wait(&mut self, time_s: f64) {
        let until_s = self.controller.time_s() + time_s;
        while self.controller.time_s() < until_s - 1e-9 {
            self.cycle(&[]);
        }
    }

    /// Cycles until the last move is done, at most a minute: its duration, s, if nothing was asked for since.
    fn finish(&mut self) -> f64 {
        let from = self.moving.unwrap();
        let begin_s = self.controller.time_s() - self.arm.period_s;
        while !self.events.contains(&Event::Done { from }) {
            assert!(
                self.controller.time_s() < begin_s + 60.0,
                "never done: {:?}",
                self.events
            );
            self.cycle(&[]);
        }
        self.controller.time_s() - begin_s
    }

    /// Pose of the tool's point in the controller's base frame.
    fn base_from_tcp(&self, joints: &Joints) -> Pose {
        base_from_base_link() * self.arm.kinematics.base_link_from_flange(joints) * tcp()
    }

    fn position(&self) -> Joints {
        self.controller.set_point().position
    }

    fn trip(&self) -> Option<needlebench_controller::Trip> {
        self.events.iter().find_map(|event| match event {
            Event::Trip { why, .. } => Some(*why),
            _ => None,
        })
    }

    fn refusals(&self) -> Vec<needlebench_controller::Refusal> {
        let refused = |event: &Event| match event {
            Event::Refused { why, .. } => Some(*why),
            _ => None,
        };
        self.events.iter().filter_map(refused).collect()
    }

    /// Largest magnitudes of joint speeds and accelerations of the set-points from one on.
    fn peaks(&self, from: usize) -> (f64, f64) {
        let states = &self.record.states()[from..];
        let most = |of: &dyn Fn(usize) -> f64| (0..states.len()).map(of).fold(0.0, f64::max);
        (
            most(&|k| states[k].velocity.amax()),
            most(&|k| states[k].acceleration.amax()),
        )
    }
}
