//! How many criteria were evaluated, how many of them met, and what was not evaluated.

use needlebench_evaluation::EXPECTED;
use needlebench_evaluation::report::{
    ConfigurationReport, CriterionResult, NotJudged, Report, Status, Verdict,
};

/// A run's verdict with its counts: `117 of 117 criteria met`, or `63 of 117 criteria evaluated, all met;
/// not evaluated: 54 (not measured by mujoco: 48; ...)`.
pub(crate) fn counts(report: &Report) -> String {
    let judged = report.criteria.len();
    let missed = report.criteria.iter().filter(|each| !each.pass).count();
    let expected = report
        .criteria
        .iter()
        .filter(|each| missed_as_expected(report, each))
        .count();
    let expected = match expected {
        0 => String::new(),
        count => format!(", {count} failed as expected by the scenario"),
    };
    let unjudged = report.not_judged.len();
    if unjudged == 0 {
        return format!("{} of {judged} criteria met{expected}", judged - missed);
    }
    let met = match missed {
        0 => "all met".to_owned(),
        _ => format!("{} of them met{expected}", judged - missed),
    };
    let reasons = reasons(&report.not_judged);
    format!(
        "{judged} of {} criteria evaluated, {met}; not evaluated: {unjudged} ({reasons})",
        judged + unjudged
    )
}

/// Whether a note qualifies the verdict: what was assumed, omitted or replaced. Every report prints it beside the
/// verdict.
pub(crate) fn qualifies(note: &str) -> bool {
    note.starts_with("assumed, since")
        || note.starts_with(needlebench_bench::LEFT_OUT)
        || note.starts_with(needlebench_robot::WITHOUT_SHAPE)
        || note.starts_with(needlebench_robot::ASSUMED_SHAPES)
        || note.starts_with(needlebench_scenario::ASSUMED_BODY)
        || note.contains(needlebench_robot::STANDS_FOR_IT)
}

/// The notes of a report that qualify its verdict.
pub(crate) fn qualifying(report: &Report) -> impl Iterator<Item = &str> {
    let notes = report.notes.iter().map(String::as_str);
    notes.filter(|note| qualifies(note))
}

/// Whether a configuration fails a criterion as the scenario expects.
pub(crate) fn missed_as_expected(report: &Report, result: &CriterionResult) -> bool {
    !result.pass
        && result.label.is_some()
        && report.criteria.iter().any(|other| {
            other.criterion == EXPECTED
                && other.pass
                && other.goal == result.goal
                && other.label == result.label
        })
}

/// Why criteria were not evaluated, each reason once with the number of criteria.
fn reasons(all: &[NotJudged]) -> String {
    let mut counted: Vec<(&str, usize)> = Vec::new();
    for each in all {
        match counted
            .iter_mut()
            .find(|(reason, _)| *reason == each.reason)
        {
            Some((_, count)) => *count += 1,
            None => counted.push((&each.reason, 1)),
        }
    }
    let texts = counted
        .into_iter()
        .map(|(reason, count)| format!("{reason}: {count}"));
    texts.collect::<Vec<_>>().join("; ")
}

/// A verdict in capitals, as a terminal's last line begins.
pub(crate) fn capitals(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Pass => "PASS",
        Verdict::Fail => "FAIL",
        Verdict::Incomplete => "INCOMPLETE",
    }
}

/// Outcome of a configuration: its status, `incomplete` where criteria on it are not evaluated and none is known
/// to fail.
pub(crate) fn status(report: &Report, goal: &str, each: &ConfigurationReport) -> &'static str {
    let mut of_it = report
        .criteria
        .iter()
        .filter(|result| result.goal == goal && result.label.as_deref() == Some(each.label));
    let missed = of_it.any(|result| !result.pass && result.criterion != EXPECTED);
    match each.status {
        Status::Ok | Status::Failed if each.not_judged > 0 && !missed => "incomplete",
        status => status.name(),
    }
}
