//! Obstacles are where their section says, whatever they are attached to.

use std::path::{Path, PathBuf};

use nalgebra::{Point3, Translation3, UnitQuaternion, Vector3};
use needlebench_cell::{BodyKind, Cell, ClearanceClass, CollisionBody};
use needlebench_geometry::{PreparedShape, Shape, separation};
use needlebench_input::Finding;
use needlebench_kinematics::Pose;
use needlebench_scenario::{
    Change, KeyPath, Overrides, ResolvedScenario, ScenarioFamily, Setting, resolve_scenario,
};

/// Rounding of places of some metres.
const ROUNDING_M: f64 = 1e-12;

fn scenarios() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios")
}

/// A tilted gantry, a turned table and a hanging robot.
const ROOM: &str = r#"
name = "room"
[robot]
urdf = "ur3"
base_position_mm = [-280, 350, 1700]
base_rpy_deg = [180, 10, 30]
[tool]
urdf = "offset"
[table]
center_mm = [-300, 0]
top_height_mm = 780
yaw_deg = 4
[gantry]
isocentre_mm = [1500, 0, 1000]
axis_yaw_deg = 5
tilt_deg = -20
[[goals]]
name = "a"
insertion_length_mm = 80
flange_pose = { position_mm = [200, -300, 200], rotation_vector_rad = [0, 3, 0] }
"#;

fn room(obstacles: &str) -> Result<ResolvedScenario, Vec<Finding>> {
    let text = format!("{ROOM}{obstacles}");
    resolve_scenario("room.toml", &text, &scenarios(), &Overrides::default())
}

fn body<'c>(cell: &'c Cell, name: &str) -> &'c CollisionBody {
    cell.bodies.iter().find(|body| body.name == name).unwrap()
}

fn rpy(deg: [f64; 3]) -> UnitQuaternion<f64> {
    let [roll, pitch, yaw] = deg.map(f64::to_radians);
    UnitQuaternion::from_euler_angles(roll, pitch, yaw)
}

#[test]
fn an_obstacle_is_in_the_frame_of_what_it_is_attached_to() {
    for (attached_to, world_from_parent) in [
        ("world", Pose::identity()),
        (
            "table",
            Pose::from_parts(Translation3::new(-0.3, 0.0, 0.78), rpy([0.0, 0.0, 4.0])),
        ),
        (
            "gantry",
            Pose::from_parts(Translation3::new(1.5, 0.0, 1.0), rpy([0.0, -20.0, 5.0])),
        ),
        (
            "robot_base",
            Pose::from_parts(
                Translation3::new(-0.28, 0.35, 1.7),
                rpy([180.0, 10.0, 30.0]),
            ),
        ),
    ] {
        let resolved = room(&format!(
            "[[obstacles]]\nname = \"it\"\nattached_to = \"{attached_to}\"\n\
             position_mm = [-700, 100, 450]\nrpy_deg = [20, -30, 40]\n\
             shape = {{ capsule = {{ radius_mm = 20, length_mm = 200 }} }}\n"
        ))
        .unwrap();
        let solid = &body(&resolved.cell, "it").solids[0];
        let wanted = world_from_parent
            * Pose::from_parts(Translation3::new(-0.7, 0.1, 0.45), rpy([20.0, -30.0, 40.0]));
        for point in [Point3::origin(), Point3::new(0.1, 0.2, 0.3)] {
            let apart = (solid.parent_from_shape * point - wanted * point).norm();
            assert!(apart < ROUNDING_M, "{attached_to} {apart}");
        }
        assert_eq!(
            solid.shape,
            Shape::Capsule {
                radius_m: 0.02,
                half_length_m: 0.1
            }
        );
    }
}

