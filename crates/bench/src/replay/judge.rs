//! Whether a recorded run and its replay are as near as they are to be.

use needlebench_evaluation::report::{CriterionResult, NotJudged, Verdict};
use needlebench_recorded::LogKind;
use needlebench_scenario::requirements::{Requirements, requirement_of};
use needlebench_scenario::scenario::ReplaySection;

use super::ReplayReport;

/// What criteria are of, in place of a goal.
pub const SUBJECT: &str = "replay";

/// Judges every criterion that is given, in every engine that was to run.
pub(super) fn judge(
    report: &mut ReplayReport,
    criteria: &ReplaySection,
    requirements: &Requirements,
    engines: &[&'static str],
) {
    let mut judge = Judge {
        requirements,
        results: Vec::new(),
        open: Vec::new(),
    };
    if let Some(limit) = criteria.max_moment_rms_nm {
        let controller = report.identification.controller.as_ref();
        let largest = controller.map(|fit| fit.held_out_rms_nm.into_iter().fold(0.0, f64::max));
        let detail = "largest RMS residual of target_moment over joints, identified arm, held-out";
        let missing = "the log has no target_moment or no target_q";
        judge.add(
            "max_moment_rms_nm",
            None,
            largest,
            limit,
            "N m",
            detail,
            missing,
        );
    }
    if let Some(limit) = criteria.max_calibration_mm {
        let calibration = report.calibration.as_ref();
        let (value, limit) = (calibration.map(|fit| fit.held_out.rms_m), limit * 1e-3);
        let detail = "RMS calibration error, held-out";
        let missing = "the log has no TCP poses";
        judge.add(
            "max_calibration_mm",
            None,
            value,
            limit,
            "m",
            detail,
            missing,
        );
    }
    for engine in engines {
        let replay = report.engines.get(engine);
        let missing = if report.log.kind == LogKind::Simulator {
            "the log is of a simulator"
        } else if report.real.is_none() {
            "the log has no target_q, so nothing was replayed"
        } else {
            "not replayed by the engine"
        };
        if let Some(limit) = criteria.max_tracking_mm {
            let against = replay.and_then(|replay| replay.against_real.as_ref());
            let (value, limit) = (against.map(|against| against.tip_largest_m), limit * 1e-3);
            let detail = "largest distance of the simulated tip from the real one";
            judge.add(
                "max_tracking_mm",
                Some(engine),
                value,
                limit,
                "m",
                detail,
                missing,
            );
        }
        if let Some(limit) = criteria.max_current_rms_a {
            let currents = replay.map(|replay| replay.current_rms_a.iter().flatten().copied());
            let value = currents.and_then(|values| values.reduce(f64::max));
            let missing = if replay.is_some() {
                "no measured currents or no torque constants"
            } else {
                missing
            };
            let detail = "largest RMS of simulated minus measured current over joints";
            judge.add(
                "max_current_rms_a",
                Some(engine),
                value,
                limit,
                "A",
                detail,
                missing,
            );
        }
    }
    let failed = judge.results.iter().any(|result| !result.pass);
    let open = !judge.open.is_empty() || !report.engine_failures.is_empty();
    report.verdict = Verdict::of(failed, open);
    report.criteria = judge.results;
    report.not_judged = judge.open;
}

struct Judge<'a> {
    requirements: &'a Requirements,
    results: Vec<CriterionResult>,
    open: Vec<NotJudged>,
}

impl Judge<'_> {
    #[expect(clippy::too_many_arguments, reason = "the parts of one line")]
    fn add(
        &mut self,
        criterion: &str,
        engine: Option<&str>,
        value: Option<f64>,
        limit: f64,
        unit: &'static str,
        detail: &str,
        missing: &str,
    ) {
        let (goal, engine) = (SUBJECT.to_owned(), engine.map(str::to_owned));
        let requirement = requirement_of(self.requirements, criterion).map(str::to_owned);
        let criterion = criterion.to_owned();
        match value.filter(|value| value.is_finite()) {
            Some(value) => self.results.push(CriterionResult {
                goal,
                label: None,
                engine,
                criterion,
                value: Some(value),
                limit: Some(limit),
                unit,
                pass: value <= limit,
                detail: detail.to_owned(),
                requirement,
            }),
            None => self.open.push(NotJudged {
                goal,
                label: None,
                engine,
                criterion,
                reason: missing.to_owned(),
                requirement,
            }),
        }
    }
}
