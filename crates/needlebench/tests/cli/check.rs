//! `check`.

use crate::support::{Bench, SMALL, files, has_keys, with_edit};

#[test]
fn every_shipped_scenario_is_sound() {
    let bench = Bench::new();
    let scenarios = files("scenarios", "toml");
    assert!(!scenarios.is_empty());
    for scenario in scenarios {
        let path = scenario.display().to_string();
        let answer = bench.run(&["check", &path, "--json"]).exits_with(0).json();
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
    let answer = bench.run(&["check", "s.toml", "--json"]).exits_with(0);
    let answer = answer.json();
    has_keys(&answer, &["schema_version", "ok", "findings"]);
    assert_eq!(answer["findings"].as_array().unwrap().len(), 0);
    let answer = bench.run(&["check", "s.toml"]).exits_with(0);
    assert!(answer.stdout.starts_with("s.toml: ok"), "{answer:#?}");
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
    let answer = bench.run(&["check", "a.toml", "s.toml", "b.toml", "--json"]);
    let answer = answer.exits_with(2).json();
    let findings = answer["findings"].as_array().unwrap();
    let keys: Vec<(&str, &str)> = findings
        .iter()
        .map(|each| {
            has_keys(each, &["file", "line", "key", "message", "hint"]);
            (
                each["file"].as_str().unwrap(),
                each["key"].as_str().unwrap(),
            )
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
    let answer = bench.run(&["check", "s.toml"]).exits_with(2);
    assert_eq!(answer.stderr, expected);
    assert_eq!(answer.stdout, "");
}

#[test]
fn every_command_that_reads_scenarios_refuses_a_bad_one_alike() {
    let bench = Bench::with_scenario(&with_edit(SMALL, "hold_s", "hold_ss"));
    let expected = bench.run(&["check", "s.toml"]).stderr;
    for arguments in [
        &["run", "s.toml"][..],
        &["ik", "s.toml", "--goal", "pose"],
        &["clearance", "s.toml", "--joints", "0,0,0,0,0,0"],
    ] {
        let answer = bench.run(arguments).exits_with(2);
        assert_eq!(answer.stderr, expected, "{arguments:?}");
        assert_eq!(answer.stdout, "", "{arguments:?}");
    }
    assert!(!bench.path("out").exists(), "a refused run writes nothing");
}
