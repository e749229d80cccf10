//! Recorded runs of real arms.

use std::fs;

use serde_json::Value;

use crate::support::{Answer, Bench, Json, holds, mujoco_is_ready, workspace};

fn shipped() -> String {
    let path = workspace().join("models/ur3e/recorded/ur3e_rad_20211005.csv");
    path.to_str().unwrap().to_owned()
}

fn number(value: &Value) -> f64 {
    value
        .as_f64()
        .unwrap_or_else(|| panic!("{value} is no number"))
}

/// A replay in rapier alone, without pictures.
fn quick(bench: &Bench, log: &str, more: &str) -> Answer {
    bench.run(format!(
        "replay '{log}' --engine rapier --no-pictures --no-page {more}"
    ))
}

#[test]
fn the_shipped_log_is_replayed_in_both_engines_and_meets_its_criteria() {
    mujoco_is_ready();
    let bench = Bench::new();
    let log = shipped();
    let limits =
        "--max-moment-rms 0.02 --max-calibration 0.1 --max-tracking 0.5 --max-current-rms 0.2";
    let report = bench.run(format!("replay '{log}' --json {limits}"));
    let report = report.exits_with(0).json();
    assert_eq!(report["verdict"], "pass");
    assert_eq!(report["arm"]["name"], "UR3e");
    assert_eq!(report["log"]["rows"], 888);
    // One for moment and calibration, two of each engine.
    assert_eq!(report["criteria"].list().len(), 6);
    let lag_s = number(&report["real"]["lag_of_all_s"]["value"]);
    assert!((lag_s - 0.5e-3).abs() < 0.1e-3, "{lag_s}");
    assert!(number(&report["calibration"]["held_out"]["rms_m"]) < 1e-4);
    for engine in ["rapier", "mujoco"] {
        let found = &report["engines"][engine];
        assert_eq!(found["rows"], 888);
        // The currents of the real arm are met as well as its own law meets them.
        for (joint, rms) in found["current_rms_a"].list().iter().enumerate() {
            assert!(number(rms) < 0.15, "{engine} {joint}: {rms}");
        }
    }
    // What the engines do differs by far less than either from the arm.
    let tip = |engine: &str| number(&report["engines"][engine]["tracking"]["tip_rms_m"]);
    assert!((tip("rapier") - tip("mujoco")).abs() < 2e-6);
    let folder = bench.path("out/ur3e_rad_20211005");
    for file in [
        "replay.json",
        "replay.txt",
        "replay.html",
        "junit.xml",
        "replay.png",
        "replay.svg",
        "course.rapier.csv",
        "course.mujoco.csv",
        "arm.toml",
        "calibration.yaml",
    ] {
        assert!(folder.join(file).exists(), "{file}");
    }
    let junit = fs::read_to_string(folder.join("junit.xml")).unwrap();
    holds(&junit, ["tests=\"6\"", "failures=\"0\""]);
}

#[test]
fn the_arms_data_that_are_written_are_used_by_scenarios() {
    let bench = Bench::new();
    quick(&bench, &shipped(), "").exits_with(0);
    let scenario = "name = \"mine\"\n[robot]\narm = \"out/ur3e_rad_20211005/arm.toml\"\n\
                    base_rpy_deg = [0, 0, 180]\n[[goals]]\nname = \"g\"\ninsertion_length_mm = 100\n\
                    [goals.flange_pose]\nposition_mm = [194.2, -359.3, 170.1]\n\
                    rotation_vector_rad = [-0.8567, 2.7197, -1.1407]\n";
    bench.write("mine.toml", scenario);
    let checked = bench.run("check mine.toml").exits_with(0);
    checked.says(["calibration.yaml"]);
    // The calibration is that of the arm: its log is met by it to the digits of the log.
    let overridden = bench.run("fk --joints 0,-1.57,-1,-1.57,1.57,0 --calibration out/ur3e_rad_20211005/calibration.yaml --robot ur3e");
    overridden.exits_with(0);
    let sheet = bench.run("servo mine.toml --engine rapier --no-pictures");
    assert!(sheet.exits_with(0).stdout.contains("identified from"));
}

#[test]
fn limits_that_are_missed_or_cannot_be_judged_fail() {
    let bench = Bench::new();
    let missed = quick(&bench, &shipped(), "--max-tracking 0.01").exits_with(1);
    missed.says(["FAILED max_tracking_mm in rapier"]);
    // Without set-points there is nothing to replay, and that is said.
    let text = fs::read_to_string(shipped())
        .unwrap()
        .replacen("target_", "x_target_", 1000);
    bench.write("untargeted.csv", &text);
    let open = quick(&bench, "untargeted.csv", "--max-tracking 1").exits_with(1);
    open.says([
        "INCOMPLETE",
        "NOT EVALUATED max_tracking_mm",
        "nothing to replay",
    ]);
    quick(&bench, "untargeted.csv", "").exits_with(0);
}

