//! URDF files of other houses: other link frames, packages, meshes and gaps.
//!
//! `foreign_urdf/arm.urdf` describes an arm with the lengths of a UR3. Its forward kinematics and
//! dynamics are held against Pinocchio in `tests/validation/dynamics`; here it is about what a
//! user is told and what becomes of meshes.

use std::fmt::Write as _;
use std::fs;
use std::path::PathBuf;

use nalgebra::{Matrix3, Vector3};
use needlebench_cell::Robot;
use needlebench_geometry::{Shape, TriangleMesh};
use needlebench_input::{Finding, PackagePaths};
use needlebench_kinematics::{Body, Dynamics, Joints, Pose, UrGeometry, rotation_angle_between};
use needlebench_robot::{Arm, LoadedRobot, MissingInertia};
use needlebench_scenario::{Overrides, load_robot};

const ARM: &str = include_str!("foreign_urdf/arm.urdf");

/// A comment in the file in whose place tests put elements of the upper arm.
const UPPER_ARM: &str = "<!-- more of the upper arm -->";

/// Half edges of the box that the STL files hold, and its centre, m.
const HALF_M: [f32; 3] = [0.03, 0.02, 0.01];
const CENTRE_M: [f32; 3] = [0.1, 0.0, -0.05];

/// Half of the last printed digit of the file's origins, some times over.
const PRINTED_M: f64 = 1e-9;

/// Sums of a few numbers of order one.
const ROUNDING: f64 = 1e-14;

/// A URDF with a package of meshes beside it.
struct Files {
    folder: tempfile::TempDir,
}

impl Files {
    fn new(urdf: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        fs::create_dir_all(folder.path().join("package/meshes")).unwrap();
        fs::write(folder.path().join("arm.urdf"), urdf).unwrap();
        let files = Self { folder };
        files.add("box.stl", &box_stl(b"a box", 1.0));
        files
    }

    fn add(&self, name: &str, bytes: &[u8]) {
        fs::write(self.package().join("meshes").join(name), bytes).unwrap();
    }

    fn package(&self) -> PathBuf {
        self.folder.path().join("package")
    }

    fn overrides(&self) -> Overrides {
        let argument = format!("my-robot={}", self.package().display());
        Overrides {
            robot_urdf: Some(self.folder.path().join("arm.urdf")),
            packages: PackagePaths::from_arguments(&[argument]).unwrap(),
            ..Overrides::default()
        }
    }

    fn load(&self) -> Result<LoadedRobot, Finding> {
        load_robot(&self.overrides())
    }
}

fn arm() -> LoadedRobot {
    Files::new(ARM).load().unwrap()
}

/// The arm's file with one place changed.
#[track_caller]
fn changed(from: &str, to: &str) -> String {
    assert_eq!(ARM.matches(from).count(), 1, "{from}");
    ARM.replace(from, to)
}

fn with_upper_arm(elements: &str) -> String {
    changed(UPPER_ARM, elements)
}

fn collision_mesh(filename: &str, more: &str) -> String {
    with_upper_arm(&format!(
        r#"<collision><geometry><mesh filename="{filename}" {more}/></geometry></collision>"#
    ))
}

fn corner(index: usize) -> [f32; 3] {
    std::array::from_fn(|axis| {
        let side = if index >> axis & 1 == 0 { -1.0 } else { 1.0 };
        CENTRE_M[axis] + side * HALF_M[axis]
    })
}

/// The box's triangles as corner indices, counter-clockwise from outside.
const BOX: [[usize; 3]; 12] = [
    [0, 2, 1],
    [1, 2, 3],
    [4, 5, 6],
    [5, 7, 6],
    [0, 1, 4],
    [1, 5, 4],
    [2, 6, 3],
    [3, 6, 7],
    [0, 4, 2],
    [2, 4, 6],
    [1, 3, 5],
    [3, 7, 5],
];

/// The box as a binary STL file, in units of `1 / per_metre` m.
fn box_stl(header: &[u8], per_metre: f32) -> Vec<u8> {
    let mut bytes = vec![b' '; 80];
    bytes[..header.len()].copy_from_slice(header);
    bytes.extend(12_u32.to_le_bytes());
    for triangle in BOX {
        bytes.extend([0; 12]);
        for number in triangle.map(corner).as_flattened() {
            bytes.extend((number * per_metre).to_le_bytes());
        }
        bytes.extend([0; 2]);
    }
    bytes
}

fn volume_m3(mesh: &TriangleMesh) -> f64 {
    let corner = |index: u32| mesh.vertices_m[index as usize].coords;
    mesh.triangles
        .iter()
        .map(|triangle| {
            let [a, b, c] = triangle.map(corner);
            a.dot(&b.cross(&c)) / 6.0
        })
        .sum()
}

