//! The arm that a program moves: its motions as set-points of every cycle of the controller.

use std::collections::BTreeSet;

use nalgebra::Vector3;
use needlebench_kinematics::ik::{Kinematics, nearest_within_limits};
use needlebench_kinematics::trajectory::JointState;
use needlebench_kinematics::{JOINT_NAMES, JointLimits, Joints, Pose, base_from_base_link};
use needlebench_recorded::MOST_JOINT_RAD;
use needlebench_urscript::{Arm, Motion, MotionKind, Pace, Place, ScriptError};

use super::chain::{Link, MoveChain};
use super::leg::{Leg, NoLine};
use super::stream::Stream;

/// Longest motion, s.
const LONGEST_S: f64 = 1800.0;

/// The last set-point of a motion is this far behind the one before it, in periods.
const LEAST_STEP: f64 = 0.25;

/// A stream stands at its end below this speed, rad/s.
const STANDING_RAD_S: f64 = 1e-4;

/// What of the controller's courses is assumed, where a program makes use of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Assumed {
    Ramps,
    Times,
    Blends,
    Process,
    Turning,
    Servo,
    Inverse,
}

impl Assumed {
    pub fn in_words(self) -> &'static str {
        match self {
            Self::Ramps => {
                "assumed: moves accelerate with a ramp of 0.14 s, as measured of a UR3e, to the program's speed, and \
                 stop likewise; the speed slider is at 100 %"
            }
            Self::Times => {
                "assumed: moves with a time accelerate for a third of it and decelerate for a third"
            }
            Self::Blends => {
                "assumed: within a blend radius the end of one move and the begin of the next are added; the tool's \
                 point stays within the radius of the corner, which it does not pass"
            }
            Self::Process => "assumed: movep goes as movel",
            Self::Turning => {
                "assumed: of lines that only turn the tool, a and v are those of the rotation, in rad"
            }
            Self::Servo => {
                "assumed: servoj reaches each target at its time, on straight joint-space lines; look-ahead time and \
                 gain smooth and delay it on a real arm"
            }
            Self::Inverse => {
                "assumed: of the joint positions of a pose, those are taken whose largest difference from the posture \
                 before (or qnear) is least"
            }
        }
    }
}

/// Set-points of a program.
#[derive(Debug)]
pub(super) struct ProgramArm {
    kinematics: Kinematics,
    limits: JointLimits,
    period_s: f64,
    /// Where all motions so far end.
    joints: Joints,
    chain: MoveChain,
    stream: Option<Stream>,
    pub times_s: Vec<f64>,
    pub states: Vec<JointState>,
    pub lines: Vec<usize>,
    pub assumed: BTreeSet<Assumed>,
}

impl ProgramArm {
    pub fn new(kinematics: &Kinematics, limits: JointLimits, period_s: f64, start: Joints) -> Self {
        Self {
            kinematics: *kinematics,
            limits,
            period_s,
            joints: start,
            chain: MoveChain::default(),
            stream: None,
            times_s: vec![0.0],
            states: vec![JointState::at_rest(start)],
            lines: vec![1],
            assumed: BTreeSet::new(),
        }
    }

    /// Ends what is under way: moves stand at the last end, a stream behind its last target.
    ///
    /// # Errors
    /// What the arm cannot do.
    pub fn finish(&mut self) -> Result<(), ScriptError> {
        self.finish_chain()?;
        self.finish_stream()
    }

    fn end_s(&self) -> f64 {
        self.times_s.last().copied().unwrap_or(0.0)
    }

    /// Adds a set-point; one of the same time takes the place of the last one.
    fn add(&mut self, time_s: f64, state: JointState, place: Place) {
        if let Some(last_s) = self.times_s.last()
            && time_s - last_s < 1e-9
        {
            let last = self.states.len() - 1;
            self.states[last] = state;
            return;
        }
        self.times_s.push(time_s);
        self.states.push(state);
        self.lines.push(place.line);
    }

    /// Times of the set-points of what lasts so long: every period, and the end.
    fn grid(&self, duration_s: f64) -> Vec<f64> {
        let mut times_s = vec![0.0];
        let mut count = 1.0;
        while count * self.period_s < duration_s - LEAST_STEP * self.period_s {
            times_s.push(count * self.period_s);
            count += 1.0;
        }
        times_s.push(duration_s);
        times_s
    }

    fn check_length(&self, place: Place, more_s: f64) -> Result<(), ScriptError> {
        let whole_s = self.end_s() + more_s;
        if whole_s <= LONGEST_S {
            return Ok(());
        }
        let message = format!("the motion lasts more than {LONGEST_S:.0} s");
        Err(ScriptError::new(place, message)
            .hint("does the program loop for ever? judge one pass of it"))
    }

