//! Families: a configuration at every angle of the guide about the needle.
//!
//! Turning the guide about the needle changes nothing for the needle, so each of the eight
//! configurations is a one-parameter family of postures. Its members are looked at one by one, on a
//! grid of rolls; between the grid's rolls the edges of the feasible ranges are bisected and the best
//! member is searched for.
//!
//! # What a sweep can miss
//!
//! A member is feasible where its constraint margin, [`surplus`](Member::surplus), is not negative. The constraint
//! margin is a continuous function of roll as long as the branch exists, so between a feasible and an infeasible roll
//! there is an edge, and bisection finds it. A range, or a gap, that begins and ends between two neighbouring rolls of
//! the grid shows only as a local maximum or minimum of the constraint margin; where a parabola through the three rolls
//! next to one comes near to zero, it is searched for. One that is narrower still and steeper than that is missed: a
//! finer grid finds it.

mod aim;
mod ranges;

use std::cell::OnceCell;

use needlebench_cell::ClearanceClass;
use needlebench_clearance::{AIMS, Counts, Couple, Held, Nearby};
use needlebench_kinematics::ik::{Configuration, Solution, Solutions, wrap_angle};
use needlebench_scenario::Goal;

pub use aim::Aim;
use aim::{BALANCED, Valued, balanced_group};
pub use ranges::{Best, EDGE_RAD, Edge, Family, RollRange};

use crate::Rejection;
use crate::limits::{ByClass, CLASS_COUNT, Shortfall};
use crate::planner::{Candidate, Planner, PostureMargins, absent};
use needlebench_cell::Rule;

/// One configuration at one angle of the guide about the needle.
#[derive(Debug, Clone, PartialEq)]
pub struct Member {
    /// Angle of the guide about the needle, rad.
    pub roll_rad: f64,
    /// The posture; `None` where the configuration does not reach the pose.
    pub candidate: Option<Candidate>,
    /// Rules that the posture violates, first failing one first; empty if it is feasible.
    pub rejections: Vec<Rejection>,
    /// Constraint margin: distance from violating a rule, or by how much the worst one is violated (negative): metres
    /// for clearances and reach, a tenth of a metre per unit for sines and radians.
    pub surplus: f64,
}

/// How good a posture is among those that break no rule; the order is that of preference.
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd)]
pub struct Merit {
    /// Of clearances, and of distances from singularities in its reserve.
    pub shortfall: Shortfall,
    /// Value for the aim.
    pub value: f64,
}

impl Merit {
    /// Less than any other.
    const NONE: Self = Self {
        shortfall: Shortfall {
            judged_m: f64::NEG_INFINITY,
            reserve_m: f64::NEG_INFINITY,
        },
        value: f64::NEG_INFINITY,
    };

    /// The better one first.
    pub(crate) fn better_first(&self, other: &Self) -> std::cmp::Ordering {
        other
            .shortfall
            .judged_m
            .total_cmp(&self.shortfall.judged_m)
            .then(
                other
                    .shortfall
                    .reserve_m
                    .total_cmp(&self.shortfall.reserve_m),
            )
            .then(other.value.total_cmp(&self.value))
    }
}

/// Metres that a unit of a sine or a radian counts in a [`Member::surplus`]: about the lever of the
/// wrist.
const METRES_PER_UNIT: f64 = 0.1;

/// Constraint margin of a configuration that is the same posture as another: it is at most at single rolls.
const MERGED_SURPLUS: f64 = -1e-12;

impl Member {
    /// The posture violates no rule.
    pub fn works(&self) -> bool {
        self.rejections.is_empty()
    }

    /// The same where the needle path is rejected: the first rule that it violates.
    #[must_use]
    pub fn on_route(mut self, refused: Option<&Rejection>) -> Self {
        if let Some(route) = refused {
            self.surplus = self.surplus.min(route.value - route.limit);
            self.rejections.insert(0, route.clone());
        }
        self
    }
}

