//! Routes and the robot together.

use needlebench_clearance::ClearanceModel;
use needlebench_engine::Servo;
use needlebench_evaluation::judge_posture;
use needlebench_evaluation::report::ConfigurationReport;
use needlebench_evaluation::room::RoomModel;
use needlebench_kinematics::ik::Configuration;
use needlebench_parallel::{Control, in_parallel};
use needlebench_planning::{Candidate, Member, Merit, Planner, judge_route};
use needlebench_routing::{Obstacle, RouteRules};
use needlebench_scenario::scenario::GoalSection;
use needlebench_scenario::{Goal, GoalPlacer, ResolvedScenario};
use needlebench_uncertainty::budget::{BudgetCase, Moments, analytic_total};
use needlebench_uncertainty::servo_of;
use serde::Serialize;

use super::{Rounded, RouteTask};
use crate::proposal::SuggestError;

/// Directions about the needle that are looked at for each configuration.
pub(super) const ROLLS: u32 = 12;

/// What the robot makes of a route.
#[derive(Debug, Clone)]
pub(super) struct Asked {
    pub rounded: Rounded,
    /// Why the goal cannot be there; none if it can, or was not checked.
    pub blocked: Option<String>,
    /// The goal in the cell; none if it is blocked or was not checked.
    pub goal: Option<Goal>,
    /// All eight, if the robot was asked.
    pub configurations: Vec<Served>,
}

/// One configuration on a route.
#[derive(Debug, Clone)]
pub(super) struct Served {
    pub configuration: Configuration,
    /// The first rule or criterion that it violates; none if it is feasible.
    pub reason: Option<String>,
    /// The best posture: of the feasible ones, if there are any.
    pub candidate: Option<Candidate>,
    /// How good it is by the scenario's aim.
    pub value: Option<Merit>,
    /// Least clearance of arm and tool from what stands around, m; none where nothing does.
    pub clearance_m: Option<f64>,
    /// Such clearances in excess of the required ones, m; infinite where there are none.
    pub clear_spare_m: f64,
    /// Expected error, if the scenario expects one.
    pub error: Option<AxisError>,
    /// What is left of each margin with this error, m; infinite where nothing is near.
    pub spare_m: Option<[f64; 3]>,
    /// Share of the space about the entry that is free.
    pub room: Option<f64>,
}

impl Served {
    pub fn works(&self) -> bool {
        self.reason.is_none()
    }

    pub(crate) fn least_spare_m(&self) -> f64 {
        let spare = self.spare_m.into_iter().flatten();
        spare.fold(f64::INFINITY, f64::min)
    }
}

impl Asked {
    pub(crate) fn without_robot(rounded: Rounded) -> Self {
        Self {
            rounded,
            blocked: None,
            goal: None,
            configurations: Vec::new(),
        }
    }

    pub fn working(&self) -> usize {
        self.configurations
            .iter()
            .filter(|each| each.works())
            .count()
    }

    /// The configuration to choose: of the feasible ones the best by the scenario's aim.
    pub fn best(&self) -> Option<&Served> {
        let works = self.configurations.iter().filter(|each| each.works());
        works.fold(None, |best: Option<&Served>, each| match best {
            Some(best)
                if each.value.partial_cmp(&best.value) != Some(std::cmp::Ordering::Greater) =>
            {
                Some(best)
            }
            _ => Some(each),
        })
    }

    /// What is left: of the needle's margins, with the error of the configuration to choose, and of that
    /// configuration's clearances; the least of them.
    pub fn spare_m(&self) -> f64 {
        let needle_m = self.rounded.route.spare_m;
        match self.best() {
            Some(best) => best.least_spare_m().min(best.clear_spare_m).min(needle_m),
            None => needle_m,
        }
    }
}

/// Checks the robot of a scenario for all needle paths at once.
pub(super) fn ask(
    task: &RouteTask<'_>,
    rules: &RouteRules,
    routes: &[Rounded],
    control: &Control<'_>,
) -> Result<Vec<Asked>, SuggestError> {
    with_robot(task, rules, routes, |robot, mut placed| {
        control.progress.message("configurations");
        control.progress.expect(robot.resolved.goals.len() as u64);
        let answers = in_parallel(control.threads, &placed, |each| {
            let answer = (!control.is_cancelled()).then(|| robot.answer(each));
            if each.goal.is_some() {
                control.progress.step();
            }
            answer
        });
        for (each, answer) in placed.iter_mut().zip(answers) {
            each.asked.configurations = answer.ok_or(SuggestError::Interrupted)?;
        }
        Ok(placed.into_iter().map(|each| each.asked).collect())
    })
}

