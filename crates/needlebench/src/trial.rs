//! The engines on trial: beside the referee, and the differences of the two inside the envelope.

use std::sync::Mutex;
use std::sync::atomic::AtomicBool;

use needlebench_cell::scenario::EngineName;
use needlebench_cell::{Goal, ResolvedScenario};
use needlebench_engine::mujoco::HarnessProcess;
use needlebench_engine::{
    EngineError, EngineIdentity, Hooks, Plant, Recording, RefereePlant, RefereeSettings, Servo,
    retrace, simulate,
};
use needlebench_evaluation::adjudication::{Adjudication, Evidence, adjudicate, judge_differences};
use needlebench_evaluation::referee::{
    DOCUMENTED_ORDER, RefereeComparison, RefereeReport, StepDifference, TipDifference,
    measured_order, steps_before_contact, time_until_lost, tip_difference,
};
use needlebench_kinematics::trajectory::JointTrajectory;
use needlebench_planning::GoalPlan;

use crate::pipeline::{EngineRun, in_parallel};
use crate::plants::plant;
use crate::progress::Progress;
use crate::reality::{Reality, servo};

/// The scenario's time step is divided by these to see how the differences converge.
const STEP_DIVISORS: [u32; 3] = [1, 2, 4];

/// What was found out about one configuration.
#[derive(Debug, Clone, Default)]
pub(crate) struct Trial {
    /// Both engines beside the referee.
    pub(crate) referee: Option<RefereeReport>,
    /// The engines' differences and the envelope.
    pub(crate) adjudication: Option<Adjudication>,
}

/// What was found out about all configurations.
pub(crate) struct Trials {
    /// By goal and configuration.
    pub(crate) by_goal: Vec<Vec<Trial>>,
    /// The referee, if it was called.
    pub(crate) identity: Option<EngineIdentity>,
    /// What could not be done.
    pub(crate) notes: Vec<String>,
}

/// What a trial is held on.
pub(crate) struct Court<'a> {
    pub(crate) resolved: &'a ResolvedScenario,
    pub(crate) reality: &'a Reality<'a>,
    pub(crate) plans: &'a [GoalPlan],
    /// Recordings, by goal, configuration and engine.
    pub(crate) runs: &'a [Vec<Vec<EngineRun>>],
    /// Call the referee for every motion, not only where the envelope is exceeded.
    pub(crate) always: bool,
    pub(crate) threads: usize,
    pub(crate) cancel: &'a AtomicBool,
    pub(crate) progress: &'a Progress,
}

/// A configuration that is held against the referee.
#[derive(Clone, Copy)]
struct Case<'a> {
    goal_index: usize,
    configuration: usize,
    goal: &'a Goal,
    trajectory: &'a JointTrajectory,
    runs: &'a [EngineRun],
}

/// Measurements of a case at one step.
struct AtStep {
    timestep_s: f64,
    /// Each engine against the referee, in the order of the case's runs.
    closed_loop: Vec<TipDifference>,
    /// The engines against each other before any contact; none unless there are two.
    between_m: Option<f64>,
}

