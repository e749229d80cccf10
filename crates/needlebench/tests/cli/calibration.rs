//! `--calibration`: the real robot instead of the nominal one.

use serde_json::Value;

use crate::support::{
    Answer, Bench, SMALL, TABLE_3_POSE, files, mujoco_is_ready, numbers, with_edit,
};

/// A real UR3.
const UR3: &str = include_str!("../../../cell/tests/cell/calibration/ur3_half_turns.yaml");

/// A real UR3e.
const UR3E: &str = include_str!("../../../cell/tests/cell/calibration/ur3e.yaml");

/// What the inverse kinematics promises, m and rad.
const RESIDUAL: f64 = 1e-12;

/// Bodies of the two engines at rest, m.
const ENGINES_AGREE_M: f64 = 1e-9;

fn bench() -> Bench {
    let bench = Bench::with_scenario(SMALL);
    bench.write("ur3.yaml", UR3);
    bench.write("ur3e.yaml", UR3E);
    bench
}

fn distance(a: &Value, b: &Value) -> f64 {
    let pairs = numbers(a).into_iter().zip(numbers(b));
    pairs.map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
}

fn joints_of(solution: &Value) -> String {
    let joints = numbers(&solution["joints_rad"]);
    let words: Vec<String> = joints.iter().map(f64::to_string).collect();
    words.join(",")
}

#[test]
fn calibrated_and_nominal_flange_are_a_millimetre_apart() {
    let bench = bench();
    let posture = "0.4,-1.3,1.5,-0.9,1.1,0.2";
    let nominal = bench.run(&["fk", "--joints", posture, "--json"]).json();
    let arguments = [
        "fk",
        "--joints",
        posture,
        "--calibration",
        "ur3.yaml",
        "--json",
    ];
    let calibrated = bench.run(&arguments).exits_with(0).json();
    assert_eq!(nominal["calibration"], Value::Null);
    assert_eq!(calibrated["arm"], "UR3");
    assert_eq!(calibrated["calibration"]["file"], "ur3.yaml");
    assert_eq!(
        calibrated["calibration"]["hash"],
        "calib_336188160809596540"
    );
    let flange = |answer: &Value| answer["flange_in_base"]["position_m"].clone();
    let apart_m = distance(&flange(&nominal), &flange(&calibrated));
    assert!(apart_m > 1e-4 && apart_m < 3e-3, "{apart_m}");
}

#[test]
fn calibrated_solutions_place_the_calibrated_flange() {
    let bench = bench();
    let calibrated = ["--calibration", "ur3.yaml", "--json"];
    let mut arguments = vec!["ik", "--pose", TABLE_3_POSE];
    arguments.extend(calibrated);
    let answer = bench.run(&arguments).exits_with(0).json();
    assert_eq!(answer["count"], 8);
    assert_eq!(answer["calibration"]["hash"], "calib_336188160809596540");
    let wanted: Vec<f64> = TABLE_3_POSE
        .split(',')
        .map(|word| word.parse().unwrap())
        .collect();
    for solution in answer["solutions"].as_array().unwrap() {
        assert_eq!(solution["kind"], "exact");
        assert!(solution["residual_m"].as_f64().unwrap() <= RESIDUAL);
        let joints = joints_of(solution);
        let mut arguments = vec!["fk", "--joints", &joints];
        arguments.extend(calibrated);
        let flange = &bench.run(&arguments).exits_with(0).json()["flange_in_base"];
        let found = [
            numbers(&flange["position_m"]),
            numbers(&flange["rotvec_rad"]),
        ]
        .concat();
        for (found, wanted) in found.iter().zip(&wanted) {
            assert!((found - wanted).abs() < RESIDUAL);
        }
        // The nominal arm's flange would be elsewhere.
        let nominal = bench.run(&["fk", "--joints", &joints, "--json"]).json();
        let nominal = &nominal["flange_in_base"]["position_m"];
        assert!(distance(nominal, &flange["position_m"]) > 1e-4);
    }
}