/// What the choice of a roll needs to know of a member.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Glance {
    /// The configuration reaches the pose.
    pub exists: bool,
    /// It violates no rule.
    pub works: bool,
    /// [`Member::surplus`] of one that exists, as far as it was asked for; else any value below the asked one.
    pub surplus: f64,
    /// The solids whose clearance it is, unless the joints decide it.
    pub decided_by: Option<Couple>,
    /// Of a feasible one whose merit was asked for: by class the solids that are nearest to each other, and how near,
    /// m, where that is nearer than what is wanted.
    nearest: [(f64, Option<Couple>); CLASS_COUNT],
    /// That of none if it does not work.
    pub merit: Merit,
}

/// A configuration at a roll.
#[derive(Debug, Clone)]
pub(crate) struct At {
    roll_rad: f64,
    /// The posture and where it holds the links; none where the configuration does not reach the pose.
    found: Option<(Solution, Held)>,
    /// How far it falls short, m, of one without a posture; found when it is asked for.
    missing_m: OnceCell<f64>,
}

/// The required clearances.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Level {
    /// Not to be rejected.
    Floor,
    /// Not to fail.
    Judged,
    /// All that is planned for.
    Wanted,
}

/// What is asked of a member.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Asked {
    /// Its merit for an aim, of one that violates no rule.
    Merit(Aim),
    /// How far it is from violating a rule if clearances had to keep a level.
    Surplus(Level),
}

impl Asked {
    /// A constraint margin below this is as good as any other.
    fn ends_below_m(self) -> f64 {
        match self {
            Self::Merit(_) => 0.0,
            Self::Surplus(_) => f64::NEG_INFINITY,
        }
    }
}

/// One configuration looked at at one roll after the other: each look is quicker by what the one before
/// has shown, and the answers do not depend on it.
pub(crate) struct Sweep<'p> {
    planner: &'p Planner<'p>,
    goal: &'p Goal,
    configuration: Configuration,
    nearby: Nearby,
    /// What counts for what was asked for last.
    counts: Option<(Asked, Counts)>,
}

impl<'p> Sweep<'p> {
    pub fn new(planner: &'p Planner<'p>, goal: &'p Goal, configuration: Configuration) -> Self {
        Self {
            planner,
            goal,
            configuration,
            nearby: Nearby::default(),
            counts: None,
        }
    }

    /// The member at a roll.
    pub fn member(&mut self, roll_rad: f64) -> Member {
        let pose = self.planner.base_link_from_flange(self.goal, roll_rad);
        let (kinematics, start) = (self.planner.kinematics(), self.planner.start());
        let found = kinematics.branch(&pose, Some(start), self.configuration);
        let Some(solution) = found else {
            // Why it is not there.
            let all = kinematics.branches(&pose, Some(start));
            return missing(roll_rad, self.configuration, &all);
        };
        self.planner.present(roll_rad, &solution, &mut self.nearby)
    }

    /// The configuration at a roll, to be looked at.
    pub(crate) fn at(&self, roll_rad: f64) -> At {
        let model = self.planner.checker.model;
        let found = self.solution(roll_rad);
        At {
            roll_rad,
            found: found.map(|solution| (solution, model.held(&solution.joints))),
            missing_m: OnceCell::new(),
        }
    }

    /// What an aim's choice needs to know of the member at a roll.
    pub(crate) fn glance(&mut self, aim: Aim, roll_rad: f64) -> Glance {
        self.glance_at(aim, &self.at(roll_rad))
    }

    /// The same where the configuration is known.
    pub(crate) fn glance_at(&mut self, aim: Aim, at: &At) -> Glance {
        let asked = Asked::Merit(aim);
        self.look(asked, at, asked.ends_below_m())
    }

    /// Constraint margin of the member at a roll if clearances had to keep a level, and whether it keeps that.
    pub fn keeps_at(&mut self, level: Level, at: &At) -> Glance {
        self.keeps_more_than(f64::NEG_INFINITY, level, at)
    }