/// Judges every configuration that both engines simulated, and calls the referee where asked for or
/// where the engines differ by more than they may.
pub(crate) fn try_all(court: &Court<'_>, harness: Option<&Mutex<HarnessProcess>>) -> Trials {
    let mut trials = Trials {
        by_goal: court
            .runs
            .iter()
            .map(|runs| vec![Trial::default(); runs.len()])
            .collect(),
        identity: None,
        notes: Vec::new(),
    };
    let mut cases = Vec::new();
    for (goal_index, runs) in court.runs.iter().enumerate() {
        let goal = court.reality.goal(goal_index);
        for (configuration, runs) in runs.iter().enumerate() {
            let trial = &mut trials.by_goal[goal_index][configuration];
            if let [a, b] = runs.as_slice() {
                trial.adjudication = Some(judge_differences(
                    court.reality.cell(),
                    goal,
                    &court.resolved.scenario.engines.envelope,
                    [&a.recording, &b.recording],
                ));
            }
            let disputed = trial
                .adjudication
                .as_ref()
                .is_some_and(Adjudication::needs_referee);
            let plan = &court.plans[goal_index].configurations[configuration];
            if let Some(trajectory) = &plan.trajectory
                && !runs.is_empty()
                && (court.always || disputed)
            {
                cases.push(Case {
                    goal_index,
                    configuration,
                    goal,
                    trajectory,
                    runs,
                });
            }
        }
    }
    if !cases.is_empty() {
        court.progress.message("refereeing");
        match court.referee(&cases, harness) {
            Ok((identity, reports)) => {
                trials.identity = Some(identity);
                for (case, (report, between)) in cases.iter().zip(reports) {
                    let trial = &mut trials.by_goal[case.goal_index][case.configuration];
                    trial.adjudication = court.rule(case, Some(&report), &between);
                    trial.referee = Some(report);
                }
            }
            Err(EngineError::Cancelled) => {}
            Err(error) => trials
                .notes
                .push(format!("the referee could not be heard: {error}")),
        }
    }
    // What lies beyond the envelope without a referee: contact, or a referee that failed.
    for (goal_index, runs) in court.runs.iter().enumerate() {
        for (configuration, runs) in runs.iter().enumerate() {
            let trial = &mut trials.by_goal[goal_index][configuration];
            let open = trial.referee.is_none()
                && trial
                    .adjudication
                    .as_ref()
                    .is_some_and(Adjudication::has_breach);
            if let (true, Some(trajectory)) = (
                open,
                &court.plans[goal_index].configurations[configuration].trajectory,
            ) {
                let goal = court.reality.goal(goal_index);
                let case = Case {
                    goal_index,
                    configuration,
                    goal,
                    trajectory,
                    runs,
                };
                trial.adjudication = court.rule(&case, None, &[]);
            }
        }
    }
    trials
}

type Verdicts = Vec<(RefereeReport, Vec<StepDifference>)>;

