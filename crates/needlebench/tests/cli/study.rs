//! `study` and `merge`: from a study file to a folder of results.

use std::fmt::Display;
use std::sync::OnceLock;

use serde_json::Value;

use crate::support::{Answer, Bench, Json, SMALL, has_keys, holds, workspace};

/// 96 static cases.
const STUDY: &str = r#"
name = "moved"
scenario = "s.toml"
mode = "static"
replanned_cases = 4
seed = 1
[sampling]
samples = 16
[[factors]]
name = "along"
key = "phantom.position_mm[0]"
range = [-20, 20]
relative = true
[[factors]]
name = "height"
key = "robot.base_position_mm[2]"
role = "control"
values = [790, 800, 810]
[[factors]]
name = "tool"
key = "tool.mount_rotation_deg"
values = [90, 180]
"#;

fn run(bench: &Bench, more: impl Display) -> Answer {
    bench.run(format!("study study.toml --quiet {more}"))
}

/// The study, computed once for several tests.
fn whole() -> &'static (Bench, Answer) {
    static WHOLE: OnceLock<(Bench, Answer)> = OnceLock::new();
    WHOLE.get_or_init(|| {
        let bench = Bench::shared();
        bench.write("s.toml", SMALL);
        bench.write("study.toml", STUDY);
        let answer = run(&bench, "--csv --junit junit.xml --jobs 2").exits_with(0);
        (bench, answer)
    })
}

/// A bench with the study's results.
fn with_results() -> Bench {
    let bench = Bench::with_study(STUDY);
    bench.copy(&whole().0, "out");
    bench
}

#[test]
fn a_study_leaves_a_table_a_summary_and_a_page() {
    let (bench, answer) = whole();
    answer.says(["96 cases", "Right-Up-Fold", "height"]);
    for file in [
        "results.parquet",
        "results.csv",
        "summary.json",
        "summary.md",
        "report.html",
        "study.json",
    ] {
        assert!(bench.path(&format!("out/moved/{file}")).is_file(), "{file}");
    }
    assert!(!bench.path("out/moved/journal.nbj").exists());
    let summary: Value = serde_json::from_slice(&bench.read("out/moved/summary.json")).unwrap();
    has_keys(
        &summary,
        "name cases verdict criteria overall effects choices study_id",
    );
    assert_eq!(summary["cases"], 96);
}

#[test]
fn a_study_of_postures_says_so_everywhere_and_what_they_overstate() {
    let bench = Bench::with_study(&format!("{STUDY}[criteria]\nmin_layouts_working = 0.0\n"));
    let answer = run(&bench, "--junit junit.xml").exits_with(0);
    let warned = answer
        .stdout
        .lines()
        .position(|line| line.starts_with("Postures only, "));
    assert!(warned.is_some_and(|line| line < 8), "{}", answer.stdout);
    let markdown = bench.text("out/moved/summary.md");
    assert!(markdown.starts_with("# moved (postures only): pass\n\n"));
    assert!(markdown.find("- Postures only, ") < markdown.find("| candidate"));
    let summary: Value = serde_json::from_slice(&bench.read("out/moved/summary.json")).unwrap();
    assert_eq!(summary["postures_only"], "all");
    let headline = summary["headline"].word();
    assert!(
        headline.starts_with("Postures only, ") && headline.contains("Of 4 cases"),
        "{headline}"
    );
    // Of the best choice alone, which has a third of the cases.
    assert_eq!(summary["replanned"]["cases"], 4);
    assert!(summary["replanned"]["of"].as_u64().unwrap() <= 32);
    let drawn = summary["replanned"]["drawn"].list();
    for of in summary["replanned"]["gaps"].list() {
        assert!(of["interval"]["low"].is_number(), "{of}");
    }
    // A case that was drawn has the postures of its rows, and the motions of the case planned by itself.
    let case = &drawn[0];
    let bits = |mode: &str| {
        bench.write("alone.toml", STUDY.replace("mode = \"static\"", mode));
        let number = case["case"].to_string();
        let arguments = format!("study alone.toml --case {number} --json");
        let alone = bench.run(&arguments).exits_with(0).json();
        let rows = alone["rows"].list().iter().enumerate();
        let ok = rows.filter(|(_, row)| row["outcome"] == "ok");
        ok.fold(0_u64, |bits, (index, _)| bits | 1 << index)
    };
    assert_eq!(case["static"], bits("mode = \"static\""));
    assert_eq!(case["planned"], bits("mode = \"planned\""));
    let junit = bench.text("junit.xml");
    holds(
        &junit,
        ["Postures only, ", "name=\"choice\"", "best of 3 candidates"],
    );
    let page = bench.text("out/moved/report.html");
    assert!(page.contains("summary.headline"));
}

/// Lines of a terminal's window: what a study says fits one.
const SCREEN: usize = 48;

