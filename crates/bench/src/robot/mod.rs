//! A program on the virtual controller, with an arm in an engine that follows it, cycle by cycle and without a wall
//! clock; its set-points are judged as any other motion.

mod host;
mod live;
mod log;
mod program;

use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use needlebench_cell::{ClearanceClass, pair_in_words};
use needlebench_clearance::{CertificateOptions, ClearanceModel, certify};
use needlebench_controller::{ArmData, StopData};
use needlebench_engine::{ArmSpec, Engine, EngineError, EnginePool, Keep, LiveArm};
use needlebench_evaluation::judged::{PROGRAM_END, ProgramEnd, ProgramEvent, ProgramReport};
use needlebench_evaluation::report::{CriterionResult, Report, Status, Verdict};
use needlebench_input::{Finding, sha256_hex};
use needlebench_kinematics::Joints;
use needlebench_kinematics::ik::Kinematics;
use needlebench_parallel::Progress;
use needlebench_planning::ClassLimits;
use needlebench_recorded::{Known, MotionFile, MotionSource};
use needlebench_scenario::ResolvedScenario;
use needlebench_urscript::Program;

use self::live::{Bounds, Ran, run_program};
use self::program::{controller_of, differences, program_text, wrong_program};
use crate::judge::{AT_GOAL_M, AT_GOAL_RAD, JudgeError, JudgeOptions, JudgedRun, judge};
use crate::run::leave_open;
use crate::scenario_run::RunOptions;
use crate::setup::Setup;

pub use self::program::{InstalledTcp, is_program};

/// Longest time that a program is run for, s, unless it is asked otherwise.
pub const TIME_LIMIT_S: f64 = 300.0;

/// Largest acceleration of a joint in set-points, rad/s^2, and deceleration of the controller's stops with the time in
/// which it is reached, s. Assumed: a UR arm's controller does not publish its own.
const ACCELERATION_RAD_S2: f64 = 16.0;
const STOP: StopData = StopData {
    deceleration_rad_s2: 15.0,
    ramp_s: 0.04,
};

/// Time in which moves reach their acceleration, s: as measured of a UR3e.
const RAMP_S: f64 = 0.14;

/// How much later than by its look-ahead time `servoj` follows, s: of the e-Series 34 ms were measured at a look-ahead
/// time of 30 ms; of a controller with a longer period one period is assumed.
const SERVO_DELAY_S: f64 = 0.004;

/// A cycle is a whole number of an engine's steps within this share of a step.
const STEP_ROUNDING: f64 = 1e-6;

/// How long a program is run.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub enum Until {
    /// Until it ends.
    #[default]
    Program,
    /// Until the arm has stood at a goal for the scenario's hold, or it ends.
    Hold,
    /// For a time, s, or until it ends.
    Seconds(f64),
}

/// How a program is run and judged.
#[derive(Debug, Clone, PartialEq)]
pub struct RobotOptions {
    /// How long.
    pub until: Until,
    /// Simulated time, s, after which a program that has not ended is not evaluated further.
    pub time_limit_s: f64,
    /// TCP of the controller's installation.
    pub installed: InstalledTcp,
    /// As of [`JudgeOptions`].
    pub goal: Option<String>,
    /// As of [`JudgeOptions`].
    pub beside: bool,
}

