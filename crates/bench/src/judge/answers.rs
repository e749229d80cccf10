//! Answers of somebody's inverse kinematics, judged against the complete set.

use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::sync::atomic::Ordering;

use needlebench_cell::Robot;
use needlebench_clearance::ClearanceModel;
use needlebench_evaluation::judge_posture;
use needlebench_evaluation::report::{ConfigurationReport, Verdict};
use needlebench_input::{Finding, nearest_name};
use needlebench_kinematics::ik::{Certificate, Configuration, Rows, Solution, SolutionKind};
use needlebench_kinematics::{JOINT_NAMES, Joints, Pose, rotation_angle_between, rotation_vector};
use needlebench_parallel::{Control, in_parallel};
use needlebench_planning::Planner;
use needlebench_recorded::{Answer, AnswersFile, AnswersSource, Asked, Question};

use needlebench_scenario::{Goal, ResolvedScenario, Roll};
use serde::Serialize;

use super::JudgeError;
use crate::scenario_run::RunError;
use crate::setup::SetupError;

/// Version of the document.
const SCHEMA_VERSION: u32 = 1;

/// An answer is right within this, m and rad, unless the user says otherwise: the repeatability of a UR3.
pub const TOLERANCE: f64 = 1e-4;

/// How answers are judged.
#[derive(Debug, Clone, PartialEq)]
pub struct AnswersOptions {
    /// The only goal that is judged.
    pub goal: Option<String>,
    /// Largest distance, m, and angle, rad, from what was asked.
    pub tolerance: f64,
    /// Missing solutions are listed, and one right answer is enough.
    pub is_partial: bool,
}

/// Judged answers.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AnswersReport {
    /// Version of this document.
    pub schema_version: u32,
    /// Name of the scenario.
    pub scenario: String,
    /// The file of answers.
    pub source: AnswersSource,
    /// Largest distance of a right answer, m.
    pub tolerance_m: f64,
    /// Largest angle of a right answer, rad.
    pub tolerance_rad: f64,
    /// Missing solutions are no failure.
    pub is_partial: bool,
    /// Whether all answers are right, and none is missing.
    pub verdict: Verdict,
    /// What was asked.
    pub questions: Vec<QuestionReport>,
    /// Notes.
    pub notes: Vec<String>,
}

/// A goal or a pose, its complete set of solutions, and what was answered.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct QuestionReport {
    /// The goal, or which pose of the file.
    pub name: String,
    /// Pose of the flange in the controller's base frame, m and rotation vector in rad; none of a goal.
    pub base_from_flange: Option<[f64; 6]>,
    /// The roll about the needle is free: a solution is a configuration at any roll.
    pub roll_is_free: bool,
    /// How certain it is that no solution is missing here, as of `ik`; none where the roll is free.
    pub certificate: Option<&'static str>,
    /// The solutions within the joints' limits.
    pub solutions: Vec<SolutionReport>,
    /// The answers, in the order of the file.
    pub answers: Vec<AnswerReport>,
}

/// A solution that there is.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SolutionReport {
    /// Configuration.
    pub label: &'static str,
    /// Joint positions, rad: where it was not answered, an example.
    pub joints_rad: [f64; 6],
    /// Roll of the guide about the needle, rad; none of a pose.
    pub roll_rad: Option<f64>,
    /// The right answers that are this solution, by number.
    pub answered_by: Vec<usize>,
    /// The posture in the cell.
    pub posture: PostureReport,
}

/// An answer.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AnswerReport {
    /// Which one of the file, from 1.
    pub number: usize,
    /// Line of the file, from 1.
    pub line: Option<usize>,
    /// Joint positions, rad.
    pub joints_rad: [f64; 6],
    /// Roll of the guide about the needle, rad; none of a pose.
    pub roll_rad: Option<f64>,
    /// Configuration of the nearest solution; none where the pose has no solution.
    pub label: Option<&'static str>,
    /// Largest difference of a joint from the nearest solution, rad.
    pub joint_off_rad: Option<f64>,
    /// Full revolutions of each joint beyond that solution.
    pub turns: Option<[i32; 6]>,
    /// Distance from what was asked, m: of the guide's exit from a goal, of the flange from a pose.
    pub off_m: f64,
    /// Angle from what was asked, rad; about the needle too, unless the roll is free.
    pub off_rad: f64,
    /// What is wrong with it.
    pub defects: Vec<Defect>,
    /// The answer before it that is the same but for full revolutions, by number.
    pub equivalent_to: Option<usize>,
    /// The posture in the cell; none of an answer that is off.
    pub posture: Option<PostureReport>,
}

