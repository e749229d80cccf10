//! What `run` makes of a chosen route: routes and runs rank configurations by one code.

use needlebench_engine::ENGINES;
use needlebench_parallel::Control;
use needlebench_patient::SuggestError;
use needlebench_patient::routes::RoutePlan;
use needlebench_scenario::ResolvedScenario;
use needlebench_scenario::scenario::EngineName;

use crate::run::run;
use crate::runnable::Runnable;
use crate::scenario_run::RunOptions;

/// Runs a scenario in the engine that is in process, and adds to the plan of one of its goals which configuration `run`
/// recommends for it, and why.
///
/// # Errors
/// If the scenario has no such goal or cannot be run, or it was interrupted.
pub fn rank_route(
    planned: &ResolvedScenario,
    plan: &mut RoutePlan,
    control: &Control<'_>,
) -> Result<(), SuggestError> {
    let Some(chosen) = &mut plan.chosen else {
        return Ok(());
    };
    let served = &plan.routes[chosen.route].configurations;
    let goal = planned.goals.iter().position(|goal| goal.name == plan.goal);
    let goal = goal
        .ok_or_else(|| SuggestError::refused(format!("no goal `{}`", plan.goal), String::new()))?;
    let options = RunOptions {
        engines: Some(vec![EngineName(ENGINES[0].name().to_owned())]),
        jobs: control.threads,
        ..RunOptions::default()
    };
    let runnable = Runnable::checked(planned.with_goal_alone(goal))?;
    let done = run(&runnable, &options, control.cancel, control.progress)
        .map_err(|error| SuggestError::refused(error.to_string(), String::new()))?;
    if done.interrupted {
        return Err(SuggestError::Interrupted);
    }
    let measured = done.report.goals.into_iter().next();
    let recommended = measured.and_then(|goal| Some((goal.recommended?, goal.ranking?.order)));
    let Some((recommended, order)) = recommended else {
        chosen.leave_open(
            "no configuration is feasible with its motion; `run` of the plan gives the reasons"
                .to_owned(),
        );
        return Ok(());
    };
    // What keeps no margin with its own error is none to choose here, however good it is otherwise.
    let best = order.iter().find_map(|label| {
        let mut works = served.iter().filter(|each| each.works);
        works.find(|each| each.label == label)
    });
    match best {
        Some(best) => {
            chosen.configuration = Some(best.label);
            chosen.because = Some(if best.label == recommended.label {
                recommended.summary
            } else {
                format!(
                    "first of {} feasible that satisfies the margins including its own error; {} \
                     ranks before it but does not",
                    order.len(),
                    recommended.label
                )
            });
        }
        None => chosen.leave_open(
            "no configuration feasible with its motion satisfies the margins including its own \
             error"
                .to_owned(),
        ),
    }
    Ok(())
}
