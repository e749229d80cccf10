//! `needlebench ik` and `needlebench fk`.

use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::path::Path;

use anyhow::Result;
use nalgebra::Vector3;
use needlebench_cell::{Finding, Robot, Roll, load_robot};
use needlebench_clearance::ClearanceModel;
use needlebench_kinematics::ik::{
    Configuration, GaussNewtonOptions, Kinematics, SolutionKind, gauss_newton, wrap_angle,
};
use needlebench_kinematics::{
    JOINT_COUNT, Joints, Pose, pose_from_rotation_vector, rotation_vector,
};
use needlebench_planning::Planner;
use serde::Serialize;

use super::{overrides, print_json, print_text};
use crate::cli::{FkArguments, IkArguments, IkMethod, RobotArguments, Six};
use crate::exit::ExitStatus;
use crate::output::findings::print_findings;

#[derive(Serialize)]
struct IkAnswer {
    schema_version: u32,
    solutions: Vec<SolutionAnswer>,
    count: usize,
    unreachable: Vec<UnreachableAnswer>,
    certificate: &'static str,
}

#[derive(Serialize)]
struct SolutionAnswer {
    label: &'static str,
    joints_rad: [f64; 6],
    residual_m: f64,
    residual_rad: f64,
    within_limits: bool,
    free_joint: Option<&'static str>,
    kind: &'static str,
    merged: bool,
    #[serde(skip_serializing_if = "Option::is_none")]
    iterations: Option<u32>,
}

#[derive(Serialize)]
struct UnreachableAnswer {
    label: &'static str,
    missing_m: f64,
}

#[derive(Serialize)]
struct FkAnswer {
    schema_version: u32,
    flange_in_base: PoseAnswer,
    flange_in_base_link: PoseAnswer,
    links: BTreeMap<String, PoseAnswer>,
}

#[derive(Serialize)]
struct PoseAnswer {
    position_m: [f64; 3],
    rotvec_rad: [f64; 3],
    quat_wxyz: [f64; 4],
}

impl PoseAnswer {
    fn new(pose: &Pose) -> Self {
        let q = pose.rotation;
        Self {
            position_m: pose.translation.vector.into(),
            rotvec_rad: rotation_vector(&q).into(),
            quat_wxyz: [q.w, q.i, q.j, q.k],
        }
    }
}

/// The robot of the arguments: a given URDF, or the shipped UR3.
fn robot(arguments: &RobotArguments) -> std::result::Result<Robot, Finding> {
    let overrides = overrides(arguments)?;
    load_robot(&overrides)
}

/// A coordinate beyond this is in another unit.
const FARTHEST_M: f64 = 10.0;

/// Solves the inverse kinematics of a pose or a goal.
pub(crate) fn ik(arguments: &IkArguments) -> Result<ExitStatus> {
    if let Some(Six([x, y, z, ..])) = arguments.pose
        && [x, y, z].iter().any(|value| value.abs() > FARTHEST_M)
    {
        let message =
            format!("the position is {x:?}, {y:?}, {z:?} m, but no arm reaches {FARTHEST_M} m");
        print_findings(&[Finding::new("--pose", message).hint("x, y and z are in metres")]);
        return Ok(ExitStatus::BadInput);
    }
    let target = match &arguments.scenario {
        Some(path) => goal_pose(arguments, path),
        None => robot(&arguments.robot)
            .map_err(|finding| vec![finding])
            .map(|robot| {
                let [x, y, z, rx, ry, rz] = arguments
                    .pose
                    .expect("clap asks for a pose without a scenario")
                    .0;
                let base_from_flange =
                    pose_from_rotation_vector(Vector3::new(x, y, z), Vector3::new(rx, ry, rz));
                (robot, Robot::base_link_from_base() * base_from_flange)
            }),
    };
    let (robot, base_link_from_flange) = match target {
        Ok(target) => target,
        Err(findings) => {
            print_findings(&findings);
            return Ok(ExitStatus::BadInput);
        }
    };
    let kinematics = match Kinematics::new(robot.chain) {
        Ok(kinematics) => kinematics,
        Err(error) => {
            print_findings(&[Finding::new(&robot.source.file, error.to_string())]);
            return Ok(ExitStatus::BadInput);
        }
    };
    let seed = arguments.seed.map(|six| Joints::from_column_slice(&six.0));
    let answer = match arguments.method {
        IkMethod::ClosedForm => closed_form(
            &robot,
            &kinematics,
            &base_link_from_flange,
            seed,
            arguments.wraps,
        ),
        IkMethod::GaussNewton => numerical(&robot, &kinematics, &base_link_from_flange, seed),
    };
    if arguments.json {
        print_json(&answer)?;
    } else {
        print_solutions(&answer)?;
    }
    Ok(ExitStatus::Success)
}

