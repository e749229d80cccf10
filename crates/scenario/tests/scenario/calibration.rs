//! Factory calibrations: real ones, and every way in which a file can be wrong.

use std::path::{Path, PathBuf};

use nalgebra::{Matrix4, Translation3, UnitQuaternion, Vector3};
use needlebench_input::Finding;
use needlebench_kinematics::{Joints, Pose, UrModel, base_from_base_link, rotation_angle_between};
use needlebench_robot::{Calibration, MOVING_LINK_LABELS};
use needlebench_scenario::{Overrides, load_robot, load_scenario};

/// A UR3 whose file writes the identity as three half turns.
const HALF_TURNS: &str = include_str!("calibration/ur3_half_turns.yaml");

/// A UR3 whose angles are all small or right angles.
const SMALL_ANGLES: &str = include_str!("calibration/ur3_small_angles.yaml");

/// A UR3e.
const UR3E: &str = include_str!("calibration/ur3e.yaml");

/// Six products of poses below 0.5 m.
const ROUNDING: f64 = 2e-15;

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("tests/scenario/calibration")
        .join(name)
}

fn read(text: &str) -> Calibration {
    Calibration::parse("c.yaml", text).unwrap()
}

fn calibrated(path: PathBuf) -> Overrides {
    Overrides {
        calibration: Some(path),
        ..Overrides::default()
    }
}

/// A text with one place changed, which has to be there exactly once.
#[track_caller]
fn with_edit(text: &str, from: &str, to: &str) -> String {
    assert_eq!(text.matches(from).count(), 1, "places of `{from}`");
    text.replace(from, to)
}

/// The finding about a text, and that it points at the line that starts like this.
#[track_caller]
fn refusal(text: &str, line: &str) -> Finding {
    let finding = Calibration::parse("c.yaml", text).unwrap_err();
    let at = text
        .lines()
        .position(|each| each.trim_start().starts_with(line))
        .unwrap_or_else(|| panic!("no line starts with `{line}`"));
    assert_eq!(finding.line, Some(at + 1), "{finding}");
    assert_eq!(finding.file, "c.yaml");
    finding
}

#[test]
fn real_calibrations_are_near_their_own_arm_and_far_from_its_relative() {
    for (text, model) in [
        (HALF_TURNS, UrModel::Ur3),
        (SMALL_ANGLES, UrModel::Ur3),
        (UR3E, UrModel::Ur3e),
    ] {
        let calibration = read(text);
        let (nearest, off) = calibration.nearest_model();
        assert_eq!(nearest, model);
        // What is said where the limits are set, and not zero: these are no nominal arms.
        assert!(off.position_m > 1e-4 && off.position_m < 9.1e-4, "{off:?}");
        assert!(off.angle_rad > 1e-4 && off.angle_rad < 6.8e-3, "{off:?}");
        for other in UrModel::ALL {
            let off = calibration.deviation_from(&other.geometry());
            assert!(other == model || off.position_m > 0.015, "{other}: {off:?}");
        }
    }
}

#[test]
fn hash_is_read_where_the_driver_writes_it() {
    let hash = |text: &str| read(text).hash;
    assert_eq!(hash(HALF_TURNS).unwrap(), "calib_336188160809596540");
    let (inside, outside) = ("  hash: calib_336188160809596540", "hash: calib_1");
    assert_eq!(
        hash(&with_edit(HALF_TURNS, inside, outside)).unwrap(),
        "calib_1"
    );
    assert_eq!(hash(&with_edit(HALF_TURNS, inside, "")), None);
}

#[test]
fn origins_are_poses_of_links_in_their_parents() {
    let calibration = read(SMALL_ANGLES);
    let forearm = calibration.origins[2];
    assert_eq!(forearm.translation.vector.x, -0.24350042966804342);
    // Fixed-axis roll, pitch and yaw: small ones add up to the rotation vector.
    let vector = forearm.rotation.scaled_axis();
    let expected = [0.002324984862296544, -0.0006311015154543339];
    for (axis, angle_rad) in expected.into_iter().enumerate() {
        assert!((vector[axis] - angle_rad).abs() < 1e-6);
    }
    // The file's first parent is `base_link_inertia`, half a turn from `base_link`.
    let shoulder = calibration.chain().link_poses(&Joints::zeros())[0];
    let expected = base_from_base_link() * calibration.origins[0];
    assert!((shoulder.translation.vector - expected.translation.vector).norm() < ROUNDING);
    assert!(rotation_angle_between(&shoulder.rotation, &expected.rotation) < ROUNDING);
}

