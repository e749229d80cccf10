//! `atlas`: every configuration at every roll.

use std::path::Path;

use serde_json::Value;

use crate::support::{Bench, Json, SMALL, has_keys, with_edit};

fn answer(jobs: &str) -> (Bench, Value) {
    let bench = Bench::with_scenario(SMALL);
    let arguments = format!("roll-map s.toml --rolls 24 --json --jobs {jobs}");
    let answer = bench.run(&arguments).exits_with(0).json();
    (bench, answer)
}

#[test]
fn every_branch_has_every_roll_and_its_ranges() {
    let (bench, answer) = answer("2");
    has_keys(&answer, "schema_version scenario provenance goals");
    let goal = &answer["goals"][0];
    assert_eq!(goal["rolls_rad"].list().len(), 24);
    assert_eq!(goal["fixed_roll_rad"], 0.0);
    let branches = goal["branches"].list();
    assert_eq!(branches.len(), 8);
    let mut ranges = 0;
    for branch in branches {
        for key in [
            "least_clearance_m",
            "class",
            "rule",
            "surplus_m",
            "joint_margin",
            "joints_rad",
        ] {
            assert_eq!(branch[key].list().len(), 24, "{key}");
        }
        let rules = branch["rule"].list();
        let surplus = branch["surplus_m"].list();
        for (rule, surplus) in rules.iter().zip(surplus) {
            assert_eq!(rule.is_null(), surplus.number() >= 0.0);
        }
        let some_work = rules.iter().any(Value::is_null);
        assert!(!some_work || !branch["ranges"].list().is_empty());
        for range in branch["ranges"].list() {
            ranges += 1;
            has_keys(range, "from_rad to_rad width_rad before after best");
            for aim in [
                "clearance",
                "joint_margin",
                "singularity",
                "tip_accuracy",
                "balanced",
            ] {
                has_keys(
                    &range["best"][aim],
                    "roll_rad value joints_rad least_clearance_m pair",
                );
            }
        }
    }
    assert!(ranges >= 6);
    let files = bench.tree("out");
    let expected = [
        "small/atlas.html",
        "small/atlas.json",
        "small/pose.atlas.png",
        "small/pose.atlas.svg",
    ]
    .map(Path::new);
    assert_eq!(files, expected);
    assert_eq!(bench.read_json("out/small/atlas.json"), answer);
}

#[test]
fn files_are_the_same_for_every_number_of_threads() {
    let (one, two) = (answer("1").0, answer("2").0);
    for file in [
        "out/small/atlas.html",
        "out/small/atlas.json",
        "out/small/pose.atlas.png",
        "out/small/pose.atlas.svg",
    ] {
        assert_eq!(one.read(file), two.read(file), "{file}");
    }
}

#[test]
fn table_names_ranges_and_the_roll_that_the_goal_fixes() {
    let bench = Bench::with_scenario(SMALL);
    let answer = bench
        .run("roll-map s.toml --rolls 24 --no-pictures")
        .exits_with(0);
    answer.says([
        "Right-Down-Fold",
        "the goal fixes the roll at 0.0 deg",
        "best roll by",
        "results: out/small",
    ]);
    let expected = ["small/atlas.html", "small/atlas.json"].map(Path::new);
    assert_eq!(bench.tree("out"), expected);
}

#[test]
fn nothing_that_works_is_a_failed_criterion() {
    let far = with_edit(
        SMALL,
        "position_mm = [194.2, -359.3, 170.1]",
        "position_mm = [194.2, -959.3, 170.1]",
    );
    let far = with_edit(
        &far,
        "position_mm = [155.0, -609.5, 0]",
        "position_mm = [155.0, -1209.5, 0]",
    );
    let far = with_edit(&far, "center_mm = [300, -598]", "center_mm = [300, -1198]");
    let bench = Bench::with_scenario(&far);
    let answer = bench
        .run("roll-map s.toml --rolls 12 --no-pictures")
        .exits_with(1);
    answer.says(["infeasible at any roll"]);
    answer.says(["out of reach"]);
}
