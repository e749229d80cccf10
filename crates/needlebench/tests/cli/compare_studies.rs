//! `compare` of two studies: folders and tables side by side.

use std::fmt::Display;
use std::sync::OnceLock;

use serde_json::Value;

use crate::support::{Answer, Bench, Json, SMALL, has_keys, holds, with_edit};

const STUDY: &str = r#"
name = "shifted"
scenario = "s.toml"
mode = "static"
replanned_cases = 4
seed = 1
[sampling]
method = "sobol"
samples = 64
[[factors]]
name = "up"
key = "phantom.position_mm[2]"
range = [-8, 16]
relative = true
"#;

/// Results of a phantom that lies where `SMALL` has it, and of one that lies 8 mm lower.
fn tables() -> &'static [Vec<u8>; 3] {
    static TABLES: OnceLock<[Vec<u8>; 3]> = OnceLock::new();
    TABLES.get_or_init(|| {
        // A patient who moves under a needle that does not brings ribs into its way: not what is compared here.
        let small = format!("{SMALL}[planning.needle_route]\noff = [\"bone\", \"vessel\"]\n");
        let lower = with_edit(&small, "-609.5, 0]", "-609.5, -8]");
        let other_seed = STUDY.replace("seed = 1", "seed = 2");
        [(&small, STUDY), (&lower, STUDY), (&small, &other_seed)].map(|(scenario, study)| {
            let bench = Bench::with_scenario(scenario);
            bench.write(
                "study.toml",
                study.replace("method = \"sobol\"", "method = \"random\""),
            );
            bench
                .run("study study.toml --out out --quiet")
                .exits_with(0);
            bench.read("out/shifted/results.parquet")
        })
    })
}

/// Folders `a` and `lower`, and a table `other.parquet` of other points.
fn bench() -> Bench {
    let bench = Bench::new();
    let [a, lower, other] = tables();
    for (name, table) in [("a", a), ("lower", lower)] {
        std::fs::create_dir(bench.path(name)).unwrap();
        bench.write(&format!("{name}/results.parquet"), table);
    }
    bench.write("other.parquet", other);
    bench
}

fn compare(bench: &Bench, more: impl Display) -> Answer {
    bench.run(format!("compare a lower --allow-status-change {more}"))
}

#[test]
fn study_against_itself_passes() {
    let bench = bench();
    let more = "--max-loss clearance=0mm --max-loss success_rate=0";
    let answer = bench.run(format!("compare a a/results.parquet {more}"));
    let answer = answer.exits_with(0);
    answer.says(["the same 64 cases"]);
    answer.says(["PASS"]);
    assert!(!answer.stdout.contains('─'), "{answer:#?}");
    assert_eq!(answer.stderr, "");
}

#[test]
fn a_lower_patient_is_farther_from_the_arm() {
    let bench = bench();
    let found = compare(&bench, "--json").exits_with(0).json();
    has_keys(
        &found,
        "schema_version pass failures a b paired unpaired_because changes thresholds",
    );
    assert_eq!(found["unpaired_because"], Value::Null);
    let clearance = found["paired"]["differences"]
        .list()
        .iter()
        .find(|each| each["of"] == "best" && each["metric"] == "clearance_static_mm")
        .unwrap();
    let mean = clearance["mean"].number();
    assert!(mean.abs() > 0.1 && mean.abs() < 8.1, "{mean}");
    let text = compare(&bench, "").exits_with(0).stdout;
    holds(&text, ["B minus A", "PASS"]);
    assert!(
        text.lines()
            .skip_while(|line| !line.contains('─'))
            .take_while(|line| !line.contains("unchanged"))
            .all(|line| line.chars().count() <= 100),
        "{text}"
    );
}

#[test]
fn loss_beyond_its_threshold_exits_with_1_and_is_written_for_ci() {
    let bench = bench();
    let more = "--max-loss clearance@5=0.1mm --junit j.xml --markdown m.md";
    // One of the two ways is a loss.
    let there = bench.run(format!("compare a lower {more}"));
    let back = bench.run(format!("compare lower a {more}"));
    let lost = if there.status == Some(1) {
        "a"
    } else {
        "lower"
    };
    let kept = if lost == "a" { &back } else { &there };
    kept.says(["threshold clearance@5 = 0.1mm"]);
    let second = if lost == "a" { "lower" } else { "a" };
    let answer = bench
        .run(format!("compare {lost} {second} {more}"))
        .exits_with(1);
    answer.says(["FAILED P5 clearance"]);
    let junit = bench.text("j.xml");
    holds(&junit, ["compare.thresholds", "<failure"]);
    let markdown = bench.text("m.md");
    holds(&markdown, ["**fail**", "- **regression** P5"]);
}

#[test]
fn other_points_are_compared_by_their_intervals() {
    let bench = bench();
    let answer = bench.run("compare a other.parquet").exits_with(0);
    answer.says(["cases differ (factor values of case 0"]);
}

#[test]
fn thresholds_of_studies_come_from_a_file_too() {
    let bench = bench();
    bench.write(
        "limits.toml",
        "[max_loss]\n\"clearance@5:every\" = \"1m\"\n",
    );
    compare(&bench, "--thresholds limits.toml").exits_with(0);
    bench.write("limits.toml", "[max_loss]\nclearence = \"1mm\"\n");
    compare(&bench, "--thresholds limits.toml")
        .exits_with(2)
        .complains(["limits.toml:2", "`clearence`", "did you mean `clearance`?"]);
}

#[test]
fn what_cannot_be_compared_is_refused_with_a_hint() {
    let bench = bench();
    for (limit, parts) in [
        ("clearance=1", ["is not a unit", "e.g. 0.5mm"]),
        ("success_rate@5=0.1", ["has no quantiles", "omit"]),
        (
            "clearance:Right-Up-Fld=1mm",
            ["`Right-Up-Fld`", "did you mean `Right-Up-Fold`?"],
        ),
    ] {
        compare(&bench, format!("--max-loss {limit}"))
            .exits_with(2)
            .complains(parts);
    }
    compare(&bench, "--goal a=b")
        .exits_with(2)
        .complains(["--goal", "hint"]);
    bench.write("s.toml", SMALL);
    bench
        .run("compare a s.toml")
        .exits_with(2)
        .complains(["--case", "a run is compared with one"]);
    let table = &tables()[0];
    bench.write("half.parquet", &table[..table.len() / 2]);
    bench
        .run("compare a half.parquet")
        .exits_with(2)
        .complains(["half.parquet", "cut off", "hint"]);
    std::fs::create_dir(bench.path("unfinished")).unwrap();
    bench.write("unfinished/study.json", "{}");
    bench.run("compare a unfinished").exits_with(2).complains([
        "unfinished",
        "not complete",
        "--resume",
    ]);
}

#[test]
fn help_lists_every_rate_of_studies() {
    let help = Bench::new().run("compare --help").exits_with(0).stdout;
    for rate in needlebench_study::compare::STUDY_RATES {
        assert!(help.contains(rate.name), "{} is not in\n{help}", rate.name);
    }
}
