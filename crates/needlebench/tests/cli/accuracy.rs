//! `--table accuracy`: the table that needle papers print.

use crate::support::{Bench, Json, SMALL};

/// A study of postures only, over two sizes and a sampled place.
const STUDY: &str = "name = \"places\"\nscenario = \"s.toml\"\nmode = \"static\"\nreplanned_cases = 0\n\
    [sampling]\nsamples = 4\n\
    [[factors]]\nname = \"roll\"\nkey = \"goal.insertion_length_mm\"\nvalues = [84, 86]\n\
    [[factors]]\nname = \"along\"\nkey = \"phantom.position_mm[0]\"\nrelative = true\nrange = [-2, 2]\n";

fn rows(bench: &Bench, file: &str) -> Vec<Vec<String>> {
    let text = bench.text(file);
    let lines = text.lines();
    lines
        .map(|line| line.split(',').map(str::to_owned).collect())
        .collect()
}

#[test]
fn a_run_leaves_the_table_in_three_formats_and_takes_it_away_again() {
    let bench = Bench::with_scenario(SMALL);
    let run = "run s.toml --engine rapier --quiet";
    let table = "--table accuracy --by configuration --hit-radius 0.5";
    let answer = bench.run(format!("{run} {table}")).exits_with(0);
    for part in [
        "before insertion (robot and registration)",
        "not the accuracy of a real arm",
        "Published errors",
        "doi 10.1002/rcs.1440",
        "with DOIs in accuracy.md",
    ] {
        let words: Vec<&str> = answer.stdout.split_whitespace().collect();
        assert!(
            words.join(" ").contains(part),
            "no `{part}` in {}",
            answer.stdout
        );
    }
    let caption = answer.stdout.find("Needle placement of small").unwrap();
    for line in answer.stdout[caption..].lines() {
        assert!(line.chars().count() <= 80, "{line}");
    }
    let csv = rows(&bench, "out/small/accuracy.csv");
    let report = bench.read_json("out/small/report.json");
    let configurations = report["goals"][0]["configurations"].list();
    let working: Vec<_> = configurations
        .iter()
        .filter(|each| each["status"] != "rejected")
        .collect();
    assert_eq!(csv.len(), 1 + working.len() + 1);
    let at = csv[0]
        .iter()
        .position(|name| name == "target_ed_mean_mm")
        .unwrap();
    for (row, configuration) in csv[1..].iter().zip(&working) {
        assert_eq!(row[0], configuration["label"]);
        let expected_mm = 1e3 * configuration["metrics"]["tip_error"].number();
        let found: f64 = row[at].parse().unwrap();
        assert!(
            (found - expected_mm).abs() <= 1e-15 * expected_mm.abs(),
            "{found}"
        );
    }
    for name in ["accuracy.md", "accuracy.tex"] {
        assert!(!bench.read(&format!("out/small/{name}")).is_empty());
    }
    // A run without the table leaves none of an earlier one.
    bench.run(run).exits_with(0);
    for name in ["accuracy.md", "accuracy.csv", "accuracy.tex"] {
        assert!(!bench.path(&format!("out/small/{name}")).exists(), "{name}");
    }
}

#[test]
fn a_study_of_postures_says_so_and_counts_each_case_once() {
    let bench = Bench::with_scenario(SMALL);
    bench.write("study.toml", STUDY);
    let study = "study study.toml --quiet --no-page --table accuracy --by roll";
    let answer = bench.run(study).exits_with(0);
    let words: Vec<&str> = answer.stdout.split_whitespace().collect();
    assert!(
        words.join(" ").contains("final postures only"),
        "{}",
        answer.stdout
    );
    let csv = rows(&bench, "out/places/accuracy.csv");
    assert_eq!(csv[3][0], "all");
    let n: Vec<u64> = csv[1..].iter().map(|row| row[1].parse().unwrap()).collect();
    assert_eq!(n[0] + n[1], n[2]);
    assert!(
        n[2] <= 8,
        "eight cases have no more than eight best configurations: {n:?}"
    );
    // What static cases do not measure is empty.
    let at = csv[0]
        .iter()
        .position(|name| name == "duration_mean_s")
        .unwrap();
    assert!(csv[1..].iter().all(|row| row[at].is_empty()));
}
