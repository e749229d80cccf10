//! Motions that somebody else planned, judged as a run judges its own.

pub mod answers;
mod course;
pub mod free;
mod peaks;

use std::ops::Range;
use std::sync::atomic::AtomicBool;

use needlebench_cell::{ClearanceClass, rule_in_words};
use needlebench_clearance::{ClearanceModel, MotionCertificate};
use needlebench_evaluation::judged::{
    BesideReport, HoldReport, JudgedReport, LARGEST_MARGIN, OwnPlanReport, SAME_CONFIGURATION,
};
use needlebench_evaluation::report::{
    ConfigurationReport, CriterionResult, Report, Status, Verdict,
};
use needlebench_input::Finding;
use needlebench_kinematics::ik::{Configuration, Kinematics};
use needlebench_kinematics::trajectory::{Between, JointTrajectory, Phase};
use needlebench_parallel::{Control, Progress};
use needlebench_planning::{ClassMargin, ConfigurationPlan, GivenMotion, GoalPlan, Held, Planner};
use needlebench_recorded::MotionFile;
use needlebench_scenario::{Goal, ResolvedScenario};

use crate::plan::Planned;
use crate::run::{judge_rest, leave_open, run_goals};
use crate::scenario_run::{RunError, RunOptions, ScenarioRun};
use crate::setup::SetupError;

use course::Course;
use peaks::{peaks, results};

/// How a motion is judged.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct JudgeOptions {
    /// Name of the goal that it leads to; found by where it stands if left out.
    pub goal: Option<String>,
    /// What joins its points; by what they have if left out.
    pub between: Option<Between>,
    /// It may begin elsewhere than at the scenario's start posture.
    pub any_start: bool,
    /// Needlebench plans to the same goals beside it.
    pub beside: bool,
    /// Where it stands at no goal it is judged by the one that it stands nearest to, and not refused.
    pub nearest: bool,
}

