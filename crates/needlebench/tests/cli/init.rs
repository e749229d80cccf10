//! `needlebench init`: every scenario that it writes passes, and says what it is.

use crate::support::{Bench, Json, holds, mujoco_is_ready};

const ARMS: [&str; 9] = [
    "ur3", "ur3e", "ur5", "ur5e", "ur10", "ur10e", "ur16e", "ur20", "ur30",
];
const TEMPLATES: [&str; 3] = ["table", "hanging", "lateral"];

/// Writes a variant, and asks `check` of it.
#[track_caller]
fn passes_check(bench: &Bench, template: &str, arm: &str) {
    let file = format!("{template}_{arm}.toml");
    let init = format!("init {file} --force --from {template} --arm {arm}");
    bench.run(init).exits_with(0);
    bench.run(format!("check {file}")).exits_with(0);
}

#[test]
fn every_template_with_every_arm_passes_check() {
    let bench = Bench::new();
    for template in TEMPLATES {
        for arm in ARMS {
            passes_check(&bench, template, arm);
        }
    }
}

/// An hour in a debug build: `cargo test --release --test cli every_variant -- --ignored`.
#[test]
#[ignore = "long: every template, arm, phantom and lesion"]
fn every_variant_passes_check_or_is_refused() {
    let bench = Bench::new();
    let choices = bench.run("init --list --json").exits_with(0).json();
    let (mut written, mut refused) = (0, 0);
    for template in TEMPLATES {
        for arm in ARMS {
            for phantom in choices["phantoms"].list() {
                for lesion in choices["lesions"].list() {
                    let [phantom, lesion] =
                        [phantom, &lesion["name"]].map(super::support::Json::word);
                    let arguments = format!(
                        "init v.toml --force --from {template} --arm {arm} --phantom {phantom} \
                         --lesion {lesion}"
                    );
                    let answer = bench.run(&arguments);
                    if answer.status == Some(1) {
                        refused += 1;
                        answer.complains(["no scenario with these options passes"]);
                        continue;
                    }
                    answer.exits_with(0);
                    bench.run("check v.toml").exits_with(0);
                    written += 1;
                }
            }
        }
    }
    println!("{written} written, {refused} refused");
    assert!(written > refused);
}

#[test]
fn what_is_written_runs_in_both_engines() {
    mujoco_is_ready();
    let bench = Bench::new();
    let said = bench.run("init").exits_with(0).stdout;
    assert!(said.contains("needlebench run first.toml"), "{said}");
    bench
        .run("run first.toml --no-pictures --no-page")
        .exits_with(0);
}

#[test]
fn other_templates_run_too() {
    let bench = Bench::new();
    for (template, arm) in [("hanging", "ur3"), ("lateral", "ur3e"), ("table", "ur5e")] {
        let file = format!("{template}.toml");
        bench
            .run(format!("init {file} --from {template} --arm {arm}"))
            .exits_with(0);
        let run = format!("run {file} --engine rapier --no-pictures --no-page");
        bench.run(run).exits_with(0);
    }
}

#[test]
fn the_text_says_its_schema_first_and_explains_every_value() {
    let bench = Bench::new();
    bench.run("init mine.toml").exits_with(0);
    let text = bench.text("mine.toml");
    assert!(
        text.starts_with("#:schema ./scenario.schema.json\n"),
        "{text}"
    );
    assert_eq!(bench.read_json("scenario.schema.json")["title"], "Scenario");
    assert!(
        text.lines().all(|line| line.chars().count() <= 120),
        "{text}"
    );
    let mut explained = false;
    for line in text.lines() {
        let is_value = line.contains(" = ") && !line.starts_with('#');
        // A comment beside a value, or above it.
        let is_named = line.starts_with("name") || line.starts_with("description");
        assert!(
            !is_value || line.contains('#') || explained || is_named,
            "{line}"
        );
        explained = line.starts_with('#') || explained && !line.is_empty();
    }
}

#[test]
fn files_are_not_replaced_unless_forced() {
    let bench = Bench::new();
    bench.write("first.toml", "mine");
    bench
        .run("init")
        .exits_with(2)
        .complains(["first.toml", "--force"]);
    assert_eq!(bench.read("first.toml"), b"mine");
    bench.run("init --force").exits_with(0);
    bench.run("init new_folder/").exits_with(0);
    bench.run("check new_folder/first.toml").exits_with(0);
}

#[test]
fn a_small_study_comes_with_it_and_runs() {
    let bench = Bench::new();
    let said = bench.run("init --study").exits_with(0).stdout;
    holds(&said, ["needlebench study first_study.toml"]);
    bench.run("study first_study.toml").exits_with(0);
}
