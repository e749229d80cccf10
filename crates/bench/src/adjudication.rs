//! The fourth stage, discrepancy analysis: engines compared with the reference integrator, and their differences within
//! tolerance.

use needlebench_engine::{
    Engine, EngineError, EngineIdentity, EnginePool, Hooks, MotionJob, MotionSettings, Plant,
    REFEREE, Recording, RefereePlant, RefereeSettings, run_motions,
};
use needlebench_evaluation::adjudication::{
    Adjudication, Evidence, PairConvergence, adjudicate, judge_differences,
};
use needlebench_evaluation::pairs;
use needlebench_evaluation::referee::{
    HELD_WINDOW_S, HeldTorques, RefereeComparison, RefereeReport, StepDifference, TipPath,
    measured_order, steps_before_contact, tip_difference,
};
use needlebench_kinematics::trajectory::JointTrajectory;
use needlebench_parallel::{Control, in_parallel};
use needlebench_planning::GoalPlan;
use needlebench_scenario::Goal;

use crate::setup::Setup;
use crate::simulate::EngineRun;

/// The scenario's time step is divided by these to see how the differences converge.
const STEP_DIVISORS: [u32; 3] = [1, 2, 4];

/// What was found out about one configuration.
#[derive(Debug, Clone, Default)]
pub(crate) struct Adjudicated {
    /// The engines compared with the reference integrator.
    pub referee: Option<RefereeReport>,
    /// The engines' differences and the envelope.
    pub adjudication: Option<Adjudication>,
}

impl Adjudicated {
    /// The engines' differences of one configuration, without an inquiry.
    pub(crate) fn without_referee(setup: &Setup<'_>, goal: usize, runs: &[EngineRun]) -> Self {
        let recordings: Vec<&Recording> = runs.iter().map(|run| &run.recording).collect();
        let envelope = &setup.resolved.scenario.engines.envelope;
        let (cell, goal) = (setup.real.cell(), setup.real.goal(goal));
        Self {
            referee: None,
            adjudication: judge_differences(cell, goal, envelope, &recordings),
        }
    }

    fn is_disputed(&self) -> bool {
        let adjudication = self.adjudication.as_ref();
        adjudication.is_some_and(Adjudication::needs_referee)
    }
}

/// What was found out about all configurations.
pub(crate) struct Adjudications {
    /// By goal and configuration.
    pub by_goal: Vec<Vec<Adjudicated>>,
    /// The reference integrator, if it was called.
    pub identity: Option<EngineIdentity>,
    /// What could not be done.
    pub notes: Vec<String>,
}

/// What is evaluated.
pub(crate) struct Adjudicator<'a> {
    pub setup: &'a Setup<'a>,
    pub plans: &'a [GoalPlan],
    /// Recordings, by goal, configuration and engine.
    pub runs: &'a [Vec<Vec<EngineRun>>],
    /// Engines that made them.
    pub engines: &'a [&'static dyn Engine],
    pub pool: &'a EnginePool,
    /// Call the reference integrator for every motion, not only where the envelope is exceeded.
    pub always: bool,
}

/// A configuration that is compared with the reference integrator.
#[derive(Clone, Copy)]
struct Case<'a> {
    goal_index: usize,
    configuration: usize,
    goal: &'a Goal,
    trajectory: &'a JointTrajectory,
    runs: &'a [EngineRun],
}

/// A case at one step.
struct AtStep {
    timestep_s: f64,
    referee: TipPath,
    /// By engine, in the order of the case's runs.
    engines: Vec<Traced>,
}

/// What is kept of a motion: recordings themselves would fill the memory.
struct Traced {
    tip: TipPath,
    /// The reference integrator under the motion's torques; none if it is too short for that.
    held: Option<HeldTorques>,
}

/// What the reference integrator yields for a case: of each engine, and of pairs of them.
type Verdict = (RefereeReport, Vec<PairConvergence>);

