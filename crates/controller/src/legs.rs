//! Moves from rest to rest, each of which may begin before the one before it ends.

use std::collections::VecDeque;

use needlebench_kinematics::ik::Kinematics;
use needlebench_kinematics::trajectory::JointState;
use needlebench_kinematics::{Joints, Pose};

use crate::course::{Course, NoSolution};
use crate::event::Blend;
use crate::ramp::Ramp;
use crate::request::Origin;

/// Places at which a blend is compared with its sphere.
const PLACES: u32 = 16;

/// Steps along the rest of a tool's way by which its end is found.
const STEPS_TO_END: u32 = 8;

/// How long before its blend a program goes on, in cycles, so that the next move is there in time.
const CYCLES_AHEAD: f64 = 2.0;

/// A move under way.
#[derive(Debug, Clone, PartialEq)]
struct Leg {
    from: Origin,
    course: Course,
    flange_from_tcp: Pose,
    blend_m: f64,
    start_s: f64,
    /// Its own state at the last set-point, by its own time.
    last: JointState,
    /// Joint positions at its end, once known.
    end: Option<Joints>,
    /// The program has gone on.
    is_announced: bool,
}

impl Leg {
    fn tcp_m(&self, kinematics: &Kinematics, local_s: f64) -> nalgebra::Vector3<f64> {
        self.course
            .tcp_m(kinematics, &self.flange_from_tcp, local_s)
    }

    /// State at a time of its own, found from a state before.
    fn state_from(
        &self,
        kinematics: &Kinematics,
        (from_s, from): (f64, &JointState),
        to_s: f64,
    ) -> Result<JointState, NoSolution> {
        let ahead_s = to_s.min(self.course.duration_s()) - from_s.max(0.0);
        let guess = from.position + (from.velocity + from.acceleration * (0.5 * ahead_s)) * ahead_s;
        self.course.state(kinematics, to_s, &guess)
    }

    /// Joint positions at the end, by steps from a time of its own.
    fn find_end(&self, kinematics: &Kinematics, local_s: f64) -> Result<Joints, NoSolution> {
        if let Some(end) = self.course.end() {
            return Ok(end);
        }
        let left_s = self.course.duration_s() - local_s;
        let (mut at_s, mut state) = (local_s, self.last);
        for step in 1..=STEPS_TO_END {
            let to_s = local_s + left_s * f64::from(step) / f64::from(STEPS_TO_END);
            state = self.state_from(kinematics, (at_s, &state), to_s)?;
            at_s = to_s;
        }
        // At rest there, whatever rounding made of the time.
        self.course
            .state(kinematics, f64::INFINITY, &state.position)
            .map(|state| state.position)
    }
}

/// Rate at which the time of motions along a path runs: 1 at full speed, 0 while the program is paused.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Clock {
    begin_s: f64,
    elapsed_s: f64,
    ramp: Ramp,
}

impl Clock {
    fn time_s(&self) -> f64 {
        self.begin_s + self.ramp.sample(self.elapsed_s).way
    }

    fn set(&mut self, rate: f64, quickness_per_s: f64, ramp_s: f64) {
        let now = self.ramp.sample(self.elapsed_s);
        self.begin_s += now.way;
        self.elapsed_s = 0.0;
        let from = [now.velocity, now.acceleration];
        let most = quickness_per_s.max(now.acceleration.abs());
        self.ramp = Ramp::new(from, rate, most, most / ramp_s);
    }
}

/// The moves under way: the sum of their ways from corner to corner.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Legs {
    legs: VecDeque<Leg>,
    clock: Clock,
}

/// A move that joins others.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct NewLeg {
    pub from: Origin,
    pub course: Course,
    pub flange_from_tcp: Pose,
    pub blend_m: f64,
}

impl NewLeg {
    fn starting_at(self, start_s: f64) -> Leg {
        Leg {
            from: self.from,
            last: JointState::at_rest(self.course.start),
            course: self.course,
            flange_from_tcp: self.flange_from_tcp,
            blend_m: self.blend_m,
            start_s,
            end: None,
            is_announced: false,
        }
    }
}

impl Legs {
    /// One move, from now on, at a rate.
    pub fn new(leg: NewLeg, rate: f64) -> Self {
        Self {
            legs: VecDeque::from([leg.starting_at(0.0)]),
            clock: Clock {
                begin_s: 0.0,
                elapsed_s: 0.0,
                ramp: Ramp::steady(rate),
            },
        }
    }

    /// Where a move that is blended into the last one begins, if the last one lets it.
    pub fn corner(&self) -> Option<Joints> {
        self.legs.back().filter(|last| last.is_announced)?.end
    }

    /// The last move, if the program waits for it.
    pub fn waiting(&self) -> Option<Origin> {
        let last = self.legs.back()?;
        (!last.is_announced).then_some(last.from)
    }

    /// Time runs at another rate; moves are slowed by no more than they are accelerated anyway.
    pub fn set_rate(&mut self, rate: f64, ramp_s: f64) {
        let quickness_per_s = self.legs.iter().map(|leg| leg.course.quickness_per_s());
        let slowest_per_s = quickness_per_s.fold(f64::INFINITY, f64::min);
        self.clock.set(rate, slowest_per_s, ramp_s);
    }

    /// Adds a move that starts in the corner: so long before the end of the last one that the tool's point stays
    /// within the last one's blend radius of the corner while both move.
    pub fn blend(&mut self, kinematics: &Kinematics, leg: NewLeg) -> Option<Blend> {
        let now_s = self.clock.time_s();
        let last = self.legs.back()?;
        let corner = last.end?;
        let end_s = last.start_s + last.course.duration_s();
        let overlap_s = overlap_s(kinematics, last, now_s, &leg).unwrap_or(0.0);
        let radius_m = last.blend_m;
        self.legs.push_back(leg.starting_at(end_s - overlap_s));
        Some(Blend {
            corner_rad: corner,
            radius_m,
            overlap_s,
        })
    }

