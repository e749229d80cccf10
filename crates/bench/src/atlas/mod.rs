//! The roll map of a goal: feasibility of each branch over the roll, margins, and reasons for rejection.

mod report;

use std::f64::consts::TAU;

use needlebench_clearance::ClearanceModel;
use needlebench_kinematics::NotUrGeometry;
use needlebench_kinematics::ik::Configuration;
use needlebench_parallel::in_parallel;
use needlebench_planning::{Aim, Family, Member, Planner, route_rejection};
use needlebench_scenario::{Goal, ResolvedScenario};

pub use report::{AtlasReport, BranchReport, GoalAtlasReport};

/// All members of a goal's eight families on a grid of rolls, and their ranges.
#[derive(Debug)]
pub struct GoalAtlas {
    /// Rolls, ascending from 0; all round, even where the goal fixes one.
    pub rolls_rad: Vec<f64>,
    /// What rolls are chosen for.
    pub aim: Aim,
    /// Ranges by configuration, in the order of [`Configuration::ALL`].
    pub families: Vec<Family>,
    /// Members by configuration and roll.
    pub members: Vec<Vec<Member>>,
}

impl GoalAtlas {
    /// Some configuration is feasible at some roll.
    pub fn works(&self) -> bool {
        self.families.iter().any(|family| !family.ranges.is_empty())
    }
}

/// Computes the roll map of a goal: postures only, no motions. The same for any number of threads.
///
/// # Errors
/// [`NotUrGeometry`] if the robot is not a UR arm.
pub fn goal_atlas(
    resolved: &ResolvedScenario,
    model: &ClearanceModel,
    goal: &Goal,
    rolls: u32,
    aim: Aim,
    threads: usize,
) -> Result<GoalAtlas, NotUrGeometry> {
    let planner = Planner::new(resolved, model)?;
    let rolls_rad: Vec<f64> = (0..rolls)
        .map(|k| TAU * f64::from(k) / f64::from(rolls))
        .collect();
    let mut members = in_parallel(threads, &Configuration::ALL, |&configuration| {
        planner.members_along(goal, configuration, &rolls_rad)
    });
    let mut families = in_parallel(threads, &Configuration::ALL, |&configuration| {
        planner.family(goal, configuration, &members[configuration.index()])
    });
    // What would work but for the needle's route: no configuration is to go there.
    if let Some(route) = route_rejection(resolved, goal) {
        for member in members.iter_mut().flatten() {
            *member = member.clone().on_route(Some(&route));
        }
        for family in &mut families {
            family.ranges.clear();
        }
    }
    Ok(GoalAtlas {
        rolls_rad,
        aim,
        families,
        members,
    })
}
