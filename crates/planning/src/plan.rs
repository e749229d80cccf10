//! The plan of a goal: for each configuration the best posture to which there is a motion.

use std::cell::OnceCell;
use std::cmp::Ordering;
use std::f64::consts::TAU;

use needlebench_kinematics::ik::{Configuration, wrap_angle};
use needlebench_scenario::{Goal, Roll};

use crate::family::{Member, Merit, Sweep};
use crate::limits::{ByClass, Shortfall};
use crate::margin::SAME_M;
use crate::motion_plan::{ConfigurationPlan, Required, Way};
use crate::planner::{Candidate, Planner};
use crate::{Rejection, route_rejection};

/// All eight configurations of one goal.
#[derive(Debug, Clone, PartialEq)]
pub struct GoalPlan {
    /// The configurations, in the order of [`Configuration::ALL`].
    pub configurations: Vec<ConfigurationPlan>,
}

/// Postures of one configuration for which a motion is tried, best first.
const MOTION_TRIES: usize = 12;
/// Rolls that are looked at to say which ones would be free.
const ROLLS_SAID: u32 = 72;
/// Rolls of each range that are tried where none of the first ones has a motion that keeps the required clearances.
const RANGE_TRIES: u32 = 9;
/// Postures of one configuration for which an alternative path is searched where the straight motion is blocked.
const SEARCH_TRIES: usize = 3;