/// What is wrong with an answer.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Defect {
    /// It does not attain what was asked.
    Off,
    /// A joint is outside its range.
    JointRange {
        /// Joint.
        joint: &'static str,
        /// Its position, rad.
        value_rad: f64,
        /// The limit, rad.
        limit_rad: f64,
    },
    /// It repeats an answer before it.
    Double {
        /// Number of that answer.
        of: usize,
    },
}

/// A posture in the cell, which decides nothing of whether an answer is right.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PostureReport {
    /// The first rule or criterion that it does not keep; none of a feasible one.
    pub fault: Option<String>,
    /// Least clearances, m, by class.
    pub clearance_m: BTreeMap<&'static str, f64>,
}

impl QuestionReport {
    /// Solutions without a right answer.
    pub fn missing(&self) -> impl Iterator<Item = &SolutionReport> {
        let all = self.solutions.iter();
        all.filter(|solution| solution.answered_by.is_empty())
    }

    /// Whether what is missing fails.
    pub fn lacks(&self, is_partial: bool) -> bool {
        let missing = self.missing().count();
        missing > 0 && (!is_partial || missing == self.solutions.len())
    }
}

/// Judges answers: how far each is off, which of the solutions it is, which are missing and which come twice, and which
/// violate the joints' limits. Clearances of the postures are told, and decide nothing.
///
/// The complete set of a goal with a fixed roll, and of a pose, is that of `ik`; of a goal whose roll is free, the
/// configurations that reach it at the roll of an answer or at one of `planning.roll_samples`.
///
/// # Errors
/// [`JudgeError`].
pub fn judge_answers(
    resolved: &ResolvedScenario,
    file: &AnswersFile,
    asked: &AnswersOptions,
    control: &Control<'_>,
) -> Result<AnswersReport, JudgeError> {
    let model = ClearanceModel::new(&resolved.cell);
    let planner = Planner::new(resolved, &model)
        .map_err(|error| RunError::Setup(SetupError::Robot(error)))?;
    let mut notes = file.notes.clone();
    let questions = questions(resolved, file, asked, &mut notes)?;
    let judge = AnswersJudge {
        planner: &planner,
        resolved,
        tolerance: asked.tolerance,
        control,
    };
    let questions: Vec<QuestionReport> = questions
        .iter()
        .take_while(|_| !control.cancel.load(Ordering::Relaxed))
        .map(|(target, name, answers)| judge.question(target, name, answers))
        .collect();
    let is_cut = control.cancel.load(Ordering::Relaxed);
    if is_cut {
        notes.push("interrupted: what follows is not evaluated".to_owned());
    }
    let failed = questions.iter().any(|question| {
        let has_defect = question.answers.iter().any(|each| !each.defects.is_empty());
        has_defect || question.lacks(asked.is_partial)
    });
    Ok(AnswersReport {
        schema_version: SCHEMA_VERSION,
        scenario: resolved.scenario.name.clone(),
        source: file.source.clone(),
        tolerance_m: asked.tolerance,
        tolerance_rad: asked.tolerance,
        is_partial: asked.is_partial,
        verdict: Verdict::of(failed, is_cut),
        questions,
        notes,
    })
}

/// What the arm is to reach.
enum Target<'a> {
    Goal(&'a Goal),
    /// The flange in `base_link`.
    Pose(Pose),
}

type AskedFor<'a> = (Target<'a>, String, &'a [Answer]);

