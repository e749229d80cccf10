//! Criteria of a test by ISO 9283.

use needlebench_cell::iso9283::Iso9283Criteria;
use needlebench_cell::scenario::CriteriaSection;

use super::{EngineMeasurement, Iso9283Report};
use crate::report::{CriterionResult, Verdict};

/// What criteria of a test are said to be about, in place of a goal.
pub const SUBJECT: &str = "iso9283";

/// Checks a simulated test against the criteria of its section, and against those of the scenario
/// that make sense without a goal: torque, contact and the difference of the engines.
///
/// The verdict is `fail` if any is missed, or if no engine measured anything.
pub fn judge(
    report: &Iso9283Report,
    own: &Iso9283Criteria,
    general: &CriteriaSection,
) -> (Verdict, Vec<CriterionResult>) {
    let mut results = Vec::new();
    let mut check = |engine: Option<&str>,
                     criterion: &str,
                     limit: Option<f64>,
                     unit: &'static str,
                     value: Option<f64>,
                     detail: String| {
        let Some(limit) = limit else { return };
        results.push(CriterionResult {
            goal: SUBJECT.to_owned(),
            label: Some(report.protocol.configuration.to_owned()),
            engine: engine.map(str::to_owned),
            criterion: criterion.to_owned(),
            value,
            limit: Some(limit),
            unit,
            pass: value.is_some_and(|value| value <= limit),
            detail,
        });
    };
    let metres = |mm: Option<f64>| mm.map(|mm| mm * 1e-3);
    for (name, measured) in &report.engines {
        let engine = Some(name.as_str());
        let statistics = &measured.statistics;
        check(
            engine,
            "max_accuracy_mm",
            metres(own.max_accuracy_mm),
            "m",
            Some(statistics.ap_m),
            worst(measured, |each| each.ap_m),
        );
        check(
            engine,
            "max_repeatability_mm",
            metres(own.max_repeatability_mm),
            "m",
            Some(statistics.rp_m),
            worst(measured, |each| each.rp_m),
        );
        check(
            engine,
            "max_directional_variation_mm",
            metres(own.max_directional_variation_mm),
            "m",
            statistics.vap_m,
            String::new(),
        );
        // The standard measures both at P1.
        let at_p1 = measured.stabilisation.iter().find(|each| each.pose == 1);
        check(
            engine,
            "max_stabilisation_time_s",
            own.max_stabilisation_time_s,
            "s",
            at_p1.and_then(|each| each.time_s),
            "at P1".to_owned(),
        );
        check(
            engine,
            "max_overshoot_mm",
            metres(own.max_overshoot_mm),
            "m",
            at_p1.and_then(|each| each.overshoot_m),
            "at P1".to_owned(),
        );
        check(
            engine,
            "max_peak_torque_ratio",
            general.max_peak_torque_ratio,
            "1",
            Some(measured.effort.peak_torque_ratio),
            String::new(),
        );
        let contact = &measured.effort.contact;
        let force_n = if contact.occurred {
            contact.peak_force_n.max(f64::MIN_POSITIVE)
        } else {
            0.0
        };
        check(
            engine,
            "allow_contact",
            (!general.allow_contact).then_some(0.0),
            "N",
            Some(force_n),
            contact
                .first_pair
                .as_ref()
                .map_or(String::new(), |[a, b]| format!("{a} touches {b}")),
        );
    }
    if let Some(difference) = report.engine_difference {
        for (criterion, limit_mm, value) in [
            (
                "max_engine_difference_peak_mm",
                general.max_engine_difference_peak_mm,
                difference.peak_tip_m,
            ),
            (
                "max_engine_difference_settled_mm",
                general.max_engine_difference_settled_mm,
                difference.settled_tip_m,
            ),
        ] {
            let limit = metres(limit_mm);
            check(None, criterion, limit, "m", Some(value), String::new());
        }
    }
    let met = results.iter().all(|result| result.pass) && !report.engines.is_empty();
    (if met { Verdict::Pass } else { Verdict::Fail }, results)
}

/// The pose at which a value is largest, in words.
fn worst(measured: &EngineMeasurement, value: fn(&super::PoseStatistics) -> f64) -> String {
    let poses = measured.statistics.poses.iter();
    poses
        .max_by(|a, b| value(a).total_cmp(&value(b)))
        .map_or(String::new(), |each| format!("at P{}", each.pose))
}