impl Planner<'_> {
    /// Plans all eight configurations of a goal.
    ///
    /// Motions are planned to a goal whose needle path is refused too: what a configuration could do is worth knowing,
    /// but none works.
    pub fn plan(&self, goal: &Goal) -> GoalPlan {
        let route = route_rejection(self.resolved, goal);
        let plan = |configuration| self.plan_on_route(goal, configuration, route.as_ref());
        GoalPlan {
            configurations: Configuration::ALL.into_iter().map(plan).collect(),
        }
    }

    /// One of [`Planner::plan`].
    pub fn plan_one(&self, goal: &Goal, configuration: Configuration) -> ConfigurationPlan {
        let route = route_rejection(self.resolved, goal);
        self.plan_on_route(goal, configuration, route.as_ref())
    }

    fn plan_on_route(
        &self,
        goal: &Goal,
        configuration: Configuration,
        route: Option<&Rejection>,
    ) -> ConfigurationPlan {
        let mut plan = self.plan_configuration(goal, configuration);
        plan.rejections.splice(0..0, route.cloned());
        if route.is_some() {
            plan.retreat = None;
        }
        plan
    }

    /// For each of the eight configurations the posture that a plan tries first: of those that break no rule the best
    /// by the scenario's `roll_aim`, else the one that comes nearest to working. No motions are looked at. Where the
    /// needle path is refused, all are.
    pub fn postures(&self, goal: &Goal) -> [Member; 8] {
        let route = route_rejection(self.resolved, goal);
        if let Roll::Fixed(roll_rad) = goal.roll {
            let members = self.members_at(goal, roll_rad);
            return members.map(|member| member.on_route(route.as_ref()));
        }
        let rolls = self.rolls(goal, self.planning().roll_samples);
        Configuration::ALL.map(|configuration| {
            let first = self.first(goal, configuration, &rolls);
            first.on_route(route.as_ref())
        })
    }

    /// One of [`Planner::postures`].
    pub fn posture(&self, goal: &Goal, configuration: Configuration) -> Member {
        let member = self.posture_off_route(goal, configuration);
        member.on_route(route_rejection(self.resolved, goal).as_ref())
    }

    /// The same without a look at the needle path, which all configurations share.
    pub fn posture_off_route(&self, goal: &Goal, configuration: Configuration) -> Member {
        if let Roll::Fixed(roll_rad) = goal.roll {
            return self.member_at(goal, configuration, roll_rad);
        }
        let rolls = self.rolls(goal, self.planning().roll_samples);
        self.first(goal, configuration, &rolls)
    }

    /// Of postures of a configuration at these rolls the best for the scenario's `roll_aim` that violates no rule;
    /// where all break one, the first that there is. Nothing between the rolls is looked at, and the needle path
    /// neither: it is for asking many goals.
    pub fn best_of_rolls(
        &self,
        goal: &Goal,
        configuration: Configuration,
        rolls_rad: &[f64],
    ) -> Member {
        let aim = self.planning().roll_aim;
        let mut sweep = Sweep::new(self, goal, configuration);
        let mut best: Option<(Merit, f64)> = None;
        for &roll_rad in rolls_rad {
            let seen = sweep.glance(aim, roll_rad);
            if !seen.works {
                continue;
            }
            let merit = seen.merit;
            if best.is_none_or(|(other, _)| merit.better_first(&other) == Ordering::Less) {
                best = Some((merit, roll_rad));
            }
        }
        if let Some((_, roll_rad)) = best {
            return sweep.member(roll_rad);
        }
        let reached = rolls_rad.iter().find(|&&roll_rad| sweep.reaches(roll_rad));
        sweep.member(*reached.or(rolls_rad.first()).unwrap_or(&0.0))
    }

    fn first(&self, goal: &Goal, configuration: Configuration, rolls_rad: &[f64]) -> Member {
        let aim = self.planning().roll_aim;
        let mut member = self.best_member(goal, configuration, rolls_rad, aim);
        self.say_what_frees(goal, configuration, &mut member.rejections);
        member
    }

    /// Feasible members, the best first.
    fn ranked(&self, goal: &Goal, configuration: Configuration, grid: &[Member]) -> Vec<Member> {
        let aim = self.planning().roll_aim;
        // The best of each range that works, then the rest of what works.
        let family = self.family_for(goal, configuration, grid, &[aim]);
        let best = family.ranges.into_iter();
        let best = best.map(|range| range.best_for(aim).member.clone());
        let of_grid = grid.iter().filter(|member| member.works()).cloned();
        // Equal ones stay in the order of roll.
        let rated = best.chain(of_grid).filter_map(|member| {
            let merit = self.merit(goal, aim, member.candidate.as_ref()?);
            Some((merit, member))
        });
        let mut rated: Vec<(Merit, Member)> = rated.collect();
        rated.sort_by(|(a, _), (b, _)| a.better_first(b));
        rated.into_iter().map(|(_, member)| member).collect()
    }

    fn plan_configuration(&self, goal: &Goal, configuration: Configuration) -> ConfigurationPlan {
        let rolls = self.rolls(goal, self.planning().roll_samples);
        let first = if let Roll::Fixed(roll_rad) = goal.roll {
            self.member_at(goal, configuration, roll_rad)
        } else {
            self.best_member(goal, configuration, &rolls, self.planning().roll_aim)
        };
        let some_work = first.works();
        let Some(candidate) = first.candidate else {
            let mut rejections = first.rejections;
            self.say_what_frees(goal, configuration, &mut rejections);
            return ConfigurationPlan {
                rejections,
                ..ConfigurationPlan::nothing(configuration)
            };
        };
        // Mostly the first one has a motion that keeps all, and no other is asked for.
        let grid = OnceCell::new();
        let grid = || grid.get_or_init(|| self.members_along(goal, configuration, &rolls));
        let best = (candidate, first.rejections);
        let candidates = std::iter::once(best.clone()).chain(
            std::iter::once_with(|| {
                let ranked = match goal.roll {
                    Roll::Fixed(_) => Vec::new(),
                    Roll::Free => self.ranked(goal, configuration, grid()),
                };
                let ranked = ranked
                    .into_iter()
                    .filter_map(|member| Some((member.candidate?, member.rejections)));
                let all = std::iter::once(best.clone()).chain(ranked).collect();
                spread_over_rolls(all).into_iter().skip(1)
            })
            .flatten(),
        );
        let mut checks_left = u64::from(self.planning().motion_checks);
        let (plan, is_settled) = self.best_motion(
            goal,
            configuration,
            candidates.take(MOTION_TRIES),
            &mut checks_left,
        );
        if is_settled || !some_work || matches!(goal.roll, Roll::Fixed(_)) {
            return plan;
        }
        // None of the first rolls has a motion that keeps what is judged: more of each range.
        let more = self.within_ranges(goal, configuration, grid());
        if more.is_empty() {
            return plan;
        }
        let (other, _) = self.best_motion(goal, configuration, more.into_iter(), &mut checks_left);
        let rank = |plan: &ConfigurationPlan| {
            let works = plan.rejections.is_empty();
            let kept = plan.certificate.as_ref();
            let kept = kept.map(|each| self.limits().shortfall(&ByClass::proven(each)));
            (works, kept)
        };
        // What does not work either says no more than the first, for which most was looked at.
        if other.rejections.is_empty() && rank(&other) > rank(&plan) {
            other
        } else {
            plan
        }
    }

    /// Members at even rolls within each range of a configuration, those first that keep the required clearances and
    /// are best for the aim.
    fn within_ranges(
        &self,
        goal: &Goal,
        configuration: Configuration,
        grid: &[Member],
    ) -> Vec<(Candidate, Vec<Rejection>)> {
        let aim = self.planning().roll_aim;
        let mut rated: Vec<(Merit, Candidate)> = self
            .family_for(goal, configuration, grid, &[aim])
            .ranges
            .iter()
            .flat_map(|range| {
                let steps = f64::from(RANGE_TRIES);
                (0..RANGE_TRIES)
                    .map(move |k| range.from_rad + range.width_rad() * (f64::from(k) + 0.5) / steps)
            })
            .filter_map(|roll_rad| {
                let member = self.member_at(goal, configuration, roll_rad.rem_euclid(TAU));
                let works = member.works();
                let candidate = member.candidate.filter(|_| works)?;
                Some((self.merit(goal, aim, &candidate), candidate))
            })
            .collect();
        // The reserve is not fought for here: it led to where there is no motion.
        rated.sort_by(|(a, _), (b, _)| {
            let judged = b.shortfall.judged_m.total_cmp(&a.shortfall.judged_m);
            judged.then(b.value.total_cmp(&a.value))
        });
        let all = rated.into_iter();
        all.map(|(_, candidate)| (candidate, Vec::new())).collect()
    }

    /// The best motion to one of some postures, tried in their order, and whether it keeps all that will be evaluated:
    /// if not, other postures may.
    fn best_motion(
        &self,
        goal: &Goal,
        configuration: Configuration,
        candidates: impl Iterator<Item = (Candidate, Vec<Rejection>)>,
        checks_left: &mut u64,
    ) -> (ConfigurationPlan, bool) {
        let limits = self.limits();
        let mut tried: Vec<(Required, Way)> = Vec::new();
        let mut without_line = None;
        for (candidate, mut rejections) in candidates {
            // The best posture breaks a rule, so all do: one motion shows what would happen.
            let hopeless = !rejections.is_empty();
            self.say_what_frees(goal, configuration, &mut rejections);
            let posture = ByClass::of_posture(&candidate.clearance);
            let required = match self.required(goal, configuration, candidate, rejections) {
                Ok(required) => required,
                Err(plan) => {
                    if hopeless {
                        return (*plan, false);
                    }
                    without_line.get_or_insert(plan);
                    continue;
                }
            };
            let straight = self.straight(&required);
            if hopeless {
                let known = straight.clone();
                let (way, search) =
                    self.improved(goal, configuration, &required, straight, checks_left);
                let plan = self.planned(configuration, &required, way, &known, search);
                return (plan, false);
            }
            // What this posture could keep at best, and what comes of it.
            let possible = limits.shortfall(&posture.least(self.start_clearance()));
            let comes = limits.shortfall(&required.achieved(&straight));
            if self.is_free(&required.achieved(&straight)) && comes.reaches(&possible, SAME_M) {
                let known = straight.clone();
                let (way, search) =
                    self.improved(goal, configuration, &required, straight, checks_left);
                let plan = self.planned(configuration, &required, way, &known, search);
                return (plan, comes.judged_m >= -SAME_M);
            }
            tried.push((required, straight));
        }
        // No straight way keeps what its posture does: ways around are searched for those that may keep
        // most.
        tried.sort_by(|(a, _), (b, _)| {
            let possible = |required: &Required| limits.shortfall(&required.attainable());
            let (a, b) = (possible(a), possible(b));
            b.partial_cmp(&a).unwrap_or(Ordering::Equal)
        });
        let mut best: Option<(bool, Shortfall, ConfigurationPlan)> = None;
        for (required, straight) in tried.into_iter().take(SEARCH_TRIES) {
            let possible = limits.shortfall(&required.attainable());
            let known = straight.clone();
            let (way, search) =
                self.improved(goal, configuration, &required, straight, checks_left);
            let achieved = required.achieved(&way);
            let (is_free, comes) = (self.is_free(&achieved), limits.shortfall(&achieved));
            let plan = self.planned(configuration, &required, way, &known, search);
            if is_free && comes.reaches(&possible, SAME_M) {
                return (plan, comes.judged_m >= -SAME_M);
            }
            let is_better = best
                .as_ref()
                .is_none_or(|(free, known, _)| (is_free, comes) > (*free, *known));
            if is_better {
                best = Some((is_free, comes, plan));
            }
        }
        best.map(|(is_free, comes, plan)| (plan, is_free && comes.judged_m >= -SAME_M))
            .or(without_line.map(|plan| (*plan, false)))
            .expect("there is at least one candidate")
    }

    /// Adds to the first rule that a posture violates, the decisive one, whether other rolls violate rules too and
    /// what else may make the configuration feasible.
    fn say_what_frees(
        &self,
        goal: &Goal,
        configuration: Configuration,
        rejections: &mut [Rejection],
    ) {
        let Some(first) = rejections.first_mut() else {
            return;
        };
        let Some(others) = first.rule.remedy() else {
            return;
        };
        first.detail = match goal.roll {
            Roll::Free => {
                let detail = &first.detail;
                format!("{detail}; no other roll angle is better; try {others}")
            }
            Roll::Fixed(roll_rad) => {
                let fixed = format!("roll fixed at {} by the goal", degrees(roll_rad));
                let free = self.free_rolls(goal, configuration);
                if free.is_empty() {
                    format!(
                        "{}; {fixed}, no other roll angle is feasible; try {others}",
                        first.detail
                    )
                } else {
                    format!("{}; {fixed}, posture feasible at {free}", first.detail)
                }
            }
        };
    }

    /// Ranges of roll in which a configuration's postures violate no rule, in words; empty if there are none.
    fn free_rolls(&self, goal: &Goal, configuration: Configuration) -> String {
        let rolls: Vec<f64> = (0..ROLLS_SAID)
            .map(|k| TAU * f64::from(k) / f64::from(ROLLS_SAID))
            .collect();
        let grid = self.members_along(goal, configuration, &rolls);
        let family = self.family_for(goal, configuration, &grid, &[]);
        let ranges = family.ranges.iter().map(|range| {
            if range.is_whole_circle {
                "any other roll angle".to_owned()
            } else {
                let [from, to] = [range.from_rad, range.to_rad].map(degrees);
                format!("roll {from} to {to}")
            }
        });
        ranges.collect::<Vec<_>>().join(" and ")
    }

    /// Nothing is below its floor.
    fn is_free(&self, clearance: &ByClass) -> bool {
        clearance.most_below(&self.limits().floors()) <= 0.0
    }
}

/// An angle in whole degrees, for people.
fn degrees(angle_rad: f64) -> String {
    // Not "-0".
    format!("{:.0} deg", angle_rad.to_degrees().round() + 0.0)
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