#[rustfmt::skip]
#[test]
fn calibrated_flange_is_where_a_product_of_matrices_puts_it() {
    // The file's origins and rotations about z multiplied as 4 x 4 matrices by NumPy 2.4, roll,
    // pitch and yaw as Rz(yaw) Ry(pitch) Rx(roll).
    let expected = Matrix4::new(
        -0.7715941819588035, -0.4500886084987866, 0.44951380720390705, 0.29659986698112983,
        0.6211245475562586, -0.38057539851017347, 0.6851033954607553, 0.28774619353385955,
        -0.13728333762827313, 0.8078258540975578, 0.5732108466011377, 0.32572342278333527,
        0.0, 0.0, 0.0, 1.0,
    );
    let q = Joints::from_column_slice(&[0.4, -1.3, 1.5, -0.9, 1.1, 0.2]);
    let flange = read(HALF_TURNS).chain().base_link_from_flange(&q);
    assert!((flange.to_homogeneous() - expected).amax() < ROUNDING);
}

/// The nominal UR3 in the words of `ur_description`'s `default_kinematics.yaml`, numbers written
/// as ROS writes them.
const NOMINAL: &str = "\
kinematics:
  shoulder: {x: 0, y: 0, z: 0.1519, roll: -0, pitch: 0, yaw: -0}
  upper_arm: {x: 0, y: 0, z: 0, roll: 1.570796327, pitch: 0, yaw: 0e0}
  forearm: {x: -0.24365, y: 0, z: 0, roll: '0', pitch: \"0.0\", yaw: 0.}
  wrist_1: {x: -2.1325e-01, y: 0, z: 0.11235, roll: 0, pitch: +0, yaw: 0}
  wrist_2: {x: 0, y: -0.08535, z: -1.750557762378351e-11, roll: 1.570796327, pitch: 0, yaw: 0}
  wrist_3: {x: 0, y: 0.0819, z: -1.679797079540562e-11, roll: 1.570796326589793, pitch: 3.141592653589793, yaw: 3.141592653589793}
  hash: calib_9122066269688285636
";

#[test]
fn nominal_file_gives_the_nominal_chain() {
    /// The file's angles have nine decimals.
    const DECIMALS: f64 = 2e-9;
    let chain = read(NOMINAL).chain();
    let nominal = UrModel::Ur3.geometry().chain();
    for q in [[0.0; 6], [0.3, -1.2, 1.5, -0.4, 0.9, 2.0]] {
        let q = Joints::from_column_slice(&q);
        let [a, b] = [&chain, &nominal].map(|chain| chain.base_link_from_flange(&q));
        assert!((a.translation.vector - b.translation.vector).norm() < DECIMALS);
        assert!(rotation_angle_between(&a.rotation, &b.rotation) < DECIMALS);
    }
}

#[test]
fn calibration_replaces_the_joint_origins_and_nothing_else() {
    let nominal = load_robot(&Overrides::default()).unwrap();
    let path = fixture("ur3_half_turns.yaml");
    let robot = load_robot(&calibrated(path.clone())).unwrap();
    assert_eq!(robot.chain.joints, read(HALF_TURNS).chain().joints);
    assert_eq!(robot.links, nominal.links);
    assert_eq!(robot.bodies, nominal.bodies);
    assert_eq!(robot.limits, nominal.limits);
    assert_eq!(robot.description.source, nominal.description.source);
    let applied = robot.description.calibration.unwrap();
    assert_eq!(applied.hash.as_deref(), Some("calib_336188160809596540"));
    assert_eq!(applied.source.file, path.display().to_string());
    assert_eq!(
        applied.source.sha256,
        needlebench_input::sha256_hex(HALF_TURNS.as_bytes())
    );
    assert!(nominal.description.calibration.is_none());
    let note = robot.description.notes.last().unwrap();
    assert!(note.contains("calib_336188160809596540"), "{note}");
}

#[test]
fn calibrated_scenario_has_the_calibrated_chain_in_its_dynamics() {
    let scenario = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios/table3.toml");
    let resolved = load_scenario(&scenario, &calibrated(fixture("ur3_small_angles.yaml"))).unwrap();
    let chain = read(SMALL_ANGLES).chain();
    assert_eq!(resolved.cell.robot.chain.joints, chain.joints);
    assert_eq!(resolved.cell.dynamics().chain.joints, chain.joints);
    assert!(
        resolved
            .notes
            .iter()
            .any(|note| note.contains("factory calibration"))
    );
}

#[test]
fn calibration_of_a_relative_is_refused_with_the_arm_it_is_of() {
    let finding = load_robot(&calibrated(fixture("ur3e.yaml"))).unwrap_err();
    for part in [
        "another robot, a UR3e",
        "the UR3 in use",
        "18.7 mm",
        "wrist_1",
    ] {
        assert!(finding.message.contains(part), "{finding}");
    }
    let hint = finding.hint.unwrap();
    assert!(
        hint.contains("--arm UR3e") && hint.contains("--robot"),
        "{hint}"
    );
    // And the other way round.
    let ur3e = UrModel::Ur3e.geometry();
    assert!(read(UR3E).chain_of("UR3e", &ur3e).is_ok());
    let finding = read(HALF_TURNS).chain_of("UR3e", &ur3e).unwrap_err();
    assert!(
        finding.message.contains("another robot, a UR3 "),
        "{finding}"
    );
}

/// What is said of a UR3e's calibration whose frames are turned, which is like no other arm's.
fn hint_on_turned_frames(calibration: &Calibration) -> String {
    let geometry = UrModel::Ur3e.geometry();
    let finding = calibration.chain_of("UR3e", &geometry).unwrap_err();
    assert!(!finding.message.contains("most like"), "{finding}");
    finding.hint.unwrap()
}

/// A calibration with the poses that a hint offers.
fn mended(calibration: &Calibration, hint: &str) -> Calibration {
    let (_, offered) = hint.split_once("frames has ").unwrap();
    let mut mended = calibration.clone();
    for block in offered.split("; ") {
        let (link, pose) = block.split_once(": ").unwrap();
        let at = MOVING_LINK_LABELS
            .iter()
            .position(|name| *name == link)
            .unwrap();
        let numbers: Vec<f64> = pose
            .split(", ")
            .map(|each| each.split_once(": ").unwrap().1.parse().unwrap())
            .collect();
        mended.origins[at] = Pose::from_parts(
            Translation3::new(numbers[0], numbers[1], numbers[2]),
            UnitQuaternion::from_euler_angles(numbers[3], numbers[4], numbers[5]),
        );
    }
    mended
}

/// A frame that is turned about its own axis and turned back by the next origin is the same arm: the poses that are
/// offered in its place are that arm's, in ROS's frames.
#[test]
fn frames_turned_about_their_axes_are_named_and_the_equivalent_is_offered() {
    let usual = read(UR3E).chain();
    for (joint, angle) in [(0, -2.0), (1, 0.5), (2, std::f64::consts::PI), (4, 1.0)] {
        let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), angle);
        let mut chain = usual;
        chain.joints[joint].parent_from_joint.rotation *= turn;
        let next = &mut chain.joints[joint + 1].parent_from_joint;
        *next = Pose::from_parts(Translation3::identity(), turn.inverse()) * *next;
        let turned = read(&Calibration::written(&chain, "turned"));
        let hint = hint_on_turned_frames(&turned);
        let said = format!("{}'s by ", MOVING_LINK_LABELS[joint]);
        let degrees: f64 = hint
            .split_once(&said)
            .unwrap()
            .1
            .split(' ')
            .next()
            .unwrap()
            .parse()
            .unwrap();
        assert!(
            (degrees.abs() - angle.to_degrees().abs()).abs() < 1.0,
            "{hint}"
        );
        // What is offered is accepted in the place of what is there, and moves the flange nowhere.
        let mended = mended(&turned, &hint);
        let mended = mended.chain_of("UR3e", &UrModel::Ur3e.geometry()).unwrap();
        let q = Joints::new(0.4, -1.3, 1.1, 0.7, -0.9, 2.0);
        let [a, b] = [&mended, &chain].map(|chain| chain.base_link_from_flange(&q));
        assert!(
            (a.to_homogeneous() - b.to_homogeneous()).amax() < 1e-12,
            "{joint}"
        );
    }
}