fn goal_pose(
    arguments: &IkArguments,
    path: &Path,
) -> std::result::Result<(Robot, Pose), Vec<Finding>> {
    let overrides = overrides(&arguments.robot).map_err(|finding| vec![finding])?;
    let resolved = needlebench_cell::load_scenario(path, &overrides)?;
    let name = arguments.goal.as_deref().unwrap_or_default();
    let Some(goal) = resolved.goals.iter().find(|goal| goal.name == name) else {
        let names: Vec<&str> = resolved
            .goals
            .iter()
            .map(|goal| goal.name.as_str())
            .collect();
        return Err(vec![
            Finding::new(
                path.display().to_string(),
                format!("it has no goal `{name}`"),
            )
            .hint(format!("goals: {}", names.join(", "))),
        ]);
    };
    let model = ClearanceModel::new(&resolved.cell);
    let planner = Planner::new(&resolved, &model).map_err(|error| {
        vec![Finding::new(
            &resolved.cell.robot.source.file,
            error.to_string(),
        )]
    })?;
    let roll_rad = match goal.roll {
        Roll::Fixed(roll_rad) => roll_rad,
        Roll::Free => 0.0,
    };
    let pose = planner.base_link_from_flange(goal, roll_rad);
    Ok((resolved.cell.robot.clone(), pose))
}

fn closed_form(
    robot: &Robot,
    kinematics: &Kinematics,
    base_link_from_flange: &Pose,
    seed: Option<Joints>,
    wraps: bool,
) -> IkAnswer {
    let found = kinematics.solve(base_link_from_flange, seed.as_ref());
    let mut solutions = Vec::new();
    for solution in &found.solutions {
        let mut rows = vec![solution.joints];
        if wraps {
            rows = whole_turns(robot, &solution.joints);
            let from = seed.unwrap_or_else(Joints::zeros);
            rows.sort_by(|a, b| (a - from).norm().total_cmp(&(b - from).norm()));
        }
        solutions.extend(rows.into_iter().map(|joints| SolutionAnswer {
            label: solution.configuration.label(),
            joints_rad: joints.into(),
            residual_m: solution.residual_m,
            residual_rad: solution.residual_rad,
            within_limits: robot.limits.first_violation(&joints).is_none(),
            free_joint: solution.wrist_3_is_free.then_some("wrist_3"),
            kind: match solution.kind {
                SolutionKind::Exact => "exact",
                SolutionKind::Nearest => "nearest",
            },
            merged: solution.merged,
            iterations: None,
        }));
    }
    let certificate = if found.solutions.is_empty() {
        "unreachable"
    } else if found
        .solutions
        .iter()
        .any(|solution| solution.wrist_3_is_free)
    {
        "free_joint"
    } else if found.solutions.iter().any(|solution| solution.merged) {
        "merged_branches"
    } else {
        "complete"
    };
    IkAnswer {
        schema_version: 1,
        count: solutions.len(),
        solutions,
        unreachable: found
            .unreachable
            .iter()
            .map(|(configuration, reason)| UnreachableAnswer {
                label: configuration.label(),
                missing_m: reason.missing_m(),
            })
            .collect(),
        certificate,
    }
}

/// The same posture with whole turns added wherever the limits allow.
fn whole_turns(robot: &Robot, joints: &Joints) -> Vec<Joints> {
    let mut rows = vec![*joints];
    for joint in 0..JOINT_COUNT {
        let limit = robot.limits.0[joint];
        rows = rows
            .iter()
            .flat_map(|row| {
                (-1..=1).filter_map(move |turns| {
                    let mut turned = *row;
                    turned[joint] += TAU * f64::from(turns);
                    (limit.lower_rad..=limit.upper_rad)
                        .contains(&turned[joint])
                        .then_some(turned)
                })
            })
            .collect();
    }
    rows
}