/// Why no verdict is given on a motion.
#[derive(Debug, thiserror::Error)]
pub enum JudgeError {
    /// The motion or the scenario is not fit for it.
    #[error("{0}")]
    Refused(Box<Finding>),
    /// The scenario cannot be run.
    #[error(transparent)]
    Run(#[from] RunError),
}

impl From<Finding> for JudgeError {
    fn from(finding: Finding) -> Self {
        Self::Refused(Box::new(finding))
    }
}

/// A judged motion.
#[derive(Debug)]
pub struct JudgedRun {
    /// The scenario with the goals at which the motion holds, in its order.
    pub resolved: ResolvedScenario,
    /// What came of it, as of a run: of each goal the one configuration in which it is held.
    pub run: ScenarioRun,
}

/// A motion begins at the start posture within this, rad: 1 degree.
const SAME_START_RAD: f64 = 0.017_453_292_519_943_295;

/// A guide is at a goal within this of its place, m, and of its axis, rad (5 degrees).
pub(crate) const AT_GOAL_M: f64 = 0.02;
pub(crate) const AT_GOAL_RAD: f64 = 0.087_266_462_599_716_48;

/// Where a motion holds.
#[derive(Debug)]
struct Hold {
    goal: usize,
    held: Held,
    configuration: Configuration,
    /// The points of its standstill.
    points: Range<usize>,
    /// Those of standstills at the same goal before it, between which the motion is at no other goal.
    earlier: Vec<Range<usize>>,
}

/// Judges a motion: at which goals it holds and in which configuration, how far the guide is off, its clearances
/// (certified along the course between its points, and simulated in the engines), the joints' limits, and all metrics
/// and criteria of a run.
///
/// # Errors
/// [`JudgeError`]. A failing engine is no error: the report says so.
pub fn judge(
    resolved: &ResolvedScenario,
    file: &MotionFile,
    asked: &JudgeOptions,
    options: &RunOptions,
    cancel: &AtomicBool,
    progress: &dyn Progress,
) -> Result<JudgedRun, JudgeError> {
    if resolved.goals.is_empty() {
        let finding = Finding::new(
            &resolved.source.file,
            "the scenario has no goals to judge by",
        );
        return Err(finding
            .key("goals")
            .hint("choose a scenario with [[goals]], or judge the clearances alone with --free")
            .into());
    }
    let course = Course::of(resolved, file, asked.between)?;
    let mut notes = file.notes.clone();
    notes.extend(begin(resolved, &course, asked.any_start)?);
    let model = ClearanceModel::new(&resolved.cell);
    let planner = Planner::new(resolved, &model)
        .map_err(|error| RunError::Setup(SetupError::Robot(error)))?;
    let holds = holds(resolved, &planner, &course, asked)?;
    let parts = parts(resolved, &course, &holds);

    let indices: Vec<usize> = holds.iter().map(|hold| hold.goal).collect();
    let mut judged = resolved.with_goals(&indices);
    // One configuration is judged of each goal, and what it violates is simulated all the same.
    judged.scenario.criteria.min_working_configurations = 1;
    judged.scenario.planning.simulate_rejected = true;
    for goal in &mut judged.goals {
        goal.expected.clear();
    }
    // What follows the hold is certified as planned.
    let mut is_deviation_open = false;
    if let Some(events) = &mut judged.scenario.events {
        is_deviation_open = events.retreat && events.max_retraction_deviation_mm.is_some();
        events.retreat = false;
    }
    judged.notes.extend(notes);

    let engines = options.chosen_engines(&judged).map_err(RunError::from)?;
    let control = Control {
        threads: options.jobs,
        cancel,
        progress,
    };
    let mut run = run_goals(&judged, options, &engines, &control, |setup, _| {
        let plans = parts.iter().zip(&holds).zip(&setup.resolved.goals);
        let plans = plans.map(|((part, hold), goal)| GoalPlan {
            configurations: vec![setup.planner.given(
                goal,
                hold.configuration,
                &hold.held,
                part.motion.clone(),
            )],
        });
        Planned::of(setup, plans.collect())
    })?;

    let mut reports = Vec::new();
    for (index, (hold, part)) in holds.iter().zip(&parts).enumerate() {
        let goal = &judged.goals[index];
        let configuration = &run.report.goals[index].configurations[0];
        let certificate = run.plans[index].configurations[0].certificate.as_ref();
        let plans = match certificate.filter(|_| asked.beside) {
            Some(certificate) => {
                let certificate = certificate.clone().later_by(part.begins_s);
                own_plans(&judged, goal, hold, &certificate, &planner)
            }
            None => Vec::new(),
        };
        reports.push(HoldReport {
            plans,
            ..hold_report(&judged, goal, hold, part, configuration)
        });
    }
    let last = parts.last().map_or(0.0, |part| part.ends_s);
    let report = JudgedReport {
        file: file.source.file.clone(),
        sha256: file.source.sha256.clone(),
        format: file.source.format,
        points: file.source.points,
        has_times: file.times_s.is_some(),
        between: course.between_in_words(),
        duration_s: last,
        holds: reports,
        program: None,
    };
    add_criteria(&mut run.report, &planner, &report);
    run.report.judged = Some(report);
    if is_deviation_open {
        let key = "events.max_retraction_deviation_mm";
        let reason = "what follows the hold is certified as planned, and not simulated";
        leave_open(&mut run.report, &[key], reason);
    }
    judge_rest(&mut run.report, &judged, options, &engines);
    Ok(JudgedRun {
        resolved: judged,
        run,
    })
}

/// Time between two set-points of the arm's controller, s; none where the arm's data do not say it.
pub(crate) fn set_point_period_s(resolved: &ResolvedScenario) -> Option<f64> {
    let used = resolved.robot_description.arm.as_ref()?;
    Some(used.arm.data.control.as_ref()?.period_ms * 1e-3)
}

/// Checks where a motion begins; with a note where that is not the start posture.
fn begin(
    resolved: &ResolvedScenario,
    course: &Course<'_>,
    any_start: bool,
) -> Result<Option<String>, Finding> {
    let off_rad = (course.position(0) - resolved.start).amax();
    if off_rad <= SAME_START_RAD {
        return Ok(None);
    }
    let off = format!(
        "the motion begins {:.1} deg from the scenario's start posture",
        off_rad.to_degrees()
    );
    if any_start {
        return Ok(Some(format!("{off}: the way there is not evaluated")));
    }
    let hint =
        "judge it from where it begins with --start as-is, or set start.joints_deg in the scenario";
    Err(course.finding(0, &off).key("start.joints_deg").hint(hint))
}

/// Where the motion holds: its standstills, and its end, that are at a goal; or the one nearest to the goal that is
/// named.
fn holds(
    resolved: &ResolvedScenario,
    planner: &Planner<'_>,
    course: &Course<'_>,
    asked: &JudgeOptions,
) -> Result<Vec<Hold>, Finding> {
    let named = asked.goal.as_deref();
    let mut places = course.stands.clone();
    if places.last().is_none_or(|stand| stand.end < course.last()) {
        places.push(course.last()..course.last());
    }
    let at = |place: &Range<usize>, goal: usize| {
        let held = planner.held(&resolved.goals[goal], course.position(place.end));
        Hold {
            goal,
            configuration: configuration(planner.kinematics(), &held),
            held,
            points: place.clone(),
            earlier: Vec::new(),
        }
    };
    // How far off in units of what is still at the goal.
    let off = |hold: &Hold| (hold.held.off_m / AT_GOAL_M).max(hold.held.off_rad / AT_GOAL_RAD);
    let goals = match named {
        None => 0..resolved.goals.len(),
        Some(name) => {
            let names = resolved.goals.iter().map(|goal| goal.name.as_str());
            let Some(index) = names.clone().position(|each| each == name) else {
                let message = format!("the scenario has no goal `{name}`");
                let all: Vec<&str> = names.collect();
                let finding = Finding::new(&resolved.source.file, message).key("--goal");
                return Err(finding.hint(format!("there are: {}", all.join(", "))));
            };
            index..index + 1
        }
    };
    let nearest = places.iter().filter_map(|place| {
        let all = goals.clone().map(|goal| at(place, goal));
        all.min_by(|a, b| off(a).total_cmp(&off(b)))
    });
    let nearest: Vec<Hold> = nearest.collect();
    if named.is_some() {
        // Of equal ones the longest, then the last.
        let stands_s =
            |hold: &Hold| course.times_s[hold.points.end] - course.times_s[hold.points.start];
        let best = nearest.into_iter().min_by(|a, b| {
            off(a)
                .total_cmp(&off(b))
                .then(stands_s(b).total_cmp(&stands_s(a)))
        });
        return Ok(best.into_iter().collect());
    }
    let (at_goals, elsewhere): (Vec<Hold>, Vec<Hold>) =
        nearest.into_iter().partition(|hold| off(hold) <= 1.0);
    if at_goals.is_empty() {
        let best = elsewhere
            .into_iter()
            .min_by(|a, b| off(a).total_cmp(&off(b)));
        let best = best.expect("every motion has an end");
        if asked.nearest {
            return Ok(vec![best]);
        }
        let message = format!(
            "the motion stands at no goal: nearest to `{}`, {:.1} mm and {:.1} deg off it (t = {:.3} s)",
            resolved.goals[best.goal].name,
            best.held.off_m * 1e3,
            best.held.off_rad.to_degrees(),
            course.times_s[best.points.end]
        );
        let hint = format!(
            "a guide is at a goal within {:.0} mm and {:.0} deg; judge it by one all the same with --goal NAME, or its clearances \
             alone with --free",
            AT_GOAL_M * 1e3,
            AT_GOAL_RAD.to_degrees()
        );
        return Err(course
            .finding(best.points.end, &message)
            .key("--goal")
            .hint(hint));
    }
    let mut found: Vec<Hold> = Vec::new();
    for mut hold in at_goals {
        if let Some(before) = found.pop_if(|before| before.goal == hold.goal) {
            hold.earlier = before.earlier;
            hold.earlier.push(before.points);
        } else if let Some(before) = found.iter().find(|before| before.goal == hold.goal) {
            let message = format!(
                "the motion comes back to goal `{}`, which it held at {:.3} s, from another (t = {:.3} s)",
                resolved.goals[hold.goal].name,
                course.times_s[before.points.start],
                course.times_s[hold.points.start]
            );
            let hint = "judge what follows by itself: cut the file, or name the goal with --goal";
            return Err(course.finding(hold.points.start, &message).hint(hint));
        }
        found.push(hold);
    }
    Ok(found)
}

/// The configuration that a posture is nearest to; by its signs alone where the goal has no solution.
fn configuration(kinematics: &Kinematics, held: &Held) -> Configuration {
    match &held.nearest {
        Some(nearest) => nearest.solution.configuration,
        None => Configuration::of(&kinematics.geometry, &held.joints),
    }
}

/// The part of a motion that leads to a hold.
#[derive(Debug)]
struct Part {
    motion: GivenMotion,
    /// In the motion, s.
    begins_s: f64,
    hold_s: [f64; 2],
    ends_s: f64,
    is_added: bool,
    /// Times of its points, s from its begin.
    points_s: Vec<f64>,
}

impl Part {
    /// What is judged: to the hold, and what follows it.
    fn whole(&self) -> JointTrajectory {
        let there = self.motion.trajectory.clone();
        match &self.motion.retreat {
            Some(retreat) => there.followed_by(retreat.clone()),
            None => there,
        }
    }
}

/// Each part from the end of the hold before it to the end of its own; the last one with what follows.
fn parts(resolved: &ResolvedScenario, course: &Course<'_>, holds: &[Hold]) -> Vec<Part> {
    let mut parts = Vec::new();
    let mut from = 0;
    for (index, hold) in holds.iter().enumerate() {
        let is_last = index + 1 == holds.len();
        let (begins_s, stands_s) = (course.times_s[from], course.times_s[hold.points.start]);
        let mut trajectory = JointTrajectory::starting_at(*course.position(from));
        let mut at = from;
        for stand in hold.earlier.iter().chain([&hold.points]) {
            trajectory = trajectory.followed_by(course.part(Phase::Travel, at..stand.start));
            trajectory = trajectory.followed_by(course.part(Phase::Hold, stand.clone()));
            at = stand.end;
        }
        let mut ends_s = course.times_s[hold.points.end];
        // Where the motion ends the arm stands on.
        let missing_s = resolved.scenario.motion.hold_s - (ends_s - stands_s);
        let is_added = is_last && hold.points.end == course.last() && missing_s > 0.0;
        if is_added {
            trajectory = trajectory.then_hold(Phase::Hold, missing_s);
            ends_s += missing_s;
        }
        let goes_on = is_last && hold.points.end < course.last();
        let retreat = goes_on.then(|| course.part(Phase::Travel, hold.points.end..course.last()));
        let until = if goes_on {
            course.last()
        } else {
            hold.points.end
        };
        let points_s = course.times_s[from..=until].iter();
        parts.push(Part {
            begins_s,
            hold_s: [stands_s, ends_s],
            ends_s: if goes_on {
                course.times_s[course.last()]
            } else {
                ends_s
            },
            is_added,
            points_s: points_s.map(|time_s| time_s - begins_s).collect(),
            motion: GivenMotion {
                trajectory,
                retreat,
            },
        });
        from = hold.points.end;
    }
    parts
}

/// What is known of a hold, without plans beside it.
fn hold_report(
    judged: &ResolvedScenario,
    goal: &Goal,
    hold: &Hold,
    part: &Part,
    configuration: &ConfigurationReport,
) -> HoldReport {
    let held = &hold.held;
    let nearest = held.nearest.as_ref();
    let afterwards = configuration.retreat_clearance.classes.iter();
    let afterwards =
        afterwards.filter_map(|(class, found)| Some((*class, found.certified_lower_bound_m?)));
    HoldReport {
        goal: goal.name.clone(),
        label: nearest.map(|_| hold.configuration.label()),
        begins_s: part.begins_s,
        hold_s: part.hold_s,
        is_added: part.is_added,
        roll_rad: held.roll_rad,
        turns: nearest.map(|each| each.turns),
        guide_off_m: held.off_m,
        angle_off_rad: held.off_rad,
        joint_off_rad: nearest.map(|each| each.off_rad),
        peaks: peaks(judged, &part.whole(), &part.points_s, part.begins_s),
        afterwards_m: afterwards.collect(),
        plans: Vec::new(),
    }
}

/// The plan to the same goal in the same configuration, and the one with the largest margin where that is another.
fn own_plans(
    judged: &ResolvedScenario,
    goal: &Goal,
    hold: &Hold,
    motion: &MotionCertificate,
    planner: &Planner<'_>,
) -> Vec<OwnPlanReport> {
    let plans = planner.plan(goal).configurations;
    let margin_m = |plan: &ConfigurationPlan| {
        let margin = plan.margin.as_ref()?;
        let least = margin.classes.iter().map(ClassMargin::margin_m);
        plan.rejections
            .is_empty()
            .then(|| least.fold(f64::INFINITY, f64::min))
    };
    let best = plans
        .iter()
        .filter_map(|plan| Some((margin_m(plan)?, plan)))
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, plan)| plan);
    let same = plans
        .iter()
        .find(|plan| plan.configuration == hold.configuration);
    let beside = |plan: &ConfigurationPlan, why| {
        let certificate = plan.certificate.as_ref();
        let classes = ClearanceClass::ALL.into_iter().filter_map(|class| {
            let (mine, theirs) = (certificate?.get(class)?, motion.get(class)?);
            let (a, b) = theirs.attained.solid_names(&judged.cell);
            let found = BesideReport {
                motion_m: theirs.attained.separation.distance_m,
                motion_certified_m: theirs.lower_bound_m,
                time_s: theirs.time_s,
                pair: [a.to_owned(), b.to_owned()],
                plan_m: mine.attained.separation.distance_m,
                plan_certified_m: mine.lower_bound_m,
            };
            Some((class.name(), found))
        });
        OwnPlanReport {
            label: plan.configuration.label(),
            why,
            rejected: plan
                .rejections
                .first()
                .map(|first| format!("{}: {}", rule_in_words(first.rule.name()), first.detail)),
            duration_s: plan.trajectory.as_ref().map(JointTrajectory::duration_s),
            clearances: classes.collect(),
        }
    };
    let mut all: Vec<OwnPlanReport> = same
        .map(|plan| beside(plan, SAME_CONFIGURATION))
        .into_iter()
        .collect();
    let other = best.filter(|best| best.configuration != hold.configuration);
    all.extend(other.map(|plan| beside(plan, LARGEST_MARGIN)));
    all
}

