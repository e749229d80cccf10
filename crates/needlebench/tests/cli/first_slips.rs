//! What people write first, before they know the schema: short scenarios work and say what was assumed, and slips are
//! answered with what to write.

use crate::support::{Bench, with_edit};

/// As one writes it after a look at a shipped scenario.
const FIRST: &str = "\
name = \"first\"
[robot]
urdf = \"ur3\"
base_position_mm = [-280, 350, 1050]
base_rpy_deg = [0, 0, 270]
[mount]
[tool]
urdf = \"perpendicular\"
needle_length_mm = 200
[phantom]
model = \"male-p50-supine\"
[table]
center_mm = [-300, 0]
top_height_mm = 780
[[goals]]
name = \"g\"
lesion = \"pleural_based\"
entry_mm = [-156.4, 16.8, 15.2]
standoff_mm = 15
";

#[test]
fn first_scenario_is_sound_before_it_is_spoilt() {
    Bench::with_scenario(FIRST)
        .run(&["check", "s.toml"])
        .exits_with(0);
}

/// A slip, and what the answer holds.
const SLIPS: [(&str, &str, &str); 26] = [
    ("[robot]", "[robots]", "did you mean `robot`?"),
    ("[[goals]]", "[[goal]]", "did you mean `goals`?"),
    ("[[goals]]", "[goals]", "write [[goals]] in double brackets"),
    (
        "base_position_mm = [-280, 350, 1050]",
        "base_position = [-0.28, 0.35, 1.05]",
        "`base_position_mm`",
    ),
    (
        "[-280, 350, 1050]",
        "[-0.28, 0.35, 1.05]",
        "`robot.base_position_mm` is in millimetres: did you give metres? They are [-280, 350, 1050] mm",
    ),
    (
        "[-156.4, 16.8, 15.2]",
        "[-0.1564, 0.0168, 0.0152]",
        "did you give metres? They are [-156.4, 16.8, 15.2] mm",
    ),
    (
        "base_rpy_deg",
        "base_rpy_rad",
        "did you mean `base_rpy_deg`?",
    ),
    (
        "lesion = \"pleural_based\"\n",
        "",
        "add `lesion = \"right_upper_lobe\"`",
    ),
    (
        "lesion = \"pleural_based\"",
        "target_mm = [-192, 14, 29]",
        "outside the phantom",
    ),
    (
        "[-156.4, 16.8, 15.2]",
        "[-180, 16.8, 15.2]",
        "the line meets the skin at [-156.6",
    ),
    (
        "urdf = \"ur3\"",
        "urdf = \"models/ur3.urdf\"",
        "did you mean `ur3`?",
    ),
    (
        "standoff_mm = 15",
        "needle_length_mm = 150",
        "`needle_length_mm` is a key of [tool]",
    ),
    (
        "[mount]",
        "[mount]\nbase_position_mm = [0, 0, 800]",
        "`base_position_mm` is a key of [robot]",
    ),
    (
        "urdf = \"ur3\"",
        "urdf = ur3",
        "write texts in quotes: `urdf = \"ur3\"`",
    ),
    (
        "needle_length_mm = 200",
        "needle_length_mm = 200,5",
        "decimals have a point: `needle_length_mm = 200.5`",
    ),
    (
        "[-156.4, 16.8, 15.2]",
        "[-156,4, 16,8, 15,2]",
        "decimals have a point",
    ),
    (
        "needle_length_mm = 200",
        "needle_length_mm = 200 mm",
        "write the number alone",
    ),
    (
        "needle_length_mm = 200",
        "needle_length_mm: 200",
        "write `needle_length_mm = 200`",
    ),
    (
        "[-156.4, 16.8, 15.2]",
        "[-156.4, 16.8]",
        "such as `entry_mm = [0, 0, 0]`",
    ),
    (
        "[-156.4, 16.8, 15.2]",
        "[-156.4 16.8 15.2]",
        "put commas between the numbers",
    ),
    (
        "[-156.4, 16.8, 15.2]",
        "(-156.4, 16.8, 15.2)",
        "square brackets",
    ),
    (
        "lesion = \"pleural_based\"",
        "lesion = \u{201c}pleural_based\u{201d}",
        "plain quotes",
    ),
    (
        "lesion = \"pleural_based\"",
        "flange_pose = [1, 2, 3]",
        "[goals.flange_pose]\n    position_mm = [0, 0, 0]",
    ),
    (
        "lesion = \"pleural_based\"",
        "target_mm = \"pleural_based\"",
        "such as `target_mm = [0, 0, 0]`",
    ),
    (
        "[mount]",
        "[engines]\nrun = \"mujoco\"\n[mount]",
        "write it in brackets: [\"mujoco\"]",
    ),
    (
        "needle_length_mm = 200",
        "needle_gauge = \"18G\"",
        "a plain whole number",
    ),
];

