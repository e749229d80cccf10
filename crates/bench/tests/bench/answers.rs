//! Answers of a solver of inverse kinematics, judged against the complete set: those of damped descents from random
//! postures, which know nothing of the closed form.

use std::path::Path;
use std::sync::atomic::AtomicBool;

use needlebench_bench::judge::answers::{
    AnswersOptions, AnswersReport, Defect, TOLERANCE, judge_answers,
};
use needlebench_bench::judge::free::judge_free;
use needlebench_cell::Robot;
use needlebench_evaluation::report::Verdict;
use needlebench_kinematics::ik::{DampedOptions, Numerical, wrap_angle};
use needlebench_kinematics::{Joints, Pose};
use needlebench_parallel::{Control, Silent};
use needlebench_recorded::{
    Answer, AnswersFile, AnswersSource, Asked, MotionOptions, Question, read_motion,
};
use needlebench_scenario::{Overrides, ResolvedScenario, Roll, load_scenario};

fn scenario() -> ResolvedScenario {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios/table3.toml");
    load_scenario(&path, &Overrides::default()).unwrap()
}

/// The flange in `base_link` at the scenario's goal, at a roll.
fn pose(resolved: &ResolvedScenario, roll_rad: f64) -> Pose {
    let cell = &resolved.cell;
    cell.robot.world_from_base_link.inverse()
        * resolved.goals[0].world_from_guide_exit_at(roll_rad)
        * cell.tool.flange_from_guide_exit.inverse()
}

/// What descents from several starts find of a pose, each once.
fn descents(resolved: &ResolvedScenario, pose: &Pose) -> Vec<Joints> {
    let solver = Numerical::new(&resolved.cell.robot.chain);
    let mut found: Vec<Joints> = Vec::new();
    for seed in 1..400_u64 {
        let options = DampedOptions {
            seed,
            ..DampedOptions::default()
        };
        let start = Joints::from_fn(|joint, _| libm::sin(seed as f64 * (1.7 + joint as f64)) * 3.0);
        let end = solver.damped(pose, &start, &options);
        assert!(end.converged);
        let joints = end.joints.map(wrap_angle);
        let is_known = found
            .iter()
            .any(|known| (known - joints).map(wrap_angle).amax() < 1e-6);
        if !is_known {
            found.push(joints);
        }
    }
    found
}

fn file(questions: Vec<(Asked, Vec<Joints>)>) -> AnswersFile {
    let mut number = 0;
    let questions: Vec<Question> = questions
        .into_iter()
        .map(|(asked, all)| Question {
            asked,
            line: None,
            answers: all
                .into_iter()
                .map(|joints| {
                    number += 1;
                    Answer {
                        number,
                        line: None,
                        joints,
                    }
                })
                .collect(),
        })
        .collect();
    AnswersFile {
        source: AnswersSource {
            file: "answers.csv".to_owned(),
            sha256: String::new(),
            format: "table",
            answers: number,
        },
        questions,
        notes: Vec::new(),
    }
}

fn judged(resolved: &ResolvedScenario, file: &AnswersFile, is_partial: bool) -> AnswersReport {
    let control = Control {
        threads: 1,
        cancel: &AtomicBool::new(false),
        progress: &Silent,
    };
    let options = AnswersOptions {
        goal: None,
        tolerance: TOLERANCE,
        is_partial,
    };
    judge_answers(resolved, file, &options, &control).unwrap()
}

#[test]
fn what_descents_find_is_the_complete_set_and_nothing_less_is() {
    let resolved = scenario();
    let all = descents(&resolved, &pose(&resolved, 0.0));
    assert_eq!(all.len(), 8);
    let report = judged(&resolved, &file(vec![(Asked::Goal, all.clone())]), false);
    assert_eq!(report.verdict, Verdict::Pass);
    let question = &report.questions[0];
    assert_eq!(question.certificate, Some("complete"));
    let by: Vec<usize> = question
        .solutions
        .iter()
        .map(|solution| solution.answered_by.len())
        .collect();
    assert_eq!(by, [1; 8]);
    for answer in &question.answers {
        assert!(answer.off_m < 1e-8 && answer.off_rad < 1e-8, "{answer:?}");
    }
    for left_out in 0..8 {
        let mut some = all.clone();
        some.remove(left_out);
        let answers = file(vec![(Asked::NamedGoal("pose".to_owned()), some)]);
        let report = judged(&resolved, &answers, false);
        assert_eq!(report.verdict, Verdict::Fail);
        let missing: Vec<&str> = report.questions[0]
            .missing()
            .map(|each| each.label)
            .collect();
        assert_eq!(missing, [question.answers[left_out].label.unwrap()]);
        assert_eq!(judged(&resolved, &answers, true).verdict, Verdict::Pass);
    }
    // A pose of the flange, which is what a solver is given.
    let base_from_flange = Robot::base_link_from_base().inverse() * pose(&resolved, 0.0);
    let asked = Asked::BaseFromFlange(base_from_flange);
    let report = judged(&resolved, &file(vec![(asked, all)]), false);
    assert_eq!(report.verdict, Verdict::Pass);
}