/// The goals and poses of a file. Where it names goals, those without an answer are asked for too.
fn questions<'a>(
    resolved: &'a ResolvedScenario,
    file: &'a AnswersFile,
    options: &AnswersOptions,
    notes: &mut Vec<String>,
) -> Result<Vec<AskedFor<'a>>, Finding> {
    let named = |name: &str| resolved.goals.iter().find(|goal| goal.name == name);
    let unknown = |name: &str, finding: Finding| {
        let names = resolved.goals.iter().map(|goal| goal.name.as_str());
        let all: Vec<&str> = names.clone().collect();
        finding.hint(match nearest_name(name, names) {
            Some(near) => format!("did you mean `{near}`?"),
            None => format!("there are: {}", all.join(", ")),
        })
    };
    let only = match &options.goal {
        None => None,
        Some(name) => Some(named(name).ok_or_else(|| {
            let message = format!("the scenario has no goal `{name}`");
            let finding = Finding::new(&resolved.source.file, message).key("--goal");
            unknown(name, finding)
        })?),
    };
    let mut found = Vec::new();
    let mut left_out = 0;
    let mut names_goals = false;
    for (
        index,
        Question {
            asked,
            line,
            answers,
        },
    ) in file.questions.iter().enumerate()
    {
        let finding = |message: String| Finding {
            line: *line,
            ..Finding::new(&file.source.file, message)
        };
        let goal = match asked {
            Asked::BaseFromFlange(pose) => {
                if only.is_some() {
                    let message = "the answers are to poses, not to a goal".to_owned();
                    return Err(finding(message).key("--goal").hint("leave it out"));
                }
                let base_link_from_flange = Robot::base_link_from_base() * pose;
                let name = format!("pose {}", index + 1);
                found.push((Target::Pose(base_link_from_flange), name, &answers[..]));
                continue;
            }
            Asked::NamedGoal(name) => {
                names_goals = true;
                let goal = named(name).ok_or_else(|| {
                    let message = format!("the scenario has no goal `{name}`");
                    unknown(name, finding(message).key("goal"))
                })?;
                if only.is_some_and(|only| only.name != goal.name) {
                    left_out += answers.len();
                    continue;
                }
                goal
            }
            Asked::Goal => match (only, &resolved.goals[..]) {
                (Some(only), _) => only,
                (None, [goal]) => goal,
                (None, goals) => {
                    let message = format!(
                        "the scenario has {} goals, and the file does not say which is answered",
                        goals.len()
                    );
                    let hint = "name it with --goal, or in a column `goal`";
                    return Err(finding(message).key("--goal").hint(hint));
                }
            },
        };
        found.push((Target::Goal(goal), goal.name.clone(), answers));
    }
    if left_out > 0 {
        notes.push(format!("{left_out} answers to other goals are left out"));
    }
    let asked_all = names_goals && only.is_none();
    let asked_goals = resolved.goals.iter();
    for goal in
        asked_goals.filter(|goal| asked_all || only.is_some_and(|only| only.name == goal.name))
    {
        if !found.iter().any(|(_, name, _)| *name == goal.name) {
            found.push((Target::Goal(goal), goal.name.clone(), &[]));
        }
    }
    Ok(found)
}

struct AnswersJudge<'a> {
    planner: &'a Planner<'a>,
    resolved: &'a ResolvedScenario,
    tolerance: f64,
    control: &'a Control<'a>,
}

/// An answer beside what it is the nearest solution of.
struct Placed {
    report: AnswerReport,
    exact: Option<Solution>,
}

