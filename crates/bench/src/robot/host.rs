//! The controller as the program sees it: what it reads, and what it asks for.

use std::collections::BTreeMap;

use nalgebra::{Vector3, Vector6};
use needlebench_controller::{
    ArmData, Command, Controller, Event, Goal, Move, Origin, Request, State,
};
use needlebench_engine::PlantState;
use needlebench_kinematics::ik::{Kinematics, nearest_within_limits};
use needlebench_kinematics::{JointLimits, Joints, Pose, base_from_base_link};
use needlebench_urscript::{
    ArmState, Bank, Belief, End, Host, Message, Place, Request as Wish, ScriptError, Signal,
};

use super::log::Log;

/// A joint stands within this of its set-point, rad, and below this speed, rad/s.
const SETTLED_RAD: f64 = 1e-3;
const SETTLED_RAD_S: f64 = 1e-3;

/// What a program acts upon.
pub(super) struct RobotHost {
    arm: ArmData,
    time_s: f64,
    state: ArmState,
    /// Measured joint positions of all cycles, rad.
    measured: Vec<Joints>,
    pub belief: Belief,
    signals: BTreeMap<(Bank, usize), Signal>,
    /// What the controller is asked for in this cycle.
    pub requests: Vec<Request>,
    arrivals: u64,
    /// Moves that are under way or wait, by their arrival.
    places: BTreeMap<u64, Place>,
    is_done: bool,
    /// Where the last move stands in the program.
    pub place: Place,
    pub log: Log,
}

impl RobotHost {
    pub fn new(arm: &ArmData, start: &Joints, flange_from_tcp: Option<Pose>) -> Self {
        let still = Joints::zeros();
        Self {
            arm: *arm,
            time_s: 0.0,
            state: ArmState {
                joints: *start,
                joint_speeds: still,
                target_joints: *start,
                target_joint_speeds: still,
                tool_speed: [0.0; 6],
                target_tool_speed: [0.0; 6],
                // No sensor and no estimate of forces is simulated.
                tool_force: [0.0; 6],
                joint_torques: still,
                is_steady: true,
                robot_mode: State::Stopped.robot_mode(),
                safety_mode: State::Stopped.safety_mode(),
            },
            measured: Vec::new(),
            belief: Belief {
                flange_from_tcp,
                ..Belief::default()
            },
            signals: BTreeMap::new(),
            requests: Vec::new(),
            arrivals: 0,
            places: BTreeMap::new(),
            is_done: true,
            place: Place::START,
            log: Log::default(),
        }
    }

    /// Begins a cycle: what is seen of the arm and of the controller now.
    pub fn see(&mut self, plant: &PlantState, controller: &Controller) {
        let (target, is_steady) = (controller.set_point(), controller.is_steady());
        let off = (plant.position - target.position).amax();
        self.time_s = controller.time_s();
        self.state.is_steady =
            is_steady && off < SETTLED_RAD && plant.velocity.amax() < SETTLED_RAD_S;
        self.state.joints = plant.position;
        self.state.joint_speeds = plant.velocity;
        self.state.target_joints = target.position;
        self.state.target_joint_speeds = target.velocity;
        self.state.tool_speed = self.tool_speed(&plant.position, &plant.velocity);
        self.state.target_tool_speed = self.tool_speed(&target.position, &target.velocity);
        self.state.robot_mode = controller.state().robot_mode();
        self.state.safety_mode = controller.state().safety_mode();
        self.measured.push(plant.position);
    }

    /// Speed of the tool's point in the controller's base frame, m/s, then rad/s about the axes.
    fn tool_speed(&self, joints: &Joints, speeds: &Joints) -> [f64; 6] {
        if speeds.amax() <= 0.0 {
            return [0.0; 6];
        }
        let kinematics = &self.arm.kinematics;
        let twist = kinematics.chain.jacobian(joints) * speeds;
        let [linear, angular] = [0, 3].map(|row| Vector3::from_fn(|i, _| twist[row + i]));
        let tcp = self.belief.flange_from_tcp.unwrap_or_default();
        let lever = kinematics.base_link_from_flange(joints).rotation * tcp.translation.vector;
        let turn = base_from_base_link().rotation;
        let (linear, angular) = (turn * (linear + angular.cross(&lever)), turn * angular);
        std::array::from_fn(|i| if i < 3 { linear[i] } else { angular[i - 3] })
    }

    /// Asks the controller for something of its own.
    pub fn ask(&mut self, what: Command) {
        self.arrivals += 1;
        let from = Origin {
            door: 0,
            client: 0,
            arrival: self.arrivals,
        };
        self.requests.push(Request { from, what });
    }

    /// Ends a cycle: what the controller tells of it. Gives how the program ended by that, if it did.
    pub fn hear(&mut self, events: &[Event], time_s: f64) -> Option<End> {
        let mut end = None;
        for event in events {
            let place = |from: &Origin| self.places.get(&from.arrival).copied();
            match event {
                Event::Done { from } | Event::Cancelled { from } => {
                    self.is_done |= from.arrival == self.arrivals;
                    self.places.remove(&from.arrival);
                }
                Event::Refused { from, why } => {
                    let place = place(from).unwrap_or(self.place);
                    end = Some(End::Exception(ScriptError::new(place, why.to_string())));
                }
                Event::Reduced {
                    from,
                    what,
                    asked,
                    used,
                    unit,
                } => {
                    let line = place(from).unwrap_or(self.place).line;
                    let text = format!("{what} reduced from {asked:.3} to {used:.3} {unit}");
                    self.log.add_once(time_s, line, "reduced", &text);
                }
                Event::Trip {
                    why,
                    least_singular_value,
                } => {
                    let near = least_singular_value.map_or(String::new(), |value| {
                        format!(" (smallest singular value {value:.4})")
                    });
                    end = Some(End::ProtectiveStop(format!("{why}{near}")));
                }
                Event::Stopping { way_rad, time_s: s } => {
                    let text = format!(
                        "the arm stops within {s:.3} s, the joints within {:.2} deg",
                        way_rad.amax().to_degrees()
                    );
                    self.log.add(time_s, Some(self.place.line), "stop", &text);
                }
                Event::Accepted { .. } | Event::State { .. } | Event::Blend(_) => {}
            }
        }
        end
    }
}

