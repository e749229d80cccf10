//! Robots that are refused, and the one defect that has a remedy.

use crate::support::{Answer, Bench, Finding, SMALL, with_edit};

/// The shipped UR3, to be spoilt.
const UR3: &str = include_str!("../../../../models/ur3/ur3.urdf");

/// A collision cylinder of the upper arm.
const CYLINDER: &str = "<cylinder radius=\"0.047\" length=\"0.1235\"/>";

fn check(urdf: &[u8], more: &[&str]) -> Answer {
    let bench = Bench::with_scenario(SMALL);
    bench.write("arm.urdf", urdf);
    let mut arguments = vec!["check", "s.toml", "--json", "--robot", "arm.urdf"];
    arguments.extend(more);
    bench.run(&arguments)
}

#[track_caller]
fn refused(urdf: &str) -> Finding {
    let answer = check(urdf.as_bytes(), &[]).exits_with(2);
    Finding::only(&answer, urdf).in_file("arm.urdf")
}

#[track_caller]
fn refused_with(from: &str, to: &str) -> Finding {
    refused(&with_edit(UR3, from, to))
}

/// The shipped UR3 with every mass and moment of inertia at zero.
fn massless() -> String {
    let zeroed = |line: &str| -> String {
        let trimmed = line.trim_start();
        if trimmed.starts_with("<mass ") {
            "<mass value=\"0\"/>".to_owned()
        } else if trimmed.starts_with("<inertia ") {
            "<inertia ixx=\"0\" ixy=\"0\" ixz=\"0\" iyy=\"0\" iyz=\"0\" izz=\"0\"/>".to_owned()
        } else {
            line.to_owned()
        }
    };
    let lines: Vec<String> = UR3.lines().map(zeroed).collect();
    lines.join("\n")
}

#[test]
fn copy_of_the_shipped_robot_is_sound_before_it_is_spoilt() {
    let answer = check(UR3.as_bytes(), &[]).exits_with(0).json();
    let notes = answer["notes"].to_string();
    // Its pictures stay behind; that is noted, not refused.
    assert!(notes.contains("left out of pictures"), "{notes}");
}

#[test]
fn missing_urdf_is_refused_by_name() {
    let bench = Bench::with_scenario(&with_edit(SMALL, "[robot]", "[robot]\nurdf = \"ur3\""));
    let answer = bench.run(&["check", "s.toml", "--robot", "none.urdf", "--json"]);
    // The command line's robot is to blame, not the scenario's line.
    Finding::only(&answer.exits_with(2), "")
        .in_file("none.urdf")
        .says("cannot read the URDF")
        .hints("working directory");
    let answer = bench.run(&["fk", "--joints", "0,0,0,0,0,0", "--robot", "none.urdf"]);
    answer.exits_with(2).complains(["none.urdf", "hint: "]);
}

#[test]
fn urdf_that_a_scenario_names_in_vain_is_refused_at_its_line() {
    let text = with_edit(SMALL, "[robot]", "[robot]\nurdf = \"none/arm.urdf\"");
    let bench = Bench::with_scenario(&text);
    let answer = bench.run(&["check", "s.toml", "--json"]).exits_with(2);
    Finding::only(&answer, &text)
        .in_file("s.toml")
        .at("urdf")
        .key("robot.urdf")
        .says("none/arm.urdf: cannot read the URDF")
        .hints("relative to the scenario");
}

#[test]
fn file_that_is_no_urdf_is_refused() {
    refused("hello")
        .at("hello")
        .says("not well-formed XML")
        .hints("<robot>");
    refused(&UR3[..UR3.len() / 2]).says("not well-formed XML");
    refused("<sdf/>")
        .at("<sdf/>")
        .says("<sdf>")
        .hints("root element is <robot>");
    let answer = check(b"\xff\xfe<", &[]).exits_with(2);
    Finding::only(&answer, "").says("not UTF-8 text");
}

#[test]
fn xacro_file_is_refused_with_the_command_that_expands_it() {
    refused_with(
        "<robot name=\"ur3\">",
        "<robot name=\"ur3\" xmlns:xacro=\"http://www.ros.org/wiki/xacro\">\
         <xacro:include filename=\"$(find ur_description)/urdf/ur.urdf.xacro\"/>",
    )
    .says("xacro file")
    .hints("xacro file.urdf.xacro > file.urdf");
}

#[test]
fn cyclic_urdf_is_refused_with_a_link_of_the_cycle() {
    refused_with(
        "<parent link=\"base_link_inertia\"/>\n    <child link=\"shoulder_link\"/>",
        "<parent link=\"wrist_3_link\"/>\n    <child link=\"shoulder_link\"/>",
    )
    .at("<link name=\"shoulder_link\">")
    .key("link 'shoulder_link'")
    .says("cycle through link 'shoulder_link'")
    .hints("tree");
}

