//! How many criteria were judged, how many of them met, and what was not judged.

use needlebench_evaluation::EXPECTED;
use needlebench_evaluation::report::{
    ConfigurationReport, CriterionResult, NotJudged, Report, Status, Verdict,
};

/// A run's verdict with its counts: `117 of 117 criteria met`, or `63 of 117 criteria judged, all met;
/// not judged: 54 (mujoco did not measure it: 48; ...)`.
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
        count => format!(", {count} missed as the scenario expects"),
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
        "{judged} of {} criteria judged, {met}; not judged: {unjudged} ({reasons})",
        judged + unjudged
    )
}

/// Whether a criterion is missed by a configuration of which the scenario expects that it fails.
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

/// Why criteria were not judged, each reason once with how many criteria it is of.
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

/// What became of a configuration: its status, `incomplete` where criteria on it are not judged and none is
/// known to be missed.
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