impl AnswersJudge<'_> {
    fn question(&self, target: &Target<'_>, name: &str, answers: &[Answer]) -> QuestionReport {
        let mut placed = in_parallel(self.control.threads, answers, |answer| {
            self.placed(target, answer)
        });
        mark_doubles(&mut placed, self.tolerance);
        let roll_is_free = matches!(target, Target::Goal(goal) if goal.roll == Roll::Free);
        let (mut solutions, certificate) = match target {
            Target::Goal(goal) if roll_is_free => (self.at_any_roll(goal, &placed), None),
            Target::Goal(goal) => {
                let roll_rad = self.planner.rolls(goal, 1)[0];
                let pose = self.planner.base_link_from_flange(goal, roll_rad);
                let (all, certificate) = self.all(&pose, Some(roll_rad));
                (all, Some(certificate.name()))
            }
            Target::Pose(pose) => {
                let (all, certificate) = self.all(pose, None);
                (all, Some(certificate.name()))
            }
        };
        for Placed { report, exact } in &placed {
            let is_right = report.defects.is_empty();
            if let Some(exact) = exact.filter(|_| is_right)
                && let Some(solution) = nearest_of(&mut solutions, &exact)
            {
                solution.answered_by.push(report.number);
            }
        }
        let base_from_flange = match target {
            Target::Goal(_) => None,
            Target::Pose(pose) => {
                let pose = Robot::base_link_from_base().inverse() * pose;
                let place = pose.translation.vector;
                let turn = rotation_vector(&pose.rotation);
                Some([place.x, place.y, place.z, turn.x, turn.y, turn.z])
            }
        };
        QuestionReport {
            name: name.to_owned(),
            base_from_flange,
            roll_is_free,
            certificate,
            solutions,
            answers: placed.into_iter().map(|each| each.report).collect(),
        }
    }

    /// How far an answer is off, and what it is.
    fn placed(&self, target: &Target<'_>, answer: &Answer) -> Placed {
        let joints = &answer.joints;
        let (roll_rad, off_m, off_rad, nearest) = match target {
            Target::Goal(goal) => {
                let held = self.planner.held(goal, joints);
                (Some(held.roll_rad), held.off_m, held.off_rad, held.nearest)
            }
            Target::Pose(asked) => {
                let pose = self.planner.kinematics().base_link_from_flange(joints);
                let off_m = (pose.translation.vector - asked.translation.vector).norm();
                let off_rad = rotation_angle_between(&pose.rotation, &asked.rotation);
                (None, off_m, off_rad, self.planner.nearest(asked, joints))
            }
        };
        let mut defects = Vec::new();
        let is_off = off_m.max(off_rad) > self.tolerance;
        if is_off {
            defects.push(Defect::Off);
        }
        let limits = &self.resolved.cell.robot.limits;
        if let Some(joint) = limits.first_violation(joints) {
            let (value_rad, limit) = (joints[joint], limits.0[joint]);
            defects.push(Defect::JointRange {
                joint: JOINT_NAMES[joint],
                value_rad,
                limit_rad: if value_rad > limit.upper_rad {
                    limit.upper_rad
                } else {
                    limit.lower_rad
                },
            });
        }
        let posture = match &nearest {
            Some(nearest) if defects.is_empty() => {
                let own = Solution {
                    joints: *joints,
                    kind: SolutionKind::Exact,
                    ..nearest.solution
                };
                Some(self.posture(&own))
            }
            _ => None,
        };
        Placed {
            report: AnswerReport {
                number: answer.number,
                line: answer.line,
                joints_rad: answer.joints.into(),
                roll_rad,
                label: nearest
                    .as_ref()
                    .map(|each| each.solution.configuration.label()),
                joint_off_rad: nearest.as_ref().map(|each| each.off_rad),
                turns: nearest.as_ref().map(|each| each.turns),
                off_m,
                off_rad,
                defects,
                equivalent_to: None,
                posture,
            },
            exact: nearest.map(|each| each.solution),
        }
    }

    /// The solutions of a pose within the joints' limits.
    fn all(&self, pose: &Pose, roll_rad: Option<f64>) -> (Vec<SolutionReport>, Certificate) {
        let found = self.planner.kinematics().branches(pose, None);
        let limits = &self.resolved.cell.robot.limits.0;
        let within = found.solutions.iter().filter(|solution| {
            let mut joints = limits.iter().zip(&solution.joints);
            joints.all(|(limit, position_rad)| limit.turns(*position_rad).is_some())
        });
        let all = within.map(|solution| self.solution(solution, roll_rad));
        (all.collect(), found.certificate)
    }

    fn solution(&self, solution: &Solution, roll_rad: Option<f64>) -> SolutionReport {
        SolutionReport {
            label: solution.configuration.label(),
            joints_rad: solution.joints.into(),
            roll_rad,
            answered_by: Vec::new(),
            posture: self.posture(solution),
        }
    }

    /// The configurations that reach a goal at any roll: at that of a right answer, else where the posture is feasible, else
    /// anywhere.
    fn at_any_roll(&self, goal: &Goal, placed: &[Placed]) -> Vec<SolutionReport> {
        let right = placed.iter().filter(|each| each.report.defects.is_empty());
        let mut answered: BTreeMap<usize, (Solution, Option<f64>)> = BTreeMap::new();
        for Placed { report, exact } in right {
            if let Some(exact) = exact {
                let index = exact.configuration.index();
                answered.entry(index).or_insert((*exact, report.roll_rad));
            }
        }
        let count = self.resolved.scenario.planning.roll_samples;
        let answers = placed.iter().filter_map(|each| each.report.roll_rad);
        let mut rolls: Vec<f64> = answers.collect();
        rolls.extend(self.planner.rolls(goal, count));
        let poses: Vec<Pose> = rolls
            .iter()
            .map(|roll_rad| self.planner.base_link_from_flange(goal, *roll_rad))
            .collect();
        let mut rows = vec![Rows::new(); poses.len()];
        let kinematics = self.planner.kinematics();
        kinematics.rows_batch(&poses, Some(&self.resolved.start), &mut rows);
        let all = Configuration::ALL.into_iter().filter_map(|configuration| {
            if let Some((exact, roll_rad)) = answered.get(&configuration.index()) {
                return Some(self.solution(exact, *roll_rad));
            }
            let mut example: Option<SolutionReport> = None;
            for (rows, roll_rad) in rows.iter().zip(&rolls) {
                let is_there = rows.iter().any(|row| row.configuration == configuration);
                if !is_there || self.control.cancel.load(Ordering::Relaxed) {
                    continue;
                }
                let pose = self.planner.base_link_from_flange(goal, *roll_rad);
                let (mut all, _) = self.all(&pose, Some(*roll_rad));
                all.retain(|each| each.label == configuration.label());
                let Some(found) = all.into_iter().next() else {
                    continue;
                };
                if found.posture.fault.is_none() {
                    return Some(found);
                }
                example.get_or_insert(found);
            }
            example
        });
        all.collect()
    }

    fn posture(&self, solution: &Solution) -> PostureReport {
        let (clearance, rejections) = self.planner.posture_rules(solution);
        let mut posture = ConfigurationReport::new(solution.configuration.label());
        posture.set_posture_clearances(&clearance);
        let fault = match rejections.first() {
            Some(rejection) => Some(rejection.detail.clone()),
            None => judge_posture(&posture, &self.resolved.scenario.criteria)
                .map(|fault| fault.into_detail().into_owned()),
        };
        PostureReport {
            fault,
            clearance_m: posture.posture_clearance_m,
        }
    }
}

