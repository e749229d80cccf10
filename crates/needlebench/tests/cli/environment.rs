//! A MuJoCo that cannot be had, or fails: rapier's results are kept and the exit status is 3.

use std::fs::Permissions;
use std::os::unix::fs::PermissionsExt;
use std::time::{Duration, Instant};

use serde_json::Value;

use crate::process::{LongRun, is_alive, signal};
use crate::support::{Answer, Bench, Json, SMALL, with_edit};

/// The report has all of rapier's results, of MuJoCo's at most those from before its failure, and
/// says why; gives MuJoCo's failure.
#[track_caller]
fn rapier_is_kept(report: &Value) -> Value {
    let configurations = report["goals"][0]["configurations"].list();
    let by = |engine: &str| {
        let measured = |each: &&Value| each["engines"][engine]["tip_position_error_m"].is_number();
        configurations.iter().filter(measured).count()
    };
    assert_eq!(by("rapier"), 6);
    assert!(by("mujoco") < 6);
    for each in configurations {
        let both = each["engines"]["mujoco"].is_object();
        assert_eq!(each["engine_difference"].is_object(), both);
    }
    let failures = report["engine_failures"].list();
    assert_eq!(failures.len(), 1, "{failures:#?}");
    assert_eq!(failures[0]["engine"], "mujoco");
    failures[0].clone()
}

#[track_caller]
fn failure_says<const N: usize>(failure: &Value, parts: [&str; N]) {
    let message = failure["message"].word();
    for part in parts {
        assert!(message.contains(part), "no `{part}` in\n{message}");
    }
}

/// Runs both engines with other environment variables; gives MuJoCo's failure and the output.
#[track_caller]
fn failing_run(text: &str, variables: &[(&str, Option<&str>)]) -> (Value, Answer) {
    let bench = Bench::with_scenario(text);
    let answer = bench.run_with(variables, "run s.toml --engine both");
    let answer = answer.exits_with(3);
    let report = bench.read_json("out/small/report.json");
    (rapier_is_kept(&report), answer)
}

/// Another program in place of the harness.
#[track_caller]
fn stand_in(command: &str) -> Value {
    let variables = [("NEEDLEBENCH_HARNESS_COMMAND", Some(command))];
    failing_run(SMALL, &variables).0
}

#[test]
fn what_an_engine_did_not_measure_is_incomplete_wherever_a_verdict_stands() {
    let bench = Bench::with_scenario(SMALL);
    let broken = [("NEEDLEBENCH_HARNESS_COMMAND", Some("sh -c \"exit 7\""))];
    let both = "run s.toml --engine both --out";
    let whole = bench.run(format!("{both} whole")).exits_with(0);
    let partial = format!("{both} part --junit part.xml");
    let partial = bench.run_with(&broken, &partial).exits_with(3);
    let [whole_report, report] =
        ["whole", "part"].map(|folder| bench.read_json(&format!("{folder}/small/report.json")));
    let count = |report: &Value, key: &str| report[key].list().len();
    let total = count(&whole_report, "criteria");
    let judged = count(&report, "criteria");
    assert_eq!(
        (
            whole_report["verdict"].as_str(),
            count(&whole_report, "not_judged")
        ),
        (Some("pass"), 0)
    );
    assert_eq!(report["verdict"], "incomplete");
    assert!(judged < total);
    assert_eq!(judged + count(&report, "not_judged"), total);
    let first = |text: &str| text.lines().next().unwrap().to_owned();
    assert_eq!(
        first(&whole.stdout),
        format!("PASS small: {total} of {total} criteria met")
    );
    let begin = format!(
        "INCOMPLETE small: {judged} of {total} criteria evaluated, all met; not evaluated: "
    );
    assert!(first(&partial.stdout).starts_with(&begin), "{partial:#?}");
    let markdown = bench.text("part/small/summary.md");
    assert!(
        markdown.starts_with("# small: **incomplete**\n"),
        "{markdown}"
    );
    let junit = bench.text("part.xml");
    assert!(junit.contains("errors=\"8\""), "{junit}"); // six configurations, the goal, the engine
    assert!(junit.contains("not evaluated: "), "{junit}");

    // Compared with a whole run metrics are lost, which needs to be allowed by name.
    let compared = bench.run("compare whole/small part/small").exits_with(1);
    assert!(
        first(&compared.stdout).starts_with("FAIL: "),
        "{compared:#?}"
    );
    compared.says(["no longer measured: "]);
    for [a, b] in [["whole", "part"], ["part", "whole"], ["part", "part"]] {
        let [a, b] = [a, b].map(|folder| format!("{folder}/small"));
        let compared = bench
            .run(format!("compare --allow-lost {a} {b}"))
            .exits_with(1);
        assert!(
            first(&compared.stdout).starts_with("INCOMPLETE: "),
            "{compared:#?}"
        );
    }
    let same = bench.run("compare whole/small whole/small").exits_with(0);
    assert!(first(&same.stdout).starts_with("PASS: "), "{same:#?}");
}

