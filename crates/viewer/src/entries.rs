//! Entries for a target: every direction evaluated by the path rules, and the best of them with the robot.
//!
//! The same code as `needlebench ct routes`, with the same numbers.

use std::sync::{Arc, OnceLock};

use needlebench_parallel::Control;
use needlebench_patient::SuggestError;
use needlebench_patient::routes::{
    RoutePlan, RouteTask, VOXEL_DIRECTIONS, VoxelsError, WithRobot, free_routes,
};
use needlebench_scenario::scenario::{GoalSection, RouteSection};
use needlebench_volume::{Remark, VolumeError};
use serde::Serialize;

use crate::around::Around;
use crate::case::Case;
use crate::live::{GoalAim, Refusal};

/// Needle paths to a target.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Entries {
    /// As in `routes.json`.
    pub plan: RoutePlan,
    /// Remarks on the label map.
    pub remarks: Vec<Remark>,
}

fn rules_of<'a>(
    case: &'a Case,
    section: &GoalSection,
    usual: &'a RouteSection,
) -> &'a RouteSection {
    let own = case.goals().iter().find(|goal| goal.name == section.name);
    own.and_then(|goal| goal.route.as_ref()).unwrap_or(usual)
}

/// Plans the needle paths to a target: first by the patient alone, then with the robot. Directions are evaluated once.
///
/// # Errors
/// An invalid target, or one outside the body; `None` if it was interrupted.
pub fn entries(
    case: &Case,
    aim: &GoalAim,
    with_robot: bool,
    control: &Control<'_>,
) -> Result<Option<Entries>, Refusal> {
    let section = aim.section(case)?;
    let usual = RouteSection::default();
    let task = task_of(case, &section, &usual);
    let around = match around(case, &task, &section, control) {
        Ok(around) => around,
        Err(VoxelsError::Scan(VolumeError::Interrupted)) => return Ok(None),
        Err(VoxelsError::Scan(VolumeError::Refused { message, hint, .. })) => {
            return Err(Refusal { message, hint });
        }
        Err(VoxelsError::Target(finding)) => return Err(finding.into()),
    };
    let plan = || {
        let anatomy = &around.anatomy;
        let free = if let Some(known) = around.free.get() {
            known
        } else {
            let found = free_routes(&task, anatomy, control)?;
            around.free.get_or_init(|| found)
        };
        if with_robot && task.robot == WithRobot::Yes {
            free.plan_with_robot(&task, anatomy, control)
        } else {
            Ok(free.plan(&task, anatomy))
        }
    };
    match plan() {
        Ok(mut plan) => {
            plan.phantom_origin_in_ct_m = Some(case.built().origin_in_ct_m().into());
            Ok(Some(Entries {
                plan,
                remarks: around.anatomy.remarks().to_vec(),
            }))
        }
        Err(SuggestError::Interrupted) => Ok(None),
        Err(SuggestError::Refused { message, hint }) => Err(Refusal::new(message, &hint)),
    }
}

fn task_of<'a>(case: &'a Case, section: &'a GoalSection, usual: &'a RouteSection) -> RouteTask<'a> {
    RouteTask {
        resolved: case.desk().scenario(),
        section,
        rules: rules_of(case, section, usual),
        // Asked now or later: the rules are the same.
        robot: match case.built().not_registered() {
            Some(why) => WithRobot::No(why.to_owned()),
            None => WithRobot::Yes,
        },
        directions: VOXEL_DIRECTIONS,
    }
}

/// Reads the voxels around a target, so that a needle to it is evaluated by the path rules even if entries were not
/// requested. A target that has none is evaluated by its tissues alone.
///
/// # Errors
/// An invalid target.
pub(crate) fn look_around(
    case: &Case,
    aim: &GoalAim,
    control: &Control<'_>,
) -> Result<(), Refusal> {
    let section = aim.section(case)?;
    let usual = RouteSection::default();
    let _judged_by_tissues_if_not =
        around(case, &task_of(case, &section, &usual), &section, control);
    Ok(())
}

/// The voxels around a target: those of the last request if it had the same target.
fn around(
    case: &Case,
    task: &RouteTask<'_>,
    section: &GoalSection,
    control: &Control<'_>,
) -> Result<Arc<Around>, VoxelsError> {
    let target = case.desk().placer().target(section)?;
    let rules = task.route_rules();
    let known = case.last_target().get();
    let known = known.filter(|it| {
        it.goal == section.name && (it.target - target).norm() < 1e-9 && it.rules == rules
    });
    if let Some(known) = known {
        return Ok(known);
    }
    // Hundreds of megabytes: those of the last target are not kept beside them.
    case.last_target().forget();
    let made = Arc::new(Around {
        goal: section.name.clone(),
        target,
        anatomy: task.voxels(case.built(), Some(case.hu()), control)?,
        rules,
        free: OnceLock::new(),
    });
    case.last_target().keep(&made);
    Ok(made)
}