impl Court<'_> {
    fn rule(
        &self,
        case: &Case<'_>,
        referee: Option<&RefereeReport>,
        convergence: &[StepDifference],
    ) -> Option<Adjudication> {
        let [a, b] = case.runs else { return None };
        Some(adjudicate(
            self.reality.cell(),
            case.goal,
            &self.resolved.scenario.engines.envelope,
            &servo(self.resolved).effort_limit_nm,
            [&a.recording, &b.recording],
            Evidence {
                referee,
                convergence,
            },
        ))
    }

    /// All cases beside the referee, with the engines' differences from each other by step.
    fn referee(
        &self,
        cases: &[Case<'_>],
        harness: Option<&Mutex<HarnessProcess>>,
    ) -> Result<(EngineIdentity, Verdicts), EngineError> {
        let whole_s = self.resolved.scenario.engines.timestep_ms * 1e-3;
        let mut by_step = Vec::new();
        for divisor in STEP_DIVISORS {
            let timestep_s = whole_s / f64::from(divisor);
            let measured = if divisor == 1 {
                in_parallel(self.threads, cases, |case| {
                    let recordings: Vec<&Recording> =
                        case.runs.iter().map(|run| &run.recording).collect();
                    self.at_step(case, timestep_s, &recordings)
                })
                .into_iter()
                .collect::<Result<Vec<_>, _>>()?
            } else {
                self.at_smaller_step(cases, timestep_s, harness)?
            };
            by_step.push(measured);
        }
        let retraced = in_parallel(self.threads, cases, |case| self.retraced(case, whole_s));
        let mut verdicts = Vec::new();
        for (index, (case, retraced)) in cases.iter().zip(retraced).enumerate() {
            let steps: Vec<&AtStep> = by_step.iter().map(|measured| &measured[index]).collect();
            let mut report = RefereeReport::default();
            for (which, (run, (same_torques, unaided_until_s))) in
                case.runs.iter().zip(retraced?).enumerate()
            {
                let convergence: Vec<StepDifference> = steps
                    .iter()
                    .map(|step| StepDifference {
                        timestep_s: step.timestep_s,
                        peak_tip_m: step.closed_loop[which].peak_tip_m,
                    })
                    .collect();
                let until = steps_before_contact(&run.recording);
                report.engines.insert(
                    run.engine.name().to_owned(),
                    RefereeComparison {
                        until_s: run.recording.time_s[until],
                        closed_loop: steps[0].closed_loop[which],
                        same_torques,
                        unaided_until_s,
                        order: measured_order(&convergence),
                        convergence,
                        documented_order: DOCUMENTED_ORDER,
                    },
                );
            }
            let between = steps
                .iter()
                .filter_map(|step| {
                    Some(StepDifference {
                        timestep_s: step.timestep_s,
                        peak_tip_m: step.between_m?,
                    })
                })
                .collect();
            verdicts.push((report, between));
        }
        Ok((self.plant(whole_s)?.identity(), verdicts))
    }

    fn plant(&self, timestep_s: f64) -> Result<RefereePlant, EngineError> {
        RefereePlant::new(self.reality.cell(), timestep_s, &RefereeSettings::default())
    }

    fn simulate(
        &self,
        plant: &mut dyn Plant,
        servo: &Servo,
        case: &Case<'_>,
    ) -> Result<Recording, EngineError> {
        let hooks = Hooks {
            cancel: Some(self.cancel),
            progress: None,
        };
        let actuation = self.reality.actuation();
        simulate(plant, servo, actuation, case.trajectory, hooks)
    }

    /// The referee in a closed loop at this step, and the engines' recordings beside it.
    fn at_step(
        &self,
        case: &Case<'_>,
        timestep_s: f64,
        recordings: &[&Recording],
    ) -> Result<AtStep, EngineError> {
        let cell = self.reality.cell();
        let referee = self.simulate(&mut self.plant(timestep_s)?, &servo(self.resolved), case)?;
        let closed_loop = recordings
            .iter()
            .map(|recording| {
                let states = steps_before_contact(recording) + 1;
                tip_difference(cell, case.goal, recording, &referee.state[..states])
            })
            .collect();
        let between_m = match recordings {
            [a, b] => {
                let states = steps_before_contact(a).min(steps_before_contact(b)) + 1;
                Some(tip_difference(cell, case.goal, a, &b.state[..states]).peak_tip_m)
            }
            _ => None,
        };
        Ok(AtStep {
            timestep_s,
            closed_loop,
            between_m,
        })
    }

    /// Engines and referee anew at a smaller step. One recording of each at a time is kept.
    fn at_smaller_step(
        &self,
        cases: &[Case<'_>],
        timestep_s: f64,
        harness: Option<&Mutex<HarnessProcess>>,
    ) -> Result<Vec<AtStep>, EngineError> {
        let engines = &self.resolved.scenario.engines;
        let cell = self.reality.cell();
        let mut process = harness.map(|harness| harness.lock().expect("no thread panics"));
        let mut process = process.as_deref_mut();
        let mut plants: Vec<(EngineName, Box<dyn Plant + '_>)> = Vec::new();
        for run in cases.iter().flat_map(|case| case.runs) {
            if plants.iter().any(|(engine, _)| *engine == run.engine) {
                continue;
            }
            let process = process.take_if(|_| run.engine == EngineName::Mujoco);
            let plant = plant(run.engine, cell, engines, timestep_s, process)?;
            plants.push((run.engine, plant));
        }
        let servo = servo(self.resolved);
        let mut measured = Vec::new();
        for case in cases {
            let mut recordings = Vec::new();
            for run in case.runs {
                let plant = plants.iter_mut().find(|(engine, _)| *engine == run.engine);
                let (_, plant) = plant.expect("every run's engine has a plant");
                recordings.push(self.simulate(plant.as_mut(), &servo, case)?);
            }
            let recordings: Vec<&Recording> = recordings.iter().collect();
            measured.push(self.at_step(case, timestep_s, &recordings)?);
        }
        Ok(measured)
    }

    /// The referee under the torques of each run, held back and not.
    fn retraced(
        &self,
        case: &Case<'_>,
        timestep_s: f64,
    ) -> Result<Vec<(TipDifference, Option<f64>)>, EngineError> {
        let gains = servo(self.resolved).gains;
        let mut plant = self.plant(timestep_s)?;
        case.runs
            .iter()
            .map(|run| {
                let recording = &run.recording;
                let steps = steps_before_contact(recording);
                let cell = self.reality.cell();
                let held = retrace(&mut plant, recording, steps, Some(&gains))?;
                let free = retrace(&mut plant, recording, steps, None)?;
                Ok((
                    tip_difference(cell, case.goal, recording, &held),
                    time_until_lost(cell, case.goal, recording, &free),
                ))
            })
            .collect()
    }
}