fn numerical(
    robot: &Robot,
    kinematics: &Kinematics,
    base_link_from_flange: &Pose,
    seed: Option<Joints>,
) -> IkAnswer {
    // Away from every singularity, so that the first step is a sensible one.
    let guess =
        seed.unwrap_or_else(|| Joints::from_column_slice(&[0.1, -1.2, -1.2, -1.0, 1.2, 0.1]));
    let found = gauss_newton(
        &kinematics.chain,
        base_link_from_flange,
        &guess,
        &GaussNewtonOptions::default(),
    );
    let joints = found.joints.map(wrap_angle);
    IkAnswer {
        schema_version: 1,
        count: 1,
        solutions: vec![SolutionAnswer {
            label: Configuration::of(&kinematics.geometry, &joints).label(),
            joints_rad: joints.into(),
            residual_m: found.residual_m,
            residual_rad: found.residual_rad,
            within_limits: robot.limits.first_violation(&joints).is_none(),
            free_joint: None,
            kind: if found.converged { "exact" } else { "nearest" },
            merged: false,
            iterations: Some(found.iterations),
        }],
        unreachable: Vec::new(),
        certificate: "one_of_several",
    }
}

fn print_solutions(answer: &IkAnswer) -> Result<()> {
    let mut table = crate::output::plain_table(&[
        "configuration",
        "q1 (rad)",
        "q2",
        "q3",
        "q4",
        "q5",
        "q6",
        "residual (m)",
        "(rad)",
        "remarks",
    ]);
    for solution in &answer.solutions {
        let mut remarks = Vec::new();
        if solution.kind != "exact" {
            remarks.push("nearest only".to_owned());
        }
        if !solution.within_limits {
            remarks.push("outside limits".to_owned());
        }
        if let Some(joint) = solution.free_joint {
            remarks.push(format!("{joint} is free"));
        }
        if solution.merged {
            remarks.push("merged".to_owned());
        }
        if let Some(iterations) = solution.iterations {
            remarks.push(format!("{iterations} iterations"));
        }
        let mut row = vec![solution.label.to_owned()];
        row.extend(solution.joints_rad.iter().map(|q| format!("{q:.6}")));
        row.push(format!("{:.1e}", solution.residual_m));
        row.push(format!("{:.1e}", solution.residual_rad));
        row.push(remarks.join(", "));
        table.add_row(row);
    }
    for unreachable in &answer.unreachable {
        let mut row = vec![unreachable.label.to_owned()];
        row.extend((0..8).map(|_| "-".to_owned()));
        row.push(format!(
            "unreachable: {:.1} mm missing",
            unreachable.missing_m * 1e3
        ));
        table.add_row(row);
    }
    print_text(&format!(
        "{table}\n{}: {}",
        answer.count, answer.certificate
    ))
}

/// Prints forward kinematics.
pub(crate) fn fk(arguments: &FkArguments) -> Result<ExitStatus> {
    let robot = match robot(&arguments.robot) {
        Ok(robot) => robot,
        Err(finding) => {
            print_findings(&[finding]);
            return Ok(ExitStatus::BadInput);
        }
    };
    let q = Joints::from_column_slice(&arguments.joints.0);
    let in_base_link = robot.chain.base_link_from_flange(&q);
    let in_base = Robot::base_link_from_base().inverse() * in_base_link;
    let poses = robot.chain.link_poses(&q);
    let links: BTreeMap<String, PoseAnswer> = robot
        .links
        .iter()
        .zip(&poses)
        .map(|(link, pose)| (format!("{}_link", link.name), PoseAnswer::new(pose)))
        .collect();
    let answer = FkAnswer {
        schema_version: 1,
        flange_in_base: PoseAnswer::new(&in_base),
        flange_in_base_link: PoseAnswer::new(&in_base_link),
        links,
    };
    if arguments.json {
        print_json(&answer)?;
        return Ok(ExitStatus::Success);
    }
    let mut table =
        crate::output::plain_table(&["frame", "x (m)", "y", "z", "rx (rad)", "ry", "rz"]);
    let mut row = |name: String, pose: &PoseAnswer| {
        let mut cells = vec![name];
        cells.extend(
            pose.position_m
                .iter()
                .chain(&pose.rotvec_rad)
                .map(|v| format!("{v:.6}")),
        );
        table.add_row(cells);
    };
    row("flange in base".to_owned(), &answer.flange_in_base);
    row(
        "flange in base_link".to_owned(),
        &answer.flange_in_base_link,
    );
    for (link, pose) in robot.links.iter().zip(&poses) {
        row(
            format!("{} in base_link", link.name),
            &PoseAnswer::new(pose),
        );
    }
    print_text(&table.to_string())?;
    Ok(ExitStatus::Success)
}
