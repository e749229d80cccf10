//! Verdict and recommendation.

use needlebench_cell::scenario::CriteriaSection;
use needlebench_cell::{Expectation, Goal};
use needlebench_kinematics::ik::Configuration;

use crate::check_configuration;
use crate::report::{
    ConfigurationReport, CriterionResult, GoalReport, Recommendation, Status, Verdict,
};

/// Judges all configurations of all goals: sets each status and recommendation, and returns the
/// verdict with every criterion that was checked.
///
/// A configuration that works is `failed` if it misses a criterion. The verdict is `fail` if any
/// configuration is, unless that was expected; if a goal has fewer working configurations than
/// asked for; or if a configuration's outcome is not the expected one.
pub fn judge(
    goals: &mut [GoalReport],
    planned: &[Goal],
    criteria: &CriteriaSection,
    both_engines_ran: bool,
) -> (Verdict, Vec<CriterionResult>) {
    let mut results = Vec::new();
    let mut failed = false;
    for (report, goal) in goals.iter_mut().zip(planned) {
        for configuration in &mut report.configurations {
            let expected = Configuration::from_label(configuration.label)
                .and_then(|each| goal.expected.get(&each));
            if configuration.rejections.is_empty() {
                let checked =
                    check_configuration(&goal.name, configuration, criteria, both_engines_ran);
                let met = checked.iter().all(|result| result.pass);
                let measured = !configuration.engines.is_empty();
                configuration.status = if met && measured {
                    Status::Ok
                } else {
                    Status::Failed
                };
                if configuration.status == Status::Failed && expected != Some(&Expectation::Failed)
                {
                    failed = true;
                }
                results.extend(checked);
            } else {
                configuration.status = Status::Rejected;
            }
            if let Some(expected) = expected {
                let result = check_expectation(&goal.name, configuration, expected);
                failed |= !result.pass;
                results.push(result);
            }
        }
        let working = report
            .configurations
            .iter()
            .filter(|each| each.status == Status::Ok)
            .count();
        let wanted = f64::from(criteria.min_working_configurations);
        let enough = working as f64 >= wanted;
        failed |= !enough;
        results.push(CriterionResult {
            goal: goal.name.clone(),
            label: None,
            engine: None,
            criterion: "min_working_configurations".to_owned(),
            value: Some(working as f64),
            limit: Some(wanted),
            unit: "1",
            pass: enough,
            detail: String::new(),
        });
        report.recommended = recommend(&report.configurations);
    }
    (if failed { Verdict::Fail } else { Verdict::Pass }, results)
}

fn check_expectation(
    goal: &str,
    configuration: &ConfigurationReport,
    expected: &Expectation,
) -> CriterionResult {
    let first_rule = configuration
        .rejections
        .first()
        .map(|rejection| rejection.rule);
    let actual = first_rule.unwrap_or(configuration.status.name());
    let wanted = match expected {
        Expectation::Ok => "ok",
        Expectation::Failed => "failed",
        Expectation::Rejected(rule) => rule,
    };
    CriterionResult {
        goal: goal.to_owned(),
        label: Some(configuration.label.to_owned()),
        engine: None,
        criterion: "expected".to_owned(),
        value: None,
        limit: None,
        unit: "1",
        pass: actual == wanted,
        detail: format!("expected {wanted}, got {actual}"),
    }
}

/// Clearance beyond which more of it is no better: nobody works nearer to the arm than this.
const AMPLE_CLEARANCE_M: f64 = 0.1;
/// Clearances in the same step of this size count as equal.
const CLEARANCE_STEP_M: f64 = 2e-3;

/// Least clearance over the motion, in steps.
fn clearance_steps(configuration: &ConfigurationReport) -> f64 {
    let clearance_m = configuration
        .clearance
        .minimum_m
        .unwrap_or(0.0)
        .min(AMPLE_CLEARANCE_M);
    (clearance_m / CLEARANCE_STEP_M).floor()
}

/// Least of joint-limit margin, `|sin q5|` and `|sin q3|`: all are 0 at worst and 1 at best.
fn posture_margin(configuration: &ConfigurationReport) -> f64 {
    configuration.margins.map_or(0.0, |margins| {
        margins
            .joint_limit
            .min(margins.wrist_sine)
            .min(margins.elbow_sine)
    })
}

/// The working configuration to choose.
///
/// First by least clearance over the motion (in steps of 2 mm, up to 100 mm), then by the margin of
/// the final posture to joint limits and singularities.
pub fn recommend(configurations: &[ConfigurationReport]) -> Option<Recommendation> {
    let mut working: Vec<&ConfigurationReport> = configurations
        .iter()
        .filter(|each| each.status == Status::Ok)
        .collect();
    working.sort_by(|a, b| {
        clearance_steps(b)
            .total_cmp(&clearance_steps(a))
            .then(posture_margin(b).total_cmp(&posture_margin(a)))
    });
    let best = *working.first()?;
    let equals = working
        .iter()
        .filter(|each| clearance_steps(each) == clearance_steps(best))
        .count();
    let pair = best.clearance.least().map_or(String::new(), |found| {
        format!(
            " ({} to {} in the {})",
            found.pair[0], found.pair[1], found.phase
        )
    });
    let clearance_mm = 1e3 * best.clearance.minimum_m.unwrap_or(0.0);
    let margin = posture_margin(best);
    let reason = match (working.len(), equals) {
        (1, _) => format!("the only one that works; least clearance {clearance_mm:.1} mm{pair}"),
        (count, 1) => format!(
            "most clearance of {count} that work: at least {clearance_mm:.1} mm{pair}; \
             posture margin {margin:.2}"
        ),
        (count, equals) => format!(
            "posture farthest from joint limits and singularities (margin {margin:.2}) of the \
             {equals} with most clearance among {count} that work: at least \
             {clearance_mm:.1} mm{pair}"
        ),
    };
    Some(Recommendation {
        label: best.label.to_owned(),
        reason,
    })
}