/// Frames that are turned and not turned back: the joints' zeros are shifted, and the same links with ROS's zeros are
/// offered.
#[test]
fn frames_that_shift_a_joints_zero_are_named_with_the_arm_without_them() {
    let usual = read(UR3E).chain();
    let half = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), std::f64::consts::PI);
    for joints in [&[2, 3][..], &[2], &[0, 1, 4]] {
        let mut chain = usual;
        for &joint in joints {
            chain.joints[joint].parent_from_joint.rotation *= half;
        }
        let turned = read(&Calibration::written(&chain, "turned"));
        let hint = hint_on_turned_frames(&turned);
        let mended = mended(&turned, &hint);
        let mended = mended.chain_of("UR3e", &UrModel::Ur3e.geometry()).unwrap();
        let mut q = Joints::new(0.4, -1.3, 1.1, 0.7, -0.9, 2.0);
        let a = mended.base_link_from_flange(&q);
        for &joint in joints {
            assert!(
                hint.contains(&format!("{}'s by ", MOVING_LINK_LABELS[joint])),
                "{hint}"
            );
            q[joint] -= std::f64::consts::PI;
        }
        let b = chain.base_link_from_flange(&q);
        assert!(
            (a.to_homogeneous() - b.to_homogeneous()).amax() < 1e-12,
            "{joints:?}"
        );
    }
}

