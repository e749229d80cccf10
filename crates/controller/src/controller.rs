//! The controller: requests in, one set-point and what happened out, every cycle.

use nalgebra::{Matrix6, Vector6};
use needlebench_kinematics::trajectory::JointState;
use needlebench_kinematics::{JOINT_COUNT, Joints, Pose, base_from_base_link};
use needlebench_urscript::{MotionKind, Pace};

use crate::arm::{ArmData, NotAnArm};
use crate::course::{Course, NoCourse};
use crate::event::{Event, Trip};
use crate::legs::{Legs, NewLeg};
use crate::mover::{JointSpeed, Mover, Settle, stop_from};
use crate::request::{Command, Goal, Move, Origin, Refusal, Request, within};
use crate::servo::Servo;
use crate::state::{BRAKE_RELEASE_S, Outcome, POWER_ON_S, State, UNLOCK_S};
use crate::tool_speed::ToolSpeed;

/// Times are sums of periods.
const ROUNDING_S: f64 = 1e-9;

/// What is seen of the arm at the start of a cycle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measured {
    /// Joint positions, rad: where the set-point moves to while brakes are released.
    pub position: Joints,
    /// Wall time, s, from any moment on: for [`UNLOCK_S`]. Without a wall clock, NaN.
    pub wall_s: f64,
}

/// One cycle.
#[derive(Debug, Clone, PartialEq)]
pub struct Cycle {
    /// Robot time at its end, s.
    pub time_s: f64,
    /// Reference at its end. Within the cycle it is the quintic from the one before, as of
    /// [`SetPoints`](crate::SetPoints).
    pub set_point: JointState,
    /// State at its end.
    pub state: State,
    /// What happened.
    pub events: Vec<Event>,
}

/// The motion that is under way, if it is no move from rest to rest.
#[derive(Debug, Clone, PartialEq)]
struct Active {
    from: Origin,
    what: Move,
    /// Time until the program goes on, s; without one once the speed is reached.
    left_s: Option<f64>,
    /// The program has gone on.
    is_done: bool,
}

/// A virtual controller of a UR arm.
#[derive(Debug, Clone, PartialEq)]
pub struct Controller {
    arm: ArmData,
    state: State,
    cycles: u64,
    /// Cycle in which the state was entered, with the wall time.
    entered: (u64, f64),
    last: JointState,
    mover: Mover,
    active: Option<Active>,
    /// Waits for the arm to stand.
    next: Option<(Origin, Move)>,
    /// Waits for the program to go on.
    held: Option<Active>,
    slider: f64,
}

impl Controller {
    /// At rest in a posture, running or without power.
    ///
    /// # Errors
    /// [`NotAnArm`].
    pub fn new(arm: &ArmData, start: Joints, is_running: bool) -> Result<Self, NotAnArm> {
        arm.check(&start)?;
        Ok(Self {
            arm: *arm,
            state: if is_running {
                State::Stopped
            } else {
                State::PowerOff
            },
            cycles: 0,
            entered: (0, f64::NAN),
            last: JointState::at_rest(start),
            mover: Mover::Still,
            active: None,
            next: None,
            held: None,
            slider: 1.0,
        })
    }

    /// Its state at the end of the last cycle.
    pub fn state(&self) -> State {
        self.state
    }

    /// Reference at the end of the last cycle.
    pub fn set_point(&self) -> &JointState {
        &self.last
    }

    /// Robot time at the end of the last cycle, s.
    pub fn time_s(&self) -> f64 {
        self.cycles as f64 * self.arm.period_s
    }

    /// The set-point is at rest, and no motion changes that.
    pub fn is_steady(&self) -> bool {
        self.mover == Mover::Still
    }

    /// Rate at which motions along a path go, from more than 0 to 1.
    pub fn speed(&self) -> f64 {
        self.slider
    }

    /// One period. Requests take effect in the order given, at the start of the cycle; callers sort them by
    /// [`Request::from`].
    pub fn cycle(&mut self, measured: &Measured, requests: &[Request]) -> Cycle {
        let mut events = Vec::new();
        self.let_time_pass(measured, &mut events);
        for Request { from, what } in requests {
            let from = *from;
            let event = match self.carry_out(from, what, measured, &mut events) {
                Ok(()) => Event::Accepted { from },
                Err(why) => Event::Refused { from, why },
            };
            events.push(event);
        }
        self.advance(measured, &mut events);
        self.cycles += 1;
        Cycle {
            time_s: self.time_s(),
            set_point: self.last,
            state: self.state,
            events,
        }
    }