#[test]
fn without_python_the_run_says_what_is_missing_and_how_to_mend_it() {
    let cache = Bench::new();
    let folder = cache.path("cache").display().to_string();
    let variables = [
        ("PATH", Some("")),
        ("NEEDLEBENCH_CACHE_DIR", Some(folder.as_str())),
        ("NEEDLEBENCH_PYTHON", None),
    ];
    let (failure, answer) = failing_run(SMALL, &variables);
    let parts = ["Python 3.11 or newer", "hint: ", "NEEDLEBENCH_PYTHON"];
    failure_says(&failure, parts);
    // People see it in the table's company, not only in the file.
    for part in parts {
        assert!(answer.stdout.contains(part), "{answer:#?}");
    }
}

#[test]
fn python_that_does_not_exist_is_named() {
    let variables = [("NEEDLEBENCH_PYTHON", Some("/nonexistent/python"))];
    let (failure, _) = failing_run(SMALL, &variables);
    failure_says(
        &failure,
        ["NEEDLEBENCH_PYTHON is /nonexistent/python", "hint: "],
    );
}

#[test]
fn cache_folder_that_cannot_be_written_is_named() {
    // Below a file no folder can be made, not even by the superuser.
    let bench = Bench::with_scenario(SMALL);
    let folder = bench.path("s.toml/cache").display().to_string();
    let variables = [("NEEDLEBENCH_CACHE_DIR", Some(folder.as_str()))];
    let (failure, _) = failing_run(SMALL, &variables);
    failure_says(
        &failure,
        [&folder, "cannot write", "hint: set NEEDLEBENCH_CACHE_DIR"],
    );
}

#[test]
fn mujoco_is_set_up_from_a_folder_of_wheels_without_a_network() {
    let bench = Bench::new();
    let fetched = bench.run("doctor --download wheels --json");
    let fetched = fetched.exits_with(0).json();
    assert_eq!(fetched["files"].list().len(), 2, "{fetched}");

    // Nobody answers there.
    let nowhere = "http://127.0.0.1:9";
    let cache = bench.path("cache").display().to_string();
    let offline = [
        ("NEEDLEBENCH_CACHE_DIR", Some(cache.as_str())),
        ("PIP_INDEX_URL", Some(nowhere)),
        ("PIP_FIND_LINKS", None),
        ("HTTPS_PROXY", Some(nowhere)),
        ("HTTP_PROXY", Some(nowhere)),
        ("ALL_PROXY", Some(nowhere)),
        ("PIP_RETRIES", Some("0")),
    ];
    // uv is asked for what has the hashes; where it fails, as this one does, pip is tried.
    std::fs::create_dir(bench.path("bin")).unwrap();
    bench.write(
        "bin/uv",
        "#!/bin/sh\necho \"$@\" >> uv.log\ntest $1 = venv\n",
    );
    std::fs::set_permissions(bench.path("bin/uv"), Permissions::from_mode(0o755)).unwrap();
    let path = std::env::var("PATH").unwrap();
    let path = format!("{}:{path}", bench.path("bin").display());
    let with_uv = [&offline[..], &[("PATH", Some(path.as_str()))]].concat();
    let prepare = "doctor --prepare --wheels wheels --json";
    let refused = bench.run_with(&with_uv, "doctor --prepare").exits_with(3);
    refused.complains([
        "uv failed, trying pip instead",
        "needlebench doctor --download",
        "--prepare --wheels",
    ]);
    let asked = String::from_utf8(bench.read("uv.log")).unwrap();
    assert!(
        asked.contains("--no-cache") && asked.contains("--require-hashes"),
        "{asked}"
    );

    let ready = bench.run_with(&offline, prepare).exits_with(0).json();
    assert_eq!(ready["made"], true);
    let folder = ready["folder"].word();
    assert!(folder.starts_with(&cache), "{ready}");
    // MuJoCo and numpy, unpacked.
    let size = ready["size_bytes"].as_u64().unwrap();
    assert!((50_000_000..200_000_000).contains(&size), "{size}");
    let again = bench.run_with(&offline, "doctor --prepare --json");
    assert_eq!(again.exits_with(0).json()["made"], false);
    bench.run_with(&offline, "doctor").exits_with(0);

    // A wheel that was cut off or changed on its way.
    std::fs::remove_dir_all(&cache).unwrap();
    let wheels = bench.tree("wheels");
    let numpy = wheels
        .iter()
        .find(|file| file.display().to_string().contains("numpy"));
    let name = numpy.unwrap().file_name().unwrap().to_str().unwrap();
    let mut bytes = bench.read(&format!("wheels/{name}"));
    *bytes.last_mut().unwrap() ^= 1;
    bench.write(&format!("wheels/{name}"), bytes);
    let refused = bench.run_with(&offline, prepare).exits_with(3);
    refused.complains([name, "is damaged", "hint: needlebench doctor --download"]);
    assert!(
        !bench
            .tree("cache")
            .iter()
            .any(|file| file.ends_with("complete"))
    );
}