#[test]
fn link_with_two_parents_is_refused_with_both_joints() {
    refused_with(
        "<link name=\"base_link\"/>",
        "<link name=\"base_link\"/><joint name=\"again\" type=\"fixed\">\
         <parent link=\"base_link\"/><child link=\"forearm_link\"/></joint>",
    )
    .says("link 'forearm_link' is the child of two joints, 'again' and 'elbow_joint'");
}

#[test]
fn urdf_with_two_roots_is_refused_with_their_names() {
    refused_with(
        "<link name=\"base_link\"/>",
        "<link name=\"base_link\"/><link name=\"loose\"/>",
    )
    .says("2 root links (base_link, loose)")
    .hints("join them");
}

#[test]
fn joint_that_names_an_unknown_link_is_refused() {
    refused_with(
        "<parent link=\"forearm_link\"/>",
        "<parent link=\"forarm_link\"/>",
    )
    .at("<joint name=\"wrist_1_joint\"")
    .says("'forarm_link', which does not exist")
    .hints("did you mean 'forearm_link'?");
}

#[test]
fn link_without_mass_is_refused_by_default() {
    refused(&massless())
        .at("<link name=\"shoulder_link\">")
        .key("link 'shoulder_link'")
        .says("has no mass")
        .hints("missing_inertia = \"nominal-ur3\"");
}

#[test]
fn link_without_mass_takes_the_shipped_one_on_request_and_says_so() {
    let answer = check(massless().as_bytes(), &["--missing-inertia", "nominal-ur3"]);
    let notes = answer.exits_with(0).json()["notes"].clone();
    let taken = notes
        .as_array()
        .unwrap()
        .iter()
        .filter(|note| note.as_str().unwrap().contains("has no mass: the shipped"))
        .count();
    assert_eq!(taken, 6, "{notes:#}");
    // By the scenario's key too.
    let text = with_edit(
        SMALL,
        "[robot]",
        "[robot]\nurdf = \"arm.urdf\"\nmissing_inertia = \"nominal-ur3\"",
    );
    let bench = Bench::with_scenario(&text);
    bench.write("arm.urdf", massless());
    bench.run(&["check", "s.toml"]).exits_with(0);
}

#[test]
fn impossible_inertia_is_refused_at_its_line() {
    refused_with("ixx=\"0.00370719\"", "ixx=\"-1\"")
        .at("<inertia ixx=\"-1\"")
        .says("no rigid body")
        .hints("positive");
    refused_with("<mass value=\"3.42\"/>", "<mass value=\"nan\"/>").says("not finite");
}

#[test]
fn missing_collision_mesh_is_refused_with_its_path() {
    refused_with(CYLINDER, "<mesh filename=\"none.stl\"/>")
        .at("<geometry><mesh filename=\"none.stl\"/>")
        .says("none.stl")
        .hints("beside the URDF");
    refused_with(CYLINDER, "<mesh filename=\"arm.dae\"/>")
        .says("`arm.dae` is not an STL file")
        .hints("convert it");
}

#[test]
fn unknown_package_is_refused_with_the_argument_that_tells_it() {
    refused_with(
        CYLINDER,
        "<mesh filename=\"package://ur_description/a.stl\"/>",
    )
    .says("package `ur_description` is not known: give --package-path ur_description=DIR");
}

#[test]
fn joint_name_mismatch_is_refused_with_the_likeliest_joint() {
    refused_with(
        "<joint name=\"elbow_joint\"",
        "<joint name=\"left_elbow_joint\"",
    )
    .key("joint 'elbow_joint'")
    .says("no joint 'elbow_joint'")
    .hints("'left_elbow_joint'");
}

#[test]
fn joint_that_slides_is_refused() {
    refused_with(
        "<joint name=\"elbow_joint\" type=\"revolute\">",
        "<joint name=\"elbow_joint\" type=\"prismatic\">",
    )
    .at("<joint name=\"elbow_joint\"")
    .says("joint 'elbow_joint' is not revolute")
    .hints("revolute");
}

#[test]
fn arm_that_is_no_ur_is_refused() {
    refused_with(
        "<origin xyz=\"0 -0.08535 0\" rpy=\"1.5707963267948966 0 0\"/>",
        "<origin xyz=\"0.1 -0.08535 0.2\" rpy=\"0.7 0 0.3\"/>",
    )
    .says("not those of a UR arm")
    .hints("UR arms");
}

#[test]
fn limit_that_leaves_no_torque_is_refused() {
    refused_with("effort=\"28\"", "effort=\"0\"")
        .key("joint 'elbow_joint'")
        .says("effort limit of joint 'elbow_joint' is 0 N m, outside 0.1 to 2000");
}