#[test]
fn the_verdict_and_the_answer_come_first_on_one_screen_of_80_columns() {
    let bench = Bench::with_study(&format!(
        "{STUDY}[criteria]\nmin_layouts_working = 0.0\n[requirements]\nmin_layouts_working = \"SRS-1\"\n"
    ));
    let arguments = "study study.toml --quiet --no-page";
    let answer = bench
        .run_with(&[("COLUMNS", Some("80"))], arguments)
        .exits_with(0);
    let lines: Vec<&str> = answer.stdout.lines().collect();
    assert_eq!(
        lines[0],
        "moved, 96 cases (postures only): PASS: 1 of 1 criteria met"
    );
    assert!(
        lines[1].starts_with("ANSWER: best of 3 candidates: height = "),
        "{}",
        lines[1]
    );
    assert!(lines.len() <= SCREEN, "{} lines", lines.len());
    for line in &lines {
        assert!(line.chars().count() <= 80, "{line}");
    }
    // The figure stands with its interval.
    let summary: Value = serde_json::from_slice(&bench.read("out/moved/summary.json")).unwrap();
    let sentence = summary["answer"]["sentence"].word();
    let label = summary["choices"]["choices"][0]["label"].word();
    // Half of the cases are invalid layouts: the pose is the flange's, and a turned tool misses the patient.
    answer.says(["16 of 32 cases are invalid layouts"]);
    for words in [label, "95 % CI", " % of 16 layouts"] {
        assert!(sentence.contains(words), "{sentence}");
    }
    let markdown = bench.text("out/moved/summary.md");
    let at = |words: &str| {
        markdown
            .find(words)
            .unwrap_or_else(|| panic!("{words} in {markdown}"))
    };
    assert!(at(sentence) < at("| candidate"));
    assert!(at("| candidate") < at("| configuration"));
    assert!(at("SRS-1") < at("<details>"));
    // A choice of what is drawn exactly has no tip error to show.
    assert!(!answer.stdout.contains("tip error"), "{}", answer.stdout);
    let all = run(&bench, "--no-page --resume --wide")
        .exits_with(0)
        .stdout;
    for words in ["all candidates", "main effects", "criteria in full"] {
        assert!(
            all.contains(words) && !answer.stdout.contains(words),
            "{words}"
        );
    }
}

#[test]
fn named_levels_are_held_against_each_other_where_nothing_is_to_be_chosen() {
    let study = STUDY.replace("role = \"control\"\n", "").replace(
        "key = \"tool.mount_rotation_deg\"\nvalues = [90, 180]",
        "[[factors.levels]]\nname = \"plain\"\n[[factors.levels]]\nname = \"wide berth\"\nset = { \"planning.min_clearance_mm\" = 60 }",
    );
    let bench = Bench::with_study(&study.replace(
        "key = \"phantom.position_mm[0]\"\nrange = [-20, 20]\nrelative = true",
        "key = \"phantom.head_yaw_deg\"\nrange = [-5, 5]\nrelative = true",
    ));
    run(&bench, "--no-page").exits_with(0);
    let summary: Value = serde_json::from_slice(&bench.read("out/moved/summary.json")).unwrap();
    let compared = summary["answer"]["compared"].list();
    // Heights are numbers, a range and no question.
    assert_eq!(compared.len(), 1, "{compared:?}");
    assert_eq!(compared[0]["factor"], "tool");
    assert_eq!(compared[0]["differs"], true);
    assert_eq!(compared[0]["levels"][1]["value"], 0.0);
    let sentence = summary["answer"]["sentence"].word();
    holds(
        sentence,
        ["feasible layouts by tool: ", "0.0 % (95 % CI 0.0 to"],
    );
}

#[test]
fn what_was_planned_for_the_gap_is_not_planned_again() {
    let bench = with_results();
    let whole = bench.read("out/moved/summary.json");
    let kept = bench.text("out/moved/replanned.txt");
    // Damage is seen, and made good.
    bench.write(
        "out/moved/replanned.txt",
        kept.replacen("\nstudy", "\nStudy", 1),
    );
    run(&bench, "--no-page --resume").exits_with(0);
    assert_eq!(bench.read("out/moved/summary.json"), whole);
    assert_eq!(bench.read("out/moved/replanned.txt"), kept.as_bytes());
}

#[test]
fn a_case_alone_has_the_numbers_of_its_rows() {
    let bench = &whole().0;
    let table = bench.text("out/moved/results.csv");
    let mut lines = table.lines();
    let names: Vec<&str> = lines.next().unwrap().split(',').collect();
    let rows: Vec<Vec<&str>> = lines.map(|line| line.split(',').collect()).collect();
    assert_eq!(rows.len(), 8 * 96);
    let mut compared = 0;
    for case in [0, 41, 95] {
        let alone = run(bench, format!("--case {case} --json"))
            .exits_with(0)
            .json();
        let of_case: Vec<_> = rows
            .iter()
            .filter(|row| row[0] == case.to_string())
            .collect();
        assert_eq!(of_case.len(), 8);
        for (row, alone) in of_case.iter().zip(alone["rows"].list()) {
            let cell = |name: &str| row[names.iter().position(|each| *each == name).unwrap()];
            assert_eq!(cell("configuration"), alone["configuration"]);
            assert_eq!(cell("outcome"), alone["outcome"]);
            let metrics = alone["metrics"].as_object().unwrap();
            compared += metrics.len();
            for (name, value) in metrics {
                // Both are the shortest digits of the same 24-bit number.
                let value = value.number();
                #[expect(clippy::cast_possible_truncation, reason = "as columns have it")]
                let value = value as f32;
                assert_eq!(
                    cell(name).parse::<f32>().unwrap().to_bits(),
                    value.to_bits(),
                    "{name}"
                );
            }
        }
    }
    assert!(compared > 200, "{compared}");
}