#[test]
fn what_is_off_double_or_out_of_range_is_told_apart() {
    let resolved = scenario();
    let all = descents(&resolved, &pose(&resolved, 0.0));
    let turned = |by: f64| {
        let mut joints = all[0];
        joints[5] += by;
        joints
    };
    let by = if all[0][5] > 0.0 { -1 } else { 1 };
    let turn = f64::from(by) * std::f64::consts::TAU;
    let cases = [
        all[0],
        all[0],
        turned(turn),
        turned(-turn),
        turned(1e-3),
        turned(1e-6),
    ];
    let report = judged(&resolved, &file(vec![(Asked::Goal, cases.to_vec())]), true);
    assert_eq!(report.verdict, Verdict::Fail);
    let answers = &report.questions[0].answers;
    assert_eq!(answers[0].defects, []);
    assert_eq!(answers[1].defects, [Defect::Double { of: 1 }]);
    assert_eq!(answers[2].defects, []);
    assert_eq!(answers[2].equivalent_to, Some(1));
    assert_eq!(answers[2].turns.unwrap()[5], by);
    // Wrist 3 of the arm turns by one revolution either way.
    assert!(
        matches!(
            answers[3].defects[..],
            [Defect::JointRange {
                joint: "wrist_3_joint",
                ..
            }]
        ),
        "{:?}",
        answers[3]
    );
    // By forward kinematics: wrist 3 turns the flange alone.
    assert_eq!(answers[4].defects, [Defect::Off]);
    assert!((answers[4].off_rad - 1e-3).abs() < 1e-9, "{:?}", answers[4]);
    assert_eq!(answers[5].defects, [Defect::Double { of: 1 }]);
    // One is right, so that a solver of one answer would pass without the others.
    let one = file(vec![(Asked::Goal, vec![all[3]])]);
    assert_eq!(judged(&resolved, &one, true).verdict, Verdict::Pass);
    assert_eq!(judged(&resolved, &one, false).verdict, Verdict::Fail);
    let none = file(vec![(Asked::NamedGoal("pose".to_owned()), Vec::new())]);
    assert_eq!(judged(&resolved, &none, true).verdict, Verdict::Fail);
}

#[test]
fn where_the_roll_is_free_each_configuration_counts_once() {
    let mut resolved = scenario();
    resolved.goals[0].roll = Roll::Free;
    // Two rolls: together they have all eight.
    let mut all = descents(&resolved, &pose(&resolved, 0.4));
    all.truncate(5);
    let report = judged(&resolved, &file(vec![(Asked::Goal, all.clone())]), false);
    assert_eq!(report.verdict, Verdict::Fail);
    let question = &report.questions[0];
    assert!(question.answers.iter().all(|each| each.defects.is_empty()));
    let off = |roll_rad: f64| (roll_rad - 0.4).abs();
    assert!(
        question
            .answers
            .iter()
            .all(|each| off(each.roll_rad.unwrap()) < 1e-6)
    );
    let missing: Vec<_> = question.missing().cloned().collect();
    assert_eq!(missing.len(), 3);
    // What is missing is a solution at the roll that stands beside it.
    for solution in &missing {
        let found = resolved
            .cell
            .robot
            .chain
            .base_link_from_flange(&solution.joints_rad.into());
        let asked = pose(&resolved, solution.roll_rad.unwrap());
        assert!((found.to_homogeneous() - asked.to_homogeneous()).amax() < 1e-9);
        all.push(solution.joints_rad.into());
    }
    let report = judged(&resolved, &file(vec![(Asked::Goal, all)]), false);
    assert_eq!(report.verdict, Verdict::Pass);
}

#[test]
fn a_motion_that_leads_nowhere_has_its_clearances_judged() {
    let resolved = scenario();
    let path =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../../guide/examples/straight_line.yaml");
    let motion = read_motion(&path, &MotionOptions::default()).unwrap();
    let report = judge_free(&resolved, &motion, None).unwrap();
    assert_eq!(report.verdict, Verdict::Fail);
    let failed: Vec<&str> = report
        .criteria
        .iter()
        .filter(|each| !each.pass)
        .map(|each| each.criterion.as_str())
        .collect();
    assert_eq!(failed, ["joint_acceleration"]);
    // Where nothing is held no access zone counts.
    assert!(!report.clearance.classes.contains_key("needle_corridor"));
    let class = &report.clearance.classes["robot_phantom"];
    let bound_m = class.certified_lower_bound_m.unwrap();
    assert!(
        class.minimum_m - bound_m < 1e-3 && bound_m > 0.0,
        "{class:?}"
    );
}