fn box_volume_m3() -> f64 {
    8.0 * HALF_M.map(f64::from).iter().product::<f64>()
}

/// The only mesh among the upper arm's collision geometry; the box does not enclose the arm that the joints make, so
/// primitives stand beside it.
fn upper_arm_hull(robot: &Robot) -> TriangleMesh {
    let solids = &robot.links[1].solids;
    let meshes = solids.iter().filter_map(|solid| match &solid.shape {
        Shape::Convex(mesh) => Some(mesh.0.clone()),
        _ => None,
    });
    let [mesh] = &meshes.collect::<Vec<_>>()[..] else {
        panic!("{solids:?}")
    };
    mesh.clone()
}

#[track_caller]
fn assert_is_the_box(mesh: &TriangleMesh) {
    assert_eq!((mesh.vertices_m.len(), mesh.triangles.len()), (8, 12));
    // Coordinates are single precision in the file.
    assert!((volume_m3(mesh) / box_volume_m3() - 1.0).abs() < 1e-5);
    let centre = mesh
        .vertices_m
        .iter()
        .map(|v| v.coords)
        .sum::<Vector3<f64>>()
        / 8.0;
    assert!((centre - Vector3::from(CENTRE_M.map(f64::from))).norm() < 1e-8);
}

#[track_caller]
fn assert_noted(robot: &LoadedRobot, text: &str) {
    let notes = &robot.description.notes;
    assert!(notes.iter().any(|note| note.contains(text)), "{notes:?}");
}

#[test]
fn link_frames_do_not_matter_to_the_flange() {
    let (foreign, ur3) = (arm().chain, UrGeometry::UR3.chain());
    for i in 0..20 {
        let q = Joints::from_fn(|joint, _| libm::sin(f64::from(i) * 1.7 + joint as f64) * 3.0);
        let [a, b] = [foreign, ur3].map(|chain| chain.base_link_from_flange(&q));
        assert!((a.translation.vector - b.translation.vector).norm() < PRINTED_M);
        assert!(rotation_angle_between(&a.rotation, &b.rotation) < PRINTED_M);
    }
}

