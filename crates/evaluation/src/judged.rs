//! What a report says of a motion from a file that it judges.

use std::collections::BTreeMap;

use serde::Serialize;

/// A motion from a file.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct JudgedReport {
    /// File as the user named it.
    pub file: String,
    /// SHA-256 of its bytes.
    pub sha256: String,
    /// What it is, in words.
    pub format: &'static str,
    /// Points in it.
    pub points: usize,
    /// Whether its points have times; else they have those of the arm's limits.
    pub has_times: bool,
    /// What joins the points, in words.
    pub between: &'static str,
    /// How long it takes, s, with a hold that was added.
    pub duration_s: f64,
    /// The goals at which it holds, in its order.
    pub holds: Vec<HoldReport>,
    /// The program that made it, where one was run on the virtual controller.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub program: Option<ProgramReport>,
}

/// Criterion on the end of a program that was run on the virtual controller.
pub const PROGRAM_END: &str = "program_end";

/// A program that was run on the virtual controller, whose set-points are the motion.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ProgramReport {
    /// Engine whose arm it moved, and read.
    pub engine: &'static str,
    /// Time between two set-points, s.
    pub period_s: f64,
    /// How it ended.
    pub end: ProgramEnd,
    /// When, s of the motion.
    pub ended_s: f64,
    /// The end in words, with the reason.
    pub detail: String,
    /// What happened, in the order of the times.
    pub events: Vec<ProgramEvent>,
    /// Further events, which are not listed.
    pub more_events: usize,
}

/// How a program on the virtual controller ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ProgramEnd {
    /// It came to its end.
    Finished,
    /// By `halt`.
    Halted,
    /// It was ended as asked: after a time, or once the arm held at a goal.
    AsAsked,
    /// By a runtime exception.
    Exception,
    /// By a protective stop.
    ProtectiveStop,
    /// It had not ended after the longest time.
    TimeLimit,
    /// The engine could not carry on.
    EngineFailed,
    /// The run was interrupted.
    Interrupted,
}

impl ProgramEnd {
    /// Whether the program ended as programs do; none where it was not let go on to its end.
    pub fn is_regular(self) -> Option<bool> {
        match self {
            Self::Finished | Self::Halted | Self::AsAsked => Some(true),
            Self::Exception | Self::ProtectiveStop => Some(false),
            Self::TimeLimit | Self::EngineFailed | Self::Interrupted => None,
        }
    }
}

/// Something that happened while a program ran.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ProgramEvent {
    /// When, s of the motion.
    pub time_s: f64,
    /// Line of the program, from 1, that it is of; none where that is not known.
    pub line: Option<usize>,
    /// Kind: `message`, `popup`, `output`, `not_simulated`, `reduced`, `stop`, `contact`, `clearance`, `end`.
    pub kind: &'static str,
    /// In words.
    pub text: String,
}

/// A goal at which a motion holds.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct HoldReport {
    /// Goal.
    pub goal: String,
    /// Configuration of the eight that the held posture is nearest to; none where the goal's pose has no solution at
    /// the roll of that posture.
    pub label: Option<&'static str>,
    /// Where in the motion the part to this goal begins, s.
    pub begins_s: f64,
    /// Begin and end of the hold, s of the motion.
    pub hold_s: [f64; 2],
    /// The motion does not stand there by itself: the scenario's hold was added.
    pub is_added: bool,
    /// Roll of the guide about the needle, rad.
    pub roll_rad: f64,
    /// 2π equivalent: full revolutions of each joint beyond `[-pi, pi]`.
    pub turns: Option<[i32; 6]>,
    /// Distance of the guide's exit from its planned place, m.
    pub guide_off_m: f64,
    /// Angle of the guide from the planned needle, rad.
    pub angle_off_rad: f64,
    /// Largest difference of a joint from the exact solution, rad.
    pub joint_off_rad: Option<f64>,
    /// Largest values along the part, each beside its limit.
    pub peaks: Vec<PeakReport>,
    /// Certified clearances of what follows the hold, m, by class; empty unless the motion goes on.
    pub afterwards_m: BTreeMap<&'static str, f64>,
    /// What needlebench plans to the same goal; none where it was not asked for.
    pub plans: Vec<OwnPlanReport>,
}

/// The largest value of a quantity along a motion, relative to its limit.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PeakReport {
    /// `joint_range`, `joint_speed`, `joint_acceleration`, `joint_torque`.
    pub criterion: &'static str,
    /// Joint.
    pub joint: &'static str,
    /// Value, in `unit`.
    pub value: f64,
    /// Its limit.
    pub limit: f64,
    /// Unit of both.
    pub unit: &'static str,
    /// When, s of the motion.
    pub time_s: f64,
    /// Where the limit is from, in words.
    pub of: &'static str,
}

/// Why a plan stands beside a motion: it is in the same configuration.
pub const SAME_CONFIGURATION: &str = "same configuration";

/// It has the largest margin of all plans to the goal.
pub const LARGEST_MARGIN: &str = "largest margin";

/// A plan of needlebench beside a motion that is judged.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct OwnPlanReport {
    /// Configuration.
    pub label: &'static str,
    /// Why it is there: [`SAME_CONFIGURATION`] or [`LARGEST_MARGIN`].
    pub why: &'static str,
    /// Why the plan is not feasible; none if it is.
    pub rejected: Option<String>,
    /// How long it takes, s; none without a motion.
    pub duration_s: Option<f64>,
    /// Certified clearances, by class, m.
    pub clearances: BTreeMap<&'static str, BesideReport>,
}

/// A clearance of a motion beside that of a plan, m.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BesideReport {
    /// Least clearance of the motion as it is commanded.
    pub motion_m: f64,
    /// Its certified lower bound.
    pub motion_certified_m: f64,
    /// When the motion comes nearest, s of the motion.
    pub time_s: f64,
    /// The two bodies then.
    pub pair: [String; 2],
    /// Least clearance of the plan.
    pub plan_m: f64,
    /// Its certified lower bound.
    pub plan_certified_m: f64,
}

impl BesideReport {
    /// By how much the motion is nearer than the plan, m; negative if it is farther. None where the difference is
    /// below what counts: 0.25 mm.
    pub fn lost_m(&self) -> Option<f64> {
        let lost_m = self.plan_m - self.motion_m;
        (lost_m.abs() >= SAME_M).then_some(lost_m)
    }
}

/// Difference of clearances that is none, m: as the planner's searches have it.
const SAME_M: f64 = 2.5e-4;
