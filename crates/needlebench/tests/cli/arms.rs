//! Arms by name, by their lengths and by a file of their own.

use crate::support::{Bench, Finding, SMALL, with_edit};

const UR5E: &str = include_str!("../../../../models/ur5e/ur5e.urdf");

fn with_robot(robot: &str) -> String {
    with_edit(SMALL, "[robot]", &format!("[robot]\n{robot}"))
}

/// A scenario that any arm's size suits.
const ROOMY: &str = "name = \"roomy\"\n[robot]\n[mount]\n[[goals]]\nname = \"pose\"\n\
    insertion_length_mm = 86\n[goals.flange_pose]\nposition_mm = [200, -400, 300]\n\
    rotation_vector_rad = [3.1, 0, 0]\n[criteria]\nmin_working_configurations = 0\n";

#[track_caller]
fn notes(bench: &Bench, arguments: &[&str]) -> String {
    let arguments = [arguments, &["--json"]].concat();
    bench.run(&arguments).exits_with(0).json()["notes"].to_string()
}

#[test]
fn check_says_whose_data_a_robot_has() {
    let bench = Bench::with_scenario(ROOMY);
    bench.write("theirs.urdf", UR5E);
    for (more, note) in [
        (vec![], "arm data: ur3 (models/ur3/arm.toml)\""),
        (
            vec!["--arm", "UR5e"],
            "arm data: ur5e (models/ur5e/arm.toml)\"",
        ),
        (
            vec!["--robot", "ur5e"],
            "arm data: ur5e (models/ur5e/arm.toml)\"",
        ),
        (
            vec!["--robot", "theirs.urdf"],
            "arm data: ur5e (models/ur5e/arm.toml), recognised by its lengths",
        ),
        (
            vec!["--robot", "theirs.urdf", "--arm", "ur5e"],
            "arm data: ur5e (models/ur5e/arm.toml), as named",
        ),
    ] {
        let found = notes(&bench, &[vec!["check", "s.toml"], more].concat());
        assert!(found.contains(note), "{found}");
    }
    bench.write(
        "s.toml",
        with_edit(ROOMY, "[robot]", "[robot]\nurdf = \"ur3e\""),
    );
    let found = notes(&bench, &["check", "s.toml"]);
    assert!(
        found.contains("arm data: ur3e (models/ur3e/arm.toml)\""),
        "{found}"
    );
}

#[test]
fn stop_of_a_ur5e_from_elsewhere_has_its_own_brakes_or_none() {
    let text = format!("{ROOMY}[events.stop]\ncategory = 0\n");
    let bench = Bench::with_scenario(&text);
    bench.write("theirs.urdf", UR5E);
    let answer = bench.run(&["check", "s.toml", "--robot", "theirs.urdf", "--json"]);
    Finding::only(&answer.exits_with(2), &text)
        .key("events.stop.category")
        .says("the data of the UR5e (models/ur5e/arm.toml) have no [brakes]")
        .hints("category = 2");
}

#[test]
fn report_has_the_arm_and_the_file_with_its_data() {
    let bench = Bench::with_scenario(SMALL);
    let run = [
        "run",
        "s.toml",
        "--engine",
        "rapier",
        "--json",
        "--no-page",
        "--quiet",
    ];
    let report = bench.run(&run).json();
    assert_eq!(report["arm"]["arm"], "ur3");
    assert_eq!(report["arm"]["name"], "UR3");
    assert_eq!(report["arm"]["recognition"], "own");
    let inputs = report["provenance"]["inputs"].as_array().unwrap();
    let data = inputs.iter().find(|input| input["role"] == "arm data");
    assert_eq!(data.unwrap()["file"], "builtin:ur3/arm.toml");
    assert_eq!(data.unwrap()["sha256"], report["arm"]["sha256"]);
}

#[test]
fn arm_that_is_not_there_is_refused_with_the_likeliest() {
    let bench = Bench::with_scenario(SMALL);
    let answer = bench.run(&["check", "s.toml", "--arm", "ur4", "--json"]);
    Finding::only(&answer.exits_with(2), SMALL)
        .key("--arm")
        .says("there is no arm `ur4`")
        .hints("ur3");
    let text = with_robot("arm = \"arms/none.toml\"");
    let bench = Bench::with_scenario(&text);
    let answer = bench.run(&["check", "s.toml", "--json"]);
    Finding::only(&answer.exits_with(2), &text)
        .in_file("s.toml")
        .at("arm")
        .key("robot.arm")
        .says("there is no arm `arms/none.toml`")
        .hints("one of ur3, ur3e, ur5e");
}

#[test]
fn fault_in_an_arms_file_is_told_at_its_line() {
    let text = with_robot("arm = \"arm.toml\"");
    let bench = Bench::with_scenario(&text);
    let arm = include_str!("../../../../models/ur3/arm.toml");
    let arm = with_edit(arm, "time_s = 0.092", "time_ms = 92");
    bench.write("arm.toml", &arm);
    let answer = bench.run(&["check", "s.toml", "--json"]);
    Finding::only(&answer.exits_with(2), &arm)
        .in_file("arm.toml")
        .at("time_ms")
        .says("unknown key `time_ms`")
        .hints("`time_s`");
}

#[test]
fn data_sheet_of_the_servo_cites_the_arms_data() {
    let bench = Bench::with_scenario(ROOMY);
    for (arm, torque) in [("ur3", "56"), ("ur5e", "150")] {
        let arguments = [
            "servo", "s.toml", "--arm", arm, "--joint", "elbow", "--engine", "rapier",
        ];
        let sheet = bench
            .run(&[&arguments[..], &["--json"]].concat())
            .exits_with(0)
            .json();
        let setting = |name: &str| {
            let settings = sheet["settings"].as_array().unwrap();
            settings
                .iter()
                .find(|each| each["name"] == name)
                .unwrap()
                .clone()
        };
        let limit = setting("torque limit");
        assert_eq!(limit["values"][0].to_string(), format!("{torque}.0"));
        let source = limit["source"].as_str().unwrap();
        assert!(
            source.contains(&format!("builtin:{arm}/{arm}.urdf (")),
            "{source}"
        );
        assert!(source.contains("Max. joint torques"), "{source}");
        let gain = setting("position gain kp");
        assert!(
            gain["source"].as_str().unwrap().starts_with("assumed: "),
            "{gain}"
        );
    }
}

#[test]
fn schema_of_an_arms_data_knows_every_table() {
    let schema = Bench::new().run(&["schema", "arm"]).exits_with(0).json();
    for table in ["geometry", "brakes", "servo", "population", "lacks"] {
        assert!(schema["properties"][table].is_object(), "{table}");
    }
}
