//! One feasible motion: of a goal in a configuration, as a run of that goal has it.

use std::fmt::Write as _;

use needlebench_cell::rule_in_words;
use needlebench_evaluation::report::{ConfigurationReport, Report, Status};
use needlebench_input::Finding;
use needlebench_kinematics::ik::Configuration;
use needlebench_kinematics::trajectory::JointTrajectory;
use needlebench_parallel::Control;
use needlebench_planning::ConfigurationPlan;
use needlebench_scenario::scenario::EngineName;
use needlebench_scenario::{Goal, ResolvedScenario};

use crate::run::run;
use crate::runnable::Runnable;
use crate::scenario_run::{RunOptions, ScenarioRun};
use crate::simulate::EngineRun;

/// A motion that is feasible in a run, with that run.
#[derive(Debug)]
pub struct WorkingMotion {
    resolved: ResolvedScenario,
    run: ScenarioRun,
    configuration: usize,
}

/// Why there is no motion.
#[derive(Debug, Clone, PartialEq)]
pub enum NoMotion {
    /// What is wrong with a request: a goal that is not named or does not exist, an infeasible configuration.
    Refused(Finding),
    /// The engine or what it needs failed.
    Engine(String),
    /// It was told to stop.
    Interrupted,
}

impl From<Finding> for NoMotion {
    fn from(finding: Finding) -> Self {
        Self::Refused(finding)
    }
}

/// Which motion of a scenario.
#[derive(Debug, Clone, PartialEq)]
pub struct MotionChoice {
    /// Name of the goal; the only one if left out.
    pub goal: Option<String>,
    /// The configuration; the recommended one if left out.
    pub configuration: Option<Configuration>,
    /// The engine that moves it.
    pub engine: EngineName,
}

impl WorkingMotion {
    /// Runs one goal in one engine and takes a motion from it, the same as in a run of the whole scenario in that engine.
    ///
    /// # Errors
    /// [`NoMotion`].
    pub fn of(
        resolved: &ResolvedScenario,
        choice: &MotionChoice,
        control: &Control<'_>,
    ) -> Result<Self, NoMotion> {
        let goal = goal_of(resolved, choice.goal.as_deref())?;
        let resolved = resolved.with_goal_alone(goal);
        let file = resolved.source.file.clone();
        let options = RunOptions {
            engines: Some(vec![choice.engine.clone()]),
            jobs: control.threads,
            ..RunOptions::default()
        };
        let runnable = Runnable::checked(resolved)?;
        let run = run(&runnable, &options, control.cancel, control.progress)
            .map_err(|error| Finding::new(&file, error.to_string()))?;
        if run.interrupted {
            return Err(NoMotion::Interrupted);
        }
        if let Some(failure) = run.report.engine_failures.first() {
            let message = format!("{}: {}", failure.engine, failure.message);
            return Err(NoMotion::Engine(message));
        }
        let configuration = chosen(&run.report, choice.configuration)
            .map_err(|finding| Finding { file, ..finding })?;
        Ok(Self {
            resolved: runnable.into_scenario(),
            run,
            configuration,
        })
    }

    /// The scenario with that goal alone.
    pub fn scenario(&self) -> &ResolvedScenario {
        &self.resolved
    }

    /// The run.
    pub fn run(&self) -> &ScenarioRun {
        &self.run
    }

    /// The goal.
    pub fn goal(&self) -> &Goal {
        &self.resolved.goals[0]
    }

    /// Its plan.
    pub fn plan(&self) -> &ConfigurationPlan {
        &self.run.plans[0].configurations[self.configuration]
    }

    /// The planned motion.
    ///
    /// # Panics
    /// Never: what works has one.
    pub fn trajectory(&self) -> &JointTrajectory {
        let trajectory = self.plan().trajectory.as_ref();
        trajectory.expect("what works has a motion")
    }

    /// What the engine recorded.
    ///
    /// # Panics
    /// Never: what works was simulated.
    pub fn recorded(&self) -> &EngineRun {
        let runs = &self.run.runs[0][self.configuration];
        runs.first().expect("what works was simulated")
    }
}

/// Index of a goal: the one of a name, or the only one.
fn goal_of(resolved: &ResolvedScenario, name: Option<&str>) -> Result<usize, Finding> {
    let goals = &resolved.goals;
    let names = || {
        let names: Vec<&str> = goals.iter().map(|goal| goal.name.as_str()).collect();
        names.join(", ")
    };
    let refuse = |message: String, hint: String| {
        let finding = Finding::new(&resolved.source.file, message).key("--goal");
        Err(finding.hint(hint))
    };
    match (name, goals.as_slice()) {
        (_, []) => {
            let finding = Finding::new(
                &resolved.source.file,
                "the scenario has no goals, and therefore no motion",
            );
            Err(finding
                .key("goals")
                .hint("choose a scenario with [[goals]]"))
        }
        (None, [_]) => Ok(0),
        (None, several) => refuse(
            format!(
                "the scenario has {} goals; a motion is exported for one",
                several.len()
            ),
            format!("name one of them: --goal NAME, with {}", names()),
        ),
        (Some(name), goals) => match goals.iter().position(|goal| goal.name == name) {
            Some(index) => Ok(index),
            None => refuse(
                format!("the scenario has no goal `{name}`"),
                format!("there are: {}", names()),
            ),
        },
    }
}

/// Index of the requested configuration, if it is feasible.
fn chosen(report: &Report, wanted: Option<Configuration>) -> Result<usize, Finding> {
    let goal = &report.goals[0];
    // The file is put in by the caller.
    let refuse = |message: String| Finding::new("", message).key("--configuration");
    let working: Vec<&str> = goal
        .configurations
        .iter()
        .filter(|each| each.status == Status::Ok)
        .map(|each| each.label)
        .collect();
    let those = match working.as_slice() {
        [] => "no configuration is feasible".to_owned(),
        some => format!("feasible: {}", some.join(", ")),
    };
    let label = match (wanted, &goal.recommended) {
        (Some(wanted), _) => wanted.label(),
        (None, Some(recommended)) => recommended.label.as_str(),
        (None, None) => {
            let each = goal.configurations.iter();
            let why: Vec<String> = each
                .map(|each| format!("{}: {}", each.label, why_not(report, each)))
                .collect();
            let message = format!("no configuration is feasible for goal `{}`", goal.name);
            return Err(refuse(message).hint(format!(
                "only feasible motions are exported; {}",
                why.join("; ")
            )));
        }
    };
    let index = goal
        .configurations
        .iter()
        .position(|each| each.label == label)
        .expect("a run has all eight");
    let found = &goal.configurations[index];
    if found.status == Status::Ok {
        return Ok(index);
    }
    let why = why_not(report, found);
    let message = format!("{label} is not feasible for goal `{}`: {why}", goal.name);
    Err(refuse(message).hint(format!("only feasible motions are exported; {those}")))
}

/// Why a configuration is not feasible.
fn why_not(report: &Report, configuration: &ConfigurationReport) -> String {
    if let Some(first) = configuration.rejections.first() {
        return format!("{}: {}", rule_in_words(first.rule), first.detail);
    }
    let missed = report
        .criteria
        .iter()
        .find(|each| !each.pass && each.label.as_deref() == Some(configuration.label));
    missed.map_or_else(
        || "fails a criterion of the scenario".to_owned(),
        |each| {
            let mut words = format!("fails {}", each.criterion);
            if !each.detail.is_empty() {
                let _ = write!(words, ": {}", each.detail);
            }
            words
        },
    )
}
