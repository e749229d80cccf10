//! The composite action's script, with this program in the place of the release.

use std::collections::HashMap;
use std::fs;
use std::path::Path;
use std::process::Command;

use crate::support::{Bench, SMALL, with_edit, workspace};

/// What the script left: its exit status, what it printed, and the files that GitHub reads.
struct Step {
    status: i32,
    printed: String,
    outputs: String,
    summary: String,
}

/// Runs a part of the script in a bench's folder.
fn script(bench: &Bench, part: &str, variables: &[(&str, &str)]) -> Step {
    let file = workspace().join(".github/actions/needlebench/needlebench.sh");
    let program = Path::new(env!("CARGO_BIN_EXE_needlebench"));
    let mut path = program.parent().unwrap().as_os_str().to_owned();
    path.push(":");
    path.push(std::env::var_os("PATH").unwrap());
    for each in ["outputs", "summary", "path"] {
        fs::write(bench.path(each), "").unwrap();
    }
    let output = Command::new("bash")
        .arg(file.canonicalize().unwrap())
        .arg(part)
        .current_dir(bench.path("."))
        .env("PATH", path)
        .env("CI", "true")
        .env("RUNNER_TEMP", bench.path("."))
        .env("GITHUB_OUTPUT", bench.path("outputs"))
        .env("GITHUB_STEP_SUMMARY", bench.path("summary"))
        .env("GITHUB_PATH", bench.path("path"))
        .envs(variables.iter().copied())
        .output()
        .unwrap();
    let text = |name: &str| bench.text(name);
    Step {
        status: output.status.code().unwrap(),
        printed: String::from_utf8(output.stdout).unwrap()
            + &String::from_utf8(output.stderr).unwrap(),
        outputs: text("outputs"),
        summary: text("summary"),
    }
}

#[test]
fn scenarios_are_run_summarised_and_compared_with_a_baseline() {
    let bench = Bench::new();
    fs::create_dir(bench.path("my scenarios")).unwrap();
    bench.write("small.toml", SMALL);
    bench.write("other.toml", with_edit(SMALL, "\"small\"", "\"other\""));
    let inputs = [
        ("INPUT_SCENARIOS", "*.toml"),
        ("INPUT_ENGINE", "rapier"),
        ("INPUT_OUT", "base"),
    ];
    let first = script(&bench, "run", &inputs);
    assert_eq!(first.status, 0, "{}", first.printed);
    assert!(first.outputs.contains("status=0\n"), "{}", first.outputs);
    assert!(
        first.outputs.contains("results=base\n"),
        "{}",
        first.outputs
    );
    for name in ["small", "other"] {
        assert!(first.summary.contains(name), "{}", first.summary);
        assert!(bench.path(&format!("base/{name}/report.json")).exists());
    }
    assert!(bench.path("base/junit.xml").exists());

    // With a baseline: the same again, and one that lost a configuration's clearance.
    let with_baseline = |scenarios: &str| {
        let inputs = [
            ("INPUT_SCENARIOS", scenarios),
            ("INPUT_ENGINE", "rapier"),
            ("INPUT_OUT", "now"),
            ("INPUT_BASELINE", "base"),
            ("INPUT_MAX_LOSS", "clearance=0.1mm\n  tip_rms=5%"),
        ];
        let _ = fs::remove_dir_all(bench.path("now"));
        script(&bench, "run", &inputs)
    };
    let same = with_baseline("small.toml\nother.toml");
    assert_eq!(same.status, 0, "{}", same.printed);
    assert_eq!(same.printed.matches("PASS: no regression").count(), 2);
    assert!(bench.path("now/small/compare.xml").exists());
    let moved = with_edit(SMALL, "top_height_mm = 763.5", "top_height_mm = 768.5");
    bench.write("small.toml", moved);
    let worse = with_baseline("small.toml");
    assert_eq!(worse.status, 1, "{}", worse.printed);
    assert!(worse.outputs.contains("status=1\n"), "{}", worse.outputs);
    assert!(worse.printed.contains("FAIL: "), "{}", worse.printed);

    // None yet is no failure, one of other scenarios is.
    fs::rename(bench.path("base"), bench.path("elsewhere")).unwrap();
    let none = with_baseline("other.toml");
    assert_eq!(none.status, 0, "{}", none.printed);
    assert!(none.printed.contains("no baseline"), "{}", none.printed);
    fs::create_dir_all(bench.path("base/unknown")).unwrap();
    let wrong = with_baseline("other.toml");
    assert_eq!(wrong.status, 2, "{}", wrong.printed);
}