/// Why no verdict is given on a program.
#[derive(Debug, thiserror::Error)]
pub enum RobotError {
    /// The program or the scenario is not fit for it.
    #[error(transparent)]
    Judge(#[from] JudgeError),
    /// The engine in which the program moves an arm cannot be had.
    #[error("the program needs an arm in {engine}: {source}")]
    Engine {
        /// Its name.
        engine: &'static str,
        /// What it reports.
        source: EngineError,
    },
}

impl From<Finding> for RobotError {
    fn from(finding: Finding) -> Self {
        Self::Judge(finding.into())
    }
}

/// Runs a program on the virtual controller, from the scenario's start posture on, with the arm in the first of the
/// engines; then judges its set-points in all engines, as [`judge`] does with a motion.
///
/// What the program reads of the arm is the joints' positions and speeds in that engine; forces are zero. Tool and
/// payload of the arm are the scenario's, whatever the program sets: differences are notes of the report.
///
/// # Errors
/// [`RobotError`]. A program that fails is no error: the report says so.
pub fn judge_program(
    resolved: &ResolvedScenario,
    path: &Path,
    asked: &RobotOptions,
    options: &RunOptions,
    cancel: &AtomicBool,
    progress: &dyn Progress,
) -> Result<JudgedRun, RobotError> {
    progress.message("running the program");
    let model = ClearanceModel::new(&resolved.cell);
    let engine = first_engine(resolved, options)?;
    let (motion, ran) = run_file((resolved, &model), path, asked, engine, cancel)?;
    let judging = JudgeOptions {
        goal: asked.goal.clone(),
        beside: asked.beside,
        nearest: true,
        ..JudgeOptions::default()
    };
    let mut judged = judge(resolved, &motion, &judging, options, cancel, progress)?;
    add_program(&mut judged, &model, engine, ran);
    Ok(judged)
}

/// The motion of a program, as [`judge_program`] runs it, to be judged by itself.
///
/// # Errors
/// [`RobotError`], and how a program ended that did not come to its end.
pub fn program_motion(
    resolved: &ResolvedScenario,
    path: &Path,
    asked: &RobotOptions,
    options: &RunOptions,
    cancel: &AtomicBool,
) -> Result<MotionFile, RobotError> {
    let model = ClearanceModel::new(&resolved.cell);
    let engine = first_engine(resolved, options)?;
    let (motion, ran) = run_file((resolved, &model), path, asked, engine, cancel)?;
    if ran.0.end.is_regular() == Some(true) {
        return Ok(motion);
    }
    let finding = Finding::new(path.display().to_string(), ran.0.detail);
    Err(finding
        .hint("`needlebench robot` judges what a program did before")
        .into())
}

/// The engine in which a program moves an arm.
///
/// # Errors
/// Engines that are not there, or none.
fn first_engine(
    resolved: &ResolvedScenario,
    options: &RunOptions,
) -> Result<&'static dyn Engine, RobotError> {
    let engines = options
        .chosen_engines(resolved)
        .map_err(|error| JudgeError::Run(error.into()))?;
    engines.first().copied().ok_or_else(|| {
        let finding = Finding::new(&resolved.source.file, "no engine is chosen");
        finding.key("engines.run").into()
    })
}

/// Runs the program of a file: its set-points as a motion, what it left, and how long it took.
fn run_file(
    (resolved, model): (&ResolvedScenario, &ClearanceModel),
    path: &Path,
    asked: &RobotOptions,
    engine: &'static dyn Engine,
    cancel: &AtomicBool,
) -> Result<(MotionFile, (Ran, Duration)), RobotError> {
    let file = path.display().to_string();
    let text = program_text(path)?;
    let program = Program::load(&text).map_err(|error| wrong_program(&file, &text, error))?;
    let setup = Setup::new(resolved, model).map_err(|error| JudgeError::Run(error.into()))?;
    let started = Instant::now();
    let ran = run_in(&setup, program, engine, asked, cancel, Keep::Near(&[]))?.0;
    let took = started.elapsed();
    let period_s = ran.set_points.period_s();
    let mut notes = assumptions(engine);
    notes.extend(differences(
        resolved,
        &ran.belief,
        asked.installed.flange_from_tcp(resolved),
    ));
    let states = ran.set_points.states().to_vec();
    let motion = MotionFile {
        source: MotionSource {
            file,
            sha256: sha256_hex(text.as_bytes()),
            format: "URScript program",
            points: states.len(),
        },
        times_s: Some((0..states.len()).map(|k| k as f64 * period_s).collect()),
        states,
        known: Known::Accelerations,
        lines: ran.lines.clone(),
        notes,
    };
    Ok((motion, (ran, took)))
}

/// Runs a program in an engine; with the arm's recording, as far as it is kept.
fn run_in<'k>(
    setup: &'k Setup<'_>,
    program: Program,
    engine: &'static dyn Engine,
    asked: &RobotOptions,
    cancel: &AtomicBool,
    keep: Keep<'k>,
) -> Result<(Ran, needlebench_engine::Recording), RobotError> {
    let resolved = setup.resolved;
    let (period_s, kinematics) = controller_of(resolved)?;
    let settings = resolved.scenario.engines.settings();
    let steps = steps(resolved, period_s, settings.timestep_s)?;
    let arm = arm(resolved, period_s, &kinematics);
    let is_at_goal = |joints: &Joints| {
        resolved.goals.iter().any(|goal| {
            let held = setup.planner.held(goal, joints);
            held.off_m <= AT_GOAL_M && held.off_rad <= AT_GOAL_RAD
        })
    };
    let (longest_s, end) = match asked.until {
        Until::Seconds(time_s) if time_s <= asked.time_limit_s => (time_s, ProgramEnd::AsAsked),
        _ => (asked.time_limit_s, ProgramEnd::TimeLimit),
    };
    let bounds = Bounds {
        longest_s,
        end,
        hold_s: (asked.until == Until::Hold).then_some(resolved.scenario.motion.hold_s),
        is_at_goal: &is_at_goal,
        cancel,
    };
    let start = (&resolved.start, asked.installed.flange_from_tcp(resolved));
    let pool = EnginePool::new(&[engine]);
    let done = pool.lend(engine, &settings, |session| {
        let cell = setup.real.cell();
        let mut plant = session.make_plant(&ArmSpec::new(cell, &settings))?;
        let (servo, actuation) = (&setup.servo, setup.real.actuation());
        let mut live = LiveArm::new(plant.as_mut(), servo, actuation, keep, start.0)?;
        let ran = run_program(program, &arm, start, (&mut live, steps), cell, &bounds);
        Ok(ran.map(|ran| {
            let recording = live.finish(&live::Followed(&ran.set_points));
            (ran, recording)
        }))
    });
    let done = done.map_err(|source| RobotError::Engine {
        engine: engine.name(),
        source,
    })?;
    done.map_err(|error| {
        let finding = Finding::new(&resolved.source.file, error.to_string());
        finding.key("start.joints_deg").into()
    })
}