#[test]
fn slips_are_answered_with_what_to_write() {
    let bench = Bench::new();
    for (from, to, answer) in SLIPS {
        bench.write("s.toml", with_edit(FIRST, from, to));
        let found = bench
            .run(&["check", "s.toml", "--json"])
            .exits_with(2)
            .json();
        let finding = &found["findings"][0];
        let words = format!("{} {}", finding["message"], finding["hint"]);
        // As JSON has them.
        let wanted = serde_json::to_string(answer).unwrap();
        assert!(
            words.contains(wanted.trim_matches('"')),
            "{to}: {finding:#}"
        );
    }
}

#[test]
fn radians_are_noted_where_degrees_belong() {
    let text = with_edit(FIRST, "[0, 0, 270]", "[0, 0, 4.712]");
    let answer = Bench::with_scenario(&text).run(&["check", "s.toml"]);
    let said = format!("{}{}", answer.stdout, answer.stderr);
    assert!(
        said.contains("did you give radians? They are [0, 0, 270] deg"),
        "{said}"
    );
}

/// All that a file has to say, and what is said of the rest.
#[test]
fn short_scenarios_work_and_say_what_was_assumed() {
    for (text, assumed) in [
        ("[[goals]]\nlesion = \"right_upper_lobe\"\n", 5),
        (
            "[phantom]\nmodel = \"female-p50-supine\"\n[[goals]]\nlesion = \"right_upper_lobe\"\n",
            4,
        ),
        (
            "[[goals]]\nentry_mm = [-156.4, 16.8, 15.2]\ntarget_mm = [-92, 14, 29]\n",
            4,
        ),
        (
            "[robot]\nurdf = \"ur5e\"\n[[goals]]\nlesion = \"left_upper_lobe\"\n",
            5,
        ),
    ] {
        let bench = Bench::with_scenario(text);
        let answer = bench
            .run(&["check", "s.toml", "--json"])
            .exits_with(0)
            .json();
        assert_eq!(answer["scenarios"][0]["name"], "s");
        let notes = answer["notes"].as_array().unwrap().iter();
        let notes: Vec<&str> = notes.filter_map(|note| note.as_str()).collect();
        let found = notes
            .iter()
            .filter(|note| note.starts_with("assumed, since"))
            .count();
        assert_eq!(found, assumed, "{text}: {notes:#?}");
    }
}

#[test]
fn nothing_is_assumed_of_a_scenario_that_says_it() {
    let answer = Bench::with_scenario(FIRST)
        .run(&["check", "s.toml"])
        .exits_with(0);
    assert!(!answer.stdout.contains("assumed, since"), "{answer:#?}");
}

/// What is assumed may be why something is wrong.
#[test]
fn errors_say_what_was_assumed() {
    let text = "[[goals]]\nentry_mm = [-156.4, 16.8, 15.2]\ntarget_mm = [-300, 14, 29]\n";
    let answer = Bench::with_scenario(text)
        .run(&["check", "s.toml"])
        .exits_with(2);
    answer.complains([
        "outside the phantom",
        "assumed, since there is no [phantom]: `model = \"male-p50-supine\"`",
    ]);
}
