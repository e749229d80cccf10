//! Limits that a scenario sets for its events.

use needlebench_evaluation::events::EventsReport;
use needlebench_evaluation::report::{CriterionResult, Judged};
use needlebench_evaluation::{UNCOMPARED, unmeasured_by};
use needlebench_scenario::scenario::EventsSection;

/// What a missing value means.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Missing {
    /// It never occurred: the limit is exceeded.
    Never,
    /// It was to be measured: the limit is not evaluated.
    Unjudged,
}

/// Everything that the section sets a limit for; `engines` are those that were to measure it.
pub(super) fn checks(
    goal: &str,
    label: &str,
    events: &EventsSection,
    report: &EventsReport,
    engines: &[&str],
) -> Judged {
    let mut judged = Judged::default();
    let mut check = |key: String,
                     engine: Option<&str>,
                     value: Option<f64>,
                     limit: Option<f64>,
                     unit: &'static str,
                     detail: &str,
                     missing: Missing| {
        let Some(limit) = limit else { return };
        let result = CriterionResult {
            goal: goal.to_owned(),
            label: Some(label.to_owned()),
            engine: engine.map(str::to_owned),
            criterion: key,
            value,
            limit: Some(limit),
            unit,
            pass: value.is_some_and(|value| value <= limit),
            detail: detail.to_owned(),
            requirement: None,
        };
        if value.is_none() && missing == Missing::Never {
            judged.results.push(result);
        } else {
            judged.add(result, || {
                engine.map_or(UNCOMPARED.to_owned(), unmeasured_by)
            });
        }
    };
    for (index, (press, asked)) in report.press.iter().zip(&events.press).enumerate() {
        let key = |name: &str| format!("events.press[{index}].{name}");
        // A contact that the arm cannot make is missed, whatever an engine would measure.
        let (detail, missing) = match &press.not_staged {
            Some(reason) => (format!("{}: {reason}", press.class), Missing::Never),
            None => (press.solids.join(" and "), Missing::Unjudged),
        };
        // One engine alone, on request, cannot differ from another.
        if engines.len() != 1 {
            let limit = asked.max_force_difference;
            let key_of = key("max_force_difference");
            let value = press.force_difference;
            check(key_of, None, value, limit, "1", &detail, missing);
            let limit = asked.max_tip_difference_mm.map(|mm| mm * 1e-3);
            let key_of = key("max_tip_difference_mm");
            let value = press.tip_difference_settled_m;
            check(key_of, None, value, limit, "m", &detail, missing);
        }
        for &engine in engines {
            let measured = press.engines.get(engine);
            let engine = Some(engine);
            let (limit, key_of) = (asked.max_balance_difference, key("max_balance_difference"));
            let value = measured.and_then(|each| each.balance_difference);
            check(key_of, engine, value, limit, "1", &detail, missing);
            let (limit, key_of) = (asked.max_recovery_s, key("max_recovery_s"));
            let value = measured.and_then(|each| each.recovery_s);
            let missing = measured.map_or(missing, |_| Missing::Never);
            check(key_of, engine, value, limit, "s", &detail, missing);
        }
    }
    if let (Some(stop), Some(asked)) = (&report.stop, &events.stop) {
        for &engine in engines {
            let measured = stop.engines.get(engine);
            let missing = measured.map_or(Missing::Unjudged, |_| Missing::Never);
            let engine = Some(engine);
            let limit = asked.max_tip_distance_mm.map(|mm| mm * 1e-3);
            let key = "events.stop.max_tip_distance_mm".to_owned();
            let value = measured.map(|each| each.tip_distance_m);
            check(key, engine, value, limit, "m", "", missing);
            let limit = asked.max_stopping_time_s;
            let key = "events.stop.max_stopping_time_s".to_owned();
            let value = measured.and_then(|each| each.stopping_time_s);
            check(key, engine, value, limit, "s", "", missing);
        }
    }
    if events.retreat {
        for &engine in engines {
            let limit = events.max_retraction_deviation_mm.map(|mm| mm * 1e-3);
            let key = "events.max_retraction_deviation_mm".to_owned();
            let measured = report.retract.get(engine);
            let value = measured.map(|each| each.largest_lateral_deviation_m);
            check(key, Some(engine), value, limit, "m", "", Missing::Unjudged);
        }
    }
    judged
}