#[test]
fn every_shape_is_measured_for_the_class_that_is_named() {
    let shapes = [
        ("box = { size_mm = [100, 200, 300] }", "robot_obstacle"),
        (
            "cylinder = { radius_mm = 30, length_mm = 300 }",
            "robot_table",
        ),
        (
            "capsule = { radius_mm = 30, length_mm = 300 }",
            "robot_gantry",
        ),
        ("sphere = { radius_mm = 30 }", "robot_mount"),
        (
            "convex = { file = \"../models/equipment/c_arm.stl\" }",
            "robot_obstacle",
        ),
        (
            "mesh = { file = \"../models/equipment/c_arm.stl\" }",
            "robot_obstacle",
        ),
    ];
    let sections: Vec<String> = (0..)
        .zip(shapes)
        .map(|(k, (shape, class))| {
            format!(
                "[[obstacles]]\nname = \"o{k}\"\nclass = \"{class}\"\n\
                 position_mm = [{}, 2000, 900]\nshape = {{ {shape} }}\n",
                -3000 + 1000 * k
            )
        })
        .collect();
    let resolved = room(&sections.concat()).unwrap();
    let cell = &resolved.cell;
    for (k, (_, class)) in (0..).zip(shapes) {
        let index = cell
            .bodies
            .iter()
            .position(|body| body.name == format!("o{k}"));
        let pairs: Vec<_> = cell
            .pairs
            .iter()
            .filter(|pair| Some(pair.b) == index)
            .collect();
        // Six links, the tool and its guide tube; and the access zone.
        let of_class = pairs.iter().filter(|pair| pair.class.name() == class);
        assert_eq!(of_class.count(), 8);
        let behind_guide =
            |pair: &&&needlebench_cell::BodyPair| pair.class == ClearanceClass::NeedleCorridor;
        assert_eq!(pairs.iter().filter(behind_guide).count(), 1);
        assert_eq!(pairs.len(), 9);
    }
    // The hull of an arc of more than half a turn holds its middle; the arc itself does not.
    let depth_of_middle = |name: &str| {
        let solid = &body(cell, name).solids[0];
        let middle = Point3::new(if name == "o4" { 1.0 } else { 2.0 }, 2.0, 0.9);
        separation(
            &PreparedShape::new(&Shape::Sphere { radius_m: 0.0 }),
            &Pose::translation(middle.x, middle.y, middle.z),
            &PreparedShape::new(&solid.shape),
            &solid.parent_from_shape,
        )
        .distance_m
    };
    assert!(matches!(body(cell, "o4").solids[0].shape, Shape::Convex(_)));
    assert!(matches!(body(cell, "o5").solids[0].shape, Shape::Mesh(_)));
    assert!(depth_of_middle("o4") < -0.05);
    // The arc's inner face, whose chords come nearer to the middle by half a step's cosine.
    let inner_m = 0.625 * libm::cos((210.0_f64 / 56.0).to_radians());
    assert!((depth_of_middle("o5") - inner_m).abs() < 1e-6);
    assert_eq!(resolved.obstacle_files.len(), 1);
}

#[test]
fn what_is_not_present_is_as_if_left_out() {
    let section = |present: bool| {
        format!(
            "[[obstacles]]\nname = \"pole\"\npresent = {present}\nposition_mm = [0, 1500, 950]\n\
             shape = {{ cylinder = {{ radius_mm = 15, length_mm = 1900 }} }}\n"
        )
    };
    let without = room("").unwrap();
    let absent = room(&section(false)).unwrap();
    assert_eq!(absent.cell, without.cell);
    assert_eq!(absent.fixtures, without.fixtures);
    let present = room(&section(true)).unwrap();
    assert_eq!(present.cell.bodies.len(), without.cell.bodies.len() + 1);
    assert_eq!(body(&present.cell, "pole").kind, BodyKind::Obstacle);
}

