//! The motion of one configuration to a needle path, with bias, covariance and RMS tip error at its end.

use nalgebra::{Matrix3, Vector3};
use needlebench_bench::Desk;
use needlebench_cell::reason_in_words;
use needlebench_kinematics::ik::Configuration;
use needlebench_scenario::Goal;
use needlebench_uncertainty::budget::Moments;
use serde::Serialize;

use crate::case::Case;
use crate::live::{Aim, Refusal, needle, registered};
use crate::plan_file::planned;

/// Bias and covariance of the needle's tip.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TipError {
    /// Mean, along the axes of `ct`.
    pub bias_m: [f64; 3],
    /// Covariance, along the axes of `ct`, rows.
    pub covariance_m2: [[f64; 3]; 3],
    /// Root mean square distance.
    pub rms_m: f64,
    /// Root mean square lateral distance.
    pub lateral_rms_m: f64,
}

/// A planned motion.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MotionAnswer {
    /// Label of the configuration.
    pub configuration: &'static str,
    /// Rules that it violates, the first failing one first; empty if it is feasible.
    pub rejections: Vec<MotionRejection>,
    /// Times of the postures, s.
    pub time_s: Vec<f64>,
    /// Postures, rad.
    pub joints_rad: Vec<[f64; 6]>,
    /// Where it ends, rad.
    pub end_joints_rad: Option<[f64; 6]>,
    /// The expected error at the target; none where the arm's data are insufficient, or there is no motion.
    pub tip: Option<TipError>,
    /// Why it is unknown.
    pub tip_unknown: Option<String>,
}

/// A rule that a motion violates.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MotionRejection {
    /// The rule.
    pub rule: &'static str,
    /// In words.
    pub words: String,
    /// Details.
    pub detail: String,
    /// The value that it evaluates.
    pub value: f64,
    /// The limit that is violated.
    pub limit: f64,
    /// The unit of both.
    pub unit: &'static str,
}

/// The planned motion of one configuration, and the error that is expected at its end.
///
/// # Errors
/// As [`needle`]; an unknown configuration; a robot whose position is unknown.
pub fn motion(case: &Case, aim: &Aim, configuration: &str) -> Result<MotionAnswer, Refusal> {
    /// Between two postures, s: as in report pages.
    const PERIOD_S: f64 = 0.04;
    registered(case)?;
    let known = Configuration::ALL.into_iter();
    let known = known.clone().find(|each| each.label() == configuration);
    let configuration = known.ok_or_else(|| {
        Refusal::new(
            "unknown configuration",
            "choose one of the eight in the table",
        )
    })?;
    let goal = needle(case, aim)?.goal?;
    let (desk, without) = match planned_desk(case, aim) {
        Ok(desk) => (desk, None),
        Err(refusal) => (case.desk(), Some(refusal.message)),
    };
    let plan = desk.plan(&goal, configuration).map_err(|error| Refusal {
        message: error.to_string(),
        hint: None,
    })?;
    let mut answer = MotionAnswer {
        configuration: configuration.label(),
        rejections: Vec::new(),
        time_s: Vec::new(),
        joints_rad: Vec::new(),
        end_joints_rad: None,
        tip: None,
        tip_unknown: None,
    };
    for rejection in &plan.rejections {
        answer.rejections.push(MotionRejection {
            rule: rejection.rule.name(),
            words: reason_in_words(rejection.rule.name()),
            detail: rejection.detail.clone(),
            value: rejection.value,
            limit: rejection.limit,
            unit: rejection.unit,
        });
    }
    let Some(trajectory) = &plan.trajectory else {
        return Ok(answer);
    };
    answer.end_joints_rad = Some(trajectory.end().into());
    let duration_s = trajectory.duration_s();
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "some hundred postures"
    )]
    let count = (duration_s / PERIOD_S).ceil().max(1.0) as usize;
    for step in 0..=count {
        let time_s = (step as f64 * PERIOD_S).min(duration_s);
        answer.time_s.push(time_s);
        answer
            .joints_rad
            .push(trajectory.sample(time_s).position.into());
    }
    match desk.expected_error(&goal, trajectory) {
        None => {
            let unknown = "this arm has no accuracy data";
            answer.tip_unknown = Some(without.unwrap_or_else(|| unknown.to_owned()));
        }
        Some(Err(finding)) => answer.tip_unknown = Some(finding.message),
        Some(Ok([_, at_target])) => answer.tip = Some(tip(case, &goal, &at_target)),
    }
    Ok(answer)
}

/// From the axes of the guide's exit to those of `ct`.
fn tip(case: &Case, goal: &Goal, moments: &Moments) -> TipError {
    let placed = case.desk().scenario().phantom.as_ref();
    let place = placed.expect("a needle has a patient").world_from_phantom;
    let turn = place.rotation.inverse() * goal.world_from_guide_exit.rotation;
    let turn = turn.to_rotation_matrix();
    let covariance: Matrix3<f64> = turn * moments.covariance() * turn.transpose();
    let bias: Vector3<f64> = turn * moments.bias();
    TipError {
        bias_m: bias.into(),
        covariance_m2: std::array::from_fn(|row| {
            std::array::from_fn(|column| covariance[(row, column)])
        }),
        rms_m: moments.rms_m,
        lateral_rms_m: moments.lateral_rms_m,
    }
}

/// The room as a run has it: what is expected of arm and patient is known of a scenario with a goal alone, and does not
/// depend on where that is.
fn planned_desk<'c>(case: &'c Case, aim: &Aim) -> Result<&'c Desk, Refusal> {
    case.run_desk(|| {
        let plan = planned(
            case,
            aim,
            None,
            None,
            &case.folder().join(crate::plan_file::PLAN_FILE),
        )?;
        Desk::new(plan.resolved).map_err(|error| Refusal {
            message: error.to_string(),
            hint: None,
        })
    })
}