    fn finish_chain(&mut self) -> Result<(), ScriptError> {
        let chain = std::mem::take(&mut self.chain);
        let Some(last) = chain.last() else {
            return Ok(());
        };
        self.check_length(last.place, chain.duration_s())?;
        let from_s = self.end_s();
        for time_s in self.grid(chain.duration_s()) {
            let (state, place) = chain
                .state(&self.kinematics, time_s)
                .map_err(|(place, error)| no_line(place, error))?;
            self.add(from_s + time_s, state, place);
        }
        Ok(())
    }

    fn finish_stream(&mut self) -> Result<(), ScriptError> {
        let Some(stream) = self.stream.take() else {
            return Ok(());
        };
        let duration_s = stream.duration_s();
        let (_, place) = stream.state(duration_s, self.period_s);
        self.check_length(place, duration_s)?;
        let from_s = self.end_s();
        for time_s in self.grid(duration_s) {
            let (state, place) = stream.state(time_s, self.period_s);
            self.add(from_s + time_s, state, place);
        }
        // One period later it stands.
        self.joints = stream.end();
        let state = JointState::at_rest(self.joints);
        self.add(from_s + duration_s + self.period_s, state, place);
        Ok(())
    }

    fn stand(&mut self, time_s: f64, place: Place) -> Result<(), ScriptError> {
        self.finish()?;
        self.check_length(place, time_s)?;
        let from_s = self.end_s();
        let state = JointState::at_rest(self.joints);
        // What follows may begin at speed: only the last period leads to that.
        if time_s > 2.0 * self.period_s {
            self.add(from_s + time_s - self.period_s, state, place);
        }
        self.add(from_s + time_s, state, place);
        Ok(())
    }

    /// Adds a move behind the last one.
    fn append(
        &mut self,
        motion: &Motion,
        leg: Option<Leg>,
        blend_m: f64,
    ) -> Result<(), ScriptError> {
        let Some(leg) = leg else {
            return Ok(());
        };
        self.joints = leg.end;
        let last = self.chain.last();
        let before_m = last.map_or(0.0, |last| last.blend_m);
        // The sphere of a corner is that of the move which ends there.
        let before = last.map(|last| last.flange_from_tcp);
        let flange_from_tcp = motion.flange_from_tcp.or(before).unwrap_or_default();
        let link = Link {
            place: motion.place,
            leg,
            blend_m,
            flange_from_tcp,
        };
        if before_m > 0.0 || blend_m > 0.0 {
            self.assumed.insert(Assumed::Blends);
            let chord_m = link.chord_m(&self.kinematics);
            if before_m + blend_m > chord_m {
                let message = format!(
                    "blend radii of {:.1} mm at its begin and {:.1} mm at its end overlap on a way of {:.1} mm",
                    before_m * 1e3,
                    blend_m * 1e3,
                    chord_m * 1e3
                );
                return Err(ScriptError::new(motion.place, message)
                    .hint("a controller leaves such a move out: choose smaller radii"));
            }
        }
        self.push(link)
    }

    fn push(&mut self, link: Link) -> Result<(), ScriptError> {
        let stops = link.blend_m <= 0.0;
        self.chain
            .push(&self.kinematics, link)
            .map_err(|(place, error)| no_line(place, error))?;
        if stops {
            return self.finish_chain();
        }
        match self.chain.last() {
            Some(last) => self.check_length(last.place, self.chain.duration_s()),
            None => Ok(()),
        }
    }

    fn line(
        &mut self,
        motion: &Motion,
        (to, via_m): (&Pose, Option<&Vector3<f64>>),
        pace: &Pace,
        blend_m: f64,
    ) -> Result<(), ScriptError> {
        self.finish_stream()?;
        self.note_pace(pace);
        let flange_from_tcp = motion.flange_from_tcp.unwrap_or_default();
        let base_link_from_end = base_from_base_link() * to;
        let start = self.joints;
        let from = self.kinematics.base_link_from_flange(&start) * flange_from_tcp;
        let way = from.translation.vector - base_link_from_end.translation.vector;
        let leg = Leg::line(
            &self.kinematics,
            start,
            &flange_from_tcp,
            &base_link_from_end,
            via_m
                .map(|via_m| base_from_base_link().rotation * via_m)
                .as_ref(),
            pace,
        );
        let leg = leg.map_err(|error| no_line(motion.place, error))?;
        if leg.is_some() && via_m.is_none() && way.norm() < super::leg::NO_TRANSLATION_M {
            self.assumed.insert(Assumed::Turning);
        }
        self.append(motion, leg, blend_m)
    }

