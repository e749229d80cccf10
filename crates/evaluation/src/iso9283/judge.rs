//! Criteria of a test by ISO 9283.

use needlebench_cell::part_in_words;
use needlebench_iso9283::PoseStatistics;
use needlebench_scenario::iso9283::Iso9283Criteria;
use needlebench_scenario::scenario::CriteriaSection;

use super::{EngineMeasurement, Iso9283Report};
use crate::report::{CriterionResult, Judged, NotJudged};
use crate::verdict::{UNCOMPARED, unmeasured_by};

/// What criteria of a test are said to be about, in place of a goal.
pub const SUBJECT: &str = "iso9283";

/// Checks a simulated test against the criteria of its section, and against those of the scenario
/// that make sense without a goal: torque, contact and the difference of the engines.
///
/// The verdict is `fail` if any fails, else `incomplete` if one of `engines`, those that were to measure, did not.
pub fn judge(
    report: &Iso9283Report,
    own: &Iso9283Criteria,
    general: &CriteriaSection,
    engines: &[&str],
) -> Judged {
    let mut judged = Judged::default();
    let mut check = |engine: Option<&str>,
                     criterion: &str,
                     limit: Option<f64>,
                     unit: &'static str,
                     value: Option<f64>,
                     detail: String,
                     missing: Option<&str>| {
        let Some(limit) = limit else { return };
        let result = CriterionResult {
            goal: SUBJECT.to_owned(),
            label: Some(report.protocol.configuration.to_owned()),
            engine: engine.map(str::to_owned),
            criterion: criterion.to_owned(),
            value,
            limit: Some(limit),
            unit,
            pass: value.is_some_and(|value| value <= limit),
            detail,
            requirement: None,
        };
        match missing {
            Some(reason) => judged.add(result, || reason.to_owned()),
            // It was looked for and never came.
            None => judged.results.push(result),
        }
    };
    let metres = |mm: Option<f64>| mm.map(|mm| mm * 1e-3);
    for &name in engines {
        let found = report.engines.get(name);
        let engine = Some(name);
        let unmeasured = unmeasured_by(name);
        let missing = Some(unmeasured.as_str());
        let statistics = found.map(|measured| &measured.statistics);
        let at_worst = |value: fn(&PoseStatistics) -> f64| {
            found.map_or(String::new(), |measured| worst(measured, value))
        };
        check(
            engine,
            "max_accuracy_mm",
            metres(own.max_accuracy_mm),
            "m",
            statistics.map(|each| each.ap_m),
            at_worst(|each| each.ap_m),
            missing,
        );
        check(
            engine,
            "max_repeatability_mm",
            metres(own.max_repeatability_mm),
            "m",
            statistics.map(|each| each.rp_m),
            at_worst(|each| each.rp_m),
            missing,
        );
        check(
            engine,
            "max_directional_variation_mm",
            metres(own.max_directional_variation_mm),
            "m",
            statistics.and_then(|each| each.vap_m),
            String::new(),
            missing,
        );
        // The standard measures both at P1.
        let at_p1 = found.and_then(|measured| {
            let mut all = measured.stabilisation.iter();
            all.find(|each| each.pose == 1)
        });
        let never_or_missing = if at_p1.is_some() { None } else { missing };
        check(
            engine,
            "max_stabilisation_time_s",
            own.max_stabilisation_time_s,
            "s",
            at_p1.and_then(|each| each.time_s),
            "at P1".to_owned(),
            never_or_missing,
        );
        check(
            engine,
            "max_overshoot_mm",
            metres(own.max_overshoot_mm),
            "m",
            at_p1.and_then(|each| each.overshoot_m),
            "at P1".to_owned(),
            never_or_missing,
        );
        let effort = found.map(|measured| &measured.effort);
        check(
            engine,
            "max_peak_torque_ratio",
            general.max_peak_torque_ratio,
            "1",
            effort.map(|effort| effort.peak_torque_ratio),
            String::new(),
            missing,
        );
        let contact = effort.map(|effort| &effort.contact);
        let force_n = contact.map(|contact| {
            if contact.occurred {
                contact.peak_force_n.max(f64::MIN_POSITIVE)
            } else {
                0.0
            }
        });
        let pair = contact.and_then(|contact| contact.first_pair.as_ref());
        check(
            engine,
            "allow_contact",
            (!general.allow_contact).then_some(0.0),
            "N",
            force_n,
            pair.map_or(String::new(), |[a, b]| {
                format!(
                    "contact between {} and {}",
                    part_in_words(a),
                    part_in_words(b)
                )
            }),
            missing,
        );
    }
    if engines.len() > 1 {
        let difference = report.engine_difference;
        for (criterion, limit_mm, value) in [
            (
                "max_engine_difference_peak_mm",
                general.max_engine_difference_peak_mm,
                difference.map(|each| each.peak_tip_m),
            ),
            (
                "max_engine_difference_settled_mm",
                general.max_engine_difference_settled_mm,
                difference.map(|each| each.settled_tip_m),
            ),
        ] {
            let (limit, missing) = (metres(limit_mm), Some(UNCOMPARED));
            check(None, criterion, limit, "m", value, String::new(), missing);
        }
    }
    // Even without a limit on what it measures an engine was to show that the test can be made.
    for &name in engines {
        if !report.engines.contains_key(name)
            && !judged
                .not_judged
                .iter()
                .any(|each| each.engine.as_deref() == Some(name))
        {
            judged.not_judged.push(NotJudged {
                goal: SUBJECT.to_owned(),
                label: Some(report.protocol.configuration.to_owned()),
                engine: Some(name.to_owned()),
                criterion: "measured".to_owned(),
                reason: unmeasured_by(name),
                requirement: None,
            });
        }
    }
    judged
}

/// The pose at which a value is largest, in words.
fn worst(measured: &EngineMeasurement, value: fn(&PoseStatistics) -> f64) -> String {
    let poses = measured.statistics.poses.iter();
    poses
        .max_by(|a, b| value(a).total_cmp(&value(b)))
        .map_or(String::new(), |each| format!("at P{}", each.pose))
}