    /// The same; a constraint margin below `least` may come out as any other below it.
    pub fn keeps_more_than(&mut self, least: f64, level: Level, at: &At) -> Glance {
        self.look(Asked::Surplus(level), at, least)
    }

    /// What [`Sweep::keeps_at`] says, of a feasible member of which a glance said so: its clearances are known as far
    /// as they fall short of what is wanted.
    pub(crate) fn keeps_by(&self, level: Level, at: &At, glance: &Glance) -> Option<Glance> {
        let (solution, _) = at.found.as_ref().filter(|_| glance.works)?;
        let planner = self.planner;
        let margins = planner.margins(&solution.joints);
        let mut surplus = planner.surplus_of_joints(&margins, &[]);
        let mut decided_by = None;
        let floor_m = planner.counts(Asked::Surplus(level)).floor_m;
        for ((nearest_m, couple), floor_m) in glance.nearest.iter().zip(floor_m) {
            let excess_m = nearest_m - floor_m;
            if floor_m > f64::NEG_INFINITY && excess_m < surplus {
                (surplus, decided_by) = (excess_m, *couple);
            }
        }
        Some(Glance {
            works: surplus >= 0.0,
            surplus,
            decided_by,
            merit: Merit::NONE,
            ..*glance
        })
    }

    /// Whether what keeps a roll from working keeps all from working between it and another: it is broken by
    /// more than the arm moves on the way, of the flange where there is no posture.
    pub(crate) fn excludes(&mut self, from: &At, glance: &Glance, to: &At) -> bool {
        match (&from.found, &to.found) {
            (Some((start, held)), Some((end, held_there))) => {
                let change_m = match glance.decided_by {
                    Some(couple) => {
                        let model = self.planner.checker.model;
                        model.travel_m(couple, held, held_there)
                    }
                    None => METRES_PER_UNIT * (start.joints - end.joints).map(wrap_angle).amax(),
                };
                change_m < -glance.surplus
            }
            (None, None) => {
                let [start, end] =
                    [from, to].map(|at| self.planner.base_link_from_flange(self.goal, at.roll_rad));
                // Of the wrist before the flange, and the joint before that.
                let geometry = &self.planner.kinematics().geometry;
                let reach_m = geometry.d6.abs() + geometry.d5.abs();
                let turn_rad = start.rotation.angle_to(&end.rotation);
                let moved_m = (start.translation.vector - end.translation.vector).norm();
                let missing_m = from
                    .missing_m
                    .get_or_init(|| -self.member(from.roll_rad).surplus);
                moved_m + turn_rad * reach_m < *missing_m
            }
            _ => false,
        }
    }

    /// Constraint margin of the member at a roll, and whether it is feasible.
    pub fn surplus(&mut self, roll_rad: f64) -> (f64, bool) {
        let seen = self.keeps_at(Level::Floor, &self.at(roll_rad));
        if seen.exists {
            (seen.surplus, seen.works)
        } else {
            (self.member(roll_rad).surplus, false)
        }
    }