    fn note_pace(&mut self, pace: &Pace) {
        self.assumed.insert(match pace.time_s {
            Some(_) => Assumed::Times,
            None => Assumed::Ramps,
        });
    }
}

/// Joint positions within the limits that bring the flange to a pose in the controller's base frame: those whose largest
/// difference from a posture is least.
pub(crate) fn nearest_joints(
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

fn check_posture(place: Place, joints: &Joints) -> Result<(), ScriptError> {
    let Some(joint) = joints.iter().position(|value| value.abs() > MOST_JOINT_RAD) else {
        return Ok(());
    };
    let (name, value) = (JOINT_NAMES[joint], joints[joint]);
    let message = format!("{name} is {value} rad, more than a revolution");
    Err(ScriptError::new(place, message)
        .hint("joint positions are in radians: are these degrees? d2r(...) converts them"))
}

/// Why a move is no motion, at its place in the program.
fn no_line(place: Place, error: NoLine) -> ScriptError {
    match error {
        NoLine::OutOfReach(share) => {
            let message = format!(
                "the line leaves the workspace after {:.1} % of its way",
                share * 1e2
            );
            ScriptError::new(place, message).hint("use movej, or another pose")
        }
        NoLine::Jump(share) => {
            let message = format!(
                "the line meets a singularity after {:.1} % of its way: the joints would have to jump",
                share * 1e2
            );
            ScriptError::new(place, message)
                .hint("use movej, or begin the line in another configuration")
        }
        NoLine::NoCircle => {
            let message = "begin, pose_via and pose_to of the circle lie on a line";
            ScriptError::new(place, message).hint("use movel")
        }
        NoLine::Pace => ScriptError::new(place, "a, v or t of the move give no course"),
    }
}

impl Arm for ProgramArm {
    fn joints(&self) -> Joints {
        self.joints
    }

    fn base_from_flange(&self, joints: &Joints) -> Pose {
        base_from_base_link() * self.kinematics.base_link_from_flange(joints)
    }

    fn inverse(&mut self, base_from_flange: &Pose, near: &Joints) -> Option<Joints> {
        self.assumed.insert(Assumed::Inverse);
        nearest_joints(&self.kinematics, &self.limits, base_from_flange, near)
    }

    fn period_s(&self) -> f64 {
        self.period_s
    }

    fn perform(&mut self, motion: &Motion) -> Result<(), ScriptError> {
        match &motion.kind {
            MotionKind::Joints { to, pace, blend_m } => {
                self.finish_stream()?;
                self.note_pace(pace);
                check_posture(motion.place, to)?;
                let leg = Leg::joints(self.joints, *to, pace);
                let leg = leg.map_err(|error| no_line(motion.place, error))?;
                self.append(motion, leg, *blend_m)
            }
            MotionKind::Line { to, pace, blend_m } => self.line(motion, (to, None), pace, *blend_m),
            MotionKind::Process { to, pace, blend_m } => {
                self.assumed.insert(Assumed::Process);
                self.line(motion, (to, None), pace, *blend_m)
            }
            MotionKind::Circle {
                via_m,
                to,
                pace,
                blend_m,
            } => self.line(motion, (to, Some(via_m)), pace, *blend_m),
            MotionKind::Servo { to, time_s, .. } => {
                self.finish_chain()?;
                check_posture(motion.place, to)?;
                self.assumed.insert(Assumed::Servo);
                if *time_s < self.period_s * (1.0 - 1e-9) {
                    let message = format!(
                        "servoj: t is {time_s} s, less than the controller's period of {} s",
                        self.period_s
                    );
                    return Err(ScriptError::new(motion.place, message));
                }
                if self.stream.as_ref().is_some_and(Stream::is_stopped) {
                    self.finish_stream()?;
                }
                let start = self.joints;
                let stream = self.stream.get_or_insert_with(|| Stream::new(start));
                stream.push(*to, *time_s, motion.place);
                self.joints = *to;
                let duration_s = stream.duration_s();
                self.check_length(motion.place, duration_s)
            }
            MotionKind::Stand { time_s } => self.stand(*time_s, motion.place),
            MotionKind::Stop {
                deceleration,
                is_linear,
            } => {
                self.finish_chain()?;
                let Some(stream) = &mut self.stream else {
                    return Ok(());
                };
                if stream.last_velocity().amax() < STANDING_RAD_S {
                    return Ok(());
                }
                if *is_linear {
                    let message =
                        "stopl while a stream of servoj moves: only stopj is judged there";
                    return Err(ScriptError::new(motion.place, message));
                }
                stream.stop(*deceleration);
                self.joints = stream.end();
                Ok(())
            }
        }
    }
}
