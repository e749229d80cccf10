//! `compare`: results, folders and scenarios side by side.

use std::fmt::Display;

use needlebench_evaluation::metric::{Metric, MetricKey};
use serde_json::{Value, json};

use crate::support::{Answer, Bench, Json, SMALL, has_keys, holds, small_run, with_edit};

/// The report of `SMALL` in rapier, as text.
fn report() -> &'static str {
    &small_run().1.stdout
}

/// A folder with `a.json`, and `b.json` that was changed.
fn bench(change: impl FnOnce(&mut Value)) -> Bench {
    let bench = Bench::new();
    bench.write("a.json", report());
    let mut changed: Value = serde_json::from_str(report()).unwrap();
    change(&mut changed);
    bench.write("b.json", changed.to_string());
    bench
}

fn compare(bench: &Bench, more: impl Display) -> Answer {
    bench.run(format!("compare a.json b.json {more}"))
}

/// Makes the arm of configuration 0 come this near to the skin.
fn nearer(report: &mut Value, clearance_m: f64) {
    let configuration = &mut report["goals"][0]["configurations"][0];
    let found = &mut configuration["clearance"]["robot_phantom"];
    found["minimum_m"] = json!(clearance_m);
    found["certified_lower_bound_m"] = json!(clearance_m);
    // What is compared, by its key: the proven bound.
    configuration["metrics"]["arm_to_skin"] = json!(clearance_m);
}

#[test]
fn result_against_itself_passes_and_lists_nothing() {
    let bench = bench(|_| ());
    let text = compare(&bench, "--max-loss clearance=0mm").exits_with(0);
    text.says(["PASS"]);
    assert!(!text.stdout.contains('─'), "{text:#?}");
    assert_eq!(text.stderr, "");
    let all = compare(&bench, "--all").exits_with(0).stdout;
    holds(&all, ["tip error", "same"]);
}

#[test]
fn document_has_its_keys_and_si_units() {
    let bench = bench(|report| nearer(report, 0.001));
    let answer = compare(&bench, "--json").exits_with(0).json();
    has_keys(
        &answer,
        "schema_version pass failures a b provenance_differences goals",
    );
    let configurations = answer["goals"][0]["configurations"].list();
    assert_eq!(configurations.len(), 8);
    let found = configurations[0]["metrics"]
        .list()
        .iter()
        .find(|found| found["metric"] == "arm_to_skin")
        .unwrap();
    has_keys(found, "metric unit a b change relative resolution outcome");
    assert_eq!((&found["unit"], &found["b"]), (&json!("m"), &json!(0.001)));
    assert_eq!(found["outcome"], "worse");
}

#[test]
fn loss_beyond_its_threshold_exits_with_1_and_is_written_for_ci() {
    let bench = bench(|report| nearer(report, 0.001));
    compare(&bench, "--max-loss arm_to_skin=1m").exits_with(0);
    let answer = compare(
        &bench,
        "--max-loss arm_to_skin=1mm --junit j.xml --markdown m.md",
    );
    let answer = answer.exits_with(1);
    answer.says(["FAILED pose Right-Down-Fold: arm to skin: "]);
    let junit = bench.text("j.xml");
    assert_eq!(junit.matches("<failure").count(), 1, "{junit}");
    assert!(junit.contains("tests=\"10\""), "{junit}");
    let markdown = bench.text("m.md");
    holds(&markdown, ["**fail**", "| worse |"]);
}

#[test]
fn status_that_got_worse_exits_with_1_unless_that_is_allowed() {
    let bench = bench(|report| {
        let configuration = &mut report["goals"][0]["configurations"][1];
        configuration["status"] = json!("rejected");
        configuration["rejections"] = json!([{"rule": "collision", "detail": "forearm and skin"}]);
    });
    let answer = compare(&bench, "--wide").exits_with(1);
    let line = "Right-Up-Fold: worse: ok -> rejected (collision: forearm and skin)";
    assert!(answer.stdout.contains(line), "{answer:#?}");
    compare(&bench, "--allow-status-change").exits_with(0);
}

#[test]
fn goal_with_another_name_is_matched_when_told() {
    let bench = bench(|report| report["goals"][0]["name"] = json!("entry"));
    let answer = compare(&bench, "").exits_with(2);
    answer.complains(["no goal in common", "pose", "entry", "--goal A=B"]);
    let answer = compare(&bench, "--goal pose=entry --wide").exits_with(0);
    answer.says(["goal pose, in B entry"]);
    compare(&bench, "--goal pose=entri")
        .exits_with(2)
        .complains(["`entri`"]);
}

#[test]
fn thresholds_come_from_a_file_too_and_the_command_line_goes_before_it() {
    let bench = bench(|report| nearer(report, 0.001));
    bench.write("limits.toml", "[max_loss]\narm_to_skin = \"1mm\"\n");
    compare(&bench, "--thresholds limits.toml").exits_with(1);
    let more = "--thresholds limits.toml --max-loss arm_to_skin=1m";
    compare(&bench, more).exits_with(0);
}