/// Adds what is judged of a motion besides what a run judges of its own: the joints' limits, and the clearances of what
/// follows the last hold.
fn add_criteria(report: &mut Report, planner: &Planner<'_>, motion: &JudgedReport) {
    let mut missed = false;
    for (goal, hold) in report.goals.iter_mut().zip(&motion.holds) {
        // There is nothing to choose from.
        (goal.recommended, goal.ranking) = (None, None);
        let configuration = &mut goal.configurations[0];
        let mut all: Vec<CriterionResult> = Vec::new();
        let result =
            |criterion: String, value: f64, limit: f64, unit, pass, detail| CriterionResult {
                goal: hold.goal.clone(),
                label: Some(configuration.label.to_owned()),
                engine: None,
                criterion,
                value: Some(value),
                limit: Some(limit),
                unit,
                pass,
                detail,
                requirement: None,
            };
        for (criterion, value, limit, unit) in [
            (
                "guide_position",
                hold.guide_off_m * 1e3,
                AT_GOAL_M * 1e3,
                "mm",
            ),
            (
                "guide_angle",
                hold.angle_off_rad.to_degrees(),
                AT_GOAL_RAD.to_degrees(),
                "deg",
            ),
        ] {
            all.push(result(
                criterion.to_owned(),
                value,
                limit,
                unit,
                value <= limit,
                "off its place at the goal; no farther off is it held there".to_owned(),
            ));
        }
        all.extend(results(&hold.peaks, &hold.goal, Some(configuration.label)));
        // Of what a scan's unseen body may undercut nothing is said but that it fails.
        let open: Vec<&str> = configuration.retreat_clearance.unknown().collect();
        for (class, lower_bound_m) in &hold.afterwards_m {
            let is_open = open.contains(class);
            let class = ClearanceClass::named(class).expect("reports name classes");
            let limit_m = planner.limits().get(class).judged_m;
            let is_kept = *lower_bound_m >= limit_m;
            if is_open && is_kept || !class.is_physical() || !limit_m.is_finite() {
                continue;
            }
            all.push(result(
                format!("min_clearance_mm.{}", class.name()),
                lower_bound_m * 1e3,
                limit_m * 1e3,
                "mm",
                is_kept,
                "after the hold, certified as planned".to_owned(),
            ));
        }
        if all.iter().any(|each| !each.pass) {
            missed = true;
            if configuration.status == Status::Ok {
                configuration.status = Status::Failed;
            }
        }
        report.criteria.extend(all);
    }
    let failed = report.verdict == Verdict::Fail || missed;
    report.verdict = Verdict::of(failed, !report.not_judged.is_empty());
}