/// Checks the robot for one needle path after the other, from the first on, until `enough` says that the next one need
/// not be checked; returns those that were checked.
pub(super) fn ask_until(
    task: &RouteTask<'_>,
    rules: &RouteRules,
    routes: &[Rounded],
    control: &Control<'_>,
    enough: impl Fn(&[Asked], &Rounded) -> bool,
) -> Result<Vec<Asked>, SuggestError> {
    with_robot(task, rules, routes, |robot, placed| {
        let mut asked: Vec<Asked> = Vec::new();
        for mut each in placed {
            if control.is_cancelled() {
                return Err(SuggestError::Interrupted);
            }
            if enough(&asked, &each.asked.rounded) {
                break;
            }
            each.asked.configurations = robot.answer(&each);
            asked.push(each.asked);
        }
        Ok(asked)
    })
}

/// A needle path in the cell, not checked yet.
struct Placed {
    asked: Asked,
    /// Number of its goal in the cell; none if the goal cannot be there.
    goal: Option<usize>,
}

/// A robot that stands by for some routes.
fn with_robot<T>(
    task: &RouteTask<'_>,
    rules: &RouteRules,
    routes: &[Rounded],
    then: impl FnOnce(&Robot<'_>, Vec<Placed>) -> Result<T, SuggestError>,
) -> Result<T, SuggestError> {
    let placer = GoalPlacer::new(task.resolved);
    let mut placed: Vec<Placed> = Vec::with_capacity(routes.len());
    let mut sections: Vec<GoalSection> = Vec::new();
    let mut goals: Vec<Goal> = Vec::new();
    for rounded in routes {
        let section = task.section_at(rounded.direction_deg);
        let mut asked = Asked::without_robot(rounded.clone());
        let mut number = None;
        match placer.place(&section) {
            Ok(goal) => {
                number = Some(goals.len());
                asked.goal = Some(goal.clone());
                sections.push(section);
                goals.push(goal);
            }
            Err(finding) => asked.blocked = Some(finding.message),
        }
        placed.push(Placed {
            asked,
            goal: number,
        });
    }
    let mut resolved = task.resolved.clone();
    resolved.goals = goals;
    resolved.scenario.goals = sections;
    let model = ClearanceModel::new(&resolved.cell);
    let planner = Planner::new(&resolved, &model)
        .map_err(|error| SuggestError::refused(error.to_string(), "only UR arms can be checked"))?;
    let robot = Robot {
        resolved: &resolved,
        planner: &planner,
        room: RoomModel::new(&resolved),
        servo: servo_of(&resolved),
        rules,
    };
    then(&robot, placed)
}

/// The first criterion on clearances that a posture misses, or why one is not evaluated.
fn fault(resolved: &ResolvedScenario, candidate: &Candidate) -> Option<String> {
    let mut posture = ConfigurationReport::new("");
    posture.set_posture_clearances(&candidate.clearance);
    let fault = judge_posture(&posture, &resolved.scenario.criteria)?;
    Some(fault.into_detail().into_owned())
}

/// Whether a posture meets the scenario's criteria on clearances.
pub(super) fn meets_criteria(resolved: &ResolvedScenario, member: &Member) -> bool {
    let candidate = member.candidate.as_ref();
    candidate.is_some_and(|candidate| fault(resolved, candidate).is_none())
}

struct Robot<'a> {
    resolved: &'a ResolvedScenario,
    planner: &'a Planner<'a>,
    room: RoomModel<'a>,
    servo: Servo,
    rules: &'a RouteRules,
}