    fn look(&mut self, asked: Asked, at: &At, ends_below_m: f64) -> Glance {
        let planner = self.planner;
        let nothing_near = [(f64::INFINITY, None); CLASS_COUNT];
        let Some((solution, held)) = &at.found else {
            return Glance {
                exists: false,
                works: false,
                surplus: f64::NEG_INFINITY,
                decided_by: None,
                nearest: nothing_near,
                merit: Merit::NONE,
            };
        };
        let q = &solution.joints;
        let margins = planner.margins(q);
        let broken = planner.joint_rules(solution);
        let mut counts = match &self.counts {
            Some((known, counts)) if *known == asked => *counts,
            _ => {
                let counts = planner.counts(asked);
                self.counts = Some((asked, counts));
                counts
            }
        };
        counts.excess_cap_m = planner.surplus_of_joints(&margins, &broken);
        counts.ends_below_m = ends_below_m;
        let model = planner.checker.model;
        let found = model.what_counts_near(held, &mut self.nearby, &counts);
        let works = broken.is_empty() && found.excess_m >= 0.0;
        let merit = match asked {
            Asked::Surplus(_) => Merit::NONE,
            Asked::Merit(_) if !works => Merit::NONE,
            Asked::Merit(aim) => planner.merit_of(
                self.goal,
                aim,
                &Valued {
                    joints: q,
                    margins: &margins,
                    clearance: &ByClass::of(|class| {
                        let found_m = found.by_class_m[class as usize];
                        match counts.farthest_m(class) {
                            far_m if model.has(class) && far_m > f64::NEG_INFINITY => {
                                found_m.min(far_m)
                            }
                            _ => found_m,
                        }
                    }),
                },
            ),
        };
        Glance {
            exists: true,
            works,
            surplus: found.excess_m,
            decided_by: found.excess_of,
            nearest: match asked {
                Asked::Merit(_) if works => std::array::from_fn(|class| {
                    (found.by_class_m[class], found.couple_of_class[class])
                }),
                _ => nothing_near,
            },
            merit,
        }
    }

    fn solution(&self, roll_rad: f64) -> Option<Solution> {
        let pose = self.planner.base_link_from_flange(self.goal, roll_rad);
        let start = Some(self.planner.start());
        let kinematics = self.planner.kinematics();
        kinematics.branch(&pose, start, self.configuration)
    }

    /// Whether the configuration reaches the pose at a roll.
    pub fn reaches(&self, roll_rad: f64) -> bool {
        self.solution(roll_rad).is_some()
    }

    /// Whether the member at a roll is feasible.
    pub fn works(&mut self, roll_rad: f64) -> bool {
        let found = self.solution(roll_rad);
        found.is_some_and(|solution| self.planner.works(&solution, &mut self.nearby))
    }
}

/// What becomes of a configuration that does not reach its pose.
fn missing(roll_rad: f64, configuration: Configuration, found: &Solutions) -> Member {
    let rejection = absent(configuration, found);
    Member {
        roll_rad,
        candidate: None,
        surplus: if rejection.rule == Rule::Unreachable {
            -rejection.value.max(f64::MIN_POSITIVE)
        } else {
            MERGED_SURPLUS
        },
        rejections: vec![rejection],
    }
}

/// Of members without a posture the one that comes nearest, which says most, with the rule that it violates.
pub(crate) fn nearest_missing(grid: Vec<Member>) -> Member {
    let missing = |member: &Member| {
        let values = member.rejections.iter().map(|rejection| rejection.value);
        values.fold(f64::INFINITY, f64::min)
    };
    grid.into_iter()
        .min_by(|a, b| missing(a).total_cmp(&missing(b)))
        .expect("at least one roll is looked at")
}