#[test]
fn calibration_of_no_arm_is_refused_with_what_is_off() {
    // A frame turned by a right angle, and a link 30 mm longer.
    for (from, to, part) in [
        (
            "roll: 1.5712907199761768",
            "roll: 0.0",
            "1.571 rad at upper_arm",
        ),
        (
            "x: -0.24350042966804342",
            "x: -0.27350042966804342",
            "29.9 mm",
        ),
    ] {
        let calibration = read(&with_edit(SMALL_ANGLES, from, to));
        let finding = calibration
            .chain_of("UR3", &UrModel::Ur3.geometry())
            .unwrap_err();
        assert!(
            finding
                .message
                .contains("not a calibration of the UR3 in use"),
            "{finding}"
        );
        assert!(finding.message.contains(part), "{finding}");
    }
}

#[test]
fn missing_and_unknown_keys_are_named_with_their_line() {
    let text = with_edit(SMALL_ANGLES, "wrist_2:", "wrist2:");
    let finding = refusal(&text, "wrist2:");
    assert_eq!(finding.key.as_deref(), Some("kinematics.wrist2"));
    assert_eq!(finding.hint.as_deref(), Some("did you mean `wrist_2`?"));

    let text = with_edit(
        SMALL_ANGLES,
        "    roll: 0.0040109807380638\n",
        "    rol: 0\n",
    );
    let finding = refusal(&text, "rol:");
    assert_eq!(finding.key.as_deref(), Some("kinematics.wrist_1.rol"));
    assert_eq!(finding.hint.as_deref(), Some("did you mean `roll`?"));

    let text = with_edit(SMALL_ANGLES, "    roll: 0.0040109807380638\n", "");
    let finding = refusal(&text, "wrist_1:");
    assert_eq!(finding.key.as_deref(), Some("kinematics.wrist_1.roll"));
    assert_eq!(finding.message, "the key `roll` is missing");

    let cut = SMALL_ANGLES.find("  wrist_3:").unwrap();
    let finding = refusal(&SMALL_ANGLES[..cut], "kinematics:");
    assert_eq!(finding.key.as_deref(), Some("kinematics.wrist_3"));

    let text = with_edit(SMALL_ANGLES, "kinematics:", "kinematic:");
    let finding = refusal(&text, "kinematic:");
    assert!(finding.hint.unwrap().contains("did you mean `kinematics`"));

    let text = SMALL_ANGLES
        .replace("kinematics:\n", "")
        .replace("\n  ", "\n");
    let finding = Calibration::parse("c.yaml", &text).unwrap_err();
    assert!(
        finding.message.contains("`kinematics` is missing"),
        "{finding}"
    );
}

#[test]
fn numbers_that_are_none_are_refused_with_their_line() {
    let z = "z: 0.15181470228501504";
    for (to, message) in [
        ("z: 0,1518", "which is not a number"),
        ("z: 0.1518 m", "which is not a number"),
        ("z: pi/2", "which is not a number"),
        ("z: yes", "which is not a number"),
        ("z:", "which is not a number"),
        ("z: [0.1518]", "is not a number"),
        ("z: {a: 1}", "is not a number"),
        ("z: .nan", "not finite"),
        ("z: -.Inf", "not finite"),
        ("z: 1e999", "not finite"),
        ("z: !degrees 90", "the tag `!degrees`"),
    ] {
        let text = with_edit(SMALL_ANGLES, z, to);
        let finding = refusal(&text, to);
        assert!(finding.message.contains(message), "{to}: {finding}");
    }
}