#[test]
fn named_arm_takes_its_own_calibration() {
    let bench = bench();
    let arguments = [
        "fk",
        "--arm",
        "ur3e",
        "--joints",
        "0,0,0,0,0,0",
        "--calibration",
    ];
    let run = |file| {
        let mut arguments = arguments.to_vec();
        arguments.push(file);
        bench.run(&arguments)
    };
    let own = run("ur3e.yaml").exits_with(0);
    assert!(
        own.stdout
            .contains("UR3e, calibrated by ur3e.yaml (calib_8672619134213134139)")
    );
    run("ur3.yaml").exits_with(2).complains([
        "another robot, a UR3 ",
        "the UR3e in use",
        "--arm UR3`",
    ]);
}

#[test]
fn every_command_refuses_the_calibration_of_another_robot() {
    let bench = bench();
    let commands: [&[&str]; 6] = [
        &["run", "s.toml"],
        &["check", "s.toml"],
        &["clearance", "s.toml", "--joints", "0,-1.57,-1,-1.57,1.57,0"],
        &["ik", "--pose", TABLE_3_POSE],
        &["ik", "s.toml", "--goal", "pose"],
        &["fk", "--joints", "0,0,0,0,0,0"],
    ];
    for command in commands {
        let run = |file| -> Answer {
            let mut arguments = command.to_vec();
            arguments.extend(["--calibration", file]);
            bench.run(&arguments)
        };
        let wrong = run("ur3e.yaml").exits_with(2);
        let message = wrong.stderr.clone() + &wrong.stdout;
        for part in [
            "another robot, a UR3e",
            "18.7 mm",
            "wrist_1",
            "--arm UR3e",
            "ur3e.yaml",
        ] {
            assert!(
                message.contains(part),
                "{command:?}: no `{part}` in {message}"
            );
        }
        let missing = run("none.yaml").exits_with(2);
        missing.complains(["none.yaml", "cannot read the calibration"]);
    }
}

#[test]
fn mistakes_are_shown_where_they_are() {
    let bench = bench();
    let text = with_edit(UR3, "roll: 1.571184458807471", "roll: 90.02");
    bench.write("degrees.yaml", &text);
    let line = text
        .lines()
        .position(|line| line.contains("90.02"))
        .unwrap()
        + 1;
    let arguments = ["check", "s.toml", "--calibration", "degrees.yaml", "--json"];
    let answer = bench.run(&arguments).exits_with(2).json();
    let finding = &answer["findings"][0];
    assert_eq!(finding["file"], "degrees.yaml");
    assert_eq!(finding["line"], line);
    assert_eq!(finding["key"], "kinematics.upper_arm.roll");
    assert!(finding["message"].as_str().unwrap().contains("degrees"));
    let shown = bench.run(&[
        "fk",
        "--joints",
        "0,0,0,0,0,0",
        "--calibration",
        "degrees.yaml",
    ]);
    let place = format!("degrees.yaml:{line}:11");
    shown
        .exits_with(2)
        .complains([&place, "roll: 90.02", "^^^^^"]);
}

#[test]
fn clearance_is_that_of_the_calibrated_robot() {
    let bench = bench();
    let run = |more: &[&str]| {
        let mut arguments = vec!["clearance", "s.toml", "--joints", "0,-1.57,-1,-1.57,1.57,0"];
        arguments.push("--json");
        arguments.extend(more);
        let answer = bench.run(&arguments).exits_with(0).json();
        let pairs = answer["pairs"].as_array().unwrap().clone();
        pairs
            .iter()
            .map(|pair| pair["distance_m"].as_f64().unwrap())
            .collect::<Vec<f64>>()
    };
    let (nominal, calibrated) = (run(&[]), run(&["--calibration", "ur3.yaml"]));
    assert_eq!(nominal.len(), calibrated.len());
    let largest_m = nominal
        .iter()
        .zip(&calibrated)
        .map(|(a, b)| (a - b).abs())
        .fold(0.0, f64::max);
    assert!(largest_m > 1e-5 && largest_m < 3e-3, "{largest_m}");
}