    fn in_state_s(&self) -> f64 {
        (self.cycles - self.entered.0) as f64 * self.arm.period_s
    }

    /// States that end by themselves.
    fn let_time_pass(&mut self, measured: &Measured, events: &mut Vec<Event>) {
        let passed_s = self.in_state_s() + ROUNDING_S;
        let next = match self.state {
            State::PoweringOn if passed_s >= POWER_ON_S => State::Idle,
            State::Starting if passed_s >= POWER_ON_S && self.is_steady() => State::Releasing,
            State::Releasing if passed_s >= BRAKE_RELEASE_S && self.is_steady() => State::Stopped,
            _ => return,
        };
        self.enter(next, measured, events);
    }

    fn carry_out(
        &mut self,
        from: Origin,
        what: &Command,
        measured: &Measured,
        events: &mut Vec<Event>,
    ) -> Result<(), Refusal> {
        let (state, order) = (self.state, what.order());
        match self.state.outcome(order) {
            Outcome::No => Err(Refusal::State { state, order }),
            Outcome::To(next) => {
                self.enter(next, measured, events);
                Ok(())
            }
            Outcome::AtRest(next) => self.enter_at_rest(next, measured, events),
            Outcome::Unlock(next) => {
                // The larger one; that which is no number does not count.
                let passed_s = self.in_state_s().max(measured.wall_s - self.entered.1);
                if passed_s + ROUNDING_S < UNLOCK_S {
                    let left_s = UNLOCK_S - passed_s;
                    return Err(Refusal::TooEarly { left_s });
                }
                self.enter_at_rest(next, measured, events)
            }
            Outcome::Stay => match what {
                Command::SetSpeed(rate) => {
                    within("the speed slider", "of full speed", *rate, [0.01, 1.0])?;
                    self.slider = *rate;
                    self.set_rate();
                    Ok(())
                }
                Command::Move(what) => {
                    what.check()?;
                    if self.is_paused() {
                        self.cancel_held(events);
                        self.held = Some(Active::new(from, what));
                        return Ok(());
                    }
                    self.begin(Active::new(from, what), events)
                }
                _ => Ok(()),
            },
        }
    }

    fn enter_at_rest(
        &mut self,
        next: State,
        measured: &Measured,
        events: &mut Vec<Event>,
    ) -> Result<(), Refusal> {
        if !self.is_steady() {
            return Err(Refusal::StillMoving);
        }
        self.enter(next, measured, events);
        Ok(())
    }

    fn is_paused(&self) -> bool {
        matches!(self.state, State::Paused | State::SafeguardPaused)
    }

    fn enter(&mut self, next: State, measured: &Measured, events: &mut Vec<Event>) {
        let from = std::mem::replace(&mut self.state, next);
        self.entered = (self.cycles, measured.wall_s);
        events.push(Event::State { from, to: next });
        match next {
            State::PowerOff | State::Emergency | State::Protective => self.end_program(events),
            State::Stopped | State::Safeguard => {
                if matches!(
                    from,
                    State::Playing | State::Paused | State::SafeguardPaused
                ) {
                    self.end_program(events);
                }
            }
            State::Paused | State::SafeguardPaused => self.pause(events),
            State::Playing => self.go_on(events),
            State::Releasing => {
                let held = self.last.position;
                let settle = Settle::new(&self.arm, held, &measured.position, BRAKE_RELEASE_S);
                self.mover = Mover::Settle(settle);
            }
            State::PoweringOn | State::Starting | State::Idle => {}
        }
    }

    fn end_program(&mut self, events: &mut Vec<Event>) {
        self.cancel(events);
        self.cancel_held(events);
        if let Some((from, _)) = self.next.take() {
            events.push(Event::Cancelled { from });
        }
        self.stop(events);
    }

    /// The motion under way will not be done.
    fn cancel(&mut self, events: &mut Vec<Event>) {
        if let Mover::Legs(legs) = &self.mover
            && let Some(from) = legs.waiting()
        {
            events.push(Event::Cancelled { from });
        }
        cancel(&mut self.active, events);
    }