    /// State one period later, and whether the arm stands from then on; tells whose program goes on.
    pub fn advance(
        &mut self,
        kinematics: &Kinematics,
        period_s: f64,
        mut done: impl FnMut(Origin),
    ) -> Result<(JointState, bool), NoSolution> {
        let before_s = self.clock.time_s();
        self.clock.elapsed_s += period_s;
        let rate = self.clock.ramp.sample(self.clock.elapsed_s);
        let now_s = self.clock.begin_s + rate.way;
        let mut sum = JointState::at_rest(Joints::zeros());
        let count = self.legs.len();
        for (index, leg) in self.legs.iter_mut().enumerate() {
            let local_s = now_s - leg.start_s;
            let from = (before_s - leg.start_s, &leg.last.clone());
            let state = leg.state_from(kinematics, from, local_s)?;
            leg.last = state;
            sum.position += state.position;
            sum.velocity += state.velocity;
            sum.acceleration += state.acceleration;
            if index + 1 < count {
                sum.position -= leg.end.unwrap_or(state.position);
            }
        }
        let state = JointState {
            position: sum.position,
            velocity: sum.velocity * rate.velocity,
            acceleration: sum.acceleration * rate.velocity.powi(2)
                + sum.velocity * rate.acceleration,
        };
        // Behind its end a move adds nothing to those that follow it.
        while self.legs.len() > 1
            && let Some(first) = self.legs.front()
            && first.course.is_over(now_s - first.start_s)
        {
            self.legs.pop_front();
        }
        let mut is_over = false;
        if let Some(last) = self.legs.back_mut() {
            let (local_s, duration_s) = (now_s - last.start_s, last.course.duration_s());
            is_over = last.course.is_over(local_s);
            let ahead_s = local_s + CYCLES_AHEAD * period_s * rate.velocity;
            let is_in_sphere = || {
                let [at, end] = [ahead_s, duration_s].map(|s| last.tcp_m(kinematics, s));
                last.blend_m > 0.0
                    && local_s >= 0.5 * duration_s
                    && (at - end).norm() <= last.blend_m
            };
            if !last.is_announced && (is_over || is_in_sphere()) {
                // Without the corner there is no blend: then the program waits for the end.
                last.end = last.find_end(kinematics, local_s).ok();
                last.is_announced = is_over || last.end.is_some();
                if last.is_announced {
                    done(last.from);
                }
            }
        }
        Ok((state, is_over))
    }
}

/// How long before the end of one move the next may begin, s.
///
/// Within the second half of the one the way to go falls ever slower, within the first half of the other the way done
/// grows ever faster; so their sum is nowhere farther from the corner than at the ends. Where the tool's point does not
/// go straight, that is looked at.
fn overlap_s(
    kinematics: &Kinematics,
    from: &Leg,
    now_s: f64,
    to: &NewLeg,
) -> Result<f64, NoSolution> {
    let radius_m = from.blend_m;
    let to = to.clone().starting_at(0.0);
    let (from_end_s, to_end_s) = (from.course.duration_s(), to.course.duration_s());
    // The sphere of a corner is that of the tool's point of the move which ends there.
    let corner_m = from.tcp_m(kinematics, from_end_s);
    let off_m = |joints: &Joints| {
        let tcp = kinematics.base_link_from_flange(joints) * from.flange_from_tcp;
        (tcp.translation.vector - corner_m).norm()
    };
    let within = |half_s: f64, off_m: &dyn Fn(f64) -> f64| {
        let (mut inside_s, mut outside_s) = (0.0, half_s);
        if off_m(half_s) <= radius_m {
            return half_s;
        }
        for _ in 0..30 {
            let middle_s = 0.5 * (inside_s + outside_s);
            if off_m(middle_s) > radius_m {
                outside_s = middle_s;
            } else {
                inside_s = middle_s;
            }
        }
        inside_s
    };
    let before_s = within(0.5 * from_end_s, &|before_s| {
        (from.tcp_m(kinematics, from_end_s - before_s) - corner_m).norm()
    });
    let begin_m = to.tcp_m(kinematics, 0.0);
    let after_s = within(0.5 * to_end_s, &|after_s| {
        (to.tcp_m(kinematics, after_s) - begin_m).norm()
    });
    let local_s = now_s - from.start_s;
    let mut overlap_s = before_s.min(after_s).min(from_end_s - local_s).max(0.0);
    let corner = from.end.ok_or(NoSolution)?;
    'shorter: for _ in 0..30 {
        let (mut of_from, mut of_to) = ((local_s, from.last), (0.0, to.last));
        for step in 0..=PLACES {
            let time_s = overlap_s * f64::from(step) / f64::from(PLACES);
            let from_s = from_end_s - overlap_s + time_s;
            of_from = (
                from_s,
                from.state_from(kinematics, (of_from.0, &of_from.1), from_s)?,
            );
            of_to = (
                time_s,
                to.state_from(kinematics, (of_to.0, &of_to.1), time_s)?,
            );
            let joints = of_from.1.position + of_to.1.position - corner;
            // Rounding where the blend begins and ends.
            if off_m(&joints) > radius_m * (1.0 + 1e-9) {
                overlap_s *= 0.9;
                continue 'shorter;
            }
        }
        return Ok(overlap_s);
    }
    Ok(0.0)
}