#[test]
fn doctor_exits_with_3_and_the_same_advice() {
    let bench = Bench::new();
    let variables = [("NEEDLEBENCH_PYTHON", Some("/nonexistent/python"))];
    let answer = bench.run_with(&variables, "doctor --json");
    let answer = answer.exits_with(3).json();
    assert_eq!(answer["ok"], false);
    let text = answer["checks"].to_string();
    assert!(text.contains("hint: "), "{text}");
}

#[test]
fn harness_that_does_not_exist_is_named() {
    let failure = stand_in("/nonexistent/harness");
    failure_says(&failure, ["cannot start", "/nonexistent/harness"]);
}

#[test]
fn harness_that_hangs_is_given_up_after_the_time_limit() {
    let text = with_edit(
        SMALL,
        "[recording]",
        "[engines]\nharness_timeout_s = 1\n[recording]",
    );
    let started = Instant::now();
    let variables = [("NEEDLEBENCH_HARNESS_COMMAND", Some("sleep 600"))];
    let (failure, _) = failing_run(&text, &variables);
    failure_says(&failure, ["no answer to", "for 1 s", "killed"]);
    assert!(started.elapsed() < Duration::from_secs(30));
}

#[test]
fn harness_that_answers_garbage_is_given_up() {
    // `yes` writes without end, `cat` sends the request back, `head` is short of an answer.
    failure_says(
        &stand_in("yes"),
        ["the MuJoCo harness answered", "expected"],
    );
    failure_says(
        &stand_in("cat"),
        ["the MuJoCo harness answered", "expected"],
    );
    failure_says(&stand_in("head -c 5"), ["the MuJoCo harness died"]);
}

#[test]
fn harness_that_dies_at_once_is_quoted() {
    let failure = stand_in("sh -c \"echo no luck today >&2; exit 7\"");
    failure_says(&failure, ["died", "7", "no luck today"]);
}

#[test]
fn harness_that_is_killed_in_mid_run_loses_its_own_results_only() {
    let mut run = LongRun::start();
    signal("KILL", i64::from(run.harness));
    assert_eq!(run.end().code(), Some(3));
    let failure = rapier_is_kept(&run.bench.read_json("out/small/report.json"));
    failure_says(&failure, ["the MuJoCo harness died", "signal: 9"]);
    let during = failure["during"].word();
    assert!(during.starts_with("pose "), "{during}");
}

#[test]
fn harness_that_hangs_in_mid_run_is_killed_after_the_time_limit() {
    let mut run = LongRun::start();
    signal("STOP", i64::from(run.harness));
    assert_eq!(run.end().code(), Some(3));
    assert!(!is_alive(run.harness));
    let failure = rapier_is_kept(&run.bench.read_json("out/small/report.json"));
    failure_says(&failure, ["no answer to", "for 5 s", "killed"]);
}
