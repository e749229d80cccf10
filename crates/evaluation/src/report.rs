//! The report: every value that a run gives, with the keys that others build on.

use std::collections::{BTreeMap, BTreeSet};

use needlebench_clearance::{ClassMinima, is_known};
use needlebench_engine::EngineIdentity;
use needlebench_robot::{ArmReport, LinkEnclosure};
use needlebench_scenario::GravitySettings;
use needlebench_uncertainty::budget::ErrorBudget;
use serde::Serialize;

use crate::adjudication::Adjudication;
pub use crate::class_clearance::{ClassClearance, ClearanceReport};
use crate::events::EventsReport;
use crate::excitation::ExcitationReport;
use crate::iso9283::Iso9283Report;
use crate::judged::JudgedReport;
use crate::motion::{EngineDifference, MotionMeasurement};
use crate::needle::NeedleMeasurement;
use crate::probability::ProbabilityReport;
use crate::ranking_report::{Dominance, GoalRanking, RankingReport};
use crate::referee::RefereeReport;
use crate::room::RoomReport;
pub use crate::truth::TruthReport;
pub use crate::verdict::{CriterionResult, Judged, NotJudged, TraceOutcome, TraceRow, Verdict};

/// Version of the report's keys.
pub const SCHEMA_VERSION: u32 = 1;

/// Result of a scenario.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Report {
    /// Version of the keys.
    pub schema_version: u32,
    /// The scenario.
    pub scenario: ScenarioSummary,
    /// `pass`, `fail` or `incomplete`.
    pub verdict: Verdict,
    /// Every criterion that was evaluated.
    pub criteria: Vec<CriterionResult>,
    /// Every criterion that was to be evaluated and could not be.
    pub not_judged: Vec<NotJudged>,
    /// Requirements with the criteria that stand for them and what came of these; empty where the scenario
    /// has none.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub trace: Vec<TraceRow>,
    /// The goals.
    pub goals: Vec<GoalReport>,
    /// The test by ISO 9283, in place of goals.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub iso9283: Option<Iso9283Report>,
    /// The excitation run, in place of goals.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub excitation: Option<ExcitationReport>,
    /// The motion from a file that was judged; none where the motions are planned.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub judged: Option<JudgedReport>,
    /// Engines that failed, and how; their results are missing.
    pub engine_failures: Vec<EngineFailure>,
    /// The arm whose data the robot has; none if its lengths are those of no arm that is known.
    pub arm: Option<ArmReport>,
    /// Gravity of the world, and what the controller takes it for.
    pub gravity: GravitySettings,
    /// What the enclosing primitives of that arm's own URDF would cost beside the meshes of the robot
    /// in use; empty unless that robot has meshes of its own.
    pub enclosure: Vec<LinkEnclosure>,
    /// Values of the arm that are assumed, each by its key in the arm's data, and why.
    pub assumed: BTreeMap<String, String>,
    /// What was assumed or adjusted.
    pub notes: Vec<String>,
    /// What arm and patient the expected tip errors (`configurations[].budget`) are of; none if there are
    /// none.
    pub expected: Option<ExpectedReport>,
    /// The arm and the patient that were simulated, where they are not the nominal ones.
    pub truth: Option<TruthReport>,
    /// Where the numbers come from.
    pub provenance: Provenance,
    /// Wall-clock times, s, and per engine the real time factor: simulated time over the wall-clock
    /// time of its motions, with control, recording and certified clearance. The only part that
    /// differs between two runs of the same inputs.
    pub timings: BTreeMap<String, f64>,
}

/// The arm and patient population of the RMS tip error.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct ExpectedReport {
    /// `factory_calibrated`, `nominal_kinematics`, `calibrated_here`; none where the scenario's own
    /// `[imperfections]` say it.
    pub arm: Option<&'static str>,
    /// What the controller knows of the arm, in words.
    pub arm_in_words: &'static str,
    /// `hold` or `free`.
    pub breath: &'static str,
}

/// Which scenario it was.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct ScenarioSummary {
    /// Its name.
    pub name: String,
    /// Its description.
    pub description: String,
    /// Its file, as given.
    pub file: String,
}