    fn cancel_held(&mut self, events: &mut Vec<Event>) {
        cancel(&mut self.held, events);
    }

    /// All joints stop.
    fn stop(&mut self, events: &mut Vec<Event>) {
        match &self.mover {
            Mover::Still => return,
            Mover::Ramp(ramp) if ramp.is_stop => return,
            _ => {}
        }
        let stop = stop_from(&self.arm, &self.last);
        let time_s = stop.ramps.duration_s();
        let [way_rad, ..] = stop.ramps.sample(time_s);
        events.push(Event::Stopping { way_rad, time_s });
        self.mover = Mover::Ramp(stop);
    }

    fn set_rate(&mut self) {
        let rate = if self.is_paused() { 0.0 } else { self.slider };
        if let Mover::Legs(legs) = &mut self.mover {
            legs.set_rate(rate, self.arm.ramp_s);
        }
    }

    /// Moves along a path stand on it; what goes by speed or follows targets is stopped, and begun again.
    fn pause(&mut self, events: &mut Vec<Event>) {
        self.set_rate();
        let is_stop =
            |active: &Active| matches!(active.what.goal, Goal::Motion(MotionKind::Stop { .. }));
        if self.active.as_ref().is_some_and(|active| !is_stop(active)) {
            self.held = self.active.take();
            self.stop(events);
        }
    }

    fn go_on(&mut self, events: &mut Vec<Event>) {
        self.set_rate();
        if let Some(held) = self.held.take() {
            self.begin_or_tell(held, events);
        }
    }

    fn begin_or_tell(&mut self, active: Active, events: &mut Vec<Event>) {
        let from = active.from;
        if let Err(why) = self.begin(active, events) {
            events.push(Event::Refused { from, why });
        }
    }

    fn begin(&mut self, mut active: Active, events: &mut Vec<Event>) -> Result<(), Refusal> {
        let Active { from, what, .. } = &active;
        let from = *from;
        let (arm, last) = (&self.arm, &self.last);
        let least_acceleration = arm.acceleration_rad_s2.min();
        let mover = match &what.goal {
            Goal::Motion(
                kind @ (MotionKind::Joints { .. }
                | MotionKind::Line { .. }
                | MotionKind::Process { .. }
                | MotionKind::Circle { .. }),
            ) => return self.begin_leg(from, what, kind, events),
            Goal::Motion(MotionKind::Servo {
                to,
                lookahead_s,
                gain,
                ..
            }) => {
                let mut servo = match &self.mover {
                    Mover::Servo(servo) => servo.clone(),
                    _ => Servo::new(last.position, delay_cycles(arm)),
                };
                servo.aim(*to, *gain, *lookahead_s);
                Mover::Servo(servo)
            }
            Goal::Motion(MotionKind::Stop {
                deceleration,
                is_linear,
            }) => {
                if self.mover == Mover::Still {
                    self.cancel(events);
                    events.push(Event::Done { from });
                    return Ok(());
                }
                if *is_linear {
                    let pace = (*deceleration, arm.ramp_s);
                    let (tcp, to) = (&what.flange_from_tcp, Vector6::zeros());
                    Mover::Tool(ToolSpeed::new(&arm.kinematics, last, tcp, &to, pace))
                } else {
                    let most = reduced(
                        from,
                        ("a", "rad/s^2"),
                        *deceleration,
                        least_acceleration,
                        events,
                    );
                    let pace = (most, arm.ramp_s);
                    Mover::Ramp(JointSpeed::new(last, &Joints::zeros(), pace))
                }
            }
            Goal::JointSpeed {
                speed,
                acceleration,
                ..
            } => {
                let most = reduced(
                    from,
                    ("a", "rad/s^2"),
                    *acceleration,
                    least_acceleration,
                    events,
                );
                Mover::Ramp(JointSpeed::new(last, speed, (most, arm.ramp_s)))
            }
            Goal::ToolSpeed {
                speed,
                acceleration,
                ..
            } => {
                let turn = base_from_base_link().rotation;
                let [linear, angular] =
                    [0, 3].map(|row| turn * speed.fixed_rows::<3>(row).into_owned());
                let to = crate::course::stacked(&linear, &angular);
                let pace = (*acceleration, arm.ramp_s);
                let tcp = &what.flange_from_tcp;
                Mover::Tool(ToolSpeed::new(&arm.kinematics, last, tcp, &to, pace))
            }
        };
        self.cancel(events);
        if let Some((from, _)) = self.next.take() {
            events.push(Event::Cancelled { from });
        }
        if let Some(left_s) = &mut active.left_s {
            *left_s = left_s.max(self.arm.period_s);
        }
        self.mover = mover;
        self.active = Some(active);
        Ok(())
    }

