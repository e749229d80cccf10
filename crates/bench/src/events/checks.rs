//! Limits that a scenario sets for its events.

use needlebench_cell::scenario::EventsSection;
use needlebench_evaluation::events::EventsReport;
use needlebench_evaluation::report::CriterionResult;

/// Everything that the section sets a limit for.
pub(super) fn checks(
    goal: &str,
    label: &str,
    events: &EventsSection,
    report: &EventsReport,
) -> Vec<CriterionResult> {
    let mut results = Vec::new();
    let mut check = |key: String,
                     engine: Option<&str>,
                     value: Option<f64>,
                     limit: Option<f64>,
                     unit: &'static str,
                     detail: &str| {
        let Some(limit) = limit else { return };
        results.push(CriterionResult {
            goal: goal.to_owned(),
            label: Some(label.to_owned()),
            engine: engine.map(str::to_owned),
            criterion: key,
            value,
            limit: Some(limit),
            unit,
            // What could not be measured is not met.
            pass: value.is_some_and(|value| value <= limit),
            detail: detail.to_owned(),
        });
    };
    for (index, (press, asked)) in report.press.iter().zip(&events.press).enumerate() {
        let key = |name: &str| format!("events.press[{index}].{name}");
        let detail = match &press.not_staged {
            Some(reason) => format!("{}: {reason}", press.class),
            None => press.solids.join(" and "),
        };
        // One engine alone, on request, cannot differ from another.
        if press.engines.len() != 1 {
            let limit = asked.max_force_difference;
            let key_of = key("max_force_difference");
            check(key_of, None, press.force_difference, limit, "1", &detail);
            let limit = asked.max_tip_difference_mm.map(|mm| mm * 1e-3);
            let key_of = key("max_tip_difference_mm");
            let value = press.tip_difference_settled_m;
            check(key_of, None, value, limit, "m", &detail);
        }
        for (engine, measured) in &press.engines {
            let engine = Some(engine.as_str());
            let (limit, key_of) = (asked.max_balance_difference, key("max_balance_difference"));
            let value = measured.balance_difference;
            check(key_of, engine, value, limit, "1", &detail);
            let (limit, key_of) = (asked.max_recovery_s, key("max_recovery_s"));
            check(key_of, engine, measured.recovery_s, limit, "s", &detail);
        }
    }
    if let (Some(stop), Some(asked)) = (&report.stop, &events.stop) {
        for (engine, measured) in &stop.engines {
            let engine = Some(engine.as_str());
            let limit = asked.max_tip_distance_mm.map(|mm| mm * 1e-3);
            let (key, value) = ("events.stop.max_tip_distance_mm", measured.tip_distance_m);
            check(key.to_owned(), engine, Some(value), limit, "m", "");
            let (limit, value) = (asked.max_stopping_time_s, measured.stopping_time_s);
            let key = "events.stop.max_stopping_time_s";
            check(key.to_owned(), engine, value, limit, "s", "");
        }
    }
    for (engine, measured) in &report.retract {
        let limit = events.max_retraction_deviation_mm.map(|mm| mm * 1e-3);
        let key = "events.max_retraction_deviation_mm".to_owned();
        let value = Some(measured.largest_lateral_deviation_m);
        check(key, Some(engine), value, limit, "m", "");
    }
    results
}
