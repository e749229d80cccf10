//! What engines measured of events.

use std::collections::BTreeMap;

use needlebench_engine::Recording;
use needlebench_evaluation::events::{
    BRAKES_FIT, EventsReport, PressReport, RIGID_FORCE_MEANS, StopBrakes, StopReport,
    measure_press, measure_retraction, measure_stop, press_difference,
};
use needlebench_evaluation::largest_over_pairs;
use needlebench_evaluation::report::Judged;
use needlebench_planning::{ConfigurationPlan, PressError, PressPlan};
use needlebench_scenario::scenario::PressSection;
use needlebench_scenario::{Goal, ResolvedScenario};

use super::checks::checks;
use super::{EngineEvents, EventRun, section};
use crate::setup::Setup;

/// The report's part about the events of a configuration; `engines` are those that were to measure them.
pub(crate) fn events_report(
    setup: &Setup<'_>,
    plan: &ConfigurationPlan,
    run: &EventRun,
    engines: &[&str],
) -> EventsReport {
    let (resolved, real) = (setup.resolved, &setup.real);
    let events = section(resolved);
    let (cell, model, goal) = (real.cell(), real.model(), real.goal(run.goal));
    let scenario = &resolved.scenario;
    let band_m = scenario.criteria.settling_band_mm * 1e-3;
    let settings = (
        scenario.recording.period_ms * 1e-3,
        scenario.planning.certificate_tolerance_mm * 1e-3,
        band_m,
    );
    let press = run
        .press
        .iter()
        .zip(&events.press)
        .enumerate()
        .map(|(index, (staged, asked))| {
            press_report(resolved, goal, staged, asked, index, &run.engines)
        })
        .collect();
    let stop = run.stop.as_ref().map(|stop| {
        let planned = plan.trajectory.as_ref().expect("events follow a motion");
        let engines: BTreeMap<_, _> = run
            .engines
            .iter()
            .filter_map(|(engine, events)| {
                let recording = events.stop.as_ref()?;
                let both = (planned, &stop.trajectory);
                let report = measure_stop(cell, model, goal, both, recording, stop.at_s, settings);
                Some(((*engine).to_owned(), report))
            })
            .collect();
        let last = |events: &EngineEvents| {
            let state = events.stop.as_ref()?.state.last()?;
            let exit = state.world_from_flange * cell.tool.flange_from_guide_exit;
            Some(exit * nalgebra::Point3::new(0.0, 0.0, goal.insertion_length_m))
        };
        let tips: Vec<_> = run
            .engines
            .iter()
            .filter_map(|(_, each)| last(each))
            .collect();
        StopReport {
            category: events.stop.as_ref().map_or(0, |stop| stop.category),
            at_s: stop.at_s,
            phase: stop.phase.name(),
            engines,
            tip_difference_m: largest_over_pairs(&tips, |a, b| Some((a - b).norm())),
            envelope: stop.envelope,
            brakes: match (&stop.figures, &stop.brakes) {
                (Some(figures), Some((_, brakes))) => Some(StopBrakes {
                    figures: figures.clone(),
                    fit: BRAKES_FIT,
                    coulomb_nm: brakes.coulomb_nm.into(),
                    viscous_nms_per_rad: brakes.viscous_nms_per_rad.into(),
                }),
                _ => None,
            },
        }
    });
    let retract = run
        .engines
        .iter()
        .filter_map(|(engine, events)| {
            let (recording, retreat) = (events.retract.as_ref()?, plan.retreat.as_ref()?);
            let report = measure_retraction(cell, model, goal, retreat, recording, settings);
            Some(((*engine).to_owned(), report))
        })
        .collect();
    let mut report = EventsReport {
        press,
        stop,
        retract,
        checks: Judged::default(),
    };
    report.checks = checks(
        &goal.name,
        plan.configuration.label(),
        events,
        &report,
        engines,
    );
    report
}

fn press_report(
    resolved: &ResolvedScenario,
    goal: &Goal,
    staged: &Result<PressPlan, PressError>,
    asked: &PressSection,
    index: usize,
    engines: &[(&'static str, EngineEvents)],
) -> PressReport {
    let friction = asked.friction.unwrap_or(resolved.scenario.engines.friction);
    let band_m = resolved.scenario.criteria.settling_band_mm * 1e-3;
    let mut report = PressReport {
        class: asked.class.class().name(),
        solids: Vec::new(),
        depth_m: asked.depth_mm * 1e-3,
        displacement_m: None,
        friction,
        force_means: RIGID_FORCE_MEANS,
        not_staged: None,
        engines: BTreeMap::new(),
        force_difference: None,
        tip_difference_settled_m: None,
        tip_difference_peak_m: None,
    };
    let plan = match staged {
        Ok(plan) => plan,
        Err(error) => {
            report.not_staged = Some(error.to_string());
            return report;
        }
    };
    report.solids = plan.solids.to_vec();
    report.displacement_m = Some(plan.displacement_m.into());
    let recordings: Vec<(&str, &Recording)> = engines
        .iter()
        .filter_map(|(engine, events)| Some((*engine, events.press.get(index)?.as_ref()?)))
        .collect();
    for (engine, recording) in &recordings {
        let measured = measure_press(
            &plan.cell,
            &plan.model,
            plan.bodies,
            goal,
            &plan.trajectory,
            recording,
            friction,
            band_m,
        );
        report.engines.insert((*engine).to_owned(), measured);
    }
    let recordings: Vec<&Recording> = recordings.iter().map(|(_, recording)| *recording).collect();
    press_difference(&mut report, &plan.cell, goal, &recordings);
    report
}