#[test]
fn reports_that_cannot_be_used_are_refused_with_file_and_line() {
    let bench = bench(|_| ());
    let half: String = report().lines().take(40).collect::<Vec<_>>().join("\n");
    bench.write("half.json", half);
    bench
        .run("compare a.json half.json")
        .exits_with(2)
        .complains(["half.json:40", "is truncated", "line 40 column"]);
}

#[test]
fn folder_of_several_results_is_answered_with_one_to_try() {
    let bench = bench(|_| ());
    for name in ["one", "two"] {
        std::fs::create_dir_all(bench.path("out").join(name)).unwrap();
        bench.write(&format!("out/{name}/report.json"), report());
    }
    bench.run("compare a.json out/one").exits_with(0);
    let answer = bench.run("compare a.json out").exits_with(2);
    answer.complains(["several scenarios", "out/one"]);
}

#[test]
fn scenarios_are_run_and_two_layouts_differ_by_their_input() {
    let bench = bench(|_| ());
    bench.write("s.toml", SMALL);
    // What is run now is what was stored.
    let answer = bench
        .run("compare a.json s.toml --json")
        .exits_with(0)
        .json();
    assert_eq!(answer["provenance_differences"], json!([]));
    for each in answer["goals"][0]["configurations"].list() {
        for found in each["metrics"].list() {
            assert_eq!(found["outcome"], "same", "{found:#}");
        }
    }
    bench.write(
        "lower.toml",
        with_edit(
            SMALL,
            "position_mm = [155.0, -609.5, 0]",
            "position_mm = [155.0, -609.5, -1.5]",
        ),
    );
    let answer = bench.run("compare s.toml lower.toml --json");
    let answer = answer.exits_with(0).json();
    assert_eq!(answer["provenance_differences"][0]["what"], "scenario");
    let changed = answer["goals"][0]["configurations"][0]["metrics"].list();
    let skin = changed
        .iter()
        .find(|found| found["metric"] == "tool_to_skin")
        .unwrap();
    assert_eq!(skin["outcome"], "better", "{skin:#}");
    assert!(!bench.path("out").exists(), "nothing is written");
}

#[test]
fn report_without_metrics_is_refused_with_the_place_of_what_it_lacks() {
    let bench = bench(|report| {
        let configuration = report["goals"][0]["configurations"][1].as_object_mut();
        configuration.unwrap().remove("metrics");
    });
    let answer = bench.run("compare b.json a.json").exits_with(2);
    answer.complains(["`goals[0].configurations[1].metrics` is missing", "b.json"]);
}

#[test]
fn help_lists_every_metric() {
    let help = Bench::new().run("compare --help").exits_with(0).stdout;
    for metric in MetricKey::all(&["rapier", "mujoco"]) {
        let listed = help
            .split(|c: char| !(c.is_ascii_alphanumeric() || c == '_'))
            .any(|word| word == metric.key());
        assert!(listed, "{metric:?} is not in\n{help}");
    }
}

#[test]
fn ranking_of_a_scenario_is_stated_with_every_term() {
    let report: Value = serde_json::from_str(report()).unwrap();
    let goal = &report["goals"][0];
    let ranking = &goal["ranking"];
    has_keys(
        ranking,
        "order pareto_set metrics runner_up smallest_weight_change",
    );
    assert_eq!(ranking["order"][0], goal["recommended"]["label"]);
    for each in goal["configurations"].list() {
        has_keys(
            each,
            "ranking pareto dominated_by room tip_sensitivity_m_per_rad",
        );
        if each["status"] != "ok" {
            assert_eq!(each["ranking"], Value::Null);
            continue;
        }
        has_keys(&each["ranking"], "rank score terms");
        for term in each["ranking"]["terms"].list() {
            has_keys(
                term,
                "metric value counted_as unit utility weight contribution",
            );
        }
    }
}

#[test]
fn weights_of_the_scenario_change_the_choice_and_wrong_ones_are_refused() {
    let ranked = |section: &str| {
        let text = with_edit(SMALL, "[recording]", &format!("{section}\n[recording]"));
        Bench::with_scenario(&text).run("run s.toml --engine rapier --json")
    };
    // Of the time alone the fastest is the best.
    let report: Value = serde_json::from_str(report()).unwrap();
    let mut others = vec![
        "[ranking]".to_owned(),
        "motion_time_s.best = 0.01".to_owned(),
    ];
    for metric in report["goals"][0]["ranking"]["metrics"].list() {
        let name = metric["name"].word();
        let key = Metric::of_key(name).unwrap().ranking_key.unwrap();
        if key != "motion_time_s" {
            others.push(format!("{key}.weight = 0"));
        }
    }
    let answer = ranked(&others.join("\n")).exits_with(0).json();
    let goal = &answer["goals"][0];
    let time_s = |each: &Value| {
        let terms = each["ranking"]["terms"].as_array()?;
        let term = terms.iter().find(|term| term["metric"] == "motion_time")?;
        term["counted_as"].as_f64()
    };
    let configurations = goal["configurations"].list();
    let least = configurations
        .iter()
        .filter_map(time_s)
        .fold(f64::INFINITY, f64::min);
    let chosen = configurations
        .iter()
        .find(|each| each["label"] == goal["recommended"]["label"])
        .unwrap();
    assert_eq!(time_s(chosen), Some(least));
}
