//! The model loader, forward kinematics and rigid-body dynamics against Pinocchio.
//!
//! Pinocchio reads the same URDF files with its own parser and its own algorithms, so that a wrong
//! frame, inertia, fixed link or tool mount shows, which the engines cannot: both are fed by our
//! loader. `make_reference.py` beside this file wrote `reference.json`.

use std::path::{Path, PathBuf};

use nalgebra::{Matrix6, Quaternion, Translation3, UnitQuaternion, Vector3};
use needlebench_cell::{Robot, Tool};
use needlebench_input::sha256_hex;
use needlebench_kinematics::{Dynamics, Joints, Pose, rotation_angle_between};
use needlebench_scenario::{Overrides, load_robot, resolve_scenario};
use serde::Deserialize;

/// Ten times the worst that is seen, 7.5e-16 m: some roundings of coordinates near 1 m.
const POSITION_M: f64 = 8e-15;

/// Ten times the worst that is seen, 1.6e-15 rad.
const ANGLE_RAD: f64 = 2e-14;

/// Of mass matrix, gravity torque, inverse dynamics and Jacobian, relative to the largest entry: ten
/// times the worst that is seen, 2.9e-15.
const RELATIVE: f64 = 3e-14;

#[derive(Deserialize)]
struct Reference {
    gravity_m_s2: f64,
    sha256: std::collections::BTreeMap<String, String>,
    cases: Vec<Case>,
}

#[derive(Deserialize)]
struct Case {
    name: String,
    robot: String,
    tool: Option<String>,
    mount_rotation_deg: f64,
    base_position_mm: [f64; 3],
    base_rpy_deg: [f64; 3],
    frames: Vec<String>,
    states: Vec<State>,
}

#[derive(Deserialize)]
struct State {
    q: [f64; 6],
    qd: [f64; 6],
    qdd: [f64; 6],
    poses: Vec<[f64; 7]>,
    mass_upper: Vec<f64>,
    gravity_nm: [f64; 6],
    torque_nm: [f64; 6],
    jacobian: Option<Vec<f64>>,
}

/// What needlebench makes of the same files.
struct Model {
    robot: Robot,
    tool: Option<Tool>,
    dynamics: Dynamics,
}

/// Largest differences over all states of a case.
#[derive(Debug, Default)]
struct Worst {
    position_m: f64,
    angle_rad: f64,
    mass: f64,
    gravity: f64,
    torque: f64,
    jacobian: f64,
}

fn repository() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn reference() -> Reference {
    serde_json::from_str(include_str!("reference.json")).unwrap()
}

fn load(case: &Case, gravity_m_s2: f64) -> Model {
    let urdf = repository().join(&case.robot);
    if case.tool.is_none() {
        let overrides = Overrides {
            robot_urdf: Some(urdf),
            ..Overrides::default()
        };
        let robot = load_robot(&overrides).unwrap();
        let dynamics = Dynamics {
            chain: robot.chain,
            bodies: robot.bodies,
            armature_kgm2: Joints::zeros(),
            gravity_m_s2: Vector3::new(0.0, 0.0, -gravity_m_s2),
        };
        return Model {
            robot: robot.robot,
            tool: None,
            dynamics,
        };
    }
    let text = format!(
        r#"
        name = "validation"
        [robot]
        urdf = {:?}
        base_position_mm = {:?}
        base_rpy_deg = {:?}
        [tool]
        urdf = {:?}
        mount_rotation_deg = {}
        [controller]
        armature_kgm2 = [0, 0, 0, 0, 0, 0]
        [[goals]]
        name = "any"
        insertion_length_mm = 50
        flange_pose = {{ position_mm = [0, 300, 300], rotation_vector_rad = [0, 0, 0] }}
        "#,
        case.robot,
        case.base_position_mm,
        case.base_rpy_deg,
        case.tool.as_ref().unwrap(),
        case.mount_rotation_deg,
    );
    let resolved =
        resolve_scenario("validation", &text, &repository(), &Overrides::default()).unwrap();
    Model {
        dynamics: resolved.cell.dynamics(),
        robot: resolved.cell.robot,
        tool: Some(resolved.cell.tool),
    }
}

