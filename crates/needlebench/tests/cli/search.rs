//! `search`: from a study file to the best choice, whatever happens on the way.

use std::fmt::Display;
use std::sync::OnceLock;

use crate::support::{Answer, Bench, Json, SMALL, has_keys, holds};

/// Three heights and two mounts of the tool.
const STUDY: &str = r#"
name = "best"
scenario = "s.toml"
seed = 1
[sampling]
samples = 16
[search]
held_out_layouts = 16
budget = 112
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
role = "control"
values = [90, 180]
"#;

fn run(bench: &Bench, more: impl Display) -> Answer {
    bench.run(format!("search study.toml --quiet {more}"))
}

/// All that a search has written, without parts of generations.
fn written(bench: &Bench, folder: &str) -> Vec<(String, Vec<u8>)> {
    let files = bench.tree(folder);
    let named = files.iter().map(|path| path.display().to_string());
    let named = named.filter(|name| !name.contains(".part_") && !name.contains(".nbj"));
    named
        .map(|name| {
            let bytes = bench.read(&format!("{folder}/{name}"));
            (name, bytes)
        })
        .collect()
}

/// The search on one thread, for several tests.
fn whole() -> &'static (Bench, Answer) {
    static WHOLE: OnceLock<(Bench, Answer)> = OnceLock::new();
    WHOLE.get_or_init(|| {
        let bench = Bench::shared();
        bench.write("s.toml", SMALL);
        bench.write("study.toml", STUDY);
        let answer = run(&bench, "--json --jobs 1").exits_with(0);
        (bench, answer)
    })
}

#[test]
fn the_answer_has_figures_of_layouts_that_nothing_was_compared_by() {
    let (bench, answer) = whole();
    let document = answer.json();
    has_keys(
        &document,
        "schema_version study_id answer candidates generations",
    );
    let answer = &document["answer"];
    assert_eq!(answer["figures"][0]["cases"], 16);
    assert_eq!(answer["rate"]["cases"], 16);
    assert_eq!(document, bench.read_json("out/best/search.json"));
    assert_eq!(
        document["cases"], 112,
        "six choices with all layouts, and the winner anew"
    );
    assert!(bench.path("out/best/search.html").exists());
    assert!(
        bench
            .path("out/best/search/gen_000/results.parquet")
            .exists()
    );
    let again = run(bench, "").exits_with(2);
    again.complains(["--resume"]);
    let resumed = Bench::with_study(STUDY);
    resumed.copy(bench, "out");
    let text = run(&resumed, "--resume").exits_with(0).stdout;
    holds(&text, ["best", "success"]);
    assert!(
        text.lines().all(|line| line.chars().count() <= 100),
        "{text}"
    );
}

#[test]
fn threads_shards_and_breaks_give_the_same_bytes() {
    let expected = written(&whole().0, "out/best");

    let threads = Bench::with_study(STUDY);
    run(&threads, "--jobs 3").exits_with(0);
    assert!(written(&threads, "out/best") == expected);

    // Parts of every generation, then a search that joins them.
    let shards = Bench::with_study(STUDY);
    for shard in ["2/2", "1/2"] {
        let said = run(&shards, format!("--shard {shard}"))
            .exits_with(0)
            .stdout;
        assert!(said.contains("generation 0"), "{said}");
    }
    run(&shards, "--resume").exits_with(0);
    assert!(written(&shards, "out/best") == expected);

    // As after a kill: a generation that has begun, and a log that is behind.
    let broken = Bench::with_study(STUDY);
    run(&broken, "--shard 1/2").exits_with(0);
    broken.write("out/best/search.json", "{");
    run(&broken, "--resume").exits_with(0);
    assert!(written(&broken, "out/best") == expected);
}

#[test]
fn a_study_of_a_choice_with_a_range_names_the_search() {
    let bench = Bench::with_study("");
    let ranges = STUDY.replace("values = [790, 800, 810]", "range = [790, 810]");
    bench.write("study.toml", ranges);
    let study = bench.run("study study.toml --quiet").exits_with(0);
    study.complains(["height", "needlebench search"]);
}

#[test]
fn the_error_of_the_tip_is_that_of_real_arms() {
    let by_error = STUDY.replace(
        "held_out_layouts = 16",
        "held_out_layouts = 16\nobjective = \"tip_error\"",
    );
    let bench = Bench::with_study(&by_error);
    let document = run(&bench, "--json").exits_with(0).json();
    let error_mm = document["answer"]["figures"][0]["value"].number();
    // Without a criterion on it, too. A perfect arm's is below a micrometre, and what does not work counts 10 mm.
    assert!((0.3..9.0).contains(&error_mm), "{error_mm}");
}

#[test]
fn of_a_generation_with_fewer_blocks_than_parts_the_last_ones_have_nothing() {
    let bench = Bench::with_study(STUDY);
    let answer = run(&bench, "--shard 200/256").exits_with(0);
    answer.says(["nothing to do"]);
    let own = run(&bench, "--shard 1/256").exits_with(0);
    own.says(["part 1/24"]);
}
