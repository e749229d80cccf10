//! The plan of a goal: for each configuration the best posture to which there is a motion.

use needlebench_cell::{Goal, Roll};
use needlebench_kinematics::ik::{Configuration, wrap_angle};

use crate::family::Member;
use crate::motion_plan::ConfigurationPlan;
use crate::planner::{Candidate, Planner};
use crate::{Rejection, Rule, route_rejection};
/// All eight configurations of one goal.
#[derive(Debug, Clone, PartialEq)]
pub struct GoalPlan {
    /// The configurations, in the order of [`Configuration::ALL`].
    pub configurations: Vec<ConfigurationPlan>,
}

/// Postures of one configuration for which a motion is tried, best first.
const MOTION_TRIES: usize = 12;
/// Postures of one configuration for which a way around is searched where the straight motion is
/// blocked.
const SEARCH_TRIES: usize = 3;

impl Planner<'_> {
    /// Plans all eight configurations of a goal.
    ///
    /// Motions are planned to a goal whose needle's route is refused too: what a configuration could do is
    /// worth knowing, but none works.
    pub fn plan(&self, goal: &Goal) -> GoalPlan {
        let route = route_rejection(self.resolved, goal);
        let configurations = Configuration::ALL
            .into_iter()
            .zip(self.grids(goal))
            .map(|(configuration, grid)| {
                let mut plan = self.plan_configuration(goal, configuration, grid);
                plan.rejections.splice(0..0, route.clone());
                if route.is_some() {
                    plan.retreat = None;
                }
                plan
            })
            .collect();
        GoalPlan { configurations }
    }

    /// For each of the eight configurations the posture that a plan tries first: of those that break
    /// no rule the best by the scenario's `roll_aim`, else the one that comes nearest to working. No
    /// motions are looked at. Where the needle's route is refused, all are.
    pub fn postures(&self, goal: &Goal) -> [Member; 8] {
        let route = route_rejection(self.resolved, goal);
        if let Roll::Fixed(roll_rad) = goal.roll {
            let members = self.members_at(goal, roll_rad);
            return members.map(|member| member.on_route(route.as_ref()));
        }
        let mut grids = self.grids(goal).into_iter();
        Configuration::ALL.map(|configuration| {
            let grid = grids.next().expect("there are eight");
            let first = self.first(goal, configuration, grid);
            first.on_route(route.as_ref())
        })
    }

    /// One of [`Planner::postures`].
    pub fn posture(&self, goal: &Goal, configuration: Configuration) -> Member {
        let member = if let Roll::Fixed(roll_rad) = goal.roll {
            self.member_at(goal, configuration, roll_rad)
        } else {
            let rolls = self.rolls(goal, self.planning().roll_samples);
            let grid = self.members_along(goal, configuration, &rolls);
            self.first(goal, configuration, grid)
        };
        member.on_route(route_rejection(self.resolved, goal).as_ref())
    }

    fn first(&self, goal: &Goal, configuration: Configuration, grid: Vec<Member>) -> Member {
        let ranked = self.ranked(goal, configuration, &grid);
        ranked.into_iter().next().unwrap_or_else(|| nearest(grid))
    }

    /// All members at the rolls that are looked at, by configuration.
    fn grids(&self, goal: &Goal) -> [Vec<Member>; 8] {
        let rolls = self.rolls(goal, self.planning().roll_samples);
        let mut grids: [Vec<Member>; 8] = std::array::from_fn(|_| Vec::with_capacity(rolls.len()));
        let mut nearby = Default::default();
        for &roll_rad in &rolls {
            let members = self.members_near(goal, roll_rad, &mut nearby);
            for (grid, member) in grids.iter_mut().zip(members) {
                grid.push(member);
            }
        }
        grids
    }

    /// Members with a posture: those that work, best first, or if none does all, nearest to working
    /// first.
    fn ranked(&self, goal: &Goal, configuration: Configuration, grid: &[Member]) -> Vec<Member> {
        let aim = self.planning().roll_aim;
        // The best of each range that works, then the rest of what works.
        let mut members: Vec<Member> = self
            .family_for(goal, configuration, grid, &[aim])
            .ranges
            .into_iter()
            .map(|range| range.best_for(aim).member.clone())
            .collect();
        let some_work = !members.is_empty();
        let of_grid = grid
            .iter()
            .filter(|member| member.candidate.is_some() && (member.works() || !some_work));
        members.extend(of_grid.cloned());
        // Equal ones stay in the order of roll.
        if some_work {
            members.sort_by(|a, b| {
                let value = |member: &Member| {
                    let candidate = member.candidate.as_ref();
                    candidate.map_or(f64::NEG_INFINITY, |each| self.value(goal, aim, each))
                };
                value(b).total_cmp(&value(a))
            });
        } else {
            members.sort_by(|a, b| b.surplus.total_cmp(&a.surplus));
        }
        members
    }

    fn plan_configuration(
        &self,
        goal: &Goal,
        configuration: Configuration,
        grid: Vec<Member>,
    ) -> ConfigurationPlan {
        let members = self.ranked(goal, configuration, &grid);
        let candidates: Vec<(Candidate, Vec<Rejection>)> = members
            .into_iter()
            .filter_map(|member| Some((member.candidate?, member.rejections)))
            .collect();
        if candidates.is_empty() {
            let rejections = nearest(grid).rejections;
            return ConfigurationPlan {
                configuration,
                candidate: None,
                rejections,
                trajectory: None,
                retreat: None,
                search: None,
            };
        }
        let mut best: Option<ConfigurationPlan> = None;
        let mut blocked = Vec::new();
        for (candidate, rejections) in spread_over_rolls(candidates).into_iter().take(MOTION_TRIES)
        {
            // The best posture breaks a rule, so all do: one motion shows what would happen.
            let hopeless = !rejections.is_empty();
            let plan = self.plan_motion(goal, configuration, candidate.clone(), rejections, None);
            if plan.rejections.is_empty() {
                return plan;
            }
            if hopeless {
                return best.unwrap_or(plan);
            }
            blocked.push(candidate);
            let better = best
                .as_ref()
                .is_none_or(|known| plan.trajectory.is_some() && known.trajectory.is_none());
            if better {
                best = Some(plan);
            }
        }
        // No straight motion to any of them: a way around is searched for the best ones.
        let mut checks_left = u64::from(self.planning().motion_checks);
        for candidate in blocked.into_iter().take(SEARCH_TRIES) {
            if checks_left == 0 {
                break;
            }
            let plan = self.plan_motion(
                goal,
                configuration,
                candidate,
                Vec::new(),
                Some(&mut checks_left),
            );
            if plan.rejections.is_empty() {
                return plan;
            }
            let searched = plan.rejections[0].rule == Rule::NoMotion;
            let better = best
                .as_ref()
                .is_none_or(|known| searched && known.rejections[0].rule != Rule::NoMotion);
            if better {
                best = Some(plan);
            }
        }
        best.expect("there is at least one candidate")
    }
}