/// An engine that failed.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct EngineFailure {
    /// The engine.
    pub engine: String,
    /// Goal and configuration it was running, if any.
    pub during: Option<String>,
    /// What happened and how to mend it.
    pub message: String,
}

/// One goal.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GoalReport {
    /// Its name.
    pub name: String,
    /// Lesion that is aimed at.
    pub lesion: Option<String>,
    /// Entry point in the world.
    pub entry_m: Option<[f64; 3]>,
    /// Target in the world.
    pub target_m: [f64; 3],
    /// Where the lesion really is, in the world before breathing and tissue move it; none where that is not known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub true_target_m: Option<[f64; 3]>,
    /// Direction of insertion in the world.
    pub axis: [f64; 3],
    /// From guide exit to needle tip.
    pub insertion_length_m: f64,
    /// Planned gap between guide exit and entry point.
    pub standoff_m: Option<f64>,
    /// The structure closest to its margin on the planned needle path; none where there is none.
    pub needle_route: Option<RouteReport>,
    /// Fissures of the lungs that the planned needle crosses.
    pub fissures_crossed: Vec<String>,
    /// How the needle bends in tissue; none for one that bends in air.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub needle: Option<NeedleReport>,
    /// All eight configurations.
    pub configurations: Vec<ConfigurationReport>,
    /// The recommended one; none if none is feasible.
    pub recommended: Option<Recommendation>,
    /// How the feasible ones compare; none until they are ranked.
    pub ranking: Option<GoalRanking>,
}

/// How the planned needle keeps away from bone, vessels and organs that do not contain the target.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RouteReport {
    /// The part of which it keeps its margin least, or misses it most.
    pub part: String,
    /// Bone, vessel or organ.
    pub tissue: String,
    /// Signed distance of the needle's surface, negative inside, never optimistic.
    pub distance_m: f64,
    /// The required distance.
    pub margin_m: f64,
    /// The margin is kept; if not, every configuration is rejected.
    pub kept: bool,
    /// Whether it is the median needle as tissue bends it that comes so near, and not the straight one.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub is_bent: bool,
}

/// How a goal's needle bends in tissue, and what can be done about it: of many needles in many patients, the same draws
/// everywhere. Bends are those of the tip at the end of its way, towards where its bevel pushes it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct NeedleReport {
    /// The answer, in a sentence.
    pub summary: String,
    /// Gauge.
    pub gauge: u32,
    /// Outer diameter.
    pub outer_diameter_m: f64,
    /// Bending stiffness.
    pub bending_stiffness_nm2: f64,
    /// `bevel`, `symmetric` or `rolled`.
    pub tip: &'static str,
    /// Tissues from the skin to the tip.
    pub layers: Vec<NeedleLayer>,
    /// Direction in the patient's frame (left, posterior, superior) towards which the tip is pushed; none where any direction
    /// is as likely.
    pub pushed_towards: Option<[f64; 3]>,
    /// The bend.
    pub bend: BendSummary,
    /// How far it is bent where it first enters a lung, by medians; none where it enters none.
    pub bend_at_pleura_m: Option<f64>,
    /// The largest slope, by medians: the model is for slopes below 0.1.
    pub largest_slope: f64,
    /// What the needle cuts by medians: depth behind the skin and how far the path is off the axis there.
    pub path_m: Vec<[f64; 2]>,
    /// Points of that path in the world, from the skin to the tip; none where its direction is not known.
    pub path_in_world_m: Vec<[f64; 3]>,
    /// Depth behind the skin at which it is turned by 180 degrees; none if it is not.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub turn_at_m: Option<f64>,
    /// Turned by 180 degrees at the depth where that helps most; none for a tip without a direction, and for a needle that is
    /// turned as it is.
    pub turned: Option<TurnedNeedle>,
    /// How far beside the target the guide is aimed against the mean bend; none if it is aimed at the target.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub aim_m: Option<f64>,
    /// Root mean square of what is left if the axis is aimed against the mean bend, as it is where `aim_m` is given; none where
    /// the direction is not known.
    pub aimed_rms_m: Option<f64>,
    /// How far the median needle would bend if a hand held it by its hub, without a guide; none for one that is too short.
    pub by_hub_m: Option<f64>,
    /// What other needles, guides and hands would give.
    pub alternatives: Vec<NeedleAlternative>,
    /// What a full breath does to the needle once it is in; none for a patient who does not breathe.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub breath: Option<NeedleInBreath>,
    /// For a tip that is pushed to one side: what the bent needle keeps from bone, vessels and organs for twelve directions of
    /// the bevel's face, the largest distance first.
    pub faces: Vec<BevelDirection>,
    /// What of it is assumed, and not measured with this needle.
    pub assumed: Vec<&'static str>,
}