/// Steps of an engine in a cycle of the controller.
///
/// # Errors
/// Steps that do not fit into it.
fn steps(resolved: &ResolvedScenario, period_s: f64, timestep_s: f64) -> Result<usize, Finding> {
    let steps = period_s / timestep_s;
    let whole = steps.round();
    if whole >= 1.0 && (steps - whole).abs() <= STEP_ROUNDING {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "whole, at least 1, and a period over a step"
        )]
        return Ok(whole as usize);
    }
    let message = format!(
        "a cycle of the controller of {} ms is no whole number of steps of {} ms",
        period_s * 1e3,
        timestep_s * 1e3
    );
    let finding = Finding::new(&resolved.source.file, message).key("engines.timestep_ms");
    Err(finding.hint("choose a step that the cycle is a multiple of, such as 1 ms"))
}

fn arm(resolved: &ResolvedScenario, period_s: f64, kinematics: &Kinematics) -> ArmData {
    ArmData {
        kinematics: *kinematics,
        limits: resolved.cell.robot.limits,
        acceleration_rad_s2: Joints::repeat(ACCELERATION_RAD_S2),
        period_s,
        ramp_s: RAMP_S,
        servo_delay_s: SERVO_DELAY_S.max(period_s),
        stop: STOP,
    }
}

/// What of the controller and the arm is assumed, and what the program reads.
fn assumptions(engine: &dyn Engine) -> Vec<String> {
    vec![
        format!(
            "assumed of the controller: moves reach their acceleration in {RAMP_S} s, joints accelerate by at most \
             {ACCELERATION_RAD_S2} rad/s^2 and stop at {} rad/s^2, blends add two moves, servoj is a filter of second \
             order",
            STOP.deceleration_rad_s2
        ),
        format!(
            "the program read joint positions and speeds of the arm in {}; forces and torques that it read were zero",
            engine.title()
        ),
    ]
}

/// Adds to a report what came of the program itself, and the places in it of what is missed.
fn add_program(
    judged: &mut JudgedRun,
    model: &ClearanceModel,
    engine: &'static dyn Engine,
    (ran, took): (Ran, Duration),
) {
    let Ran {
        set_points,
        lines,
        end,
        detail,
        ended_s,
        mut log,
        ..
    } = ran;
    let period_s = set_points.period_s();
    for missed in missed(judged, model, &lines, period_s) {
        judge_missed(&mut judged.run.report, &missed);
        log.events.push(missed.event());
    }
    log.events.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
    let report = &mut judged.run.report;
    judge_end(report, end, &detail);
    let wall_s = took.as_secs_f64();
    report.timings.insert("program_s".to_owned(), wall_s);
    let factor = set_points.end_s() / wall_s;
    report
        .timings
        .insert("program_real_time_factor".to_owned(), factor);
    if let Some(motion) = &mut report.judged {
        motion.program = Some(ProgramReport {
            engine: engine.name(),
            period_s,
            end,
            ended_s,
            detail,
            events: log.events,
            more_events: log.more,
        });
    }
}

/// The end of the program as a criterion of the last goal.
fn judge_end(report: &mut Report, end: ProgramEnd, detail: &str) {
    let Some(goal) = report.goals.len().checked_sub(1) else {
        return;
    };
    match end.is_regular() {
        None => leave_open(report, &[PROGRAM_END], detail),
        Some(pass) => {
            let result = CriterionResult {
                criterion: PROGRAM_END.to_owned(),
                pass,
                detail: detail.to_owned(),
                ..nothing(report, goal)
            };
            add(report, goal, result);
        }
    }
}

