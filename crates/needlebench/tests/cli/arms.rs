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
