//! A recorded run of a real arm: what it says of the arm, and the same set-points in the engines.
//!
//! ```text
//! log -read, check-> run -name the arm-> arm -calibrate, identify-> figures with intervals
//!   -replay the set-points through the shared servo-> recordings -compare-> real | rapier | mujoco
//! ```

mod arm;
mod compare;
mod data;
mod judge;
mod pieces;

use std::collections::BTreeMap;

use nalgebra::Vector3;
use needlebench_engine::{Engine, EngineIdentity, EnginePool};
use needlebench_evaluation::report::{CriterionResult, EngineFailure, NotJudged, Verdict};
use needlebench_input::Finding;
use needlebench_kinematics::{Joints, UrGeometry};
use needlebench_parallel::Control;
use needlebench_recorded::{
    ArmFit, CalibrationFit, Estimate, Identification, KnownArm, LogKind, LogSource, RecordedRun,
    Tracking, arm_fits, calibrate, identify, tracking,
};
use needlebench_scenario::ResolvedScenario;
use needlebench_scenario::scenario::ReplaySection;
use serde::Serialize;

use crate::provenance::provenance;
use arm::ReplayedArm;
pub use compare::{Course, EngineReplay};
pub use data::{ArmFiles, arm_files};
pub use judge::SUBJECT;

/// Version of the report's layout.
pub(crate) const REPLAY_SCHEMA_VERSION: u32 = 1;

/// The tip at which errors of joints are shown, beyond the flange along its z, m: where the needle of a
/// guide is.
pub const TIP_M: f64 = 0.2;

/// A log whose poses are farther from an arm's, rms, is not of this arm: factory calibrations leave up to
/// 1.7 mm at the flange, and the arms most like each other are 18 mm apart.
const SAME_ARM_M: f64 = 5e-3;

/// What a recorded run says, and how the engines compare.
#[derive(Debug, Serialize)]
pub struct ReplayReport {
    /// Version of this layout.
    pub schema_version: u32,
    /// The log.
    pub log: LogSummary,
    /// The arm.
    pub arm: ArmSummary,
    /// The arm's links from the log's poses; none without poses.
    pub calibration: Option<CalibrationFit>,
    /// Loads, rotors, friction, torque constants.
    pub identification: Identification,
    /// How the real arm follows its set-points; none without set-points.
    pub real: Option<Tracking>,
    /// How each engine does.
    pub engines: BTreeMap<&'static str, EngineReplay>,
    /// How the replayed arm was set up, in words.
    pub replayed: Vec<String>,
    /// Engines that failed.
    pub engine_failures: Vec<EngineFailure>,
    /// Criteria that were evaluated.
    pub criteria: Vec<CriterionResult>,
    /// Criteria that could not be evaluated, and why.
    pub not_judged: Vec<NotJudged>,
    /// What follows.
    pub verdict: Verdict,
    /// What was found or assumed.
    pub notes: Vec<String>,
    /// Where the numbers come from.
    pub provenance: needlebench_evaluation::report::Provenance,
}

/// A log in a report.
#[derive(Debug, Clone, Serialize)]
pub struct LogSummary {
    /// The file.
    #[serde(flatten)]
    pub source: LogSource,
    /// Whether an arm stands behind it.
    pub kind: LogKind,
    /// Time covered, s.
    pub duration_s: f64,
    /// Median time between two rows, s.
    pub period_s: f64,
    /// Parts without a gap.
    pub stretches: usize,
    /// Lowest and highest temperature of any joint, degrees C.
    pub temperature_c: Option<[f64; 2]>,
}

/// Which arm a log is of.
#[derive(Debug, Clone, Serialize)]
pub struct ArmSummary {
    /// The manufacturer's name.
    pub name: String,
    /// The arm's data.
    pub data: Option<String>,
    /// How the arm was found, in words.
    pub found: String,
    /// How well each known arm explains the log's poses, best first.
    pub fits: Vec<ArmFit>,
}