impl Planner<'_> {
    /// Up to where clearances count for what is asked. What lies beyond changes nothing: a utility is full there.
    fn counts(&self, asked: Asked) -> Counts {
        const MM: f64 = 1e-3;
        let all = ClearanceClass::ALL;
        let limits = self.limits();
        let level = match asked {
            Asked::Merit(_) => Level::Floor,
            Asked::Surplus(level) => level,
        };
        let counts = Counts {
            class_cap_m: [f64::NEG_INFINITY; CLASS_COUNT],
            aim_of: [None; CLASS_COUNT],
            aim_cap_m: [f64::NEG_INFINITY; AIMS],
            floor_m: all.map(|class| match level {
                Level::Floor => limits.get(class).floor_m,
                Level::Judged => limits.get(class).judged_m,
                Level::Wanted => limits.get(class).wanted_m,
            }),
            excess_cap_m: f64::INFINITY,
            ends_below_m: asked.ends_below_m(),
        };
        let Asked::Merit(aim) = asked else {
            return counts;
        };
        let counts = Counts {
            class_cap_m: all.map(|class| limits.get(class).wanted_m),
            ..counts
        };
        match aim {
            Aim::JointMargin | Aim::Singularity | Aim::TipAccuracy => counts,
            Aim::Clearance => Counts {
                class_cap_m: [f64::INFINITY; CLASS_COUNT],
                ..counts
            },
            Aim::Balanced => Counts {
                aim_of: all.map(balanced_group),
                aim_cap_m: BALANCED.map(|key| {
                    let mut aims = self.ranking_aims().iter();
                    let aim = aims.find(|(known, aim)| *known == key && aim.weight > 0.0);
                    aim.map_or(f64::NEG_INFINITY, |(_, aim)| aim.best.max(aim.worst) * MM)
                }),
                ..counts
            },
        }
    }

    /// All eight configurations at one roll, in the order of [`Configuration::ALL`]: postures only,
    /// no motions.
    pub fn members_at(&self, goal: &Goal, roll_rad: f64) -> [Member; 8] {
        self.members_near(goal, roll_rad, &mut Default::default())
    }

    /// [`Planner::members_at`] of one roll after the other.
    pub(crate) fn members_near(
        &self,
        goal: &Goal,
        roll_rad: f64,
        nearby: &mut [Nearby; 8],
    ) -> [Member; 8] {
        let pose = self.base_link_from_flange(goal, roll_rad);
        let found = self.kinematics().branches(&pose, Some(self.start()));
        Configuration::ALL.map(|configuration| {
            let mut rows = found.solutions.iter();
            match rows.find(|each| each.configuration == configuration) {
                Some(solution) => {
                    self.present(roll_rad, solution, &mut nearby[configuration.index()])
                }
                None => missing(roll_rad, configuration, &found),
            }
        })
    }

    /// One configuration at one roll.
    pub fn member_at(&self, goal: &Goal, configuration: Configuration, roll_rad: f64) -> Member {
        Sweep::new(self, goal, configuration).member(roll_rad)
    }

    /// One configuration at one roll after the other.
    pub fn members_along(
        &self,
        goal: &Goal,
        configuration: Configuration,
        rolls_rad: &[f64],
    ) -> Vec<Member> {
        let mut sweep = Sweep::new(self, goal, configuration);
        let rolls = rolls_rad.iter();
        rolls.map(|&roll_rad| sweep.member(roll_rad)).collect()
    }

    /// A member that has a posture.
    fn present(&self, roll_rad: f64, solution: &Solution, nearby: &mut Nearby) -> Member {
        let (candidate, rejections) = self.candidate(roll_rad, solution, nearby);
        Member {
            roll_rad,
            surplus: self.surplus(&candidate, &rejections),
            candidate: Some(candidate),
            rejections,
        }
    }

    /// Distances from the rules about singularities, m.
    fn singular_surplus_m(&self, margins: &PostureMargins) -> [f64; 3] {
        let planning = self.planning();
        let sine = |sine: f64| METRES_PER_UNIT * (sine - planning.min_singularity_sine);
        [
            sine(margins.wrist_sine),
            sine(margins.elbow_sine),
            margins.shoulder_m - planning.min_shoulder_distance_mm * 1e-3,
        ]
    }

    /// How good a posture is: first how little it falls short of the clearances that will be evaluated, then of the
    /// reserve, from singularities too, and then by the aim. The order is that of preference.
    pub fn merit(&self, goal: &Goal, aim: Aim, candidate: &Candidate) -> Merit {
        let posture = Valued {
            joints: &candidate.joints,
            margins: &candidate.margins,
            clearance: &ByClass::of_posture(&candidate.clearance),
        };
        self.merit_of(goal, aim, &posture)
    }

    fn merit_of(&self, goal: &Goal, aim: Aim, posture: &Valued<'_>) -> Merit {
        let mut shortfall = self.limits().shortfall(posture.clearance);
        let reserve_m = self.planning().clearance_reserve_mm * 1e-3;
        shortfall.reserve_m += self
            .singular_surplus_m(posture.margins)
            .iter()
            .map(|surplus_m| (surplus_m - reserve_m).min(0.0))
            .sum::<f64>();
        Merit {
            shortfall,
            value: self.value_of(goal, aim, posture),
        }
    }

    /// Least distance of a posture from violating a rule.
    ///
    /// Of `rejections` those for its joint limits and for what it misses count: the others say what
    /// the candidate's own numbers say.
    pub fn surplus(&self, candidate: &Candidate, rejections: &[Rejection]) -> f64 {
        let clearances = candidate
            .clearance
            .iter()
            .map(|pair| pair.separation.distance_m - self.limits().get(pair.class).floor_m);
        clearances.fold(
            self.surplus_of_joints(&candidate.margins, rejections),
            f64::min,
        )
    }

    /// The same without clearances.
    pub fn surplus_of_joints(&self, margins: &PostureMargins, rejections: &[Rejection]) -> f64 {
        let others = rejections
            .iter()
            .filter_map(|rejection| match rejection.rule {
                Rule::JointLimit => {
                    Some(-METRES_PER_UNIT * (rejection.value - rejection.limit).abs())
                }
                Rule::NearestOnly => Some(rejection.limit - rejection.value),
                _ => None,
            });
        let singular = self.singular_surplus_m(margins).into_iter();
        singular.chain(others).fold(f64::INFINITY, f64::min)
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;
    use std::path::Path;

    use needlebench_clearance::ClearanceModel;
    use needlebench_numerics::random::SplitMix64;
    use needlebench_scenario::{Overrides, load_scenario};

    use super::*;

    #[test]
    fn a_sweep_sees_what_each_member_is_alone() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios");
        let (mut working, mut seen) = (0, 0);
        for name in ["supine_suite.toml", "studies/chest.toml"] {
            let resolved = load_scenario(&folder.join(name), &Overrides::default()).unwrap();
            let model = ClearanceModel::new(&resolved.cell);
            let planner = Planner::new(&resolved, &model).unwrap();
            let mut random = SplitMix64::new(4);
            for goal in &resolved.goals {
                for configuration in Configuration::ALL {
                    let mut sweep = Sweep::new(&planner, goal, configuration);
                    let mut roll_rad: f64 = 1.0;
                    for step_rad in [1.0, 0.3, 0.1, 0.03, 0.01, 1e-3, 1e-4, 1.0, 1e-3, 0.02] {
                        roll_rad = (roll_rad + random.uniform(-step_rad, step_rad)).rem_euclid(TAU);
                        let alone = planner.member_at(goal, configuration, roll_rad);
                        assert_eq!(sweep.works(roll_rad), alone.works());
                        assert_eq!(sweep.surplus(roll_rad), (alone.surplus, alone.works()));
                        for least in [-0.05, -0.002, 0.0] {
                            let at = sweep.at(roll_rad);
                            let seen = sweep.keeps_more_than(least, Level::Floor, &at);
                            if alone.candidate.is_some() && alone.surplus >= least {
                                assert_eq!(seen.surplus, alone.surplus);
                            } else {
                                assert!(seen.surplus < least);
                            }
                        }
                        // Values need the least of each group alone.
                        for aim in Aim::ALL {
                            let merit = match &alone.candidate {
                                Some(candidate) if alone.works() => {
                                    planner.merit(goal, aim, candidate)
                                }
                                _ => Merit::NONE,
                            };
                            let glance = sweep.glance(aim, roll_rad);
                            assert_eq!(glance.merit, merit, "{aim:?}");
                            assert_eq!(glance.works, alone.works());
                            assert_eq!(glance.exists, alone.candidate.is_some());
                            assert!(
                                !glance.exists || (glance.surplus < 0.0) == (alone.surplus < 0.0)
                            );
                        }
                        assert_eq!(sweep.member(roll_rad), alone);
                        working += usize::from(alone.works());
                        seen += 1;
                    }
                }
            }
        }
        assert!(working > seen / 40 && working < seen, "{working} of {seen}");
    }
}