/// Joint positions within the limits that bring the flange to a pose in the controller's base frame: those whose largest
/// difference from a posture is least.
fn nearest_joints(
    kinematics: &Kinematics,
    limits: &JointLimits,
    base_from_flange: &Pose,
    near: &Joints,
) -> Option<Joints> {
    let base_link_from_flange = base_from_base_link() * base_from_flange;
    let found = kinematics.branches(&base_link_from_flange, Some(near));
    let within = found.solutions.iter().filter_map(|solution| {
        let wrap = nearest_within_limits(&solution.joints, limits, near)?;
        Some(wrap.joints)
    });
    let off = |joints: &Joints| (joints - near).amax();
    within.min_by(|a, b| off(a).total_cmp(&off(b)))
}

impl Host for RobotHost {
    fn period_s(&self) -> f64 {
        self.arm.period_s
    }

    fn time_s(&self) -> f64 {
        self.time_s
    }

    fn state(&self) -> &ArmState {
        &self.state
    }

    fn joints_ago(&self, cycles: usize) -> Option<Joints> {
        let index = self.measured.len().checked_sub(cycles + 1)?;
        self.measured.get(index).copied()
    }

    fn belief(&self) -> &Belief {
        &self.belief
    }

    fn set_belief(&mut self, belief: Belief) {
        self.belief = belief;
    }

    fn base_from_flange(&self, joints: &Joints) -> Pose {
        base_from_base_link() * self.arm.kinematics.base_link_from_flange(joints)
    }

    fn inverse(&mut self, base_from_flange: &Pose, near: &Joints) -> Option<Joints> {
        nearest_joints(
            &self.arm.kinematics,
            &self.arm.limits,
            base_from_flange,
            near,
        )
    }

    fn is_within_limits(&self, joints: &Joints) -> bool {
        self.arm.limits.first_violation(joints).is_none()
    }

    fn begin(&mut self, wish: &Wish, place: Place) -> Result<(), String> {
        let believed = self.belief.flange_from_tcp;
        let (goal, tcp) = match wish {
            Wish::Move(motion) => (Goal::Motion(motion.kind.clone()), motion.flange_from_tcp),
            Wish::JointSpeeds {
                speeds,
                acceleration,
                time_s,
            } => {
                let goal = Goal::JointSpeed {
                    speed: *speeds,
                    acceleration: *acceleration,
                    time_s: *time_s,
                };
                (goal, None)
            }
            Wish::ToolSpeed {
                speed,
                acceleration,
                turning_acceleration,
                time_s,
                flange_from_tcp,
            } => {
                if turning_acceleration.is_some() {
                    let text = "speedl: aRot is not simulated, a counts for both";
                    self.log
                        .add_once(self.time_s, place.line, "not_simulated", text);
                }
                let goal = Goal::ToolSpeed {
                    speed: Vector6::from_column_slice(speed),
                    acceleration: *acceleration,
                    time_s: *time_s,
                };
                (goal, Some(*flange_from_tcp))
            }
            Wish::ServoCircle { .. } => return Err("servoc is not simulated".to_owned()),
            Wish::Optimised { is_linear, .. } => {
                let name = if *is_linear { "optimovel" } else { "optimovej" };
                return Err(format!("{name} is not simulated"));
            }
        };
        // Without a tool's point only joints are meant.
        let flange_from_tcp = tcp.or(believed).unwrap_or_default();
        self.ask(Command::Move(Box::new(Move {
            flange_from_tcp,
            goal,
        })));
        self.places.insert(self.arrivals, place);
        self.place = place;
        self.is_done = false;
        Ok(())
    }

    fn is_done(&mut self) -> bool {
        self.is_done
    }

    fn read(&self, bank: Bank, index: usize) -> Signal {
        let known = self.signals.get(&(bank, index)).copied();
        known.unwrap_or(bank.zero())
    }

    fn write(&mut self, bank: Bank, index: usize, signal: Signal) {
        let before = self.read(bank, index);
        self.signals.insert((bank, index), signal);
        if bank == Bank::DigitalOutput && signal != before {
            let state = if signal == Signal::Truth(true) {
                "on"
            } else {
                "off"
            };
            let text = format!("digital output {index} {state}");
            self.log.add(self.time_s, None, "output", &text);
        }
    }

    fn message(&mut self, message: Message, place: Place) {
        let (time_s, line) = (self.time_s, Some(place.line));
        match message {
            Message::Text(text) => self.log.add(time_s, line, "message", &text),
            Message::Popup {
                text,
                title,
                is_blocking,
            } => {
                let waits = if is_blocking {
                    " (answered at once)"
                } else {
                    ""
                };
                self.log
                    .add(time_s, line, "popup", &format!("{title}: {text}{waits}"));
            }
            Message::NotSimulated(what) => self.log.add(time_s, line, "not_simulated", what),
        }
    }

    fn zero_force(&mut self) {}

    fn set_watchdog(&mut self, input: &str, _: f64, _: &str) -> Result<(), String> {
        Err(format!(
            "nothing is connected that writes {input}, which a watchdog waits for"
        ))
    }

    fn protective_stop(&mut self, _: &str) {
        self.ask(Command::ProtectiveStop);
    }
}