#[test]
fn what_is_wrong_with_a_log_is_said_with_its_place() {
    let bench = Bench::new();
    let text = fs::read_to_string(shipped()).unwrap();
    let mut lines: Vec<&str> = text.lines().collect();
    let swapped = lines[10].replacen("1550297", "1550290", 1);
    lines[10] = &swapped;
    bench.write("back.csv", &(lines.join("\n") + "\n"));
    let refused = quick(&bench, "back.csv", "").exits_with(2);
    refused.complains(["back.csv:"]);
    refused.complains(["the clock goes back"]);
    // Without poses the arm has to be named.
    let anonymous = text.replacen("TCP_pose", "TCP_place", 1000);
    bench.write("anonymous.csv", &anonymous);
    let refused = quick(&bench, "anonymous.csv", "").exits_with(2);
    refused.complains(["does not identify its arm"]);
    quick(&bench, "anonymous.csv", "--arm ur3e").exits_with(0);
}

#[test]
fn a_scenario_gives_criteria_and_the_command_line_goes_before_it() {
    let bench = Bench::new();
    let scenario = "name = \"s\"\n[robot]\narm = \"ur3e\"\n[[goals]]\nname = \"g\"\n\
                    insertion_length_mm = 100\n[goals.flange_pose]\nposition_mm = [200, -300, 200]\n\
                    rotation_vector_rad = [0, 3.14, 0]\n[replay]\nmax_moment_rms_nm = 1e-6\n";
    bench.write("s.toml", scenario);
    let missed = quick(&bench, &shipped(), "--scenario s.toml").exits_with(1);
    missed.says(["FAILED max_moment_rms_nm"]);
    let more = "--scenario s.toml --max-moment-rms 0.02";
    quick(&bench, &shipped(), more).exits_with(0);
}

#[test]
fn the_same_log_gives_the_same_bytes() {
    let bench = Bench::new();
    let log = shipped();
    let read = || {
        quick(&bench, &log, "").exits_with(0);
        ["replay.json", "course.rapier.csv", "arm.toml"]
            .map(|file| fs::read(bench.path("out/ur3e_rad_20211005").join(file)).unwrap())
    };
    assert_eq!(read(), read());
}

/// An arm of ours, miscalibrated and with friction of its own, is recorded on a planned run, and its log
/// gives back what was put in.
#[test]
fn a_recorded_run_of_ours_gives_back_what_was_put_in() {
    /// Estimates are within this many of their own intervals: of thirty of 95 % one or two are outside one.
    const INTERVALS: f64 = 2.5;
    let bench = Bench::new();
    let plan = "plan-excitation --arm ur3e --poses 12 --payload-kg 0.8 --out out";
    bench.run(plan).exits_with(0);
    let mut scenario = bench.text("out/ur3e/excitation.toml");
    scenario += "\n[imperfections.calibration]\narm = \"population\"\n[imperfections.friction]\n\
                 [imperfections.encoder]\n";
    bench.write("mine.toml", &scenario);
    bench
        .run("run mine.toml --engine rapier --quiet --no-pictures")
        .exits_with(0);
    let folder = bench.path("out/ur3e_excitation");
    let logs: Vec<_> = fs::read_dir(&folder)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.to_string_lossy().ends_with(".rtde.csv"))
        .collect();
    assert_eq!(logs.len(), 1, "{logs:?}");
    let truth = bench.read_json("out/ur3e_excitation/report.json")["truth"].clone();
    let report = quick(&bench, logs[0].to_str().unwrap(), "--json")
        .exits_with(0)
        .json();
    assert_eq!(report["arm"]["name"], "UR3e");
    // Calibration: nominal lengths are off, the fitted ones predict what they have not seen.
    let calibration = &report["calibration"];
    assert_eq!(calibration["is_worth"], true);
    assert!(number(&calibration["nominal_held_out"]["rms_m"]) > 5e-5);
    assert!(number(&calibration["held_out"]["rms_m"]) < 1e-6);
    let identification = &report["identification"];
    let near = |estimate: &Value, wanted: f64| {
        assert_eq!(estimate["identifiable"], true, "{estimate} {wanted}");
        let (value, half) = (number(&estimate["value"]), number(&estimate["half_width"]));
        // Digits of the log.
        let slack = INTERVALS * half + 1e-6;
        assert!((value - wanted).abs() < slack, "{estimate} {wanted}");
    };
    // The arm's own data, and friction as it was drawn about them.
    let data = fs::read_to_string(workspace().join("models/ur3e/arm.toml")).unwrap();
    let of_data = |key: &str| -> Vec<f64> {
        let line = data.lines().find(|line| line.starts_with(key)).unwrap();
        let list = line.split_once('[').unwrap().1.trim_end_matches(']');
        list.split(',')
            .map(|number| number.trim().parse().unwrap())
            .collect()
    };
    let (rotors, coulomb, viscous) = (
        of_data("inertia_kgm2"),
        of_data("coulomb_nm"),
        of_data("viscous_nms_rad"),
    );
    for joint in 0..6 {
        let share = number(&truth["friction_true_over_nominal"][joint]);
        let measured = &identification["measured"];
        near(
            &identification["controller"]["rotor_inertia_kgm2"][joint],
            rotors[joint],
        );
        near(&measured["rotor_inertia_kgm2"][joint], rotors[joint]);
        near(&measured["coulomb_nm"][joint], share * coulomb[joint]);
        near(&measured["viscous_nms_rad"][joint], share * viscous[joint]);
    }
    let load = &identification["measured"]["loads"][0];
    let logged = number(&load["logged"]["mass_kg"]);
    assert!((logged - 0.8).abs() < 0.3, "{load}");
    near(&load["mass_kg"], logged);
}