#[test]
fn obstacles_that_cannot_be_are_refused_at_their_key() {
    let pole = |rest: &str| {
        format!(
            "[[obstacles]]\nname = \"pole\"\n{rest}\n\
             shape = {{ cylinder = {{ radius_mm = 15, length_mm = 1900 }} }}\n"
        )
    };
    let shaped = |shape: &str| {
        format!("[[obstacles]]\nname = \"it\"\nposition_mm = [0, 2000, 900]\nshape = {shape}\n")
    };
    let place = "obstacles[0].position_mm";
    let twice = [
        pole("position_mm = [0, 1500, 950]"),
        pole("position_mm = [0, 1600, 950]"),
    ]
    .concat();
    for (text, key, says) in [
        (
            pole("position_mm = [0, 1500, 900]"),
            place,
            "50.0 mm below the floor",
        ),
        (
            pole("position_mm = [-300, 0, 950]"),
            place,
            "overlaps the table",
        ),
        (
            pole("position_mm = [1500, 900, 950]"),
            place,
            "overlaps the gantry's housing",
        ),
        (
            pole("position_mm = [-280, 350, 950]"),
            place,
            "overlaps the robot's base",
        ),
        (
            pole("attached_to = \"gantry\"\nposition_mm = [-1800, 0, 600]"),
            place,
            "overlaps the table",
        ),
        (twice, "obstacles[1].name", "two obstacles"),
        (
            pole("position_mm = [0, 1500, 950]").replace("\"pole\"", "\"forearm\""),
            "obstacles[0].name",
            "another body in the cell",
        ),
        (shaped("{}"), "obstacles[0].shape", "no shape"),
        (
            shaped("{ sphere = { radius_mm = 5 }, box = { size_mm = [1, 1, 1] } }"),
            "obstacles[0].shape",
            "box and sphere",
        ),
        (
            shaped("{ mesh = { file = \"no_such.stl\" } }"),
            "obstacles[0].shape.mesh.file",
            "no_such.stl",
        ),
        (
            shaped("{ mesh = { file = \"../models/equipment/c_arm.stl\", unit = \"m\" } }"),
            "obstacles[0].shape.mesh.unit",
            "in metres the obstacle is 881173 x",
        ),
        (
            shaped("{ mesh = { file = \"../models/equipment/c_arm.stl\", flip = true } }"),
            "obstacles[0].shape.mesh.file",
            "inside out",
        ),
    ] {
        let findings = room(&text).unwrap_err();
        assert_eq!(
            findings[0].key.as_deref(),
            Some(key),
            "{text}\n{findings:?}"
        );
        assert!(findings[0].message.contains(says), "{findings:?}");
        assert!(
            findings[0].line.is_some() && findings[0].hint.is_some(),
            "{findings:?}"
        );
    }
    let text = ROOM.replace("[gantry]", "[iso_gantry]");
    assert!(text != ROOM);
    let without = ROOM.split("[gantry]").next().unwrap().to_owned()
        + "[[goals]]"
        + ROOM.split("[[goals]]").nth(1).unwrap();
    let text = format!(
        "{without}{}",
        pole("attached_to = \"gantry\"\nposition_mm = [0, 0, 0]")
    );
    let findings = resolve_scenario("s.toml", &text, &scenarios(), &Overrides::default());
    let findings = findings.unwrap_err();
    assert_eq!(findings[0].key.as_deref(), Some("obstacles[0].attached_to"));
    assert!(findings[0].message.contains("there is no [gantry]"));
}

#[test]
fn what_is_built_into_a_thing_may_go_into_it() {
    for rest in [
        "attached_to = \"table\"\nposition_mm = [0, 0, 0]",
        "class = \"robot_table\"\nposition_mm = [-300, 0, 780]",
        "attached_to = \"gantry\"\nposition_mm = [0, 600, 0]",
        "attached_to = \"robot_base\"\nposition_mm = [0, 0, -50]",
    ] {
        let text = format!(
            "[[obstacles]]\nname = \"it\"\n{rest}\nshape = {{ box = {{ size_mm = [60, 60, 60] }} }}\n"
        );
        let resolved = room(&text).unwrap();
        assert!(!resolved.notes.iter().any(|note| note.contains("`it` is ")));
    }
    let hanging = room(
        "[[obstacles]]\nname = \"lamp\"\nposition_mm = [0, 0, 2100]\n\
         shape = { sphere = { radius_mm = 200 } }\n",
    )
    .unwrap();
    let note = "obstacle `lamp` is 1900 mm above the floor without support";
    assert!(hanging.notes.iter().any(|each| each.contains(note)));
}

