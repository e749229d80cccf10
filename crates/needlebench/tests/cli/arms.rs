//! Arms by name, by their lengths and by a file of their own.

use crate::support::{Bench, Json, small_run};

/// A scenario that any arm's size suits.
const ROOMY: &str = include_str!("../cmd/fixtures/roomy.toml");

#[test]
fn report_has_the_arm_and_the_file_with_its_data() {
    let report = small_run().1.json();
    assert_eq!(report["arm"]["arm"], "ur3");
    assert_eq!(report["arm"]["name"], "UR3");
    assert_eq!(report["arm"]["recognition"], "own");
    let inputs = report["provenance"]["inputs"].list();
    let data = inputs.iter().find(|input| input["role"] == "arm data");
    assert_eq!(data.unwrap()["file"], "builtin:ur3/arm.toml");
    assert_eq!(data.unwrap()["sha256"], report["arm"]["sha256"]);
}

#[test]
fn data_sheet_of_the_servo_cites_the_arms_data() {
    let bench = Bench::with_scenario(ROOMY);
    for (arm, torque) in [("ur3", "56"), ("ur5e", "150")] {
        let arguments = format!("servo s.toml --arm {arm} --joint elbow --engine rapier");
        let sheet = bench
            .run(format!("{arguments} --json"))
            .exits_with(0)
            .json();
        let setting = |name: &str| {
            let settings = sheet["settings"].list();
            settings
                .iter()
                .find(|each| each["name"] == name)
                .unwrap()
                .clone()
        };
        let limit = setting("torque limit");
        assert_eq!(limit["values"][0].to_string(), format!("{torque}.0"));
        let source = limit["source"].word();
        assert!(
            source.contains(&format!("builtin:{arm}/{arm}.urdf (")),
            "{source}"
        );
        assert!(source.contains("Max. joint torques"), "{source}");
        let gain = setting("position gain kp");
        assert!(gain["source"].word().starts_with("assumed: "), "{gain}");
    }
}

#[test]
fn schema_of_an_arms_data_knows_every_table() {
    let schema = Bench::new().run("schema arm").exits_with(0).json();
    for table in ["geometry", "brakes", "servo", "population", "lacks"] {
        assert!(schema["properties"][table].is_object(), "{table}");
    }
}

/// Across the room, where the place that is assumed for an arm is in the patient.
const ACROSS: &str = "[phantom]\nhead_yaw_deg = 90\n[[goals]]\nlesion = \"right_upper_lobe\"\n";

#[test]
fn suggest_proposes_a_place_where_the_assumed_one_cannot_be() {
    let bench = Bench::with_scenario(ACROSS);
    let told = [
        "the robot's place is assumed, since [robot] gives none, and cannot be: the robot's base overlaps the patient",
        "`needlebench suggest s.toml`",
    ];
    bench.run("check s.toml").exits_with(2).complains(told);
    let suggest = "suggest s.toml --entries 1 --placements 1 --write placed.toml";
    let said = bench.run(suggest).exits_with(0).stdout;
    assert!(
        said.contains("assumed, since [robot] gives no base placement"),
        "{said}"
    );
    bench.run("check placed.toml").exits_with(0);
}

#[test]
fn an_arm_by_its_urdf_alone_has_a_place_beside_the_patient() {
    let bench = Bench::with_scenario("[[goals]]\nlesion = \"right_upper_lobe\"\n");
    let urdf = include_str!("../../../../models/ur10e/ur10e.urdf");
    bench.write("ur10e.urdf", urdf);
    // One with a longer upper arm, of which nothing is known.
    bench.write("theirs.urdf", urdf.replace("-0.6127 0 0", "-0.7127 0 0"));
    for (file, place) in [
        ("ur10e", "[-350, 700, 920]"),
        ("theirs", "[-350, 920, 920]"),
    ] {
        let check = format!("check s.toml --robot {file}.urdf");
        let said = bench.run(check).exits_with(0).stdout.replace("\n    ", " ");
        assert!(
            said.contains(&format!("base_position_mm = {place}")),
            "{said}"
        );
    }
}
