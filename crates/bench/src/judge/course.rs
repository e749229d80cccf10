//! A motion's file as a course with its standstills.

use std::ops::Range;

use needlebench_input::Finding;
use needlebench_kinematics::trajectory::{Between, JointTrajectory, Phase};
use needlebench_kinematics::{JOINT_COUNT, JOINT_NAMES, Joints};
use needlebench_recorded::{Known, MotionFile};
use needlebench_scenario::ResolvedScenario;

/// Joints stand below this speed, rad/s.
const STANDING_RAD_S: f64 = 1e-3;

/// A standstill lasts so long, s, at least.
const STANDSTILL_S: f64 = 0.2;

/// What rounding makes of a speed that is the limit, relative.
const ROUNDING: f64 = 1e-6;

/// A motion with its course between the points.
pub(super) struct Course<'a> {
    pub file: &'a MotionFile,
    pub between: Between,
    /// Time of each point, s from the first.
    pub times_s: Vec<f64>,
    /// Where the joints stand, by points, the last one included.
    pub stands: Vec<Range<usize>>,
    /// Way points get their times from the limits of the scenario's motions.
    timed: Option<JointTrajectory>,
}

impl<'a> Course<'a> {
    /// The course of a file.
    ///
    /// # Errors
    /// Points that the arm's speed does not allow, or that lack what joins them.
    pub fn of(
        resolved: &ResolvedScenario,
        file: &'a MotionFile,
        between: Option<Between>,
    ) -> Result<Self, Finding> {
        let Some(times_s) = &file.times_s else {
            return Self::timed(resolved, file, between);
        };
        let own = file.known.between();
        let between = between.unwrap_or(own);
        let needed = match between {
            Between::Lines => Known::Positions,
            Between::Cubics => Known::Velocities,
            Between::Quintics => Known::Accelerations,
        };
        if needed > file.known {
            let lacks = match needed {
                Known::Accelerations => "accelerations",
                _ => "velocities",
            };
            let message = format!("the points have no {lacks}, by which --between joins them");
            let finding = Finding::new(&file.source.file, message).key("--between");
            return Err(finding.hint(format!("leave it out: {} then", in_words(own))));
        }
        let times_s: Vec<f64> = times_s.iter().map(|time_s| time_s - times_s[0]).collect();
        let course = Self {
            stands: stands(file, &times_s),
            file,
            between,
            times_s,
            timed: None,
        };
        course.check_jumps(&resolved.cell.robot.limits.velocities_rad_s())?;
        Ok(course)
    }

    /// Way points: from each to the next along a straight line of the joints, with a stop at each.
    fn timed(
        resolved: &ResolvedScenario,
        file: &'a MotionFile,
        between: Option<Between>,
    ) -> Result<Self, Finding> {
        if between.is_some() {
            let message = "the points have no times, and are joined by straight lines";
            let finding = Finding::new(&file.source.file, message).key("--between");
            return Err(finding.hint("leave it out, or give the points times"));
        }
        let mut motion = JointTrajectory::starting_at(file.states[0].position);
        let mut times_s = vec![0.0];
        for state in &file.states[1..] {
            motion = motion.then_straight_to(Phase::Travel, state.position, &resolved.motion);
            times_s.push(motion.duration_s());
        }
        Ok(Self {
            file,
            between: Between::Lines,
            times_s,
            stands: Vec::new(),
            timed: Some(motion),
        })
    }

    /// What joins the points, in words.
    pub fn between_in_words(&self) -> &'static str {
        if self.timed.is_some() {
            "straight joint-space lines with a stop at each point, timed by the scenario's [motion]"
        } else {
            in_words(self.between)
        }
    }

    /// Index of the last point.
    pub fn last(&self) -> usize {
        self.times_s.len() - 1
    }

    /// Joint positions at a point.
    pub fn position(&self, point: usize) -> &Joints {
        &self.file.states[point].position
    }

    /// The part between two points; nothing where they are the same.
    pub fn part(&self, phase: Phase, points: Range<usize>) -> JointTrajectory {
        let start = JointTrajectory::starting_at(*self.position(points.start));
        if points.is_empty() {
            return start;
        }
        if let Some(whole) = &self.timed {
            // Only the end is a hold: a part is the whole of it.
            return whole.clone();
        }
        let points = points.start..points.end + 1;
        let times_s = &self.times_s[points.clone()];
        let states = &self.file.states[points];
        let part = JointTrajectory::sampled(phase, self.between, times_s, states);
        start.followed_by(part.expect("the file's points are finite and their times increase"))
    }

    /// A point as an error names it.
    pub fn finding(&self, point: usize, message: &str) -> Finding {
        let line = self.file.lines.get(point).copied();
        Finding {
            line,
            ..Finding::new(
                &self.file.source.file,
                format!("point {}: {message}", point + 1),
            )
        }
    }

    /// No joint is faster between two points than it can be, whatever joins them.
    fn check_jumps(&self, most_rad_s: &Joints) -> Result<(), Finding> {
        for point in 1..self.times_s.len() {
            let step_s = self.times_s[point] - self.times_s[point - 1];
            let step = self.position(point) - self.position(point - 1);
            for joint in 0..JOINT_COUNT {
                let speed_rad_s = step[joint].abs() / step_s;
                let most_rad_s = most_rad_s[joint];
                if speed_rad_s > most_rad_s * (1.0 + ROUNDING) {
                    let message = format!(
                        "{} jumps by {:.6} rad in {:.6} s: {speed_rad_s:.3} rad/s, where the joint can do {most_rad_s:.3}",
                        JOINT_NAMES[joint], step[joint], step_s
                    );
                    let hint = "are points missing, or 2π added?";
                    let finding = self.finding(point, &message).key(JOINT_NAMES[joint]);
                    return Err(finding.hint(hint));
                }
            }
        }
        Ok(())
    }
}

/// What joins points, in words.
fn in_words(between: Between) -> &'static str {
    match between {
        Between::Quintics => "quintics with the points' velocities and accelerations",
        Between::Cubics => "cubics with the points' velocities",
        Between::Lines => "straight joint-space lines at constant speed",
    }
}

/// Points between which the joints stand for long enough.
fn stands(file: &MotionFile, times_s: &[f64]) -> Vec<Range<usize>> {
    let is_slow = |point: usize| file.states[point].velocity.amax() < STANDING_RAD_S;
    let stands_after = |point: usize| {
        let step = file.states[point + 1].position - file.states[point].position;
        let step_s = times_s[point + 1] - times_s[point];
        step.amax() < STANDING_RAD_S * step_s && is_slow(point) && is_slow(point + 1)
    };
    let mut found: Vec<Range<usize>> = Vec::new();
    let mut begin = None;
    for point in 0..times_s.len() {
        let stands_on = point + 1 < times_s.len() && stands_after(point);
        match (begin, stands_on) {
            (None, true) => begin = Some(point),
            (Some(from), false) => {
                if times_s[point] - times_s[from] >= STANDSTILL_S {
                    found.push(from..point);
                }
                begin = None;
            }
            _ => {}
        }
    }
    found
}
