//! The words in which people read parts of the room and the people in it.

use std::path::Path;

use needlebench_scenario::{Overrides, load_scenario};

#[test]
fn words_of_a_scenario_name_parts_and_people() {
    let scenario = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios/table3.toml");
    let resolved = load_scenario(&scenario, &Overrides::default()).expect("it is shipped");
    let words = resolved.words();
    for (name, expected) in [
        ("doctor", "physician across the table"),
        ("doctor_2", "physician at the feet"),
        ("wrist_2", "wrist 2"),
        ("upper_arm", "upper arm"),
        ("needle_corridor", "access zone"),
        (
            "intercostal_vessels_right_5.7",
            "intercostal vessels of the right 5th rib",
        ),
        ("lung_left", "left lung"),
    ] {
        assert_eq!(
            words.get(name).map(String::as_str),
            Some(expected),
            "{name}"
        );
    }
    // What is called as it is named needs no words, and no machine's name is left.
    assert!(!words.contains_key("table"));
    for (name, words) in &words {
        let is_own = name.starts_with("lesion_");
        assert!(is_own || !words.contains(['_', '.']), "{name}: {words}");
    }
    let doctors = &resolved.people.by_goal[0];
    assert_eq!(
        doctors[0].in_words(1.75),
        "physician across the table, 1.75 m"
    );
}