/// A clearance on the way that is missed: a criterion, unless one says so already.
fn judge_missed(report: &mut Report, missed: &Missed) {
    let criterion = format!("min_clearance_mm.{}", missed.class.name());
    let name = &report.goals[missed.goal].name;
    let is_said = report
        .criteria
        .iter()
        .any(|each| each.goal == *name && each.criterion == criterion && !each.pass);
    if is_said || !missed.class.is_physical() {
        return;
    }
    let result = CriterionResult {
        criterion,
        value: Some(missed.distance_m * 1e3),
        limit: Some(missed.limit_m * 1e3),
        unit: "mm",
        pass: false,
        detail: format!(
            "{} at t = {:.3} s, line {} of the program, as commanded",
            missed.pair, missed.time_s, missed.line
        ),
        ..nothing(report, missed.goal)
    };
    add(report, missed.goal, result);
}

/// A criterion on the configuration of a goal, of which nothing is said yet.
fn nothing(report: &Report, goal: usize) -> CriterionResult {
    let goal = &report.goals[goal];
    CriterionResult {
        goal: goal.name.clone(),
        label: Some(goal.configurations[0].label.to_owned()),
        engine: None,
        criterion: String::new(),
        value: None,
        limit: None,
        unit: "",
        pass: false,
        detail: String::new(),
        requirement: None,
    }
}

fn add(report: &mut Report, goal: usize, result: CriterionResult) {
    if result.pass {
        report.criteria.push(result);
    } else {
        let configuration = &mut report.goals[goal].configurations[0];
        if configuration.status == Status::Ok {
            configuration.status = Status::Failed;
        }
        report.verdict = Verdict::Fail;
        // What the program itself tells of comes first.
        report.criteria.insert(0, result);
    }
}

/// A clearance that the commanded course misses.
struct Missed {
    goal: usize,
    class: ClearanceClass,
    /// Of the motion, s.
    time_s: f64,
    line: usize,
    pair: String,
    distance_m: f64,
    limit_m: f64,
}

impl Missed {
    fn event(&self) -> ProgramEvent {
        ProgramEvent {
            time_s: self.time_s,
            line: Some(self.line),
            kind: "clearance",
            text: format!(
                "{}: {:.1} mm, {:.1} mm required",
                self.pair,
                self.distance_m * 1e3,
                self.limit_m * 1e3
            ),
        }
    }
}

/// Clearances that are missed on the way, each with the line of the move that misses it.
fn missed(
    judged: &JudgedRun,
    model: &ClearanceModel,
    lines: &[usize],
    period_s: f64,
) -> Vec<Missed> {
    let limits = ClassLimits::of(&judged.resolved.scenario);
    let cell = &judged.resolved.cell;
    let mut all = Vec::new();
    let holds = judged.run.report.judged.iter().flat_map(|each| &each.holds);
    for (goal, (hold, plan)) in holds.zip(&judged.run.plans).enumerate() {
        let plan = &plan.configurations[0];
        let to_hold = plan.certificate.clone().map(|each| (each, hold.begins_s));
        let behind = plan.retreat.as_ref().map(|retreat| {
            let planning = &judged.resolved.scenario.planning;
            let options = CertificateOptions {
                tolerance_m: planning.certificate_tolerance_mm * 1e-3,
                ..CertificateOptions::default()
            };
            (certify(model, retreat, &options), hold.hold_s[1])
        });
        for (certificate, begins_s) in to_hold.into_iter().chain(behind) {
            for class in ClearanceClass::ALL {
                let limit_m = limits.get(class).judged_m;
                let found = certificate.get(class);
                let found =
                    found.filter(|found| limit_m.is_finite() && found.lower_bound_m < limit_m);
                let Some(found) = found else { continue };
                let (a, b) = found.attained.solid_names(cell);
                let time_s = begins_s + found.time_s;
                all.push(Missed {
                    goal,
                    class,
                    time_s,
                    line: line_at(lines, period_s, time_s),
                    pair: pair_in_words(&[a.to_owned(), b.to_owned()]),
                    distance_m: found.attained.separation.distance_m,
                    limit_m,
                });
            }
        }
    }
    all
}

/// Line of the move at a time.
fn line_at(lines: &[usize], period_s: f64, time_s: f64) -> usize {
    // A set-point is of the end of its cycle.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a time of the motion over its period; a cast cuts off what is negative"
    )]
    let index = (time_s / period_s - STEP_ROUNDING).ceil() as usize;
    lines.get(index).or(lines.last()).copied().unwrap_or(1)
}

#[cfg(test)]
mod tests;
