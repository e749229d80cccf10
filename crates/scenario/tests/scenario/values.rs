//! Values of files into structs, against the TOML library's own deserializer.

use needlebench_input::read_table;
use needlebench_robot::arm::ArmData;
use needlebench_scenario::scenario::Scenario;

#[test]
fn shipped_files_are_what_toml_makes_of_them() {
    let models = concat!(env!("CARGO_MANIFEST_DIR"), "/../../models");
    let scenarios = concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenarios");
    let mut compared = 0;
    for name in ["table3", "imperfect", "iso9283", "contact", "supine_suite"] {
        let text = std::fs::read_to_string(format!("{scenarios}/{name}.toml")).unwrap();
        let expected: Scenario = toml::from_str(&text).unwrap();
        let found: Scenario = read_table(&text.parse().unwrap()).unwrap();
        assert_eq!(format!("{found:?}"), format!("{expected:?}"), "{name}");
        compared += 1;
    }
    for name in ["ur3", "ur3e"] {
        let text = std::fs::read_to_string(format!("{models}/{name}/arm.toml")).unwrap();
        let expected: ArmData = toml::from_str(&text).unwrap();
        let found: ArmData = read_table(&text.parse().unwrap()).unwrap();
        assert_eq!(format!("{found:?}"), format!("{expected:?}"), "{name}");
        compared += 1;
    }
    assert_eq!(compared, 7);
}

#[test]
fn what_does_not_fit_is_refused() {
    for (text, part) in [
        ("goals = 3", "expected an array, found integer"),
        ("robot = 3", "expected a table, found integer"),
        ("[robot]\nmodel = 3", "expected"),
    ] {
        let refused = read_table::<Scenario>(&text.parse().unwrap()).unwrap_err();
        assert!(refused.contains(part), "{text}: {refused}");
    }
}