/// Poses in the world of the frames that the reference names.
fn poses(model: &Model, frames: &[String], q: &Joints) -> Vec<Pose> {
    let links = model.robot.world_from_links(q);
    let flange = model.robot.world_from_flange(q);
    let tool = || model.tool.as_ref().unwrap();
    frames
        .iter()
        .map(|frame| match frame.as_str() {
            "tool0" => flange,
            "shoulder_link" => links[0],
            "upper_arm_link" => links[1],
            "forearm_link" => links[2],
            "wrist_1_link" => links[3],
            "wrist_2_link" => links[4],
            "wrist_3_link" => links[5],
            "guide_exit" => flange * tool().flange_from_guide_exit,
            "needle_tip" => {
                let ahead = Pose::translation(0.0, 0.0, tool().needle.length_m);
                flange * tool().flange_from_guide_entry * ahead
            }
            other => panic!("unknown frame {other}"),
        })
        .collect()
}

fn pose([x, y, z, i, j, k, w]: [f64; 7]) -> Pose {
    Pose::from_parts(
        Translation3::new(x, y, z),
        UnitQuaternion::from_quaternion(Quaternion::new(w, i, j, k)),
    )
}

fn symmetric(upper: &[f64]) -> Matrix6<f64> {
    let mut entries = upper.iter();
    let mut matrix = Matrix6::zeros();
    for row in 0..6 {
        for column in row..6 {
            matrix[(row, column)] = *entries.next().unwrap();
            matrix[(column, row)] = matrix[(row, column)];
        }
    }
    matrix
}

fn compare(model: &Model, case: &Case) -> Worst {
    let mut worst = Worst::default();
    for state in &case.states {
        let [q, qd, qdd] = [state.q, state.qd, state.qdd].map(Joints::from);
        for (ours, theirs) in poses(model, &case.frames, &q).iter().zip(&state.poses) {
            let theirs = pose(*theirs);
            let miss = (ours.translation.vector - theirs.translation.vector).norm();
            worst.position_m = worst.position_m.max(miss);
            let angle = rotation_angle_between(&ours.rotation, &theirs.rotation);
            worst.angle_rad = worst.angle_rad.max(angle);
        }
        let mass = symmetric(&state.mass_upper);
        let difference = model.dynamics.mass_matrix(&q) - mass;
        worst.mass = worst.mass.max(difference.amax() / mass.amax());
        let gravity = Joints::from(state.gravity_nm);
        let difference = model.dynamics.gravity_torque(&q) - gravity;
        worst.gravity = worst.gravity.max(difference.amax() / gravity.amax());
        let torque = Joints::from(state.torque_nm);
        let difference = model.dynamics.inverse_dynamics(&q, &qd, &qdd) - torque;
        worst.torque = worst.torque.max(difference.amax() / torque.amax());
        if let Some(jacobian) = &state.jacobian {
            let theirs = Matrix6::from_row_slice(jacobian);
            let difference = model.robot.chain.jacobian(&q) - theirs;
            worst.jacobian = worst.jacobian.max(difference.amax() / theirs.amax());
        }
    }
    worst
}

#[test]
fn the_reference_was_made_from_the_models_as_they_are() {
    for (file, sha256) in reference().sha256 {
        let bytes = std::fs::read(repository().join(&file)).unwrap();
        assert_eq!(
            sha256_hex(&bytes),
            sha256,
            "{file} has changed: run tests/validation/dynamics/make_reference.py"
        );
    }
}

#[test]
fn loader_and_dynamics_agree_with_pinocchio() {
    let reference = reference();
    assert!(reference.cases.len() >= 4);
    for case in &reference.cases {
        let worst = compare(&load(case, reference.gravity_m_s2), case);
        println!("{}: {} states, {worst:?}", case.name, case.states.len());
        // Kept with the records of the checks, which take the largest of several.
        println!("figure loader_position_m {:e}", worst.position_m);
        println!("figure loader_angle_rad {:e}", worst.angle_rad);
        println!("figure loader_mass {:e}", worst.mass);
        println!("figure loader_gravity {:e}", worst.gravity);
        println!("figure loader_torque {:e}", worst.torque);
        println!("figure loader_jacobian {:e}", worst.jacobian);
        assert!(case.states.len() >= 40);
        assert!(worst.position_m < POSITION_M, "{}: {worst:?}", case.name);
        assert!(worst.angle_rad < ANGLE_RAD, "{}: {worst:?}", case.name);
        for relative in [worst.mass, worst.gravity, worst.torque, worst.jacobian] {
            assert!(relative < RELATIVE, "{}: {worst:?}", case.name);
        }
    }
}