#[test]
fn calibrated_run_reaches_its_goals_in_both_engines_and_names_the_file() {
    mujoco_is_ready();
    let bench = bench();
    let scenario = files("scenarios", "toml")
        .into_iter()
        .find(|path| path.ends_with("table3.toml"))
        .unwrap();
    let scenario = scenario.to_str().unwrap();
    let arguments = [
        "run",
        scenario,
        "--calibration",
        "ur3.yaml",
        "--no-pictures",
        "--json",
    ];
    let report = bench.run(&arguments).exits_with(0).json();
    let input = report["provenance"]["inputs"]
        .as_array()
        .unwrap()
        .iter()
        .find(|input| input["role"] == "calibration")
        .unwrap();
    assert_eq!(input["file"], "ur3.yaml");
    assert_eq!(input["sha256"].as_str().unwrap().len(), 64);
    let truth = report["provenance"]["truth"].as_str().unwrap();
    assert!(truth.starts_with("factory-calibrated robot"), "{truth}");
    let notes = report["notes"].to_string();
    assert!(notes.contains("calib_336188160809596540"), "{notes}");
    let configurations = report["goals"][0]["configurations"].as_array().unwrap();
    assert_eq!(configurations.len(), 8);
    for configuration in configurations {
        assert!(configuration["ik_residual_m"].as_f64().unwrap() <= RESIDUAL);
        // Measured on the engines' own bodies: an engine that had the nominal arm would be off by
        // a millimetre.
        for engine in ["rapier", "mujoco"] {
            let error = &configuration["engines"][engine]["tip_position_error_m"];
            assert!(
                error.as_f64().unwrap() < ENGINES_AGREE_M,
                "{configuration:#}"
            );
        }
        let settled = &configuration["engine_difference"]["settled_tip_m"];
        assert!(settled.as_f64().unwrap() < ENGINES_AGREE_M);
    }
}

#[test]
fn goal_of_a_scenario_is_solved_for_the_calibrated_robot() {
    let bench = bench();
    let run = |more: &[&str]| {
        let mut arguments = vec!["ik", "s.toml", "--goal", "pose", "--json"];
        arguments.extend(more);
        bench.run(&arguments).exits_with(0).json()
    };
    let (nominal, calibrated) = (run(&[]), run(&["--calibration", "ur3.yaml"]));
    assert_eq!(calibrated["count"], 8);
    let [a, b] = [&nominal, &calibrated].map(|answer| &answer["solutions"][0]["joints_rad"]);
    let apart_rad = distance(a, b);
    assert!(apart_rad > 1e-4 && apart_rad < 0.1, "{apart_rad}");
}

#[test]
fn a_scenario_may_name_the_calibration_of_its_robot() {
    let bench = bench();
    let naming = |file: &str| {
        let section = format!("[robot]\ncalibration = \"{file}\"\n");
        with_edit(SMALL, "[robot]\n", &section)
    };
    bench.write("c.toml", naming("ur3.yaml"));
    let solve = |arguments: &[&str]| bench.run(arguments).exits_with(0).json();
    let by_key = solve(&["ik", "c.toml", "--goal", "pose", "--json"]);
    let by_option = ["ik", "s.toml", "--goal", "pose", "--json", "--calibration"];
    let by_option = solve(&[&by_option[..], &["ur3.yaml"]].concat());
    assert_eq!(by_key["solutions"], by_option["solutions"]);

    bench.write("d.toml", naming("ur4.yaml"));
    let answer = bench.run(&["check", "d.toml"]).exits_with(2);
    answer.complains(["d.toml", "robot.calibration", "ur4.yaml"]);
}