#[test]
fn place_and_presence_vary_as_the_text_would() {
    let section = |x_mm: f64, present: bool| {
        format!(
            "[[obstacles]]\nname = \"tray\"\nattached_to = \"table\"\npresent = {present}\n\
             position_mm = [{x_mm}, 100, 300]\nshape = {{ box = {{ size_mm = [400, 300, 20] }} }}\n"
        )
    };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("room.toml");
    std::fs::write(&path, format!("{ROOM}{}", section(-200.0, true))).unwrap();
    let family = ScenarioFamily::load(&path, &Overrides::default()).unwrap();
    let key = |text: &str| KeyPath::parse(text).unwrap();
    let presence = key("obstacles[0].present");
    let along = key("obstacles[0].position_mm[0]");
    for (change, wanted) in [
        ((along.clone(), Change::Add(-125.0)), section(-325.0, true)),
        (
            (along, Change::Set(Setting::from(40.0))),
            section(40.0, true),
        ),
        (
            (presence, Change::Set(Setting::from(false))),
            section(-200.0, false),
        ),
    ] {
        family.check(&change.0, &change.1).unwrap();
        let varied = family.vary("a", &[change]).unwrap();
        let text = format!("{ROOM}{wanted}");
        let file = path.display().to_string();
        let from_text = resolve_scenario(&file, &text, folder.path(), &Overrides::default());
        let mut from_text = from_text.unwrap();
        // The hash of another text.
        from_text.source = varied.source.clone();
        assert!(varied == from_text);
    }
    let through = [(
        key("obstacles[0].position_mm[2]"),
        Change::Set(Setting::from(-800.0)),
    )];
    let findings = family.vary("a", &through).unwrap_err();
    assert!(
        findings[0].message.contains("below the floor"),
        "{findings:?}"
    );
}

#[test]
fn a_criterion_for_obstacles_that_are_not_there_is_noted() {
    let judged = "[criteria.min_clearance_mm]\nrobot_obstacle = 30\n";
    let note = "robot_obstacle` is not evaluated: there is no [[obstacles]]";
    let has_note = |text: &str| {
        let resolved = room(&format!("{judged}{text}")).unwrap();
        resolved.notes.iter().any(|each| each.contains(note))
    };
    let ball = |rest: &str| {
        format!(
            "[[obstacles]]\nname = \"ball\"\n{rest}\nposition_mm = [0, 1500, 100]\n\
             shape = {{ sphere = {{ radius_mm = 100 }} }}\n"
        )
    };
    assert!(has_note(""));
    assert!(has_note(&ball("present = false")));
    assert!(has_note(&ball("class = \"robot_table\"")));
    assert!(!has_note(&ball("")));
}

#[test]
fn gravity_pulls_down_whatever_way_the_base_looks() {
    for rpy_deg in [
        [0.0; 3],
        [180.0, 0.0, 0.0],
        [90.0, 0.0, 0.0],
        [20.0, -140.0, 70.0],
    ] {
        let text = ROOM.replace("[180, 10, 30]", &format!("{rpy_deg:?}"));
        let resolved = resolve_scenario("r.toml", &text, &scenarios(), &Overrides::default());
        let cell = resolved.unwrap().cell;
        let in_world = cell.robot.world_from_base_link.rotation * cell.dynamics().gravity_m_s2;
        assert!((in_world - Vector3::new(0.0, 0.0, -9.80665)).norm() < ROUNDING_M);
    }
}