    /// A move from rest to rest: at once, blended into the last one, or once the arm stands.
    fn begin_leg(
        &mut self,
        from: Origin,
        what: &Move,
        kind: &MotionKind,
        events: &mut Vec<Event>,
    ) -> Result<(), Refusal> {
        let corner = match &self.mover {
            Mover::Still => None,
            Mover::Legs(legs) if legs.corner().is_some() => legs.corner(),
            _ => {
                self.cancel(events);
                if let Some((from, _)) = self.next.replace((from, what.clone())) {
                    events.push(Event::Cancelled { from });
                }
                self.stop(events);
                return Ok(());
            }
        };
        let start = corner.unwrap_or(self.last.position);
        let leg = self.leg(from, what, kind, start, events)?;
        let Some(leg) = leg else {
            events.push(Event::Done { from });
            return Ok(());
        };
        if let Mover::Legs(legs) = &mut self.mover {
            let blend = legs.blend(&self.arm.kinematics, leg);
            events.extend(blend.map(Event::Blend));
        } else {
            self.cancel(events);
            let rate = if self.is_paused() { 0.0 } else { self.slider };
            self.mover = Mover::Legs(Legs::new(leg, rate));
        }
        Ok(())
    }

    fn leg(
        &self,
        from: Origin,
        what: &Move,
        kind: &MotionKind,
        start: Joints,
        events: &mut Vec<Event>,
    ) -> Result<Option<NewLeg>, Refusal> {
        let (arm, tcp) = (&self.arm, &what.flange_from_tcp);
        let tool = |to: &Pose, via_m: Option<&nalgebra::Vector3<f64>>, pace: &Pace| {
            let via_m = via_m.map(|via_m| base_from_base_link().rotation * via_m);
            Course::tool(
                &arm.kinematics,
                (start, tcp),
                &(base_from_base_link() * to),
                via_m.as_ref(),
                (pace, arm.ramp_s),
            )
        };
        let (course, blend_m) = match kind {
            MotionKind::Joints { to, pace, blend_m } => {
                let pace = self.reduced_pace(from, &(to - start), pace, events);
                let course = Course::joints(start, *to, &pace, arm.ramp_s);
                (course, *blend_m)
            }
            MotionKind::Line { to, pace, blend_m } | MotionKind::Process { to, pace, blend_m } => {
                (tool(to, None, pace), *blend_m)
            }
            MotionKind::Circle {
                via_m,
                to,
                pace,
                blend_m,
            } => (tool(to, Some(via_m), pace), *blend_m),
            // No moves from rest to rest.
            MotionKind::Servo { .. } | MotionKind::Stop { .. } => return Ok(None),
        };
        let course = course.map_err(|error| match error {
            NoCourse::NoCircle => Refusal::NoCircle,
            NoCourse::Pace => Refusal::Pace,
        })?;
        Ok(course.map(|course| NewLeg {
            from,
            course,
            flange_from_tcp: *tcp,
            blend_m,
        }))
    }

    /// Speed and half the acceleration that every joint has on its way together with the others.
    fn reduced_pace(
        &self,
        from: Origin,
        delta: &Joints,
        pace: &Pace,
        events: &mut Vec<Event>,
    ) -> Pace {
        let leading = delta.amax();
        if pace.time_s.is_some() || leading <= 0.0 {
            return *pace;
        }
        let (mut speed, mut acceleration) = (f64::INFINITY, f64::INFINITY);
        for i in (0..JOINT_COUNT).filter(|i| delta[*i] != 0.0) {
            let share = delta[i].abs() / leading;
            speed = speed.min(self.arm.limits.0[i].velocity_rad_s / share);
            acceleration = acceleration.min(0.5 * self.arm.acceleration_rad_s2[i] / share);
        }
        Pace {
            speed: reduced(from, ("v", "rad/s"), pace.speed, speed, events),
            acceleration: reduced(
                from,
                ("a", "rad/s^2"),
                pace.acceleration,
                acceleration,
                events,
            ),
            time_s: None,
        }
    }