/// A layer that a needle passes.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct NeedleLayer {
    /// `fat`, `wall`, `lung`, `lesion`, `gas` or `fluid`.
    pub tissue: &'static str,
    /// Length along the needle.
    pub length_m: f64,
    /// Median of the lateral force per length per displacement.
    pub stiffness_n_m2: f64,
    /// Median of the force across the tip.
    pub force_n: f64,
}

/// Bends of many needles.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct BendSummary {
    /// Median.
    pub median_m: f64,
    /// 5 % bend less.
    pub p05_m: f64,
    /// 5 % bend more.
    pub p95_m: f64,
    /// Root mean square.
    pub rms_m: f64,
}

/// A needle that is turned on its way.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct TurnedNeedle {
    /// Depth behind the skin at which it is turned.
    pub at_m: f64,
    /// Root mean square of the bend then.
    pub rms_m: f64,
}

/// A needle that is in when the patient breathes in from the end of expiration: by medians, motions lateral to the needle
/// alone, since tissue slides along it freely (assumed).
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct NeedleInBreath {
    /// How far the lung slides along the wall; 0 for a needle that enters none.
    pub lung_slides_m: f64,
    /// How far that takes the tip off the lesion.
    pub off_by_lung_m: f64,
    /// How far the chest moves.
    pub chest_moves_m: f64,
    /// How far that takes the tip off the lesion while the guide holds the needle.
    pub off_by_chest_m: f64,
    /// The force that the guide holds it with then, N.
    pub guide_n: f64,
}

/// Another needle, guide or hand.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct NeedleAlternative {
    /// What is other.
    pub what: String,
    /// How it bends.
    pub bend: BendSummary,
}

/// A direction of a bevel's face, and what the needle keeps away from then.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BevelDirection {
    /// On a clock seen by whoever holds the hub, 12:00 towards the patient's head.
    pub clock: String,
    /// The structure that the bent needle comes nearest to.
    pub part: String,
    /// Signed distance of its surface, negative inside.
    pub distance_m: f64,
}

/// Which configuration to choose.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Recommendation {
    /// Its label.
    pub label: String,
    /// Why, in one sentence.
    pub summary: String,
    /// Why, with all that speaks for it and against it.
    pub reason: String,
}

/// What became of a configuration.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Status {
    /// It is feasible and meets all criteria that were evaluated; [`ConfigurationReport::not_judged`] says how many
    /// were not.
    Ok,
    /// It is infeasible.
    Rejected,
    /// It is feasible but fails a criterion, or no engine could measure it.
    Failed,
}

impl Status {
    /// As in the report.
    pub fn name(self) -> &'static str {
        match self {
            Self::Ok => "ok",
            Self::Rejected => "rejected",
            Self::Failed => "failed",
        }
    }
}

/// One rule that rejects a configuration.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RejectionReport {
    /// Name of the rule.
    pub rule: &'static str,
    /// The value that violates it.
    pub value: f64,
    /// The limit.
    pub limit: f64,
    /// Unit of both.
    pub unit: &'static str,
    /// Which joint, pair and phase.
    pub detail: String,
}

/// Margins of the final posture.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct MarginsReport {
    /// 1 in the middle of every joint's range, 0 at a limit.
    pub joint_limit: f64,
    /// `|sin q5|`.
    pub wrist_sine: f64,
    /// `|sin q3|`.
    pub elbow_sine: f64,
    /// `sqrt(rho^2 - d4^2)`.
    pub shoulder_m: f64,
    /// `sqrt(det J J^T)` of the flange, m^3.
    pub manipulability_m3: f64,
}