#[test]
fn degrees_and_millimetres_are_recognised() {
    let text = with_edit(SMALL_ANGLES, "roll: 1.5712907199761768", "roll: 90.03");
    let finding = refusal(&text, "roll: 90.03");
    assert_eq!(finding.key.as_deref(), Some("kinematics.upper_arm.roll"));
    assert!(finding.message.contains("is it in degrees?"), "{finding}");
    assert!(finding.hint.unwrap().contains("90.03 degrees are 1.57"));

    let text = with_edit(SMALL_ANGLES, "z: 0.15181470228501504", "z: 151.8");
    let finding = refusal(&text, "z: 151.8");
    assert!(finding.message.contains("is it in mm?"), "{finding}");
    assert!(finding.hint.unwrap().contains("151.8 mm are 0.151800 m"));
}

#[test]
fn files_of_other_kinds_are_recognised() {
    let hint = |text: &str| {
        let finding = Calibration::parse("c.yaml", text).unwrap_err();
        finding.hint.unwrap_or_default()
    };
    assert!(hint("<?xml version=\"1.0\"?>\n<robot name=\"x\"/>").contains("--robot"));
    assert!(hint("[mounting]\ndelta_theta = [0.1]\n").contains("calibration.conf"));
    assert!(hint("joint_limits:\n  shoulder_pan: {}\n").contains("ur_calibration"));
    assert!(hint("- a\n- b\n").contains("the six links"));
    assert!(hint("just words").contains("the six links"));
}

#[test]
fn files_that_cannot_be_read_are_refused() {
    let finding = load_robot(&calibrated(fixture("no_such.yaml"))).unwrap_err();
    assert!(
        finding.message.contains("cannot read the calibration"),
        "{finding}"
    );
    let finding = load_robot(&calibrated(fixture(""))).unwrap_err();
    assert!(
        finding.message.contains("cannot read the calibration"),
        "{finding}"
    );
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("c.yaml");
    std::fs::write(&path, [0xff, 0xfe, 0x00]).unwrap();
    let finding = load_robot(&calibrated(path)).unwrap_err();
    assert!(finding.message.contains("not UTF-8"), "{finding}");
}

#[test]
fn byte_order_mark_and_windows_line_ends_do_no_harm() {
    let windows = format!("\u{feff}{}", SMALL_ANGLES.replace('\n', "\r\n"));
    assert_eq!(read(&windows).origins, read(SMALL_ANGLES).origins);
}

#[test]
fn robot_with_other_link_frames_is_refused() {
    // The same arm, its forearm frame turned by a right angle about the joint's axis.
    let urdf = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models/ur3/ur3.urdf");
    let mut text = std::fs::read_to_string(urdf).unwrap();
    for (joint, from, to) in [
        (
            "elbow_joint",
            r#"xyz="-0.24365 0 0" rpy="0 0 0""#,
            r#"xyz="-0.24365 0 0" rpy="0 0 1.5707963267948966""#,
        ),
        (
            "wrist_1_joint",
            r#"xyz="-0.21325 0 0.11235" rpy="0 0 0""#,
            r#"xyz="0 0.21325 0.11235" rpy="0 0 -1.5707963267948966""#,
        ),
    ] {
        assert!(text.contains(&format!("<joint name=\"{joint}\"")));
        text = with_edit(&text, from, to);
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("turned.urdf");
    std::fs::write(&path, text).unwrap();
    let overrides = Overrides {
        robot_urdf: Some(path),
        ..Overrides::default()
    };
    assert!(load_robot(&overrides).is_ok(), "it is a UR3 all the same");
    let finding = load_robot(&Overrides {
        calibration: Some(fixture("ur3_small_angles.yaml")),
        ..overrides
    })
    .unwrap_err();
    assert!(finding.file.ends_with("turned.urdf"), "{finding}");
    assert_eq!(finding.key.as_deref(), Some("--calibration"));
    assert!(
        finding.message.contains("link frames are not ROS's"),
        "{finding}"
    );
    assert!(finding.message.contains("1.571 rad"), "{finding}");
}
