//! Runs that excite every joint: found, written, simulated, refused.

use needlebench_kinematics::{Joints, UrModel, rotation_vector};
use serde_json::Value;

use crate::support::{Bench, Json, holds, numbers, with_edit};

/// A run of a few seconds, rapier alone.
const SMALL: &str = r#"
name = "small"
seed = 3

[robot]
arm = "ur3e"

[engines]
run = ["rapier"]

[excitation]
postures_deg = [
    [40, -100, -60, -90, 60, 30],
    [-20, -70, -80, -120, 100, -60],
]
dwell_s = 0.2
sweep_speeds_deg_s = [40]
period_ms = 4

[[excitation.sweeps]]
joint = "wrist_3"
posture = 2
by_deg = 45

[[excitation.payloads]]

[[excitation.payloads]]
mass_kg = 1
centre_mm = [40, 0, 25]
"#;

fn text(bench: &Bench, name: &str) -> String {
    bench.text(name)
}

/// A log's columns by name.
struct Log {
    names: Vec<String>,
    rows: Vec<Vec<f64>>,
}

impl Log {
    fn read(text: &str) -> Self {
        let mut lines = text.lines();
        let names = lines.next().unwrap().split(',').map(str::to_owned);
        let names: Vec<String> = names.collect();
        let rows: Vec<Vec<f64>> = lines
            .map(|line| line.split(',').map(|word| word.parse().unwrap()).collect())
            .collect();
        assert!(rows.iter().all(|row| row.len() == names.len()));
        Self { names, rows }
    }

    fn has(&self, name: &str) -> bool {
        self.names.iter().any(|each| each == name)
    }

    fn six(&self, row: &[f64], name: &str) -> Joints {
        let first = format!("{name}_0");
        let at = self.names.iter().position(|each| *each == first).unwrap();
        Joints::from_column_slice(&row[at..at + 6])
    }

    fn one(&self, row: &[f64], name: &str) -> f64 {
        row[self.names.iter().position(|each| each == name).unwrap()]
    }
}

#[test]
fn plan_keeps_what_is_asked_for_and_is_the_same_again() {
    let bench = Bench::new();
    let arguments = "plan-excitation --arm ur3e --poses 12 --json";
    let plan = bench.run(arguments).exits_with(0).json();
    assert!(plan["planned"]["minimum_certified_m"].number() >= 0.005);
    for motion in plan["motions"].list() {
        for (class, found) in motion["clearance"].as_object().unwrap() {
            let least_m = match class.as_str() {
                "self" => 0.005,
                "robot_mount" => 0.03,
                _ => continue,
            };
            let proven_m = found["certified_lower_bound_m"].number();
            assert!(proven_m >= least_m, "{motion}");
        }
    }
    let names = [
        "excitation.toml",
        "excitation.script",
        "clearances.txt",
        "plan.json",
    ];
    let written = names.map(|name| bench.read(&format!("out/ur3e/{name}")));
    bench.run(arguments).exits_with(0);
    assert_eq!(
        written,
        names.map(|name| bench.read(&format!("out/ur3e/{name}")))
    );

    // Chosen postures tell more than random ones.
    let (here, random) = (&plan["tells"], &plan["random"]);
    for key in ["calibration_condition", "flange_rms_m", "flange_worst_m"] {
        assert!(here[key].as_f64() < random[key].as_f64(), "{key}: {plan:#}");
    }
    for joint in here["joints"].list() {
        assert_eq!(joint["torque_constant_identified"], true, "{joint}");
    }

    let scenario = "out/ur3e/excitation.toml";
    let answer = bench.run(format!("check {scenario}")).exits_with(0);
    answer.says(["excitation run, 12 postures, 2 payloads"]);
}

#[test]
fn script_makes_the_motions_of_the_scenario() {
    let bench = Bench::with_scenario(SMALL);
    bench
        .run("plan-excitation s.toml --poses 10 --payload-kg 0,0.5")
        .exits_with(0);
    let script = text(&bench, "out/small/excitation.script");
    let scenario = text(&bench, "out/small/excitation.toml");
    holds(&scenario, ["name = \"small_excitation\""]);
    let postures: Vec<Vec<f64>> = scenario
        .lines()
        .filter(|line| line.starts_with("    ["))
        .map(|line| {
            let inner = line.trim_start_matches("    [").split(']').next().unwrap();
            let degrees = inner
                .split(',')
                .map(|word| word.trim().parse::<f64>().unwrap());
            degrees.map(f64::to_radians).collect()
        })
        .collect();
    assert!(postures.len() >= 10, "{scenario}");
    let moves: Vec<Vec<f64>> = script
        .lines()
        .filter_map(|line| line.trim().strip_prefix("movej(["))
        .map(|line| {
            let inner = line.split(']').next().unwrap();
            inner
                .split(',')
                .map(|word| word.trim().parse().unwrap())
                .collect()
        })
        .collect();
    // In their order among the motions, which sweeps lie between.
    let mut moves = moves.iter();
    for posture in &postures {
        let same = |found: &&Vec<f64>| found.iter().zip(posture).all(|(a, b)| (a - b).abs() < 1e-6);
        assert!(moves.any(|found| same(&found)), "{posture:?} in\n{script}");
    }
    // Definitions, loops and conditions are closed.
    let opens = |line: &str| line.ends_with(':') && !line.starts_with('#');
    let lines = || script.lines().map(str::trim);
    let opened = lines().filter(|line| opens(line)).count();
    assert_eq!(
        opened,
        lines().filter(|line| *line == "end").count(),
        "{script}"
    );
    assert_eq!(script.matches("  set_payload(").count(), 2);
    assert!(script.contains("READ THIS BEFORE YOU RUN IT") && script.contains("emergency stop"));
}

