//! Routes and the robot together.

use std::cmp::Ordering;

use needlebench_clearance::ClearanceModel;
use needlebench_engine::Servo;
use needlebench_evaluation::judge_posture;
use needlebench_evaluation::report::ConfigurationReport;
use needlebench_evaluation::room::RoomModel;
use needlebench_kinematics::ik::Configuration;
use needlebench_parallel::{Control, in_parallel};
use needlebench_planning::{Candidate, Member, Merit, Planner, judge_route};
use needlebench_routing::{Obstacle, Route, RouteRules};
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

    /// A route with its goal in the cell; the robot was not checked yet.
    fn placed(task: &RouteTask<'_>, placer: &GoalPlacer<'_>, rounded: &Rounded) -> Self {
        let mut asked = Self::without_robot(rounded.clone());
        match placer.place(&task.section_at(rounded.direction_deg)) {
            Ok(goal) => asked.goal = Some(goal),
            Err(finding) => asked.blocked = Some(finding.message),
        }
        asked
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
        preferred(works, |each| each.value)
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

/// The one of most value; of equal ones the first.
fn preferred<T>(all: impl Iterator<Item = T>, value: impl Fn(&T) -> Option<Merit>) -> Option<T> {
    all.reduce(|best, each| {
        if value(&each).partial_cmp(&value(&best)) == Some(Ordering::Greater) {
            each
        } else {
            best
        }
    })
}

/// Checks the robot of a scenario for all needle paths at once, and the room that it leaves about each entry.
pub(super) fn ask(
    task: &RouteTask<'_>,
    rules: &RouteRules,
    routes: &[Rounded],
    control: &Control<'_>,
) -> Result<Vec<Asked>, SuggestError> {
    let placer = GoalPlacer::new(task.resolved);
    let mut asked: Vec<Asked> = routes
        .iter()
        .map(|rounded| Asked::placed(task, &placer, rounded))
        .collect();
    let mut resolved = task.resolved.clone();
    resolved.goals = asked.iter().filter_map(|each| each.goal.clone()).collect();
    let model = ClearanceModel::new(&resolved.cell);
    let robot = Robot::new(&resolved, &model, rules)?;
    let room = RoomModel::new(&resolved);
    let mut numbers = 0..resolved.goals.len();
    let numbered: Vec<(&Asked, Option<usize>)> = asked
        .iter()
        .map(|each| (each, each.goal.as_ref().and_then(|_| numbers.next())))
        .collect();
    control.progress.message("configurations");
    control.progress.expect(resolved.goals.len() as u64);
    let answers = in_parallel(control.threads, &numbered, |(each, number)| {
        let answer = || {
            let mut answer = robot.held(each);
            if let Some(number) = *number {
                for served in answer.iter_mut().filter(|served| served.works()) {
                    served.room = served.candidate.as_ref().map(|candidate| {
                        let taken = room.taken(number, &candidate.joints);
                        room.sector(number).free_fraction(&taken)
                    });
                }
                control.progress.step();
            }
            robot.measure(each, &mut answer);
            answer
        };
        (!control.is_cancelled()).then(answer)
    });
    for (each, answer) in asked.iter_mut().zip(answers) {
        each.configurations = answer.ok_or(SuggestError::Interrupted)?;
    }
    Ok(asked)
}

/// The best needle path that is feasible in as many configurations as wanted; of equal ones the first.
///
/// `routes` are in the order of `better_first`, by what the needle alone has to spare. The robot leaves no more than that,
/// and no more than clearances in excess of the required ones, which are known before any error is: only what could be
/// better than the best path so far is checked further.
pub(super) fn best_asked(
    task: &RouteTask<'_>,
    rules: &RouteRules,
    routes: &[Rounded],
    control: &Control<'_>,
    better_first: impl Fn((&Route, f64), (&Route, f64)) -> Ordering,
) -> Result<Option<Asked>, SuggestError> {
    let placer = GoalPlacer::new(task.resolved);
    let model = ClearanceModel::new(&task.resolved.cell);
    let robot = Robot::new(task.resolved, &model, rules)?;
    let mut best: Option<Asked> = None;
    for rounded in routes {
        if control.is_cancelled() {
            return Err(SuggestError::Interrupted);
        }
        let is_beaten = |spare_m: f64| {
            best.as_ref().is_some_and(|best| {
                let best = (&best.rounded.route, best.spare_m());
                better_first(best, (&rounded.route, spare_m)).is_le()
            })
        };
        if is_beaten(rounded.route.spare_m) {
            break;
        }
        let mut each = Asked::placed(task, &placer, rounded);
        let mut answer = robot.held(&each);
        let most_spare_m = answer
            .iter()
            .filter(|served| served.works())
            .map(|served| served.clear_spare_m.min(rounded.route.spare_m))
            .fold(f64::NEG_INFINITY, f64::max);
        if is_beaten(most_spare_m) {
            continue;
        }
        robot.measure_until(&each, &mut answer, task.wanted());
        each.configurations = answer;
        if each.working() >= task.wanted() && !is_beaten(each.spare_m()) {
            best = Some(each);
        }
    }
    if let Some(best) = &mut best {
        let mut answer = std::mem::take(&mut best.configurations);
        robot.measure(best, &mut answer);
        best.configurations = answer;
    }
    Ok(best)
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
    planner: Planner<'a>,
    servo: Servo,
    rules: &'a RouteRules,
}

impl<'a> Robot<'a> {
    fn new(
        resolved: &'a ResolvedScenario,
        model: &'a ClearanceModel,
        rules: &'a RouteRules,
    ) -> Result<Self, SuggestError> {
        let planner = Planner::new(resolved, model).map_err(|error| {
            SuggestError::refused(error.to_string(), "only UR arms can be checked")
        })?;
        Ok(Self {
            resolved,
            planner,
            servo: servo_of(resolved),
            rules,
        })
    }

    /// All eight configurations on a route, by clearances alone; none where its goal cannot be.
    fn held(&self, asked: &Asked) -> Vec<Served> {
        let Some(goal) = &asked.goal else {
            return Vec::new();
        };
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
                served
            })
            .collect()
    }

    /// Expected errors of those configurations that are feasible, and what they leave of the margins.
    fn measure(&self, asked: &Asked, answer: &mut [Served]) {
        self.measure_until(asked, answer, usize::MAX);
    }

    /// The same in the order of preference, until as many as wanted are feasible with their errors: the one to choose
    /// is the first of these, whatever the errors of the others are.
    fn measure_until(&self, asked: &Asked, answer: &mut [Served], wanted: usize) {
        let Some(goal) = &asked.goal else {
            return;
        };
        let is_measured = |served: &Served| served.works() && served.spare_m.is_some();
        while answer.iter().filter(|served| is_measured(served)).count() < wanted {
            let unknown = answer
                .iter_mut()
                .filter(|served| served.works() && served.spare_m.is_none());
            let Some(next) = preferred(unknown, |served| served.value) else {
                break;
            };
            self.measure_one(goal, &asked.rounded, next);
        }
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

    /// Expected error, and what it leaves of the margins.
    fn measure_one(&self, goal: &Goal, rounded: &Rounded, served: &mut Served) {
        let Some(candidate) = &served.candidate else {
            return;
        };
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