    fn advance(&mut self, measured: &Measured, events: &mut Vec<Event>) {
        let follows_a_tool = self.mover.follows_a_tool();
        let done = |from| events.push(Event::Done { from });
        let moved = self.mover.advance(&self.arm, &self.last, done);
        let stands = match moved {
            Ok((state, stands)) => {
                self.last = state;
                stands
            }
            Err(why) => self.trip(why, follows_a_tool, measured, events),
        };
        self.pass_on(events);
        if !stands {
            return;
        }
        self.mover = Mover::Still;
        self.last = JointState::at_rest(self.last.position);
        // One that has not gone on waits for its time.
        self.active.take_if(|active| active.is_done);
        if let Some((from, what)) = self.next.take() {
            self.begin_or_tell(Active::new(from, &what), events);
        }
    }

    /// A protective stop from the last set-point on. Whether the arm stands.
    fn trip(
        &mut self,
        why: Trip,
        follows_a_tool: bool,
        measured: &Measured,
        events: &mut Vec<Event>,
    ) -> bool {
        let least_singular_value =
            follows_a_tool.then(|| least_singular_value(&self.arm, &self.last.position));
        events.push(Event::Trip {
            why,
            least_singular_value,
        });
        self.enter(State::Protective, measured, events);
        let Mover::Ramp(stop) = &mut self.mover else {
            return true;
        };
        let (state, stands) = stop.advance(self.arm.period_s);
        self.last = state;
        stands
    }

    /// Programs that wait for a time or a speed go on.
    fn pass_on(&mut self, events: &mut Vec<Event>) {
        let Some(active) = &mut self.active else {
            return;
        };
        let is_due = match &mut active.left_s {
            Some(left_s) => {
                *left_s -= self.arm.period_s;
                *left_s <= ROUNDING_S
            }
            None => match &self.mover {
                Mover::Ramp(ramp) => ramp.is_reached(),
                Mover::Tool(tool) => tool.is_reached(),
                _ => false,
            },
        };
        if is_due && !active.is_done {
            active.is_done = true;
            events.push(Event::Done { from: active.from });
        }
    }
}

impl Active {
    fn new(from: Origin, what: &Move) -> Self {
        let left_s = match &what.goal {
            Goal::Motion(MotionKind::Servo { time_s, .. }) => Some(*time_s),
            Goal::JointSpeed { time_s, .. } | Goal::ToolSpeed { time_s, .. } => *time_s,
            Goal::Motion(_) => None,
        };
        Self {
            from,
            what: what.clone(),
            left_s,
            is_done: false,
        }
    }
}

fn cancel(active: &mut Option<Active>, events: &mut Vec<Event>) {
    if let Some(active) = active.take()
        && !active.is_done
    {
        events.push(Event::Cancelled { from: active.from });
    }
}

fn delay_cycles(arm: &ArmData) -> usize {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "positive; a cast cuts off what is too large"
    )]
    let cycles = (arm.servo_delay_s / arm.period_s).round() as usize;
    cycles
}

/// A value, or the most that the arm has, which is then told.
fn reduced(
    from: Origin,
    (what, unit): (&'static str, &'static str),
    asked: f64,
    most: f64,
    events: &mut Vec<Event>,
) -> f64 {
    if asked <= most {
        return asked;
    }
    events.push(Event::Reduced {
        from,
        what,
        asked,
        used: most,
        unit,
    });
    most
}

fn least_singular_value(arm: &ArmData, joints: &Joints) -> f64 {
    const CHARACTERISTIC_LENGTH_M: f64 = 0.5;
    let mut jacobian: Matrix6<f64> = arm.kinematics.chain.jacobian(joints);
    jacobian
        .fixed_rows_mut::<3>(0)
        .scale_mut(1.0 / CHARACTERISTIC_LENGTH_M);
    jacobian.singular_values().min()
}