/// Against UR's DH formula, and against the torque of gravity as the change of the potential energy.
#[test]
fn logs_say_what_a_controller_would() {
    let bench = Bench::with_scenario(SMALL);
    let report = bench.run("run s.toml --json --quiet").exits_with(0).json();
    assert_eq!(report["verdict"], "pass");
    let files: Vec<&str> = report["excitation"]["files"]
        .list()
        .iter()
        .map(super::support::Json::word)
        .collect();
    assert_eq!(
        files,
        ["payload_1.rapier.rtde.csv", "payload_2.rapier.rtde.csv"]
    );
    let geometry = UrModel::Ur3e.geometry();
    let mut standing_nm = Vec::new();
    for (index, file) in files.iter().enumerate() {
        let log = Log::read(&text(&bench, &format!("out/small/{file}")));
        let load = &report["excitation"]["loads"][index];
        let mut moved = Joints::zeros();
        for row in &log.rows {
            for kind in ["actual", "target"] {
                let q = log.six(row, &format!("{kind}_q"));
                let tcp = log.six(row, &format!("{kind}_TCP_pose"));
                let base_from_flange = geometry.base_from_flange(&q);
                let place = base_from_flange.translation.vector;
                let turn = rotation_vector(&base_from_flange.rotation);
                // Ten digits of angles and poses.
                assert!((place - tcp.fixed_rows::<3>(0)).norm() < 1e-8);
                let same = (turn - tcp.fixed_rows::<3>(3)).norm() < 1e-8;
                // Half a turn has two rotation vectors.
                assert!(same || (turn.norm() - std::f64::consts::PI).abs() < 1e-6);
            }
            moved += log.six(row, "target_qd").abs();
            assert_eq!(log.one(row, "robot_mode"), 7.0);
            assert_eq!(log.one(row, "joint_mode_5"), 253.0);
            assert!((log.one(row, "payload") - load["payload_kg"].number()).abs() < 1e-8);
        }
        assert!(moved.min() > 0.0, "every joint moves");
        let step_s = log.one(&log.rows[1], "timestamp") - log.one(&log.rows[0], "timestamp");
        assert!((step_s - 0.004).abs() < 1e-9);
        // The constants of the arm's data.
        let first = &log.rows[0];
        let (moment, current) = (
            log.six(first, "target_moment"),
            log.six(first, "target_current"),
        );
        for (joint, constant) in [10.6, 10.9, 7.5, 3.6, 3.8, 3.8].into_iter().enumerate() {
            assert!((moment[joint] - constant * current[joint]).abs() < 1e-7);
        }
        standing_nm.push(log.six(first, "target_moment"));
    }
    // What the second payload adds while the arm stands: m g times how its centre rises with each joint.
    let q: Joints = Joints::from([0.0, -90.0, -60.0, -90.0, 90.0, 0.0_f64]).map(f64::to_radians);
    let centre = nalgebra::Point3::new(0.04, 0.0, 0.025);
    let height = |q: &Joints| (geometry.base_from_flange(q) * centre).z;
    let report_kg = numbers(&serde_json::json!(
        report["excitation"]["loads"]
            .list()
            .iter()
            .map(|load| load["added_kg"].clone())
            .collect::<Vec<Value>>()
    ));
    assert_eq!(report_kg, [0.0, 1.0]);
    for joint in 0..6 {
        const STEP: f64 = 1e-5;
        let mut ends = [q, q];
        ends[0][joint] -= STEP;
        ends[1][joint] += STEP;
        let slope = (height(&ends[1]) - height(&ends[0])) / (2.0 * STEP);
        let added_nm = standing_nm[1][joint] - standing_nm[0][joint];
        // Gravity is 9.807 to 9.82 m/s^2 by choice of the program.
        let error_nm = added_nm - 9.815 * slope;
        assert!(error_nm.abs() < 0.01 * slope.abs() + 1e-7, "{joint}");
    }
}

#[test]
fn currents_are_left_out_where_no_constants_are_known() {
    let bench = Bench::with_scenario(&with_edit(SMALL, "\"ur3e\"", "\"ur5e\""));
    bench.run("run s.toml --quiet --no-page").exits_with(0);
    let log = Log::read(&text(&bench, "out/small/payload_1.rapier.rtde.csv"));
    assert!(log.has("target_moment_5") && !log.has("target_current_0"));
}

/// The noise of the encoders is in the log, and is not the same with each payload.
#[test]
fn actual_angles_are_what_encoders_read() {
    let imperfect = format!("{SMALL}\n[imperfections.encoder]\n");
    let bench = Bench::with_scenario(&imperfect);
    bench.run("run s.toml --quiet --no-page").exits_with(0);
    let offsets = [1, 2].map(|load| {
        let log = Log::read(&text(
            &bench,
            &format!("out/small/payload_{load}.rapier.rtde.csv"),
        ));
        let last = &log.rows[log.rows.len() - 1];
        log.six(last, "actual_q") - log.six(last, "target_q")
    });
    assert!(
        offsets[0].amax() > 1e-7 && offsets[0] != offsets[1],
        "{offsets:?}"
    );
}

#[test]
fn any_run_writes_logs_on_request() {
    let bench = Bench::with_scenario(crate::support::SMALL);
    let arguments = "run s.toml --engine rapier --quiet --no-page --rtde";
    bench.run(arguments);
    let logs: Vec<_> = bench
        .tree("out/small/pose")
        .into_iter()
        .filter(|path| path.to_string_lossy().ends_with(".rapier.rtde.csv"))
        .collect();
    assert!(!logs.is_empty());
    let log = Log::read(&text(
        &bench,
        &format!("out/small/pose/{}", logs[0].display()),
    ));
    assert!(log.has("target_moment_0") && log.has("actual_TCP_pose_5"));
}
