//! glTF.

use nalgebra::{Quaternion, Translation3, UnitQuaternion};
use needlebench_export::{ExportError, Packing, Shown, gltf};
use needlebench_kinematics::ik::Configuration;
use needlebench_kinematics::{JOINT_NAMES, Joints, LINK_NAMES, Pose};
use serde_json::Value;

use crate::{hanging, shipped};

/// The scene of a binary file, and the bytes of its numbers.
fn read(bytes: &[u8]) -> (Value, &[u8]) {
    let number = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
    assert_eq!(&bytes[..4], b"glTF");
    assert_eq!(number(8), bytes.len());
    let length = number(12);
    assert_eq!(&bytes[16..20], b"JSON");
    let (json, rest) = bytes[20..].split_at(length);
    assert_eq!(&rest[4..8], b"BIN\0");
    (serde_json::from_slice(json).unwrap(), &rest[8..])
}

fn numbers<const N: usize>(value: &Value, otherwise: [f64; N]) -> [f64; N] {
    let Some(array) = value.as_array() else {
        return otherwise;
    };
    let numbers: Vec<f64> = array.iter().map(|each| each.as_f64().unwrap()).collect();
    numbers.try_into().unwrap()
}

fn local(node: &Value) -> Pose {
    let [x, y, z] = numbers(&node["translation"], [0.0; 3]);
    let [i, j, k, w] = numbers(&node["rotation"], [0.0, 0.0, 0.0, 1.0]);
    Pose::from_parts(
        Translation3::new(x, y, z),
        UnitQuaternion::from_quaternion(Quaternion::new(w, i, j, k)),
    )
}

/// Pose of a node below the scene's root.
fn pose(scene: &Value, name: &str) -> Pose {
    let nodes = scene["nodes"].as_array().unwrap();
    let mut at = nodes.iter().position(|node| node["name"] == name).unwrap();
    let mut pose = local(&nodes[at]);
    while let Some(parent) = nodes.iter().position(|node| {
        let children = node["children"].as_array();
        children.is_some_and(|children| children.contains(&at.into()))
    }) {
        pose = local(&nodes[parent]) * pose;
        at = parent;
    }
    pose
}

#[test]
fn links_are_where_the_arm_has_them_and_y_is_up() {
    let resolved = hanging();
    let joints = Joints::new(0.3, -1.2, 0.8, -0.4, 1.1, 2.9);
    let files = gltf(&resolved, "cell", &Shown::Joints(joints), Packing::Binary).unwrap();
    let (scene, _) = read(&files[0].bytes);
    let world = pose(&scene, "world");
    let up = world * nalgebra::Vector3::z();
    assert!((up - nalgebra::Vector3::y()).norm() < 1e-15);
    let links = resolved.cell.robot.world_from_links(&joints);
    for ((name, wanted), joint) in LINK_NAMES.iter().zip(links).zip(JOINT_NAMES) {
        let off = (world * wanted).inverse() * pose(&scene, name);
        assert!(off.translation.vector.norm() < 1e-14, "{name}");
        assert!(off.rotation.angle() < 1e-7, "{name}");
        let nodes = scene["nodes"].as_array().unwrap();
        let node = nodes.iter().find(|node| node["name"] == *name).unwrap();
        assert_eq!(node["extras"]["joint"], joint);
    }
}

#[test]
fn a_scene_in_two_files_is_the_one_of_the_binary_file() {
    let files = |packing| gltf(&hanging(), "my cell", &Shown::Start, packing).unwrap();
    let binary = files(Packing::Binary);
    let (mut wanted, numbers) = read(&binary[0].bytes);
    let apart = files(Packing::Separate);
    let names: Vec<&str> = apart.iter().map(|file| &*file.name).collect();
    assert_eq!(names, ["my cell.gltf", "my cell.bin"]);
    wanted["buffers"][0]["uri"] = "my%20cell.bin".into();
    let scene: Value = serde_json::from_slice(&apart[0].bytes).unwrap();
    assert_eq!(scene, wanted);
    assert_eq!(apart[1].bytes, numbers);
}

#[test]
fn surfaces_are_within_the_numbers_that_the_file_has() {
    let files = gltf(&hanging(), "cell", &Shown::Start, Packing::Binary).unwrap();
    let (scene, bytes) = read(&files[0].bytes);
    let view = |accessor: &Value| {
        let index = usize::try_from(accessor["bufferView"].as_u64().unwrap()).unwrap();
        let view = &scene["bufferViews"][index];
        let at = |key: &str| usize::try_from(view[key].as_u64().unwrap()).unwrap();
        &bytes[at("byteOffset")..at("byteOffset") + at("byteLength")]
    };
    let accessor = |index: &Value| {
        let index = usize::try_from(index.as_u64().unwrap()).unwrap();
        &scene["accessors"][index]
    };
    let mut triangles = 0;
    for mesh in scene["meshes"].as_array().unwrap() {
        for primitive in mesh["primitives"].as_array().unwrap() {
            let points = accessor(&primitive["attributes"]["POSITION"]);
            let indices = accessor(&primitive["indices"]);
            let most = points["count"].as_u64().unwrap();
            for index in view(indices).chunks_exact(4) {
                assert!(u64::from(u32::from_le_bytes(index.try_into().unwrap())) < most);
            }
            assert_eq!(view(points).len() as u64, 12 * most);
            triangles += indices["count"].as_u64().unwrap() / 3;
        }
    }
    assert!(triangles > 10_000, "{triangles}");
}

#[test]
fn a_motion_is_an_animation_from_the_start_to_the_posture() {
    let resolved = shipped("table3");
    let configuration = Configuration::from_label("Right-Up-Fold").unwrap();
    let shown = Shown::Goal {
        goal: 0,
        configuration,
    };
    let files = gltf(&resolved, "cell", &shown, Packing::Binary).unwrap();
    let (scene, _) = read(&files[0].bytes);
    assert_eq!(scene["asset"]["extras"]["planned"], true);
    let animation = &scene["animations"][0];
    assert_eq!(animation["channels"].as_array().unwrap().len(), 6);
    // The flange is where the goal wants it.
    let joints = numbers::<6>(&scene["asset"]["extras"]["joint_positions_rad"], [0.0; 6]);
    let wanted = pose(&scene, "world") * resolved.cell.robot.world_from_flange(&joints.into());
    let off = wanted.inverse() * pose(&scene, "tool0");
    assert!(off.translation.vector.norm() < 1e-14);
    let still = gltf(&resolved, "cell", &Shown::Start, Packing::Binary).unwrap();
    assert!(read(&still[0].bytes).0["animations"].is_null());
}

#[test]
fn a_goal_out_of_reach_has_no_picture() {
    let mut resolved = shipped("table3");
    let goal = &mut resolved.goals[0];
    goal.world_from_guide_exit.translation.vector.x += 5.0;
    let shown = Shown::Goal {
        goal: 0,
        configuration: Configuration::ALL[0],
    };
    let error = gltf(&resolved, "cell", &shown, Packing::Binary).unwrap_err();
    assert!(matches!(error, ExportError::NoPosture { .. }), "{error}");
    assert!(error.to_string().contains("`pose`"), "{error}");
}