/// A replay: its report, and the courses for charts and tables.
#[derive(Debug)]
pub struct Replay {
    /// The report.
    pub report: ReplayReport,
    /// The recorded run.
    pub run: RecordedRun,
    /// What each engine did at the times of the log's rows.
    pub courses: Vec<(&'static str, Course)>,
    /// Torque per current of each joint, N m/A; none where nothing is known.
    pub torque_constants_nm_a: [Option<f64>; 6],
    /// It was interrupted.
    pub interrupted: bool,
}

/// Why a log cannot be replayed with the arm that is given.
#[derive(Debug, thiserror::Error)]
pub enum ReplayError {
    /// It is another arm's.
    #[error(transparent)]
    Arm(#[from] Box<Finding>),
}

/// The name of the arm that a log is of, if its poses say so: the best fit, if it is within what factory
/// calibrations leave.
pub fn named_by(run: &RecordedRun) -> Option<&'static str> {
    let best = arm_fits(run).into_iter().next()?;
    (best.rms_m <= SAME_ARM_M).then_some(best.arm)
}

/// Holds a recorded run against an arm and replays it.
///
/// `resolved` is the cell; its load is replaced by the log's. `criteria` are those of the scenario and the
/// command line.
///
/// # Errors
/// A log that is of another arm.
pub fn replay(
    mut run: RecordedRun,
    resolved: &ResolvedScenario,
    how_found: &str,
    criteria: &ReplaySection,
    engines: &[&'static dyn Engine],
    control: &Control<'_>,
) -> Result<Replay, ReplayError> {
    let (robot, description) = (&resolved.cell.robot, &resolved.robot_description);
    let fits = arm_fits(&run);
    check_arm(&run, &fits, &description.arm_name).map_err(Box::new)?;
    let data = description.arm.as_ref().map(|used| &used.arm.data);
    let nominal =
        UrGeometry::of_chain(&robot.chain).map_or(robot.chain, |geometry| geometry.chain());
    control.progress.message("calibrating");
    let calibration = calibrate(&run, &nominal);
    control.progress.message("identifying");
    let known = KnownArm {
        robot,
        rotor_inertia_kgm2: data
            .and_then(|data| data.rotors.as_ref())
            .map(|rotors| rotors.inertia_kgm2),
        torque_constant_nm_a: data
            .and_then(|data| data.motors.as_ref())
            .map(|motors| motors.torque_constant_nm_a),
        gravity_m_s2: resolved.cell.gravity_m_s2.norm(),
    };
    let identification = identify(&run, &known);
    let tip = Vector3::new(0.0, 0.0, TIP_M);
    let real = run
        .target
        .as_ref()
        .filter(|_| run.kind == LogKind::Arm)
        .map(|target| {
            let (q, speed): (Vec<Joints>, Vec<Joints>) = target
                .iter()
                .map(|state| (state.position, state.velocity))
                .unzip();
            tracking(&robot.chain, &tip, &q, &speed, &run.actual_q)
        });
    let mut notes = run.notes.clone();
    notes.extend(identification.notes.iter().cloned());
    notes.extend(remarks(&identification, calibration.as_ref()));
    notes.extend(resolved.notes.iter().cloned());
    // What nobody needs any more: of a long run it is a third of the memory.
    (run.actual_qd, run.target_current_a, run.tcp, run.effort_nm) = (None, None, None, None);
    let (mut replays, mut courses, mut failures) = (BTreeMap::new(), Vec::new(), Vec::new());
    let mut identities: Vec<EngineIdentity> = Vec::new();
    let mut replayed = Vec::new();
    let mut torque_constants_nm_a = [None; 6];
    if run.target.is_some() {
        let arm = ReplayedArm::new(&run, resolved, &identification);
        replayed.clone_from(&arm.words);
        torque_constants_nm_a = arm.torque_constants;
        let pool = EnginePool::new(engines);
        for engine in engines {
            control
                .progress
                .message(&format!("replaying in {}", engine.title()));
            let settings = &resolved.scenario.engines.settings();
            let mut tell = |text: &str| control.progress.notice(text);
            // Why it could not start is told again to whoever asks it for a motion.
            let _ = pool.start(*engine, settings, &mut tell);
            match pieces::course(&run, &arm, settings, &pool, *engine, control) {
                Ok((identity, course)) => {
                    let compared = compare::compared(&run, &arm, &course, &tip);
                    identities.push(identity);
                    replays.insert(engine.name(), compared);
                    courses.push((engine.name(), course));
                }
                Err(error) if !control.is_cancelled() => failures.push(EngineFailure {
                    engine: engine.name().to_owned(),
                    during: Some("replay".to_owned()),
                    message: error.to_string(),
                }),
                Err(_) => {}
            }
        }
    }
    let mut report = ReplayReport {
        schema_version: REPLAY_SCHEMA_VERSION,
        log: LogSummary {
            source: run.source.clone(),
            kind: run.kind,
            duration_s: run.duration_s(),
            period_s: run.period_s(),
            stretches: run.stretches.len(),
            temperature_c: run.temperature_c,
        },
        arm: ArmSummary {
            name: description.arm_name.clone(),
            data: description.arm.as_ref().map(|used| used.arm.path()),
            found: how_found.to_owned(),
            fits,
        },
        calibration,
        identification,
        real,
        engines: replays,
        replayed,
        engine_failures: failures,
        criteria: Vec::new(),
        not_judged: Vec::new(),
        verdict: Verdict::Pass,
        notes,
        provenance: provenance(resolved, identities),
    };
    let names: Vec<&'static str> = engines.iter().map(|engine| engine.name()).collect();
    judge::judge(
        &mut report,
        criteria,
        &resolved.scenario.requirements,
        &names,
    );
    Ok(Replay {
        report,
        run,
        courses,
        torque_constants_nm_a,
        interrupted: control.is_cancelled(),
    })
}

/// Refuses a log that is of another arm.
fn check_arm(run: &RecordedRun, fits: &[ArmFit], name: &str) -> Result<(), Finding> {
    let file = &run.source.file;
    let Some(best) = fits.first() else {
        return Ok(());
    };
    if let Some(own) = fits.iter().find(|fit| fit.arm == name)
        && own.rms_m <= SAME_ARM_M
    {
        return Ok(());
    }
    let off = fits.iter().find(|fit| fit.arm == name).map_or_else(
        || format!("the {name}'s lengths match no known arm"),
        |own| {
            format!(
                "RMS error of the {name}'s lengths at the log's poses: {:.1} mm",
                own.rms_m * 1e3
            )
        },
    );
    if best.rms_m > SAME_ARM_M {
        return Err(Finding::new(
            file,
            format!(
                "the log's poses match no known arm ({off}; best match {}, {:.1} mm)",
                best.arm,
                best.rms_m * 1e3
            ),
        )
        .hint("check the units of angles and positions, and that the TCP did not change"));
    }
    if fits.iter().any(|fit| fit.arm == name) {
        return Err(Finding::new(
            file,
            format!(
                "the log is of a {}, but the arm is a {name} ({off}; {}: {:.2} mm)",
                best.arm,
                best.arm,
                best.rms_m * 1e3
            ),
        )
        .key("--arm")
        .hint(format!("--arm {}", best.arm.to_lowercase())));
    }
    Ok(())
}

/// What a reader should not miss.
fn remarks(identification: &Identification, calibration: Option<&CalibrationFit>) -> Vec<String> {
    let mut notes = Vec::new();
    if let Some(fit) = calibration.filter(|fit| !fit.is_worth) {
        notes.push(format!(
            "the calibration is not used: RMS error at held-out poses {:.3} mm, with nominal \
             lengths {:.3} mm; the run has too few distinct poses (24 well-distributed ones \
             suffice: `needlebench record-plan`)",
            fit.held_out.rms_m * 1e3,
            fit.nominal_held_out.rms_m * 1e3
        ));
    }
    let controller = identification.controller.iter();
    let controller = controller.map(|fit| ("target_moment", &fit.rotor_inertia_kgm2, &fit.loads));
    let measured = identification.measured.iter();
    let measured = measured.map(|fit| (fit.source.as_str(), &fit.rotor_inertia_kgm2, &fit.loads));
    for (source, rotors, loads) in controller.chain(measured) {
        let masses = loads.iter().map(|load| &load.mass_kg);
        let is_negative = |each: &Estimate| {
            each.value
                .zip(each.half_width)
                .is_some_and(|(value, half)| value < -half)
        };
        if rotors.iter().chain(masses).any(is_negative) {
            notes.push(format!(
                "negative rotor inertia or load identified from {source}: the torques do not match \
                 this arm and motion, so no parameter identified from them is reliable"
            ));
        }
    }
    let (Some(controller), Some(measured)) = (&identification.controller, &identification.measured)
    else {
        return notes;
    };
    for (belief, found) in controller.loads.iter().zip(&measured.loads) {
        let [belief, found] = [belief.mass_kg, found.mass_kg];
        let parts = (
            belief.value,
            belief.half_width,
            found.value,
            found.half_width,
        );
        if let (Some(a), Some(da), Some(b), Some(db)) = parts
            && (a - b).abs() > da + db + 0.02 * a
        {
            notes.push(format!(
                "load from measured torques {b:.3} +- {db:.3} kg, load assumed by the controller \
                 {a:.3} +- {da:.3} kg: the difference exceeds their intervals. Either the load was \
                 set incorrectly, or friction depends on more than speed, which biases the first \
                 only"
            ));
        }
    }
    notes
}
