//! Slips in a URDF that a reader which skips what it does not know would turn into zeros.

use needlebench_input::Finding;
use needlebench_robot::LoadedRobot;
use needlebench_scenario::{Overrides, load_robot};

const ARM: &str = include_str!("foreign_urdf/arm.urdf");

fn load(urdf: &str) -> Result<LoadedRobot, Finding> {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("arm.urdf");
    std::fs::write(&file, urdf).unwrap();
    load_robot(&Overrides {
        robot_urdf: Some(file),
        ..Overrides::default()
    })
}

#[track_caller]
fn changed(from: &str, to: &str) -> String {
    assert_eq!(ARM.matches(from).count(), 1, "{from}");
    ARM.replace(from, to)
}

/// Refused at the line where `to` stands.
#[track_caller]
fn refused(from: &str, to: &str) -> String {
    let text = changed(from, to);
    let finding = load(&text).unwrap_err();
    let line = 1 + text[..text.find(to).unwrap()].matches('\n').count();
    assert_eq!(finding.line, Some(line), "{finding}");
    finding.to_string()
}

#[track_caller]
fn says(text: &str, parts: &[&str]) {
    for part in parts {
        assert!(text.contains(part), "{text}");
    }
}

#[test]
fn misspelt_attributes_are_refused_with_the_right_one() {
    let finding = refused(r#"<origin xyz="0 0 0.1219""#, r#"<origin xy="0 0 0.1219""#);
    says(
        &finding,
        &[
            "<origin> has the unknown attribute `xy`",
            "did you mean `xyz`?",
        ],
    );
    let finding = refused(
        r#"<limit lower="-6.2" upper="6.1" effort="61" velocity="2.9"/>"#,
        r#"<limit lowr="-6.2" upper="6.1" effort="61" velocity="2.9"/>"#,
    );
    says(&finding, &["`lowr`", "did you mean `lower`?"]);
    let finding = refused(
        r#"<sphere radius="0.03"/>"#,
        r#"<sphere radius="0.03" r="0.03"/>"#,
    );
    says(&finding, &["<sphere> has the unknown attribute `r`"]);
}

#[test]
fn misspelt_elements_are_refused_with_the_right_one() {
    let finding = refused(r#"<origin xyz="0 0 0.1219""#, r#"<orign xyz="0 0 0.1219""#);
    says(
        &finding,
        &[
            "joint 'shoulder_pan_joint' has the unknown element <orign>",
            "did you mean <origin>?",
        ],
    );
    let upper_arm = "<!-- more of the upper arm -->";
    let finding = refused(
        upper_arm,
        "<colision><geometry><box size=\"1 1 1\"/></geometry></colision>",
    );
    says(
        &finding,
        &[
            "link 'upper_arm_link' has the unknown element <colision>",
            "<collision>?",
        ],
    );
    let finding = refused(upper_arm, "<inertail><mass value=\"1\"/></inertail>");
    says(&finding, &["did you mean <inertial>?"]);
    let finding = refused("<link name=\"world\"/>", "<lnk name=\"world\"/>");
    says(
        &finding,
        &[
            "<robot> has the unknown element <lnk>",
            "did you mean <link>?",
        ],
    );
}

#[test]
fn what_other_programs_read_is_left_to_them() {
    let quiet = changed(
        "<!-- more of the upper arm -->",
        "<gazebo><mu1>0.2</mu1></gazebo><drake:x xmlns:drake=\"http://drake.mit.edu\"/>",
    );
    let notes = load(&quiet).unwrap().description.notes;
    assert!(
        !notes.iter().any(|note| note.contains("unknown")),
        "{notes:?}"
    );
    let odd = changed(
        "<!-- more of the upper arm -->",
        "<paint_code>7</paint_code>",
    );
    let line = odd
        .lines()
        .position(|line| line.contains("paint_code"))
        .unwrap()
        + 1;
    let notes = load(&odd).unwrap().description.notes;
    let note = notes.iter().find(|note| note.contains("<paint_code>"));
    let note = note.unwrap_or_else(|| panic!("{notes:?}"));
    says(
        note,
        &[
            &format!("arm.urdf:{line}:"),
            "link 'upper_arm_link'",
            "which is ignored",
        ],
    );
}

/// Readers of URDFs take the words that are numbers, and pass over the others.
#[test]
fn numbers_are_counted_and_read_as_such() {
    let origin = r#"<origin xyz="0 0 0.1219""#;
    for (to, what) in [
        (
            r#"<origin xyz="0 0 x 0.1219""#,
            "has 'x', which is not a number",
        ),
        (r#"<origin xyz="0 0.1219""#, "needs 3 numbers"),
        (r#"<origin xyz="0 0 0.1219 0""#, "more than 3 numbers"),
        (r#"<origin xyz="0 0 inf""#, "has inf, which is not finite"),
        (
            r#"<origin xyz="0 0 0,1219""#,
            "has '0,1219', which is not a number",
        ),
    ] {
        says(&refused(origin, to), &[what]);
    }
    says(
        &refused(r#"<sphere radius="0.03"/>"#, r#"<sphere radius="-0.03"/>"#),
        &["`radius` of <sphere> is -0.03, but must be positive"],
    );
}

/// Slips of a unit, and numbers that no robot has.
#[test]
fn numbers_that_no_robot_has_are_refused_at_their_line() {
    let origin = r#"<origin xyz="0 0 0.1219""#;
    let limit = r#"<limit lower="-6.2" upper="6.1" effort="61" velocity="2.9"/>"#;
    let mass = r#"<mass value="2.3"/>"#;
    let sphere = r#"<sphere radius="0.03"/>"#;
    for (from, to, words) in [
        (
            origin,
            r#"<origin xyz="0 0 121.9""#,
            ["has 121.9 m, outside -10 to 10", "millimetres"],
        ),
        (
            origin,
            r#"<origin xyz="0 0 1e200""#,
            ["has 1e200 m", "metres"],
        ),
        (
            origin,
            r#"<origin xyz="0 0 2.4""#,
            ["is 2.400 m from its parent's", "metres"],
        ),
        (
            limit,
            r#"<limit lower="-360" upper="360" effort="61" velocity="2.9"/>"#,
            ["has -360 rad", "degrees"],
        ),
        (
            limit,
            r#"<limit upper="6.1" effort="61" velocity="2.9"/>"#,
            ["has no `lower`", "lower and upper"],
        ),
        (
            limit,
            r#"<limit lower="-6.2" upper="6.1" effort="1e300" velocity="2.9"/>"#,
            ["1e300 N m, outside 0.1 to 2000", "N m"],
        ),
        (
            limit,
            r#"<limit lower="-6.2" upper="6.1" effort="61" velocity="180"/>"#,
            ["180 rad/s, outside", "degrees"],
        ),
        (
            limit,
            r#"<limit lower="-6.2" upper="6.1" effort="61" velocity="0"/>"#,
            ["0 rad/s, outside", "rad/s"],
        ),
        (mass, r#"<mass value="2300"/>"#, ["has 2300 kg", "grams"]),
        (mass, r#"<mass value="230"/>"#, ["weighs 23", "kilograms"]),
        (
            sphere,
            r#"<sphere radius="30"/>"#,
            ["has 30 m, outside 1e-5 to 3", "millimetres"],
        ),
        (
            sphere,
            r#"<cylinder radius="0.03" length="64"/>"#,
            ["has 64 m", "millimetres"],
        ),
        (
            sphere,
            r#"<box size="0.1 0.1 1e-9"/>"#,
            ["has 1e-9 m", "metres"],
        ),
    ] {
        says(&refused(from, to), &words);
    }
}

#[test]
fn elements_are_there_as_often_as_they_should_be() {
    let mass = r#"<mass value="2.3"/>"#;
    says(
        &refused(mass, &format!("{mass}<mass value=\"2.4\"/>")).replace('\n', " "),
        &["<mass> twice"],
    );
    let finding = load(&changed(mass, "")).unwrap_err().to_string();
    says(&finding, &["link 'shoulder_link' has no mass"]);
    let sphere = r#"<sphere radius="0.03"/>"#;
    let finding = load(&changed(sphere, &format!("{sphere}<box size=\"1 1 1\"/>"))).unwrap_err();
    says(&finding.to_string(), &["more than one shape"]);
    let finding = load(&changed(sphere, "<cone radius=\"1\"/>"))
        .unwrap_err()
        .to_string();
    says(
        &finding,
        &["<cone> is not a geometry", "box, cylinder, sphere or mesh"],
    );
}

#[test]
fn a_missing_limit_is_no_limit_of_zero() {
    let limit = r#"<limit lower="-6.2" upper="6.1" effort="61" velocity="2.9"/>"#;
    let finding = load(&changed(limit, "")).unwrap_err().to_string();
    says(
        &finding,
        &["joint 'shoulder_pan_joint' has no <limit>", "effort (N m)"],
    );
    let finding = refused(limit, r#"<limit lower="-6.2" upper="6.1" velocity="2.9"/>"#);
    says(&finding, &["<limit> has no `effort`"]);
}

#[test]
fn joint_types_are_those_of_the_format() {
    let joint = r#"<joint name="elbow_joint" type="revolute">"#;
    let finding = refused(joint, r#"<joint name="elbow_joint" type="revolut">"#);
    says(
        &finding,
        &["unknown type 'revolut'", "did you mean 'revolute'?"],
    );
}

/// Version 1.1 of the format has quaternions; what has no version is 1.0, whose readers ignore them.
#[test]
fn quaternions_count_where_the_version_has_them() {
    let origin = r#"<origin xyz="0 0 0.04"/>"#;
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let quat = format!(r#"<origin xyz="0 0 0.04" quat_xyzw="0 0 {half} {half}"/>"#);
    says(
        &refused(origin, &quat),
        &["`quat_xyzw` is not part of URDF 1.0", "version=\"1.1\""],
    );
    let newer = |text: String| text.replace("<robot ", "<robot version=\"1.1\" ");
    let robot = load(&newer(changed(origin, &quat))).unwrap();
    let pose = robot
        .base
        .solids
        .iter()
        .find(|solid| matches!(solid.shape, needlebench_geometry::Shape::Cylinder { .. }));
    let angle = pose.unwrap().parent_from_shape.rotation.angle();
    assert!(
        (angle - std::f64::consts::FRAC_PI_2).abs() < 1e-12,
        "{angle}"
    );
    let both = quat.replace("quat", "rpy=\"0 0 0\" quat");
    let finding = load(&newer(changed(origin, &both)))
        .unwrap_err()
        .to_string();
    says(&finding, &["both `rpy` and `quat_xyzw`"]);
}

/// A material without a name has the colour that it says.
#[test]
fn colours_are_kept_without_a_name_and_found_by_one() {
    let wrist = r#"<link name="wrist_1_link">"#;
    let visual = |material: &str| {
        let visual =
            format!("<visual><geometry><sphere radius=\"0.01\"/></geometry>{material}</visual>");
        load(&changed(wrist, &format!("{wrist}{visual}")))
            .unwrap()
            .links[3]
            .visuals[0]
            .color_rgba
    };
    let own = visual("<material><color rgba=\"0.1 0.2 0.3 1\"/></material>");
    assert_eq!(own, [0.1, 0.2, 0.3, 1.0]);
    assert_eq!(visual("<material name=\"paint\"/>"), [0.9, 0.5, 0.1, 1.0]);
}