#[test]
fn an_inertia_is_turned_with_its_frame() {
    let quarter = std::f64::consts::FRAC_PI_2;
    let text = changed(
        r#"<origin xyz="0.011 0.023 -0.007" rpy="0.4 -0.3 1.1"/>"#,
        &format!(r#"<origin xyz="0.011 0.023 -0.007" rpy="0 0 {quarter}"/>"#),
    );
    let body = Files::new(&text).load().unwrap().bodies[0];
    // x of the inertial frame is y of the link, y is -x.
    let expected = Matrix3::new(
        0.0052, -0.0002, -0.0001, //
        -0.0002, 0.0041, -0.0003, //
        -0.0001, -0.0003, 0.0029,
    );
    assert!((body.inertia_kgm2 - expected).amax() < ROUNDING);
    assert!((body.com_m - Vector3::new(0.011, 0.023, -0.007)).norm() < ROUNDING);
}

#[test]
fn fixed_links_add_their_mass_to_the_link_that_carries_them() {
    let bodies = arm().bodies;
    for (body, mass_kg) in bodies.iter().zip([2.3, 3.1, 1.31, 0.75, 0.85, 0.33]) {
        assert!((body.mass_kg - mass_kg).abs() < ROUNDING);
    }
    // The adapter between elbow and wrist 1 belongs to the forearm.
    let rotation = |[r, p, y]: [f64; 3]| nalgebra::Rotation3::from_euler_angles(r, p, y);
    let adapter = Vector3::new(0.05, -0.02, 0.03)
        + rotation([0.2, -0.4, 1.0]) * Vector3::new(-0.1, 0.05, -0.03);
    let com_m = (Vector3::new(-0.09, -0.01, 0.004) * 1.1 + adapter * 0.21) / 1.31;
    assert!((bodies[2].com_m - com_m).norm() < ROUNDING);
}

#[test]
fn a_joint_without_end_has_no_position_limits() {
    let limits = arm().limits;
    let wrist_3 = limits.0[5];
    assert_eq!(
        (wrist_3.lower_rad, wrist_3.upper_rad),
        (f64::NEG_INFINITY, f64::INFINITY)
    );
    assert_eq!((wrist_3.effort_nm, wrist_3.velocity_rad_s), (12.5, 5.9));
    let far = Joints::new(0.0, 0.0, 0.0, 0.0, 0.0, 50.0);
    assert_eq!(limits.first_violation(&far), None);
    assert!(limits.margin(&far) > 0.9);
}

#[test]
fn what_stands_above_base_link_stays_beside_it() {
    let robot = arm();
    assert_eq!(robot.world_from_base_link, Pose::identity());
    assert_noted(
        &robot,
        "its pose relative to 'world' in the URDF is ignored",
    );
    // The plate is not turned in the file's world, in which base_link is, by 0.6 rad.
    let plate = robot.base.solids.iter().find(
        |solid| matches!(&solid.shape, Shape::Cuboid { half_extents_m } if half_extents_m.x == 0.1),
    );
    let pose = plate.unwrap().parent_from_shape;
    assert!((pose.translation.vector - Vector3::new(0.0, 0.0, -0.01)).norm() < ROUNDING);
    let turned = Pose::rotation(Vector3::z() * -0.6).rotation;
    assert!(rotation_angle_between(&pose.rotation, &turned) < ROUNDING);
}

#[test]
fn limits_that_are_not_a_ur3s_are_told() {
    let robot = arm();
    assert_noted(&robot, "effort limits used: 61, 62, 33, 14, 13, 12.5 N m");
    assert_noted(&robot, "the shipped UR3's are 56, 56, 28, 12, 12, 12");
    assert_noted(
        &robot,
        "velocity limits used: 2.9, 2.8, 2.7, 6.1, 6, 5.9 rad/s",
    );
}

#[test]
fn a_package_may_have_a_hyphen_in_its_name() {
    let files = Files::new(&collision_mesh("package://my-robot/meshes/box.stl", ""));
    let robot = files.load().unwrap();
    assert_is_the_box(&upper_arm_hull(&robot));
    assert_noted(
        &robot,
        "'upper_arm_link' is convex: it is used as its convex hull (8 vertices)",
    );
}

#[test]
fn an_unknown_package_is_named_with_the_option_that_gives_it() {
    let files = Files::new(&collision_mesh("package://other-robot/meshes/box.stl", ""));
    let finding = files.load().unwrap_err().to_string();
    assert!(finding.contains("`other-robot`"), "{finding}");
    assert!(
        finding.contains("--package-path other-robot=DIR"),
        "{finding}"
    );
    assert!(finding.contains("arm.urdf:"), "{finding}");
}

#[test]
fn a_missing_collision_mesh_is_an_error_with_its_line() {
    let text = collision_mesh("package://my-robot/meshes/gone.stl", "");
    let finding = Files::new(&text).load().unwrap_err();
    let line = text.lines().position(|line| line.contains("gone.stl"));
    assert_eq!(finding.line, line.map(|line| line + 1));
    assert!(finding.to_string().contains("gone.stl"), "{finding}");
}

#[test]
fn a_mesh_that_is_no_stl_is_an_error_where_it_can_be_hit() {
    let files = Files::new(&collision_mesh("package://my-robot/meshes/box.stl", ""));
    files.add("box.stl", b"<COLLADA/>");
    let finding = files.load().unwrap_err().to_string();
    assert!(finding.contains("box.stl"), "{finding}");
}

/// Wrist 2 carries a camera that has a surface of its own: that must not hide the gap.
#[test]
fn a_link_whose_visual_is_collada_is_drawn_as_its_collision_geometry() {
    let file = "package://my-robot/meshes/wrist.dae";
    let text = changed(
        r#"<link name="wrist_2_link">"#,
        &format!(
            r#"<link name="wrist_2_link"><visual><geometry><mesh filename="{file}"/></geometry></visual>"#
        ),
    );
    let robot = Files::new(&text).load().unwrap();
    assert_noted(
        &robot,
        "omitted from images, which show its collision geometry instead",
    );
    let visuals = &robot.links[4].visuals;
    assert_eq!(
        visuals.len(),
        2,
        "sphere of the wrist and box of the camera"
    );
    assert_eq!(visuals[1].color_rgba, [0.9, 0.5, 0.1, 1.0]);
}

#[test]
fn a_mesh_is_drawn_itself_not_as_its_hull() {
    let file = "package://my-robot/meshes/box.stl";
    let mesh = format!(r#"<geometry><mesh filename="{file}"/></geometry>"#);
    let text = with_upper_arm(&format!(
        r#"<visual><geometry><mesh filename="gone.dae"/></geometry></visual>
        <collision>{mesh}</collision>"#
    ));
    let files = Files::new(&text);
    // Without its last two triangles the box is open, which its hull is not.
    let mut open = box_stl(b"open", 1.0);
    open.truncate(84 + 10 * 50);
    open[80] = 10;
    files.add("box.stl", &open);
    let robot = files.load().unwrap();
    assert_eq!(upper_arm_hull(&robot).triangles.len(), 12);
    let drawn = &robot.links[1].visuals.last().unwrap().mesh;
    assert_eq!(drawn.triangles.len(), 10);
}

#[test]
fn meshes_are_scaled() {
    let scale = r#"scale="0.001 0.001 0.001""#;
    let files = Files::new(&collision_mesh("package://my-robot/meshes/box.stl", scale));
    files.add("box.stl", &box_stl(b"millimetres", 1000.0));
    assert_is_the_box(&upper_arm_hull(&files.load().unwrap()));
}

#[test]
fn a_mirrored_mesh_keeps_its_outside_out() {
    let file = "package://my-robot/meshes/box.stl";
    let text = with_upper_arm(&format!(
        r#"<visual><geometry><mesh filename="{file}" scale="1 -1 1"/></geometry></visual>"#
    ));
    let robot = Files::new(&text).load().unwrap();
    let volume = volume_m3(&robot.links[1].visuals[0].mesh);
    assert!((volume / box_volume_m3() - 1.0).abs() < 1e-5, "{volume}");
}

#[test]
fn stl_files_are_told_apart_by_their_size_not_their_first_word() {
    let files = Files::new(&collision_mesh("package://my-robot/meshes/box.stl", ""));
    files.add("box.stl", &box_stl(b"solid box\n", 1.0));
    assert_is_the_box(&upper_arm_hull(&files.load().unwrap()));

    let mut text = "solid\n".to_owned();
    for triangle in BOX {
        text += "facet normal 0 0 0\nouter loop\n";
        for [x, y, z] in triangle.map(corner) {
            writeln!(text, "vertex {x} {y} {z}").unwrap();
        }
        text += "endloop\nendfacet\n";
    }
    files.add("box.stl", (text + "endsolid\n").as_bytes());
    assert_is_the_box(&upper_arm_hull(&files.load().unwrap()));
}

#[test]
fn a_moving_link_without_collision_geometry_is_told() {
    let text = changed(
        r#"<collision>
      <geometry><sphere radius="0.03"/></geometry>
    </collision>"#,
        "",
    );
    let robot = Files::new(&text).load().unwrap();
    assert_noted(&robot, "wrist_3 has no collision geometry");
}

/// The arm's file without a single mass.
fn massless() -> String {
    let mut text = ARM.to_owned();
    while let Some(start) = text.find("<inertial>") {
        let end = text.find("</inertial>").unwrap() + "</inertial>".len();
        text.replace_range(start..end, "");
    }
    text
}

#[test]
fn a_moving_link_without_mass_is_an_error() {
    let finding = Files::new(&massless()).load().unwrap_err().to_string();
    assert!(
        finding.contains("link 'shoulder_link' has no mass"),
        "{finding}"
    );
    assert!(
        finding.contains("--missing-inertia nominal-ur3"),
        "{finding}"
    );
    let point = changed(
        r#"<inertia ixx="0.0041" ixy="0.0002" ixz="-0.0003" iyy="0.0052" iyz="0.0001" izz="0.0029"/>"#,
        r#"<inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/>"#,
    );
    let finding = Files::new(&point).load().unwrap_err().to_string();
    assert!(finding.contains("has no moment of inertia"), "{finding}");
}

/// Link frames differ, so the stand-in's masses have to be moved into them.
#[test]
fn nominal_masses_weigh_the_same_in_other_link_frames() {
    let files = Files::new(&massless());
    let foreign = load_robot(&Overrides {
        missing_inertia: Some(MissingInertia::NominalOf("ur3".to_owned())),
        ..files.overrides()
    })
    .unwrap();
    for link in [
        "shoulder",
        "upper_arm",
        "forearm",
        "wrist_1",
        "wrist_2",
        "wrist_3",
    ] {
        let note = format!("link '{link}_link' has no mass: the shipped UR3's {link} is used");
        assert_noted(&foreign, &note);
    }
    let shipped = load_robot(&Overrides::default()).unwrap();
    let q = Joints::new(0.4, -1.3, 1.1, 0.7, -0.9, 2.0);
    let (qd, qdd) = (q.map(|x| x - 0.5), q.map(|x| 3.0 * x + 1.0));
    let [a, b] = [&foreign, &shipped].map(|robot| {
        let dynamics = Dynamics {
            chain: robot.chain,
            bodies: robot.bodies,
            armature_kgm2: Joints::zeros(),
            gravity_m_s2: Vector3::new(0.0, 0.0, -9.80665),
        };
        dynamics.inverse_dynamics(&q, &qd, &qdd)
    });
    assert!((a - b).amax() < 1e-7, "{a} {b}");
    assert_ne!(
        foreign.bodies.map(|body: Body| body.com_m),
        shipped.bodies.map(|body| body.com_m)
    );
}

#[test]
fn nominal_masses_are_not_given_to_another_arm() {
    let longer = massless().replacen(r#"xyz="0 0 0.1219""#, r#"xyz="0 0 0.1339""#, 1);
    let files = Files::new(&longer);
    let finding = load_robot(&Overrides {
        missing_inertia: Some(MissingInertia::NominalOf("ur3".to_owned())),
        ..files.overrides()
    })
    .unwrap_err()
    .to_string();
    assert!(finding.contains("lengths are not a UR3's"), "{finding}");
}

#[test]
fn a_file_that_xacro_wrote_is_a_urdf_and_one_for_xacro_is_not() {
    assert!(ARM.contains("xmlns:xacro") && ARM.contains("${"));
    for (from, to) in [
        (UPPER_ARM, r#"<xacro:insert_block name="more"/>"#),
        (r#"<mass value="2.1"/>"#, r#"<mass value="${base_mass}"/>"#),
    ] {
        let finding = Files::new(&changed(from, to)).load().unwrap_err();
        let line = changed(from, to).lines().position(|line| line.contains(to));
        assert_eq!(finding.line, line.map(|line| line + 1));
        assert!(finding.to_string().contains("xacro file"), "{finding}");
    }
}

/// The loader looks joints up by name.
#[test]
fn a_joint_name_is_not_given_twice() {
    let again = r#"<link name="spare"/><joint name="elbow_joint" type="revolute">
        <parent link="base_link"/><child link="spare"/>
        <limit lower="-1" upper="1" effort="1" velocity="1"/></joint><transmission name="pan">"#;
    let text = changed(r#"<transmission name="pan">"#, again);
    let finding = Files::new(&text).load().unwrap_err().to_string();
    assert!(
        finding.contains("duplicate joint 'elbow_joint'"),
        "{finding}"
    );
}

/// The shipped arm's file with other collision shapes.
fn shipped(arm: &str, change: impl Fn(&str) -> String) -> Result<LoadedRobot, Finding> {
    let path = format!(
        "{}/../../models/{arm}/{arm}.urdf",
        env!("CARGO_MANIFEST_DIR")
    );
    Files::new(&change(&fs::read_to_string(path).unwrap())).load()
}

/// A text without its elements of a kind.
fn without(text: &str, tag: &str) -> String {
    let (open, close) = (format!("<{tag}"), format!("</{tag}>"));
    let mut left = text;
    let mut kept = String::new();
    while let Some(start) = left.find(&open) {
        kept += &left[..start];
        left = &left[start + left[start..].find(&close).unwrap() + close.len()..];
    }
    kept + left
}

/// Reach of each link's shapes in a bundle of directions, m.
fn reaches(robot: &Robot) -> Vec<f64> {
    let mut all = Vec::new();
    for link in std::iter::once(&robot.base).chain(&robot.links) {
        for k in 0..50 {
            let (sine, cosine) = libm::sincos(f64::from(k) * 2.4);
            let height = 1.0 - f64::from(k) / 24.5;
            let ring = (1.0 - height * height).max(0.0).sqrt();
            let way = Vector3::new(ring * cosine, ring * sine, height);
            let points = link.solids.iter().flat_map(|solid| {
                let surface = solid.shape.surface(1e-4);
                let placed = surface.vertices_m.into_iter();
                placed.map(|point| (solid.parent_from_shape * point).coords.dot(&way))
            });
            all.push(points.fold(f64::NEG_INFINITY, f64::max));
        }
    }
    all
}

#[test]
fn a_known_arm_without_shapes_is_as_large_as_it_is() {
    for arm in Arm::shipped_names() {
        let whole = reaches(&shipped(arm, str::to_owned).unwrap());
        // All shapes out; a speck at the flange; links as thin as sticks.
        let stick = "<collision><geometry><cylinder radius=\"0.01\" length=\"0.3\"/></geometry></collision>";
        let bare = |text: &str| without(text, "collision");
        let speck = "<collision><geometry><box size=\"0.01 0.01 0.01\"/></geometry></collision>";
        let changes: [&dyn Fn(&str) -> String; 3] = [
            &bare,
            &|text| {
                bare(text).replacen(
                    "<link name=\"wrist_3_link\">",
                    &format!("<link name=\"wrist_3_link\">{speck}"),
                    1,
                )
            },
            &|text| {
                let mut text = bare(text);
                for link in ["upper_arm_link", "forearm_link"] {
                    let open = format!("<link name=\"{link}\">");
                    text = text.replacen(&open, &format!("{open}{stick}"), 1);
                }
                text
            },
        ];
        for (index, change) in changes.into_iter().enumerate() {
            let robot = shipped(arm, change).unwrap();
            assert!(
                robot.unseen.is_empty(),
                "{arm}, {index}: {:?}",
                robot.unseen
            );
            assert_noted(&robot, "are added to it");
            for (own, known) in reaches(&robot).iter().zip(&whole) {
                assert!(own >= &(known - 1e-6), "{arm}, {index}: {own} {known}");
            }
        }
    }
}

#[test]
fn shapes_that_fill_their_links_stay_as_they_are() {
    for arm in Arm::shipped_names() {
        let robot = shipped(arm, str::to_owned).unwrap();
        let told = robot
            .description
            .notes
            .iter()
            .any(|note| note.contains("are added to it"));
        assert!(!told, "{:?}", robot.description.notes);
    }
}

#[test]
fn an_unknown_arm_without_shapes_is_unseen() {
    // A forearm that no arm has.
    let longer = |text: &str| {
        let text = without(text, "collision");
        assert!(text.contains("-0.2132"), "the forearm's length");
        text.replace("-0.2132", "-0.2532")
    };
    let robot = shipped("ur3e", longer).unwrap();
    let names: Vec<&str> = robot.unseen.iter().map(|part| part.name.as_str()).collect();
    assert!(names.contains(&"forearm") && names.len() == 7, "{names:?}");
}

#[test]
fn what_is_bolted_on_and_drawn_has_to_have_a_shape() {
    let camera = r#"
      <link name="camera_link"><visual><geometry><box size="0.1 0.1 0.1"/></geometry></visual></link>
      <joint name="camera_joint" type="fixed"><parent link="wrist_3_link"/><child link="camera_link"/></joint>
    </robot>"#;
    let robot = shipped("ur3e", |text| text.replace("</robot>", camera)).unwrap();
    let names: Vec<&str> = robot.unseen.iter().map(|part| part.name.as_str()).collect();
    assert_eq!(names, ["camera_link"]);
}

#[test]
fn a_prefix_is_taken_off_and_told() {
    let prefixed = |text: &str| {
        let mut text = text.to_owned();
        for key in [
            "<link name=\"",
            "<joint name=\"",
            "<parent link=\"",
            "<child link=\"",
        ] {
            text = text.replace(key, &format!("{key}left_"));
        }
        text
    };
    let robot = shipped("ur3e", prefixed).unwrap();
    assert_noted(&robot, "prefix `left_` removed");
    assert_eq!(robot.chain, shipped("ur3e", str::to_owned).unwrap().chain);
}

/// A file with two UR3e, or with the prefix of one of them.
fn two_arms(prefix: Option<&str>) -> Result<LoadedRobot, Finding> {
    let path = format!("{}/../../models/ur3e/ur3e.urdf", env!("CARGO_MANIFEST_DIR"));
    let text = fs::read_to_string(path).unwrap();
    let (start, end) = (text.find("<link").unwrap(), text.find("</robot>").unwrap());
    let arm = |prefix: &str| {
        let keys = [
            "<link name=\"",
            "<joint name=\"",
            "<parent link=\"",
            "<child link=\"",
        ];
        keys.iter().fold(text[start..end].to_owned(), |text, key| {
            text.replace(key, &format!("{key}{prefix}"))
        })
    };
    let root = arm("left_");
    let root = root.split('"').nth(1).unwrap();
    let both = format!(
        "{}{}{}<joint name=\"between\" type=\"fixed\"><parent link=\"left_base_link\"/><child link=\"{}\"/>\
         <origin xyz=\"0 0.9 0\"/></joint></robot>",
        &text[..start],
        arm("left_"),
        arm("right_"),
        root.replace("left_", "right_"),
    );
    let files = Files::new(&both);
    load_robot(&Overrides {
        prefix: prefix.map(str::to_owned),
        ..files.overrides()
    })
}

#[test]
fn of_two_arms_one_is_said_and_the_other_stands_still() {
    let finding = two_arms(None).unwrap_err().to_string();
    assert!(
        finding.contains("2 UR arms, `left_` and `right_`") && finding.contains("--prefix"),
        "{finding}"
    );
    let finding = two_arms(Some("middle_")).unwrap_err().to_string();
    assert!(finding.contains("`left_` and `right_`"), "{finding}");
    let single = shipped("ur3e", str::to_owned).unwrap();
    let mut bases = Vec::new();
    for prefix in ["left_", "right_"] {
        let robot = two_arms(Some(prefix)).unwrap();
        assert_eq!(robot.chain, single.chain);
        assert_noted(&robot, &format!("prefix `{prefix}` removed"));
        assert_noted(&robot, "fixed at 0");
        // The other arm is of the base, as far away as the file has it.
        assert!(robot.base.solids.len() >= single.base.solids.len() + 6);
        bases.push(reaches(&robot));
    }
    let most = |index: usize| bases[index][..50].iter().copied().fold(0.0, f64::max);
    assert!(most(0) > 0.9 && most(1) > 0.9, "{} {}", most(0), most(1));
}

#[test]
fn a_mass_alone_is_a_points_and_moments_alone_are_nobodys() {
    let given = |policy: Option<MissingInertia>, change: &dyn Fn(&str) -> String| {
        let path = format!("{}/../../models/ur3/ur3.urdf", env!("CARGO_MANIFEST_DIR"));
        let files = Files::new(&change(&fs::read_to_string(path).unwrap()));
        load_robot(&Overrides {
            missing_inertia: policy,
            ..files.overrides()
        })
    };
    let single = |text: &str, tag: &str| {
        let mut text = text.to_owned();
        while let Some(start) = text.find(&format!("<{tag} ")) {
            let end = start + text[start..].find("/>").unwrap() + 2;
            text.replace_range(start..end, "");
        }
        text
    };
    let whole = shipped("ur3", str::to_owned).unwrap();
    for (tag, lacks, told) in [
        ("inertia", "no moment of inertia", "it is a point mass"),
        ("mass", "no mass", "has no <mass> and is ignored"),
    ] {
        let change = |text: &str| single(text, tag);
        let finding = given(None, &change).unwrap_err().to_string();
        assert!(finding.contains(lacks), "{finding}");
        assert!(
            finding.contains("--missing-inertia nominal-ur3"),
            "{finding}"
        );
        let robot = given(Some(MissingInertia::Nominal), &change).unwrap();
        assert_noted(&robot, told);
        for (own, known) in robot.bodies.iter().zip(&whole.bodies) {
            assert!((own.mass_kg - known.mass_kg).abs() < 1e-12);
            assert!((own.inertia_kgm2 - known.inertia_kgm2).amax() < 1e-12);
        }
    }
}

#[test]
fn an_element_of_thousands_of_attributes_is_refused() {
    let mut many = String::new();
    for k in 0..5000 {
        write!(many, " a{k}=\"1\"").unwrap();
    }
    let text = changed(
        "<link name=\"world\"/>",
        &format!("<link name=\"world\"{many}/>"),
    );
    let finding = Files::new(&text).load().unwrap_err().to_string();
    assert!(finding.contains("5001 attributes"), "{finding}");
}

/// The box as an OBJ file, and as a COLLADA file in centimetres.
fn box_obj(per_metre: f32) -> String {
    let mut text = String::new();
    for at in 0..8 {
        let [x, y, z] = corner(at).map(|number| number * per_metre);
        writeln!(text, "v {x} {y} {z}").unwrap();
    }
    for [a, b, c] in BOX {
        writeln!(text, "f {} {} {}", a + 1, b + 1, c + 1).unwrap();
    }
    text
}

fn box_dae() -> String {
    let corners = (0..8)
        .flat_map(corner)
        .map(|number| (number * 100.0).to_string());
    let corners: Vec<String> = corners.collect();
    let indices: Vec<String> = BOX.as_flattened().iter().map(usize::to_string).collect();
    format!(
        "<COLLADA version=\"1.4.1\"><asset><unit meter=\"0.01\"/><up_axis>Z_UP</up_axis></asset>\
         <library_geometries><geometry id=\"g\"><mesh><source id=\"s\"><float_array id=\"f\">{}</float_array>\
         <technique_common><accessor source=\"#f\" count=\"8\" stride=\"3\"/></technique_common></source>\
         <vertices id=\"v\"><input semantic=\"POSITION\" source=\"#s\"/></vertices><triangles>\
         <input semantic=\"VERTEX\" source=\"#v\" offset=\"0\"/><p>{}</p></triangles></mesh></geometry>\
         </library_geometries></COLLADA>",
        corners.join(" "),
        indices.join(" ")
    )
}

#[test]
fn obj_and_collada_are_read_whatever_the_case_of_their_names() {
    for (name, scale, bytes) in [
        ("box.OBJ", "", box_obj(1.0).into_bytes()),
        (
            "mm.obj",
            r#"scale="0.001 0.001 0.001""#,
            box_obj(1000.0).into_bytes(),
        ),
        ("box.dae", "", box_dae().into_bytes()),
        ("box.DAE", "", box_dae().into_bytes()),
        ("loud.STL", "", box_stl(b"a box", 1.0)),
    ] {
        let files = Files::new(&collision_mesh(
            &format!("package://my-robot/meshes/{name}"),
            scale,
        ));
        files.add(name, &bytes);
        assert_is_the_box(&upper_arm_hull(&files.load().unwrap()));
    }
}

#[test]
fn formats_that_are_not_read_are_named() {
    for (name, what) in [
        ("box.ply", "a PLY file"),
        ("b.GLB", "a glTF file"),
        ("b.step", "a STEP file"),
        ("b", "not a mesh file"),
    ] {
        let files = Files::new(&collision_mesh(
            &format!("package://my-robot/meshes/{name}"),
            "",
        ));
        files.add(name, b"ply");
        let finding = files.load().unwrap_err();
        assert!(finding.message.contains(what), "{finding}");
        assert!(finding.hint.unwrap().contains("STL, OBJ and COLLADA"));
    }
}

#[test]
fn names_of_meshes_are_uris() {
    for filename in [
        "package://my-robot/meshes/a%20box.stl",
        "model://my-robot/meshes/a%20box.stl",
        "package://my-robot/meshes/a box.stl",
        "file://package/meshes/a box.stl",
    ] {
        let files = Files::new(&collision_mesh(filename, ""));
        files.add("a box.stl", &box_stl(b"a box", 1.0));
        assert_is_the_box(&upper_arm_hull(&files.load().unwrap()));
    }
    // A file whose name has the escape itself.
    let files = Files::new(&collision_mesh("package://my-robot/meshes/50%25.stl", ""));
    files.add("50%25.stl", &box_stl(b"a box", 1.0));
    assert_is_the_box(&upper_arm_hull(&files.load().unwrap()));
    let finding = Files::new(&collision_mesh("https://example.org/box.stl", "")).load();
    assert!(
        finding
            .unwrap_err()
            .message
            .contains("`https://` is not supported")
    );
}

#[test]
fn an_axis_of_a_joint_that_does_not_turn_does_not_matter() {
    let zero = |text: &str| {
        text.replacen(
            "<child link=\"tool0\"/>",
            "<child link=\"tool0\"/><axis xyz=\"0 0 0\"/>",
            1,
        )
    };
    assert_eq!(
        shipped("ur3e", zero).unwrap().chain,
        shipped("ur3e", str::to_owned).unwrap().chain
    );
}

#[test]
fn soft_limits_narrow_a_joint_and_are_told() {
    let soft = "<safety_controller soft_lower_limit=\"-0.5\" soft_upper_limit=\"0.5\" k_position=\"20\" k_velocity=\"0\"/>";
    let with = |text: &str| {
        let at = text.find("<joint name=\"wrist_3_joint\"").unwrap();
        let end = at + text[at..].find("</joint>").unwrap();
        format!("{}{soft}{}", &text[..end], &text[end..])
    };
    let robot = shipped("ur3e", with).unwrap();
    let limit = robot.limits.0[5];
    assert_eq!([limit.lower_rad, limit.upper_rad], [-0.5, 0.5]);
    assert_noted(&robot, "wrist_3_joint");
}

#[test]
fn a_declared_latin_1_is_read() {
    let path = format!("{}/../../models/ur3e/ur3e.urdf", env!("CARGO_MANIFEST_DIR"));
    let text = fs::read_to_string(path).unwrap();
    let files = Files::new("");
    let write = |declaration: &str| {
        let (_, rest) = text.split_once("?>").unwrap();
        let mut bytes = declaration.as_bytes().to_vec();
        bytes.extend(b"<!-- Pr\xfcfstand -->");
        bytes.extend(rest.bytes().filter(u8::is_ascii));
        fs::write(files.folder.path().join("arm.urdf"), bytes).unwrap();
    };
    write("<?xml version=\"1.0\" encoding=\"ISO-8859-1\"?>");
    files.load().unwrap();
    write("<?xml version=\"1.0\"?>");
    let finding = files.load().unwrap_err().to_string();
    assert!(finding.contains("ISO-8859-1"), "{finding}");
}

#[test]
fn another_makers_arm_is_called_that() {
    let kuka = |text: &str| {
        let mut text = text.to_owned();
        for (index, name) in needlebench_kinematics::JOINT_NAMES.iter().enumerate() {
            text = text.replace(name, &format!("joint_a{}", index + 1));
        }
        text
    };
    let finding = shipped("ur3e", kuka).unwrap_err().to_string();
    assert!(
        finding.contains("not a UR arm") && finding.contains("Universal Robots"),
        "{finding}"
    );
}

#[test]
fn a_pointer_of_git_lfs_is_called_that() {
    let files = Files::new(&collision_mesh("package://my-robot/meshes/box.stl", ""));
    let pointer = b"version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 1\n";
    files.add("box.stl", pointer);
    let finding = files.load().unwrap_err().to_string();
    assert!(finding.contains("git lfs pull"), "{finding}");
}