impl Robot<'_> {
    /// All eight configurations on a route; none where its goal cannot be.
    fn answer(&self, placed: &Placed) -> Vec<Served> {
        placed
            .goal
            .map_or_else(Vec::new, |goal| self.serve(goal, &placed.asked.rounded))
    }

    /// All eight configurations of a goal.
    fn serve(&self, index: usize, rounded: &Rounded) -> Vec<Served> {
        let goal = &self.resolved.goals[index];
        let rolls = self.planner.rolls(goal, ROLLS);
        // The planned patient's own surfaces count, too: `run` holds the needle against them.
        let refused = judge_route(self.resolved, goal).filter(|judged| !judged.is_kept());
        Configuration::ALL
            .into_iter()
            .map(|configuration| {
                let member = self.planner.best_of_rolls(goal, configuration, &rolls);
                let mut served = self.served(goal, configuration, member);
                if served.works() && refused.is_some() {
                    served.reason = Some("needle_route".to_owned());
                }
                if served.works() {
                    self.measure(index, rounded, &mut served);
                }
                served
            })
            .collect()
    }

    /// What a posture is worth. The best one comes nearest to all criteria: where it misses one, all miss one.
    fn served(&self, goal: &Goal, configuration: Configuration, member: Member) -> Served {
        let candidate = member.candidate.as_ref();
        let reason = match member.rejections.first() {
            Some(rejection) => Some(rejection.rule.name().to_owned()),
            None => candidate.and_then(|candidate| fault(self.resolved, candidate)),
        };
        let aim = self.resolved.scenario.planning.roll_aim;
        let limits = self.planner.limits();
        let minima = candidate.into_iter().flat_map(|it| it.clearance.iter());
        let around = minima.filter(|pair| pair.class.is_surroundings());
        let (mut clearance_m, mut clear_spare_m) = (None, f64::INFINITY);
        for pair in around {
            let distance_m = pair.separation.distance_m;
            clearance_m = Some(clearance_m.map_or(distance_m, |least: f64| least.min(distance_m)));
            clear_spare_m = clear_spare_m.min(distance_m - limits.get(pair.class).judged_m);
        }
        Served {
            clear_spare_m,
            configuration,
            value: candidate
                .filter(|_| reason.is_none())
                .map(|candidate| self.planner.merit(goal, aim, candidate)),
            reason,
            clearance_m,
            candidate: member.candidate,
            error: None,
            spare_m: None,
            room: None,
        }
    }

    /// Expected error, what it leaves of the margins, and the room.
    fn measure(&self, index: usize, rounded: &Rounded, served: &mut Served) {
        let Some(candidate) = &served.candidate else {
            return;
        };
        let goal = &self.resolved.goals[index];
        let taken = self.room.taken(index, &candidate.joints);
        served.room = Some(self.room.sector(index).free_fraction(&taken));
        let error = self.error(goal, candidate);
        let (bias_m, sd_m) = match &error {
            Some(Ok(error)) => (error.bias_m, error.sd_m),
            Some(Err(())) => {
                served.reason = Some("expected_error".to_owned());
                return;
            }
            None => (0.0, 0.0),
        };
        served.error = error.and_then(Result::ok);
        let distances_m = rounded.route.distances_m;
        let spare_m = Obstacle::ALL.map(|obstacle| {
            let margin_m = self.rules.margin_m(obstacle, bias_m, sd_m);
            distances_m[obstacle as usize] - margin_m.max(self.rules.margins_m[obstacle as usize])
        });
        served.spare_m = Some(spare_m);
        if served.least_spare_m() < 0.0 {
            served.reason = Some("margin_with_error".to_owned());
        }
    }

    /// The needle's expected error where the arm holds it, at the worse of skin and target: none if the scenario
    /// expects none, an error if it cannot be told.
    fn error(&self, goal: &Goal, candidate: &Candidate) -> Option<Result<AxisError, ()>> {
        let expected = self.resolved.expected.as_ref()?;
        let told = || {
            let trajectory = self.planner.approach(goal, candidate)?;
            let imperfections = &expected.imperfections;
            let case = BudgetCase::of(self.resolved, goal, &self.servo, imperfections, &trajectory);
            analytic_total(&case).ok()
        };
        let moments = told();
        Some(moments.map(|both| AxisError::of(&both)).ok_or(()))
    }
}

/// The RMS lateral error.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct AxisError {
    /// Mean error across it, at the worse of skin and target, m.
    pub bias_m: f64,
    /// Largest standard deviation across it, at the worse of skin and target, m.
    pub sd_m: f64,
    /// Root mean square across it at the target, m.
    pub target_lateral_rms_m: f64,
    /// Root mean square at the target, m.
    pub target_rms_m: f64,
    /// Mean at the target; x and y lateral to the needle, z along it, m.
    pub target_bias_m: [f64; 3],
    /// Covariance at the target in these axes, m^2, row by row.
    pub target_covariance_m2: [[f64; 3]; 3],
}

impl AxisError {
    /// Of the moments at skin and target. In between, the needle being straight, neither is larger.
    pub(super) fn of(both: &[Moments; 2]) -> Self {
        let [skin, target] = both.each_ref().map(|moments| {
            let bias_m = moments.bias().xy().norm();
            let across = moments.covariance().fixed_view::<2, 2>(0, 0).into_owned();
            let largest = across.symmetric_eigenvalues().max().max(0.0);
            (bias_m, largest.sqrt())
        });
        Self {
            bias_m: skin.0.max(target.0),
            sd_m: skin.1.max(target.1),
            target_lateral_rms_m: both[1].lateral_rms_m,
            target_rms_m: both[1].rms_m,
            target_bias_m: both[1].bias_m,
            target_covariance_m2: both[1].covariance_m2,
        }
    }
}