/// One phase of the planned motion.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct PhaseReport {
    /// `transfer`, `approach` or `hold`; `retract` or `return` on the retreat.
    pub phase: &'static str,
    /// Its start.
    pub start_s: f64,
    /// Its end.
    pub end_s: f64,
}

/// Search for a motion.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct SearchReport {
    /// Corners of the way that was found, ends included; 0 if none was.
    pub waypoints: usize,
    /// Postures that were looked at.
    pub postures_checked: u64,
    /// Random postures that were drawn.
    pub postures_drawn: u64,
    /// Seed of the random postures.
    pub seed: u64,
}

/// Margins of a planned motion, of those that its configuration allows. Clearances are certified lower bounds; margins
/// are what they are beyond the required clearance: the scenario's `[criteria]`, else the floors of `[planning]`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MarginReport {
    /// Least margin from the surroundings that any motion to this posture could keep: that of the start, the
    /// approach and the place where it ends.
    pub attainable_m: Option<f64>,
    /// The one that this motion keeps.
    pub achieved_m: Option<f64>,
    /// Class of that one.
    pub class: Option<&'static str>,
    /// What comes nearest in it: `start`, `approach` (with the place where it ends) or `transfer`.
    pub limited_by: Option<&'static str>,
    /// How the search for a transit ended: `bound`, it keeps what the other postures keep, or what is ample, so that
    /// there is none that keeps more that counts; `proof`, a posture that every motion must take is nearer than
    /// allowed; `budget`, there may be a better one.
    pub search: &'static str,
    /// What the straight transit would have kept and taken; none where the transit is straight.
    pub straight: Option<StraightReport>,
    /// The classes, by name.
    pub classes: BTreeMap<&'static str, ClassMarginReport>,
}

/// The straight transit that an alternative path replaces.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct StraightReport {
    /// Least clearance from the surroundings, negative where it is blocked.
    pub clearance_m: f64,
    /// The same of the alternative path.
    pub instead_m: f64,
    /// How long the motion would take.
    pub duration_s: f64,
}

/// What a motion keeps in one class.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ClassMarginReport {
    /// The required clearance.
    pub limit_m: f64,
    /// Clearance of the start, the approach and the place where it ends.
    pub attainable_m: f64,
    /// Clearance of the whole motion.
    pub achieved_m: f64,
    /// What comes nearest: `start`, `approach` or `transfer`.
    pub limited_by: &'static str,
}