/// The solution that another one of the same pose is.
fn nearest_of<'s>(
    solutions: &'s mut [SolutionReport],
    exact: &Solution,
) -> Option<&'s mut SolutionReport> {
    let off = |solution: &SolutionReport| {
        let joints = Joints::from(solution.joints_rad) - exact.joints;
        joints
            .map(|off| (off - (off / TAU).round() * TAU).abs())
            .amax()
    };
    let label = exact.configuration.label();
    let same = solutions.iter_mut().filter(|each| each.label == label);
    same.min_by(|a, b| off(a).total_cmp(&off(b)))
}

/// Marks answers that repeat one before them, and those that do so but for full revolutions.
fn mark_doubles(placed: &mut [Placed], tolerance: f64) {
    // Only answers of a configuration can be the same.
    let mut before: BTreeMap<&'static str, Vec<usize>> = BTreeMap::new();
    for index in 0..placed.len() {
        let report = &placed[index].report;
        let Some(label) = report.label.filter(|_| report.defects.is_empty()) else {
            continue;
        };
        let joints = Joints::from(report.joints_rad);
        let known = before.entry(label).or_default();
        let same = known.iter().filter_map(|earlier| {
            let earlier = &placed[*earlier].report;
            let off = joints - Joints::from(earlier.joints_rad);
            let turns = off.map(|off| (off / TAU).round());
            let is_same = (off - turns * TAU).amax() <= tolerance;
            is_same.then_some((turns.amax() > 0.0, earlier.number))
        });
        // The same joint positions before 2π equivalents.
        match same.min() {
            Some((false, of)) => placed[index].report.defects.push(Defect::Double { of }),
            Some((true, number)) => {
                placed[index].report.equivalent_to = Some(number);
                known.push(index);
            }
            None => known.push(index),
        }
    }
}