impl Adjudicator<'_> {
    /// Evaluates every configuration that several engines simulated, and calls the reference integrator where asked for
    /// or where the engines differ by more than they may.
    pub(crate) fn judge_all(&self, control: &Control<'_>) -> Adjudications {
        let mut found = Adjudications {
            by_goal: Vec::new(),
            identity: None,
            notes: Vec::new(),
        };
        for (goal, runs) in self.runs.iter().enumerate() {
            let each = |runs: &Vec<EngineRun>| Adjudicated::without_referee(self.setup, goal, runs);
            found.by_goal.push(runs.iter().map(each).collect());
        }
        let cases: Vec<Case<'_>> = self
            .cases()
            .filter(|case| {
                let judged = &found.by_goal[case.goal_index][case.configuration];
                !case.runs.is_empty() && (self.always || judged.is_disputed())
            })
            .collect();
        if !cases.is_empty() {
            control.progress.message("refereeing");
            match self.referee(&cases, control) {
                Ok((identity, reports)) => {
                    found.identity = Some(identity);
                    for (case, (report, convergence)) in cases.iter().zip(reports) {
                        let judged = &mut found.by_goal[case.goal_index][case.configuration];
                        judged.adjudication = self.rule(case, Some(&report), &convergence);
                        judged.referee = Some(report);
                    }
                }
                Err(EngineError::Cancelled) => {}
                Err(error) => found
                    .notes
                    .push(format!("reference integrator failed: {error}")),
            }
        }
        // What lies beyond the envelope without a referee: contact, or a referee that failed.
        for case in self.cases() {
            let judged = &mut found.by_goal[case.goal_index][case.configuration];
            let adjudication = judged.adjudication.as_ref();
            if judged.referee.is_none() && adjudication.is_some_and(Adjudication::has_breach) {
                judged.adjudication = self.rule(&case, None, &[]);
            }
        }
        found
    }

    /// All configurations with a motion.
    fn cases(&self) -> impl Iterator<Item = Case<'_>> {
        let by_goal = self.runs.iter().zip(self.plans).enumerate();
        by_goal.flat_map(|(goal_index, (runs, plan))| {
            let goal = self.setup.real.goal(goal_index);
            let each = runs.iter().zip(&plan.configurations).enumerate();
            each.filter_map(move |(configuration, (runs, plan))| {
                Some(Case {
                    goal_index,
                    configuration,
                    goal,
                    trajectory: plan.trajectory.as_ref()?,
                    runs,
                })
            })
        })
    }

    fn rule(
        &self,
        case: &Case<'_>,
        referee: Option<&RefereeReport>,
        convergence: &[PairConvergence],
    ) -> Option<Adjudication> {
        let recordings: Vec<&Recording> = case.runs.iter().map(|run| &run.recording).collect();
        adjudicate(
            self.setup.real.cell(),
            case.goal,
            &self.setup.resolved.scenario.engines.envelope,
            &self.setup.servo.effort_limit_nm,
            &recordings,
            Evidence {
                referee,
                convergence,
            },
        )
    }

    /// All cases compared with the reference integrator, with the engines' differences from each other by step.
    fn referee(
        &self,
        cases: &[Case<'_>],
        control: &Control<'_>,
    ) -> Result<(EngineIdentity, Vec<Verdict>), EngineError> {
        let mut by_case: Vec<Vec<AtStep>> = cases.iter().map(|_| Vec::new()).collect();
        for divisor in STEP_DIVISORS {
            let timestep_s = self.whole_s() / f64::from(divisor);
            let engines = if divisor == 1 {
                let recorded = in_parallel(control.threads, cases, |case| self.recorded(case));
                recorded.into_iter().collect::<Result<_, EngineError>>()?
            } else {
                self.at_smaller_step(cases, timestep_s, control)?
            };
            let referee = in_parallel(control.threads, cases, |case| {
                let pool = EnginePool::new(&[REFEREE]);
                let tip = |case: &Case<'_>, recording: &Recording| Ok(self.tip(case, recording));
                let mut tips = self.moved(&pool, REFEREE, &[*case], timestep_s, control, tip)?;
                Ok::<_, EngineError>(tips.remove(0))
            });
            for ((of_case, engines), referee) in by_case.iter_mut().zip(engines).zip(referee) {
                of_case.push(AtStep {
                    timestep_s,
                    referee: referee?,
                    engines,
                });
            }
        }
        let reports = cases.iter().zip(&by_case);
        let reports =
            reports.map(|(case, steps)| (self.report(case, steps), convergence(case, steps)));
        Ok((self.referee_plant()?.identity(), reports.collect()))
    }

    fn report(&self, case: &Case<'_>, steps: &[AtStep]) -> RefereeReport {
        let mut report = RefereeReport::default();
        for (which, run) in case.runs.iter().enumerate() {
            let closed_loop = |step: &AtStep| {
                let engine = &step.engines[which].tip;
                tip_difference(engine, &step.referee, engine.steps_before_contact)
            };
            let convergence: Vec<StepDifference> = steps
                .iter()
                .map(|step| StepDifference {
                    timestep_s: step.timestep_s,
                    peak_tip_m: closed_loop(step).peak_tip_m,
                })
                .collect();
            let until = steps_before_contact(&run.recording);
            report.engines.insert(
                run.engine.to_owned(),
                RefereeComparison {
                    until_s: run.recording.time_s[until],
                    closed_loop: closed_loop(&steps[0]),
                    held_torques: held_torques(steps, which),
                    order: measured_order(&convergence),
                    convergence,
                    documented_order: self.engine(run).documented_order(),
                },
            );
        }
        report
    }

    fn engine(&self, run: &EngineRun) -> &'static dyn Engine {
        let named = self
            .engines
            .iter()
            .find(|engine| engine.name() == run.engine);
        *named.expect("a run is that of one of the engines")
    }

    /// The scenario's own step in seconds.
    fn whole_s(&self) -> f64 {
        self.setup.motion_settings().timestep_s
    }

    fn referee_plant(&self) -> Result<RefereePlant, EngineError> {
        RefereePlant::new(
            self.setup.real.cell(),
            self.whole_s(),
            &RefereeSettings::default(),
        )
    }

    fn tip(&self, case: &Case<'_>, recording: &Recording) -> TipPath {
        TipPath::of(self.setup.real.cell(), case.goal, recording)
    }

    /// A motion, and the reference integrator under its torques.
    fn traced(&self, case: &Case<'_>, recording: &Recording) -> Result<Traced, EngineError> {
        let tip = self.tip(case, recording);
        let windows = self.referee_plant()?.held_windows(
            recording,
            tip.steps_before_contact,
            self.window_steps(recording.timestep_s),
        )?;
        Ok(Traced {
            tip,
            held: HeldTorques::of(self.setup.real.cell(), case.goal, recording, &windows),
        })
    }

    /// Steps of a window: at smaller steps it lasts as long as at the scenario's own.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a window is some steps long"
    )]
    fn window_steps(&self, timestep_s: f64) -> usize {
        let whole = (HELD_WINDOW_S / self.whole_s()).round().max(1.0);
        whole as usize * (self.whole_s() / timestep_s).round() as usize
    }

    /// The recordings that there are.
    fn recorded(&self, case: &Case<'_>) -> Result<Vec<Traced>, EngineError> {
        let runs = case.runs.iter();
        runs.map(|run| self.traced(case, &run.recording)).collect()
    }

    /// All cases in all of their engines at another step, by case and in the order of its runs.
    fn at_smaller_step(
        &self,
        cases: &[Case<'_>],
        timestep_s: f64,
        control: &Control<'_>,
    ) -> Result<Vec<Vec<Traced>>, EngineError> {
        let by_engine = in_parallel(control.threads, self.engines, |engine| {
            let ran = |case: &&Case<'_>| case.runs.iter().any(|run| run.engine == engine.name());
            let own: Vec<Case<'_>> = cases.iter().filter(ran).copied().collect();
            let traced = |case: &Case<'_>, recording: &Recording| self.traced(case, recording);
            self.moved(self.pool, *engine, &own, timestep_s, control, traced)
        });
        let mut by_engine = by_engine
            .into_iter()
            .map(|traced| Ok(traced?.into_iter()))
            .collect::<Result<Vec<_>, EngineError>>()?;
        let mut next = |run: &EngineRun| {
            let at = self
                .engines
                .iter()
                .position(|engine| engine.name() == run.engine);
            by_engine[at?].next()
        };
        let of_case = |case: &Case<'_>| {
            let traced = case.runs.iter().map(&mut next);
            traced
                .map(|traced| traced.expect("every run was made again"))
                .collect()
        };
        Ok(cases.iter().map(of_case).collect())
    }

    /// What `keep` makes of the cases' motions in one engine.
    fn moved<T>(
        &self,
        pool: &EnginePool,
        engine: &dyn Engine,
        cases: &[Case<'_>],
        timestep_s: f64,
        control: &Control<'_>,
        keep: impl Fn(&Case<'_>, &Recording) -> Result<T, EngineError>,
    ) -> Result<Vec<T>, EngineError> {
        let jobs: Vec<MotionJob<'_>> = cases
            .iter()
            .map(|case| self.setup.job(case.trajectory))
            .collect();
        let settings = MotionSettings {
            timestep_s,
            ..self.setup.motion_settings()
        };
        let hooks = Hooks {
            cancel: Some(control.cancel),
            progress: None,
        };
        let mut ended: Vec<Option<Result<T, EngineError>>> = cases.iter().map(|_| None).collect();
        let done = run_motions(
            pool,
            engine,
            &jobs,
            settings,
            hooks,
            &mut |index, result| {
                ended[index] = Some(result.and_then(|recording| keep(&cases[index], &recording)));
            },
        );
        if let Some(error) = done.error {
            return Err(error);
        }
        let each = ended.into_iter();
        each.map(|ended| ended.expect("the engine went on to the end"))
            .collect()
    }
}

/// One engine under held torques at the scenario's step, with what smaller steps make of it.
fn held_torques(steps: &[AtStep], engine: usize) -> Option<HeldTorques> {
    let at = |step: &AtStep| step.engines[engine].held.clone();
    let convergence: Vec<StepDifference> = steps
        .iter()
        .filter_map(|step| {
            Some(StepDifference {
                timestep_s: step.timestep_s,
                peak_tip_m: at(step)?.peak_tip_m,
            })
        })
        .collect();
    Some(HeldTorques {
        order: measured_order(&convergence),
        convergence,
        ..at(steps.first()?)?
    })
}

/// How the engines of a case differ from each other before any contact, by step.
fn convergence(case: &Case<'_>, steps: &[AtStep]) -> Vec<PairConvergence> {
    let engines: Vec<usize> = (0..case.runs.len()).collect();
    pairs(&engines)
        .map(|[a, b]| PairConvergence {
            engines: [a, b].map(|each| case.runs[*each].engine),
            steps: steps
                .iter()
                .map(|step| {
                    let [a, b] = [a, b].map(|each| &step.engines[*each].tip);
                    let free = a.steps_before_contact.min(b.steps_before_contact);
                    StepDifference {
                        timestep_s: step.timestep_s,
                        peak_tip_m: tip_difference(a, b, free).peak_tip_m,
                    }
                })
                .collect(),
        })
        .collect()
}