#[test]
fn shards_on_any_number_of_threads_merge_into_the_same_bytes() {
    let bench = Bench::with_study(STUDY);
    let mut shards = Vec::new();
    let merge = |shards: &[String]| format!("merge study.toml --out merged {}", shards.join(" "));
    for k in 1..=3 {
        let (shard, out) = (format!("{k}/3"), format!("shard{k}"));
        run(&bench, format!("--shard {shard} --out {out} --jobs 1")).exits_with(0);
        if k == 3 {
            // Not all of it is there yet.
            let refused = bench.run(merge(&shards)).exits_with(2);
            refused.complains(["missing"]);
        }
        shards.push(format!("{out}/moved"));
    }
    bench.run(merge(&shards)).exits_with(0);
    for file in ["results.parquet", "summary.json", "report.html"] {
        let whole = whole().0.read(&format!("out/moved/{file}"));
        assert!(
            bench.read(&format!("merged/moved/{file}")) == whole,
            "{file}"
        );
    }
}

#[test]
fn results_do_not_depend_on_how_the_study_was_called() {
    let bench = Bench::with_study(STUDY);
    let absolute = bench.path("study.toml").display().to_string();
    let arguments = format!("study '{absolute}' --quiet --csv --jobs 1");
    bench.run(arguments).exits_with(0);
    let files = [
        "replanned.txt",
        "report.html",
        "results.csv",
        "results.parquet",
        "study.json",
        "summary.json",
        "summary.md",
    ];
    assert_eq!(bench.tree("out").len(), files.len());
    for file in files {
        let [here, there] = [&bench, &whole().0].map(|at| at.read(&format!("out/moved/{file}")));
        assert!(here == there, "{file} differs");
    }
}

#[test]
fn a_folder_with_results_is_neither_overwritten_nor_mixed() {
    let bench = with_results();
    let table = bench.read("out/moved/results.parquet");
    run(&bench, "").exits_with(2).complains(["--resume"]);
    run(&bench, "--resume").exits_with(0);
    bench.write("study.toml", STUDY.replace("samples = 16", "samples = 8"));
    run(&bench, "--resume")
        .exits_with(2)
        .complains(["another study", "different"]);
    assert!(bench.read("out/moved/results.parquet") == table);
    // A table that is cut off is found, and made whole again on request.
    bench.write("study.toml", STUDY);
    bench.write("out/moved/results.parquet", &table[..table.len() / 2]);
    let compared = bench.run("compare out/moved out/moved");
    compared
        .exits_with(2)
        .complains(["results.parquet", "--resume"]);
    let answer = run(&bench, "--resume").exits_with(0);
    answer.complains(["results.parquet: is cut off", "recompute"]);
    assert!(bench.read("out/moved/results.parquet") == table);
}

#[test]
fn a_missed_criterion_of_a_study_is_a_failure() {
    let bench = Bench::with_study(&format!(
        "{STUDY}[criteria]\nmin_layouts_working = 1.0\nmin_clearance_mm = {{ at_least = 500 }}\n"
    ));
    let answer = run(&bench, "--junit junit.xml --json --no-page").exits_with(1);
    assert_eq!(answer.json()["verdict"], "fail");
    let junit = bench.text("junit.xml");
    holds(&junit, ["min_clearance_mm", "<failure"]);
}

#[test]
fn a_case_is_run_with_everything_that_a_run_leaves() {
    let bench = Bench::with_study(STUDY);
    let study = STUDY.replace(
        "mode = \"static\"",
        "mode = \"dynamic\"\nengines = [\"rapier\"]",
    );
    bench.write("study.toml", study);
    let answer = run(&bench, "--case 7 --run");
    assert!(matches!(answer.status, Some(0 | 1)), "{answer:#?}");
    for file in ["report.json", "report.html"] {
        assert!(
            bench.path(&format!("out/moved/cases/7/{file}")).is_file(),
            "{file}"
        );
    }
}

#[test]
fn shipped_studies_are_understood() {
    for name in ["layouts", "base_placement", "accuracy_budget", "tools"] {
        let file = workspace().join(format!("scenarios/studies/{name}.toml"));
        let bench = Bench::new();
        let answer = bench
            .run(format!("study '{}' --case 0 --json", file.display()))
            .exits_with(0)
            .json();
        assert_eq!(answer["rows"].list().len(), 8, "{name}");
    }
}