#[test]
fn inputs_are_never_taken_for_script() {
    let bench = Bench::new();
    let hostile = "$(touch hurt) `touch hurt` ;touch hurt; --help";
    let variables: HashMap<&str, &str> = ["INPUT_SCENARIOS", "INPUT_ENGINE", "INPUT_MAX_LOSS"]
        .into_iter()
        .map(|name| (name, hostile))
        .collect();
    let step = script(&bench, "run", &variables.into_iter().collect::<Vec<_>>());
    assert_eq!(step.status, 2, "{}", step.printed);
    assert!(!bench.path("hurt").exists());
}

/// Releases in a folder, with a shell script in the program's place.
#[cfg(target_os = "linux")]
fn releases(bench: &Bench) -> String {
    let target = format!("{}-unknown-linux-musl", std::env::consts::ARCH);
    let name = format!("needlebench-9.8.7-{target}");
    let folder = bench.path("releases/v9.8.7");
    fs::create_dir_all(folder.join(&name)).unwrap();
    let program = folder.join(&name).join("needlebench");
    fs::write(&program, "#!/bin/sh\necho needlebench 9.8.7\n").unwrap();
    let make = format!(
        "chmod 755 {name}/needlebench && tar -cJf {name}.tar.xz {name} && sha256sum *.tar.xz > SHA256SUMS"
    );
    let made = Command::new("sh")
        .args(["-c", &make])
        .current_dir(&folder)
        .status();
    assert!(made.unwrap().success());
    format!("file://{}", bench.path("releases").display())
}

#[test]
#[cfg(target_os = "linux")]
fn the_release_of_the_actions_own_version_is_installed_if_it_is_what_was_released() {
    let bench = Bench::new();
    let from = releases(&bench);
    let install = |inputs: &[(&str, &str)]| {
        let given = [&[("NEEDLEBENCH_RELEASES", from.as_str())], inputs].concat();
        script(&bench, "install", &given)
    };
    for inputs in [
        [("INPUT_VERSION", ""), ("ACTION_REF", "v9.8.7")],
        [("INPUT_VERSION", "9.8.7"), ("ACTION_REF", "main")],
    ] {
        let step = install(&inputs);
        assert_eq!(step.status, 0, "{}", step.printed);
        assert!(step.printed.contains("installed needlebench 9.8.7"));
        assert!(step.outputs.contains("version=9.8.7\n"), "{}", step.outputs);
        let path = bench.text("path");
        assert!(Path::new(path.trim()).join("needlebench").is_file());
        fs::remove_dir_all(path.trim()).unwrap();
    }
    for (version, reference, reason) in [
        ("", "main", "set the input `version`"),
        ("1.0.0", "main", "cannot fetch"),
        ("1;true", "main", "is not a valid version"),
    ] {
        let step = install(&[("INPUT_VERSION", version), ("ACTION_REF", reference)]);
        assert_ne!(step.status, 0);
        assert!(step.printed.contains(reason), "{}", step.printed);
    }
    // Another archive than the sums say.
    let sums = bench.read("releases/v9.8.7/SHA256SUMS");
    let other: Vec<u8> = [b"0".repeat(64), sums[64..].to_vec()].concat();
    bench.write("releases/v9.8.7/SHA256SUMS", other);
    let step = install(&[("INPUT_VERSION", "9.8.7"), ("ACTION_REF", "main")]);
    assert_ne!(step.status, 0);
    assert!(
        step.printed.contains("its SHA-256 differs"),
        "{}",
        step.printed
    );
    assert!(!bench.path("needlebench-bin/needlebench").exists());
}