/// One configuration of a goal.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ConfigurationReport {
    /// Table 2's words.
    pub label: &'static str,
    /// What became of it.
    pub status: Status,
    /// How many criteria on it were to be evaluated and could not be.
    pub not_judged: usize,
    /// Rules that reject it, first failing one first.
    pub rejections: Vec<RejectionReport>,
    /// Final joint positions.
    pub joints_rad: Option<[f64; 6]>,
    /// Angle of the guide about the needle.
    pub roll_rad: Option<f64>,
    /// 2π equivalent: full revolutions added to the positions in (-pi, pi].
    pub wrap: Option<[i32; 6]>,
    /// Position residual of the inverse kinematics.
    pub ik_residual_m: Option<f64>,
    /// Orientation residual of the inverse kinematics.
    pub ik_residual_rad: Option<f64>,
    /// Joint that may take any value at this pose.
    pub free_joint: Option<&'static str>,
    /// Margins of the final posture.
    pub margins: Option<MarginsReport>,
    /// Planned motion.
    pub motion: Vec<PhaseReport>,
    /// The retreat: straight back along the needle axis, then to the start posture. Empty unless the configuration is
    /// feasible. Planned and certified, not simulated.
    pub retreat: Vec<PhaseReport>,
    /// Certified clearances of the retreat, by itself, planned; empty where there is none.
    pub retreat_clearance: ClearanceReport,
    /// Search for an alternative path, where the straight transit is blocked or comes nearer than the postures that it
    /// joins; none where it was not needed.
    pub search: Option<SearchReport>,
    /// What the planned motion keeps of the clearance that its posture allows; none without a motion.
    pub margin: Option<MarginReport>,
    /// From the planned entry point on the skin to the target; none without a phantom.
    pub entry_to_target_m: Option<f64>,
    /// Needle metrics of the commanded posture, by our forward kinematics.
    pub commanded: Option<NeedleMeasurement>,
    /// Measurements per engine: `rapier`, `mujoco`.
    pub engines: BTreeMap<String, EngineReport>,
    /// Difference of the engines; none unless both ran.
    pub engine_difference: Option<EngineDifference>,
    /// The engines' difference and the scenario's envelope; none unless both ran.
    pub adjudication: Option<Adjudication>,
    /// Each engine compared with the reference integrator; none unless asked for, or the envelope was exceeded.
    pub referee: Option<RefereeReport>,
    /// Clearances over the motions of all engines; over the planned motion where nothing was
    /// simulated, and of the final posture where there is no motion.
    pub clearance: ClearanceReport,
    /// Contacts, stop and retreat, where the scenario prescribes them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub events: Option<EventsReport>,
    /// Signed clearances by class of the final posture of the nominal arm, with the needle path; empty without a
    /// posture.
    pub posture_clearance_m: BTreeMap<&'static str, f64>,
    /// Distances of the same posture by class from where the patient's body may go on behind the cuts of its scan; empty
    /// where nothing is cut.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub posture_behind_cuts_m: BTreeMap<&'static str, f64>,
    /// Constraint margin: distance of the posture from violating a planning rule, negative where it violates one; sines
    /// and radians count 0.1 m.
    pub surplus_m: Option<f64>,
    /// The needle in static equilibrium, without any engine; where it is commanded to without imperfections.
    pub predicted: Option<NeedleMeasurement>,
    /// Room that it leaves to the people around it.
    pub room: Option<RoomReport>,
    /// How far the needle's tip moves, root mean square, when every joint has an independent error.
    pub tip_sensitivity_m_per_rad: Option<f64>,
    /// Whether it is feasible and no other feasible one is as good in everything and better in something.
    pub pareto: bool,
    /// The one that is, if any.
    pub dominated_by: Option<Dominance>,
    /// Its score; none unless it is feasible.
    pub ranking: Option<RankingReport>,
    /// Error budget of the needle over the arm and patient population; none without imperfections.
    pub budget: Option<ErrorBudget>,
    /// Why there is no budget, where there should be one.
    pub budget_failure: Option<String>,
    /// How likely the needle meets what, and reaches the lesion; none without a patient or imperfections.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub probability: Option<ProbabilityReport>,
    /// Why it is not known, where it should be.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub probability_failure: Option<String>,
    /// Everything that was measured, in SI units, with the unit at the end of the name: `tip_rms_m`.
    pub measured: BTreeMap<String, f64>,
    /// The same by the keys of the [metrics](crate::metric), as the command line and `[ranking]` use them. The same
    /// key is the same number in a study.
    pub metrics: BTreeMap<String, f64>,
    /// Files written for it, relative to the results folder.
    pub files: Vec<String>,
}

impl ConfigurationReport {
    /// A configuration of which nothing is known.
    pub fn new(label: &'static str) -> Self {
        Self {
            label,
            status: Status::Rejected,
            not_judged: 0,
            rejections: Vec::new(),
            joints_rad: None,
            roll_rad: None,
            wrap: None,
            ik_residual_m: None,
            ik_residual_rad: None,
            free_joint: None,
            margins: None,
            motion: Vec::new(),
            retreat: Vec::new(),
            retreat_clearance: ClearanceReport::default(),
            search: None,
            margin: None,
            entry_to_target_m: None,
            commanded: None,
            engines: BTreeMap::new(),
            engine_difference: None,
            adjudication: None,
            referee: None,
            clearance: ClearanceReport::default(),
            events: None,
            posture_clearance_m: BTreeMap::new(),
            posture_behind_cuts_m: BTreeMap::new(),
            surplus_m: None,
            predicted: None,
            room: None,
            tip_sensitivity_m_per_rad: None,
            pareto: false,
            dominated_by: None,
            ranking: None,
            budget: None,
            budget_failure: None,
            probability: None,
            probability_failure: None,
            measured: BTreeMap::new(),
            metrics: BTreeMap::new(),
            files: Vec::new(),
        }
    }

