//! A motion that leads to no goal: its clearances and the joints' limits alone.

use needlebench_cell::ClearanceClass;
use needlebench_clearance::ClearanceModel;
use needlebench_evaluation::judged::PeakReport;
use needlebench_evaluation::planned_clearance;
use needlebench_evaluation::report::{ClearanceReport, CriterionResult, NotJudged, Verdict};
use needlebench_kinematics::trajectory::{Between, Phase};
use needlebench_planning::{ClassLimits, Planner};
use needlebench_recorded::{MotionFile, MotionSource};
use needlebench_scenario::ResolvedScenario;
use serde::Serialize;

use super::course::Course;
use super::peaks::{peaks, results};
use super::{JudgeError, begin};
use crate::scenario_run::RunError;
use crate::setup::SetupError;

/// Version of the document.
const SCHEMA_VERSION: u32 = 1;

/// A judged motion that leads to no goal.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FreeReport {
    /// Version of this document.
    pub schema_version: u32,
    /// Name of the scenario.
    pub scenario: String,
    /// The motion's file.
    pub source: MotionSource,
    /// What joins its points, in words.
    pub between: &'static str,
    /// How long it takes, s.
    pub duration_s: f64,
    /// Whether all criteria were met.
    pub verdict: Verdict,
    /// Least clearances along the motion, with certified lower bounds.
    pub clearance: ClearanceReport,
    /// Largest values of the joints, each beside its limit.
    pub peaks: Vec<PeakReport>,
    /// Each criterion.
    pub criteria: Vec<CriterionResult>,
    /// Criteria that could not be evaluated.
    pub not_judged: Vec<NotJudged>,
    /// Notes.
    pub notes: Vec<String>,
}

/// Judges the clearances of a motion, certified along the course between its points, and the joints' limits. Where it
/// begins and leads to plays no part; nothing is simulated.
///
/// # Errors
/// [`JudgeError`].
pub fn judge_free(
    resolved: &ResolvedScenario,
    file: &MotionFile,
    between: Option<Between>,
) -> Result<FreeReport, JudgeError> {
    let course = Course::of(resolved, file, between)?;
    let mut notes = file.notes.clone();
    notes.extend(begin(resolved, &course, true)?);
    notes.push(
        "the access zone behind the guide counts where the guide is held at a goal, and is left out"
            .to_owned(),
    );
    let model = ClearanceModel::new(&resolved.cell);
    let planner = Planner::new(resolved, &model)
        .map_err(|error| RunError::Setup(SetupError::Robot(error)))?;
    let motion = course.part(Phase::Travel, 0..course.last());
    let tolerance_m = resolved.scenario.planning.certificate_tolerance_mm * 1e-3;
    let minima = planned_clearance(&resolved.cell, &model, &motion, tolerance_m);
    let clearance = ClearanceReport::of(&minima);
    let peaks = peaks(resolved, &motion, &course.times_s, 0.0);
    let (mut criteria, not_judged) = clearance_results(&clearance, planner.limits());
    criteria.extend(results(&peaks, "", None));
    let failed = criteria.iter().any(|each| !each.pass);
    Ok(FreeReport {
        schema_version: SCHEMA_VERSION,
        scenario: resolved.scenario.name.clone(),
        source: file.source.clone(),
        between: course.between_in_words(),
        duration_s: motion.duration_s(),
        verdict: Verdict::of(failed, !not_judged.is_empty()),
        clearance,
        peaks,
        criteria,
        not_judged,
        notes,
    })
}

/// The certified clearance of each class of bodies beside its limit.
fn clearance_results(
    clearance: &ClearanceReport,
    limits: &ClassLimits,
) -> (Vec<CriterionResult>, Vec<NotJudged>) {
    let (mut criteria, mut open) = (Vec::new(), Vec::new());
    let unknown: Vec<&str> = clearance.unknown().collect();
    for (name, found) in &clearance.classes {
        let class = ClearanceClass::named(name).expect("reports name classes");
        let limit_m = limits.get(class).judged_m;
        if !class.is_physical() || !limit_m.is_finite() {
            continue;
        }
        let criterion = format!("min_clearance_mm.{name}");
        let bound_m = found.certified_lower_bound_m;
        // What is attained decides where it is too little, whatever is not known besides.
        let is_kept =
            found.minimum_m >= limit_m && bound_m.is_none_or(|bound_m| bound_m >= limit_m);
        let why = if unknown.contains(name) {
            Some("the patient may be nearer behind the cuts of its scan")
        } else if bound_m.is_none() {
            Some("no certified bound")
        } else {
            None
        };
        if let Some(why) = why.filter(|_| is_kept) {
            open.push(NotJudged {
                goal: String::new(),
                label: None,
                engine: None,
                criterion,
                reason: why.to_owned(),
                requirement: None,
            });
            continue;
        }
        criteria.push(CriterionResult {
            goal: String::new(),
            label: None,
            engine: None,
            criterion,
            value: Some(bound_m.unwrap_or(found.minimum_m) * 1e3),
            limit: Some(limit_m * 1e3),
            unit: "mm",
            pass: is_kept,
            detail: format!(
                "{}, {:.3} mm attained, certified",
                needlebench_cell::pair_in_words(&found.pair),
                found.minimum_m * 1e3
            ),
            requirement: None,
        });
    }
    (criteria, open)
}
