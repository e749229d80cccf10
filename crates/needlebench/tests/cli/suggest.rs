//! `needlebench suggest`: what it proposes passes `check`, and where it has nothing it says why.

use std::fs;

use serde_json::Value;

use crate::support::{Bench, Json, holds, numbers, workspace};

/// A patient, a table, a robot beside it, and a lesion: all else is left out.
const SHORT: &str =
    "[phantom]\nmodel = \"male-p50-supine\"\n[[goals]]\nlesion = \"right_upper_lobe\"\n";

fn suite() -> String {
    fs::read_to_string(workspace().join("scenarios/supine_suite.toml")).unwrap()
}

fn entries(answer: &Value) -> &Vec<Value> {
    answer["entries"][0]["entries"].list()
}

#[test]
fn proposed_entries_lie_on_the_skin_and_pass_check() {
    let bench = Bench::with_scenario(&suite());
    let arguments = "suggest s.toml --goal right_upper_anterior --placements 0 --json";
    let answer = bench.run(arguments).exits_with(0).json();
    assert_eq!(entries(&answer).len(), 3);
    for entry in entries(&answer) {
        let direction = numbers(&entry["direction_deg"]);
        let point = numbers(&entry["entry_in_phantom_m"]);
        // By the direction, and by the point where it says that this leaves the skin.
        let by_direction = format!("entry_direction_deg = {direction:?}");
        let by_point = format!(
            "entry_mm = {:?}",
            point.iter().map(|m| m * 1e3).collect::<Vec<_>>()
        );
        for line in [by_direction, by_point] {
            let text = suite().replace("entry_mm = [-108.9, -76.4, 85.8]", &line);
            bench.write("with.toml", text);
            let check = bench.run("check with.toml --json").exits_with(0).json();
            let goal = &check["scenarios"][0]["goals"][0];
            assert_eq!(goal["name"], "right_upper_anterior");
            assert_eq!(goal["working"], entry["working"]);
            assert_eq!(goal["needle_route"]["kept"], true);
            let moved = check["notes"].list().iter().filter_map(Value::as_str);
            let moved = moved
                .filter(|note| note.contains("right_upper_anterior") && note.contains("moved"));
            assert_eq!(moved.count(), 0, "the entry is not on the skin");
        }
        let depth = entry["depth_m"].number();
        let target = numbers(&answer["entries"][0]["target_in_phantom_m"]);
        let apart: f64 = point
            .iter()
            .zip(&target)
            .map(|(a, b)| (a - b).powi(2))
            .sum();
        assert!((apart.sqrt() - depth).abs() < 1e-12);
    }
    // The best is first.
    let scores: Vec<f64> = entries(&answer)
        .iter()
        .map(|each| each["score"].number())
        .collect();
    assert!(scores.is_sorted_by(|a, b| a >= b), "{scores:?}");
}

#[test]
fn proposed_places_pass_check_for_all_goals() {
    let bench = Bench::with_scenario(&suite());
    let arguments = "suggest s.toml --entries 0 --placements 2 --json";
    let answer = bench.run(arguments).exits_with(0).json();
    let places = answer["places"]["places"].list();
    assert_eq!(places.len(), 2);
    for place in places {
        let lines = place["toml"].word();
        let old = "base_position_mm = [-280, 350, 1050]\nbase_rpy_deg = [0, 0, 270]";
        assert!(suite().contains(old));
        bench.write("with.toml", suite().replace(old, lines));
        let check = bench.run("check with.toml --json").exits_with(0).json();
        let goals = check["scenarios"][0]["goals"].list();
        let working: Vec<u64> = goals
            .iter()
            .map(|goal| goal["working"].as_u64().unwrap())
            .collect();
        let proposed = place["goals"].list();
        let proposed: Vec<u64> = proposed
            .iter()
            .map(|goal| goal["working"].as_u64().unwrap())
            .collect();
        assert_eq!(working, proposed);
        assert_eq!(place["working"].as_u64(), working.iter().min().copied());
    }
}

#[test]
fn answers_do_not_depend_on_threads() {
    let bench = Bench::with_scenario(SHORT);
    let ask = |jobs: &str| {
        let arguments = format!("suggest s.toml --placements 1 --json --jobs {jobs}");
        bench.run(&arguments).exits_with(0).stdout
    };
    assert_eq!(ask("1"), ask("3"));
}

#[test]
fn a_scenario_is_written_that_passes_check_and_keeps_its_comments() {
    let bench = Bench::with_scenario(&suite());
    let arguments =
        "suggest s.toml --lesion left_lower_lobe --placements 1 --write new.toml --out maps";
    let said = bench.run(arguments).exits_with(0).stdout;
    assert!(said.contains("next: needlebench run new.toml"), "{said}");
    let text = bench.text("new.toml");
    assert!(text.contains("name = \"new\""), "{text}");
    assert!(said.contains(" rib") && !said.contains("rib_"), "{said}");
    holds(
        &text,
        ["# Driven out of the bore", "lesion = \"left_lower_lobe\""],
    );
    for name in [
        "left_lower_lobe.entries.png",
        "left_lower_lobe.entries.svg",
        "places.png",
        "places.svg",
    ] {
        assert!(
            bench.path("maps/supine_suite").join(name).is_file(),
            "{name}"
        );
    }
    bench
        .run(arguments)
        .exits_with(2)
        .complains(["new.toml", "--force"]);
}

#[test]
fn where_there_is_no_entry_it_says_which_rule_refuses_most() {
    let short = suite().replace("needle_length_mm = 200", "needle_length_mm = 70");
    let bench = Bench::with_scenario(&short);
    let arguments = "suggest s.toml --lesion left_lower_lobe --entries 1 --placements 0";
    let said = bench.run(arguments).exits_with(1).stdout;
    holds(
        &said,
        ["none: none of", "most frequent reason: needle too short"],
    );
}

/// Half an hour in a debug build.
#[test]
#[ignore = "long: every shipped phantom and lesion"]
fn proposals_for_every_phantom_and_lesion_pass_check() {
    let bench = Bench::new();
    let choices = bench.run("init --list --json").exits_with(0).json();
    let (mut proposed, mut none) = (0, 0);
    for phantom in choices["phantoms"].list() {
        for lesion in choices["lesions"].list() {
            let [phantom, lesion] = [phantom, &lesion["name"]].map(super::support::Json::word);
            let text = format!("[phantom]\nmodel = \"{phantom}\"\n");
            bench.write("s.toml", &text);
            let arguments = format!("suggest s.toml --lesion {lesion} --placements 0 --json");
            let answer = bench.run(&arguments);
            let found = answer.json();
            assert_eq!(
                answer.status,
                Some(i32::from(entries(&found).is_empty())),
                "{phantom} {lesion}"
            );
            none += usize::from(entries(&found).is_empty());
            for entry in entries(&found) {
                let entry = entry["toml"].word();
                bench.write(
                    "with.toml",
                    format!("{text}[[goals]]\nlesion = \"{lesion}\"\n{entry}\n"),
                );
                bench.run("check with.toml").exits_with(0);
                proposed += 1;
            }
        }
    }
    println!("{proposed} entries pass; {none} lesions have none");
    assert!(proposed > 0);
}
