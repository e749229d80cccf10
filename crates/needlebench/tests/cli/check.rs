//! `check`.

use crate::support::{Bench, Json, SMALL, files, has_keys, holds, with_edit, workspace};

#[test]
fn every_shipped_scenario_is_sound() {
    let bench = Bench::new();
    let scenarios = files("scenarios", "toml");
    assert!(!scenarios.is_empty());
    for scenario in scenarios {
        let path = scenario.display().to_string();
        let answer = bench.run(format!("check '{path}' --json"));
        let answer = answer.exits_with(0).json();
        assert_eq!(answer["ok"], true, "{path}");
    }
}

#[test]
fn every_shipped_scenario_points_editors_at_the_schema() {
    for scenario in files("scenarios", "toml") {
        let text = std::fs::read_to_string(&scenario).unwrap();
        assert!(
            text.starts_with("#:schema ./scenario.schema.json\n"),
            "{}",
            scenario.display()
        );
    }
}

#[test]
fn sound_scenario_has_no_findings() {
    let bench = Bench::with_scenario(SMALL);
    let answer = bench.run("check s.toml --json").exits_with(0);
    let answer = answer.json();
    has_keys(&answer, "schema_version ok findings");
    assert_eq!(answer["findings"].list().len(), 0);
    let answer = bench.run("check s.toml").exits_with(0);
    assert!(answer.stdout.starts_with("s.toml: ok"), "{answer:#?}");
    // Without a name of its own it has its file's.
    bench.write("short.toml", "[[goals]]\nlesion = \"right_upper_lobe\"\n");
    let answer = bench.run("check short.toml --json").exits_with(0).json();
    assert_eq!(answer["scenarios"][0]["name"], "short");
}

#[test]
fn findings_of_all_files_and_values_come_together() {
    let bench = Bench::with_scenario(SMALL);
    let text = with_edit(SMALL, "hold_s = 0.1", "hold_s = 900");
    bench.write(
        "a.toml",
        with_edit(&text, "period_ms = 50", "period_ms = -1"),
    );
    bench.write("b.toml", with_edit(SMALL, "hold_s", "hold"));
    let answer = bench.run("check a.toml s.toml b.toml --json");
    let answer = answer.exits_with(2).json();
    let findings = answer["findings"].list();
    let keys: Vec<(&str, &str)> = findings
        .iter()
        .map(|each| {
            has_keys(each, "file line key message hint");
            (each["file"].word(), each["key"].word())
        })
        .collect();
    assert_eq!(
        keys,
        [
            ("a.toml", "motion.hold_s"),
            ("a.toml", "recording.period_ms"),
            ("b.toml", "motion.hold")
        ]
    );
}

#[test]
fn diagnostics_for_people_show_the_place_and_the_hint() {
    let bench = Bench::with_scenario(&with_edit(SMALL, "hold_s", "hold_ss"));
    let line = 1 + SMALL
        .lines()
        .position(|line| line.starts_with("hold_s"))
        .unwrap();
    let expected = format!(
        "\
error: motion.hold_ss: unknown key `hold_ss`
  --> s.toml:{line}:1
   |
{line} | hold_ss = 0.1
   | ^^^^^^^
   |
   = hint: did you mean `hold_s`?

"
    );
    let answer = bench.run("check s.toml").exits_with(2);
    assert_eq!(answer.stderr, expected);
    assert_eq!(answer.stdout, "");
}

#[test]
fn every_command_that_reads_scenarios_refuses_a_bad_one_alike() {
    let bench = Bench::with_scenario(&with_edit(SMALL, "hold_s", "hold_ss"));
    let expected = bench.run("check s.toml").stderr;
    for arguments in [
        "run s.toml",
        "ik s.toml --goal pose",
        "clearance s.toml --joints 0,0,0,0,0,0",
    ] {
        let answer = bench.run(arguments).exits_with(2);
        assert_eq!(answer.stderr, expected, "{arguments:?}");
        assert_eq!(answer.stdout, "", "{arguments:?}");
    }
    assert!(!bench.path("out").exists(), "a refused run writes nothing");
}

