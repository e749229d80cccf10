//! `--calibration`: the real robot instead of the nominal one.

use serde_json::Value;

use crate::support::{
    Bench, Json, SMALL, TABLE_3_POSE, files, mujoco_is_ready, numbers, with_edit,
};

/// A real UR3.
const UR3: &str = include_str!("../../../scenario/tests/scenario/calibration/ur3_half_turns.yaml");

/// What the inverse kinematics promises, m and rad.
const RESIDUAL: f64 = 1e-12;

/// Bodies of the two engines at rest, m.
const ENGINES_AGREE_M: f64 = 1e-9;

fn bench() -> Bench {
    let bench = Bench::with_scenario(SMALL);
    bench.write("ur3.yaml", UR3);
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
    let nominal = bench.run(format!("fk --joints {posture} --json")).json();
    let arguments = format!("fk --joints {posture} --calibration ur3.yaml --json");
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
    let calibrated = "--calibration ur3.yaml --json";
    let answer = bench.run(format!("ik --pose {TABLE_3_POSE} {calibrated}"));
    let answer = answer.exits_with(0).json();
    assert_eq!(answer["count"], 8);
    assert_eq!(answer["calibration"]["hash"], "calib_336188160809596540");
    let wanted: Vec<f64> = TABLE_3_POSE
        .split(',')
        .map(|word| word.parse().unwrap())
        .collect();
    for solution in answer["solutions"].list() {
        assert_eq!(solution["kind"], "exact");
        assert!(solution["residual_m"].number() <= RESIDUAL);
        let joints = joints_of(solution);
        let flange = bench.run(format!("fk --joints {joints} {calibrated}"));
        let flange = &flange.exits_with(0).json()["flange_in_base"];
        let found = [
            numbers(&flange["position_m"]),
            numbers(&flange["rotvec_rad"]),
        ]
        .concat();
        for (found, wanted) in found.iter().zip(&wanted) {
            assert!((found - wanted).abs() < RESIDUAL);
        }
        // The nominal arm's flange would be elsewhere.
        let nominal = bench.run(format!("fk --joints {joints} --json")).json();
        let nominal = &nominal["flange_in_base"]["position_m"];
        assert!(distance(nominal, &flange["position_m"]) > 1e-4);
    }
}

#[test]
fn clearance_is_that_of_the_calibrated_robot() {
    let bench = bench();
    let run = |more: &str| {
        let posture = "0,-1.57,-1,-1.57,1.57,0";
        let answer = bench.run(format!("clearance s.toml --joints {posture} --json {more}"));
        let answer = answer.exits_with(0).json();
        let pairs = answer["pairs"].list().clone();
        pairs
            .iter()
            .map(|pair| pair["distance_m"].number())
            .collect::<Vec<f64>>()
    };
    let (nominal, calibrated) = (run(""), run("--calibration ur3.yaml"));
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
    let run = format!("run '{scenario}' --calibration ur3.yaml --no-pictures --json");
    let report = bench.run(run).exits_with(0).json();
    let input = report["provenance"]["inputs"]
        .list()
        .iter()
        .find(|input| input["role"] == "calibration")
        .unwrap();
    assert_eq!(input["file"], "ur3.yaml");
    assert_eq!(input["sha256"].word().len(), 64);
    let truth = report["provenance"]["truth"].word();
    assert!(truth.starts_with("factory-calibrated robot"), "{truth}");
    let notes = report["notes"].to_string();
    assert!(notes.contains("calib_336188160809596540"), "{notes}");
    let configurations = report["goals"][0]["configurations"].list();
    assert_eq!(configurations.len(), 8);
    for configuration in configurations {
        assert!(configuration["ik_residual_m"].number() <= RESIDUAL);
        // Measured on the engines' own bodies: an engine that had the nominal arm would be off by
        // a millimetre.
        for engine in ["rapier", "mujoco"] {
            let error = &configuration["engines"][engine]["tip_position_error_m"];
            assert!(error.number() < ENGINES_AGREE_M, "{configuration:#}");
        }
        let settled = &configuration["engine_difference"]["settled_tip_m"];
        assert!(settled.number() < ENGINES_AGREE_M);
    }
}

#[test]
fn goal_of_a_scenario_is_solved_for_the_calibrated_robot() {
    let bench = bench();
    let run = |more: &str| {
        let answer = bench.run(format!("ik s.toml --goal pose --json {more}"));
        answer.exits_with(0).json()
    };
    let (nominal, calibrated) = (run(""), run("--calibration ur3.yaml"));
    assert_eq!(calibrated["count"], 8);
    let [a, b] = [&nominal, &calibrated].map(|answer| &answer["solutions"][0]["joints_rad"]);
    let apart_rad = distance(a, b);
    assert!(apart_rad > 1e-4 && apart_rad < 0.1, "{apart_rad}");
}

#[test]
fn a_scenario_may_name_the_calibration_of_its_robot() {
    let bench = bench();
    let naming = "[robot]\ncalibration = \"ur3.yaml\"\n";
    bench.write("c.toml", with_edit(SMALL, "[robot]\n", naming));
    let solve = |arguments: &str| bench.run(arguments).exits_with(0).json();
    let by_key = solve("ik c.toml --goal pose --json");
    let by_option = solve("ik s.toml --goal pose --json --calibration ur3.yaml");
    assert_eq!(by_key["solutions"], by_option["solutions"]);
}