/// Of members without a posture the one that comes nearest, which says most, with the rule that it
/// breaks.
fn nearest(grid: Vec<Member>) -> Member {
    let missing = |member: &Member| {
        let values = member.rejections.iter().map(|rejection| rejection.value);
        values.fold(f64::INFINITY, f64::min)
    };
    grid.into_iter()
        .min_by(|a, b| missing(a).total_cmp(&missing(b)))
        .expect("at least one roll is looked at")
}

/// Angle between two rolls that count as different for a motion, rad.
const ROLL_SPREAD_RAD: f64 = 0.5;

/// The same candidates, those first that are best within their neighbourhood of rolls: where the
/// motion to one roll collides, that to the next one mostly does too.
fn spread_over_rolls<T>(candidates: Vec<(Candidate, T)>) -> Vec<(Candidate, T)> {
    let mut first: Vec<(Candidate, T)> = Vec::new();
    let mut rest = Vec::new();
    for (candidate, extra) in candidates {
        let apart = |other: &Candidate| wrap_angle(candidate.roll_rad - other.roll_rad).abs();
        if first
            .iter()
            .all(|(other, _)| apart(other) >= ROLL_SPREAD_RAD)
        {
            first.push((candidate, extra));
        } else {
            rest.push((candidate, extra));
        }
    }
    first.extend(rest);
    first
}