/// The text of a shipped scenario with one part changed.
fn shipped(name: &str, from: &str, to: &str) -> String {
    let path = workspace().join("scenarios").join(name);
    with_edit(&std::fs::read_to_string(path).unwrap(), from, to)
}

#[test]
fn reach_route_start_and_target_are_known_without_a_simulation() {
    let bench = Bench::with_scenario(&shipped("supine_suite.toml", "seed = 1", "seed = 2"));
    let answer = bench.run("check s.toml --json").exits_with(0).json();
    let scenario = &answer["scenarios"][0];
    assert_eq!(scenario["basis"], "postures only, motions not planned");
    assert!(scenario["start"]["least_clearance_m"].number() > 0.0);
    let goals = scenario["goals"].list();
    assert_eq!(goals.len(), 4);
    for goal in goals {
        let all = goal["configurations"].list();
        let works = |each: &&serde_json::Value| each["works"] == true;
        assert_eq!(all.len(), 8);
        assert_eq!(goal["working"], all.iter().filter(works).count());
        assert!(
            goal["working"].as_u64().unwrap() >= 4,
            "as the scenario wants"
        );
        for each in all {
            let says_why = !each["rejections"].list().is_empty() || each["missed"].is_string();
            assert_eq!(each["works"] == false, says_why, "{each}");
        }
        // What its comments say: ribs are 4.7 mm away and more.
        assert!(goal["needle_route"]["distance_m"].number() > 4e-3);
        assert_eq!(goal["needle_route"]["kept"], true);
        assert!(goal["target"]["lesion"].is_string());
    }
    let text = bench.run("check s.toml").exits_with(0).stdout;
    holds(
        &text,
        ["8 configurations feasible (postures only, motions not planned)"],
    );
    assert!(text.contains("needle path: "), "{text}");
}

#[test]
fn a_goal_out_of_reach_is_a_finding_with_what_is_missing() {
    let text = shipped(
        "supine_suite.toml",
        "[-280, 350, 1050]",
        "[-280, 900, 1050]",
    );
    let bench = Bench::with_scenario(&text);
    let answer = bench.run("check s.toml --json").exits_with(1).json();
    assert_eq!(answer["ok"], false);
    let findings = answer["findings"].list();
    assert_eq!(findings.len(), 4, "{findings:?}");
    let line = 1 + text
        .lines()
        .position(|line| line.starts_with("entry_mm"))
        .unwrap();
    let message = findings[0]["message"].word();
    holds(
        message,
        ["out of reach", "mm or more in every configuration"],
    );
    assert_eq!(findings[0]["key"], "goals[0].entry_mm");
    assert_eq!(findings[0]["line"], line);
    // A run says the same, configuration by configuration.
    let report = bench.run("run s.toml --engine rapier --json --no-pictures");
    let report = report.exits_with(1).json();
    let least_m = report["goals"][0]["configurations"]
        .list()
        .iter()
        .map(|each| {
            assert_eq!(each["rejections"][0]["rule"], "unreachable");
            each["rejections"][0]["value"].number()
        })
        .fold(f64::INFINITY, f64::min);
    assert!(
        message.contains(&format!("{:.1} mm or more", least_m * 1e3)),
        "{message} {least_m}"
    );
}

#[test]
fn a_route_through_bone_is_a_finding() {
    // Straight through rib 3 instead of between the ribs.
    let text = shipped(
        "supine_suite.toml",
        "[-108.9, -76.4, 85.8]",
        "[-108.9, -76.4, 75.8]",
    );
    let bench = Bench::with_scenario(&text);
    let answer = bench.run("check s.toml --json").exits_with(1).json();
    let findings = answer["findings"].list();
    let message = findings[0]["message"].word();
    holds(message, ["needle", "rib_"]);
    assert_eq!(findings[0]["key"], "goals[0].entry_mm");
}