    /// Sets the clearances of its posture: the least one of each class, and what may be nearer behind the cuts of the
    /// patient's scan.
    pub fn set_posture_clearances(&mut self, minima: &ClassMinima) {
        for pair in minima.iter() {
            let class = pair.class.name();
            let distance_m = pair.separation.distance_m;
            self.posture_clearance_m.insert(class, distance_m);
            if let Some(behind_cuts_m) = minima.behind_cuts_m(pair.class) {
                self.posture_behind_cuts_m.insert(class, behind_cuts_m);
            }
        }
    }

    /// The same, if what is not known of its clearances were the worst that can be; none where all are known. A value that
    /// differs in it is not known either.
    #[must_use]
    pub fn at_worst(&self) -> Option<Self> {
        let unknown = self.unknown_clearances();
        if unknown.is_empty() {
            return None;
        }
        let mut worst = self.clone();
        for class in unknown {
            if let Some(found) = worst.clearance.classes.get_mut(class) {
                found.minimum_m = f64::NEG_INFINITY;
                found.certified_lower_bound_m = Some(f64::NEG_INFINITY);
            }
            if let Some(clearance_m) = worst.posture_clearance_m.get_mut(class) {
                *clearance_m = f64::NEG_INFINITY;
            }
        }
        Some(worst)
    }

    /// Classes of which the clearance is not known, since the patient may be nearer behind the cuts of its scan: along the
    /// motion and the retreat, planned and prescribed, or in the posture where there is no motion.
    pub fn unknown_clearances(&self) -> BTreeSet<&'static str> {
        if !self.clearance.classes.is_empty() {
            let events = self.events.iter().flat_map(EventsReport::clearances);
            let motions = [&self.clearance, &self.retreat_clearance].into_iter();
            let motions = motions.chain(events);
            return motions.flat_map(ClearanceReport::unknown).collect();
        }
        let classes = self.posture_clearance_m.iter();
        let unknown = classes.filter(|(class, clearance_m)| {
            let behind_cuts_m = self.posture_behind_cuts_m.get(*class);
            !is_known(**clearance_m, behind_cuts_m.copied())
        });
        unknown.map(|(class, _)| *class).collect()
    }
}

/// What one engine measured.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EngineReport {
    /// Needle metrics of the settled state, from the engine's own body poses.
    #[serde(flatten)]
    pub needle: NeedleMeasurement,
    /// Distance of the settled tip from static equilibrium, without any engine; none for the nominal robot. Trembling
    /// by the encoders' noise is no part of it.
    pub unexplained_tip_m: Option<f64>,
    /// Time and effort.
    #[serde(flatten)]
    pub motion: MotionMeasurement,
    /// Least clearances over the recorded motion.
    pub clearance: ClearanceReport,
}

/// Where a report's numbers come from.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Provenance {
    /// Version of needlebench.
    pub version: String,
    /// Git revision of the program, with `-dirty` where it was changed; `unknown` outside git.
    pub git_revision: String,
    /// SHA-256 of all sources that results depend on, with the versions of all libraries and the compiler.
    pub source_sha256: String,
    /// How numbers are rounded; engines that round otherwise say so themselves.
    pub arithmetic: String,
    /// SHA-256 of the lock file of the build.
    pub cargo_lock_sha256: String,
    /// Engines with their settings.
    pub engines: Vec<EngineIdentity>,
    /// Files that went in, with their SHA-256.
    pub inputs: Vec<InputFile>,
    /// The scenario's seed.
    pub seed: u64,
    /// Which model is the ground truth.
    pub truth: &'static str,
}

/// A file that went into a result.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct InputFile {
    /// `scenario`, `robot`, `robot mesh`, `tool`, `calibration`, `phantom`, `phantom part`.
    pub role: &'static str,
    /// As named.
    pub file: String,
    /// SHA-256 of its bytes.
    pub sha256: String,
}
