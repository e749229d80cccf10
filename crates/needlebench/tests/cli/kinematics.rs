//! `ik` and `fk`.

use std::f64::consts::{PI, TAU};

use serde_json::Value;

use crate::support::{Bench, Json, SMALL, TABLE_3_POSE, has_keys, numbers};

/// The paper's Table 3 under its true labels, rad, wrapped to (-pi, pi].
const TABLE_3: [(&str, [f64; 6]); 8] = [
    (
        "Right-Down-Fold",
        [-0.73508, 2.370465, 1.882823, -1.96721, 1.274286, 0.113862],
    ),
    (
        "Right-Up-Fold",
        [-0.73508, -2.212137, -1.882823, 0.097853, 1.274286, 0.113862],
    ),
    (
        "Right-Down-Unfold",
        [-0.73508, 3.086748, 0.81324, 1.527683, -1.274286, -3.027731],
    ),
    (
        "Right-Up-Unfold",
        [-0.73508, -2.440485, -0.81324, 2.39821, -1.274286, -3.027731],
    ),
    (
        "Left-Down-Fold",
        [
            1.75692, 0.776095, -1.872123, -1.227444, -1.423564, -0.365947,
        ],
    ),
    (
        "Left-Up-Fold",
        [1.75692, -0.915811, 1.872123, 3.003401, -1.423564, -0.365947],
    ),
    (
        "Left-Down-Unfold",
        [1.75692, 0.054278, -0.827189, 1.591031, 1.423564, 2.775646],
    ),
    (
        "Left-Up-Unfold",
        [1.75692, -0.714521, 0.827189, 0.705453, 1.423564, 2.775646],
    ),
];

/// Table 3 was computed from more digits of the pose than the four that are printed.
const TABLE_3_RAD: f64 = 2e-4;

/// What the inverse kinematics promises, m and rad.
const RESIDUAL: f64 = 1e-12;

/// A pose through inverse and forward kinematics, both printed with 17 digits.
const ROUND_TRIP: f64 = 1e-12;

fn angle_difference(a: f64, b: f64) -> f64 {
    let difference = (a - b).rem_euclid(TAU);
    difference.min(TAU - difference)
}

fn solutions(answer: &Value) -> &Vec<Value> {
    answer["solutions"].list()
}

fn comma_separated(numbers: &[f64]) -> String {
    let words: Vec<String> = numbers.iter().map(f64::to_string).collect();
    words.join(",")
}

#[test]
fn pose_of_table_3_has_its_eight_solutions_under_their_labels() {
    let bench = Bench::new();
    let answer = bench.run(format!("ik --pose {TABLE_3_POSE} --json"));
    let answer = answer.exits_with(0).json();
    has_keys(&answer, "schema_version solutions count certificate");
    assert_eq!(answer["count"], 8);
    assert_eq!(answer["certificate"], "complete");
    assert_eq!(solutions(&answer).len(), 8);
    for (solution, (label, row)) in solutions(&answer).iter().zip(TABLE_3) {
        has_keys(
            solution,
            "label joints_rad residual_m residual_rad within_limits free_joint kind",
        );
        assert_eq!(solution["label"], label);
        assert_eq!(solution["kind"], "exact");
        assert_eq!(solution["within_limits"], true);
        assert_eq!(solution["free_joint"], Value::Null);
        assert!(solution["residual_m"].number() <= RESIDUAL);
        assert!(solution["residual_rad"].number() <= RESIDUAL);
        let joints = numbers(&solution["joints_rad"]);
        for (joint, expected) in joints.iter().zip(row) {
            assert!(angle_difference(*joint, expected) < TABLE_3_RAD, "{label}");
        }
    }
}

#[test]
fn forward_kinematics_undo_inverse_kinematics() {
    let bench = Bench::new();
    let answer = bench.run(format!("ik --pose {TABLE_3_POSE} --json")).json();
    let pose: Vec<f64> = TABLE_3_POSE
        .split(',')
        .map(|word| word.parse().unwrap())
        .collect();
    for solution in solutions(&answer) {
        let joints = comma_separated(&numbers(&solution["joints_rad"]));
        let found = bench.run(format!("fk --joints {joints} --json"));
        let found = &found.exits_with(0).json()["flange_in_base"];
        let position = numbers(&found["position_m"]);
        let rotation = numbers(&found["rotvec_rad"]);
        for (got, expected) in position.iter().chain(&rotation).zip(&pose) {
            assert!((got - expected).abs() < ROUND_TRIP, "{got} {expected}");
        }
    }
}

#[test]
fn forward_kinematics_answer_in_both_base_frames_and_for_every_link() {
    let bench = Bench::new();
    let answer = bench.run("fk --joints 0,0,0,0,0,0 --json");
    let answer = answer.exits_with(0).json();
    has_keys(
        &answer,
        "schema_version flange_in_base flange_in_base_link links",
    );
    // `base_link` is `base` turned by half a turn about z.
    let in_base = numbers(&answer["flange_in_base"]["position_m"]);
    let in_base_link = numbers(&answer["flange_in_base_link"]["position_m"]);
    for (axis, sign) in [-1.0, -1.0, 1.0].into_iter().enumerate() {
        assert!((in_base[axis] - sign * in_base_link[axis]).abs() < ROUND_TRIP);
    }
    // At zero the arm lies stretched along -x of `base`: a2 + a3.
    assert!((in_base[0] + 0.24365 + 0.21325).abs() < ROUND_TRIP);
    let links = answer["links"].as_object().unwrap();
    assert_eq!(links.len(), 6);
    for pose in links.values() {
        has_keys(pose, "position_m rotvec_rad quat_wxyz");
        let norm: f64 = numbers(&pose["quat_wxyz"]).iter().map(|q| q * q).sum();
        assert!((norm - 1.0).abs() < ROUND_TRIP);
    }
}

#[test]
fn goal_of_a_scenario_is_solved_like_its_pose() {
    let bench = Bench::with_scenario(SMALL);
    let by_goal = bench.run("ik s.toml --goal pose --json");
    let by_goal = by_goal.exits_with(0).json();
    let by_pose = bench.run(format!("ik --pose {TABLE_3_POSE} --json")).json();
    assert_eq!(solutions(&by_goal).len(), 8);
    for (goal, pose) in solutions(&by_goal).iter().zip(solutions(&by_pose)) {
        assert_eq!(goal["label"], pose["label"]);
        let pairs = numbers(&goal["joints_rad"]).into_iter();
        for (a, b) in pairs.zip(numbers(&pose["joints_rad"])) {
            assert!(angle_difference(a, b) < 1e-9);
        }
    }
}

#[test]
fn unreachable_pose_says_how_much_is_missing() {
    let bench = Bench::new();
    let answer = bench.run("ik --pose 0.9,0,0.1,0,0,0 --json");
    let answer = answer.exits_with(1).json();
    assert_eq!(answer["count"], 0);
    assert!(solutions(&answer).is_empty());
    assert_eq!(answer["certificate"], "nearest_only");
    let unreachable = answer["unreachable"].list();
    assert_eq!(unreachable.len(), 8);
    assert!(
        unreachable
            .iter()
            .all(|each| each["missing_m"].number() > 0.2)
    );
    // Apart from the solutions, and named for what they are.
    let nearest = answer["nearest"].list();
    assert!(!nearest.is_empty());
    for row in nearest {
        assert_eq!(row["kind"], "nearest");
        assert!(row["residual_m"].number() > 0.2);
    }
}

#[test]
fn free_wrist_is_named_and_certified_as_such() {
    let bench = Bench::new();
    let pose = bench.run("fk --joints 0.3,-1.2,1.4,-0.5,0,0.8 --json");
    let pose = &pose.json()["flange_in_base"];
    let numbers = [numbers(&pose["position_m"]), numbers(&pose["rotvec_rad"])].concat();
    let answer = bench.run(format!("ik --pose {} --json", comma_separated(&numbers)));
    let answer = answer.exits_with(0).json();
    assert_eq!(answer["certificate"], "free_joint");
    let free = solutions(&answer)
        .iter()
        .filter(|solution| solution["free_joint"] == "wrist_3");
    assert!(free.count() > 0);
}

/// The matrix that the paper prints, four decimals.
const PRINTED_MATRIX: &str = "[[-0.8421 -0.4673  0.2693  0.1942]
 [-0.5196  0.5690 -0.6374 -0.3593]
 [ 0.1446 -0.6766 -0.7220  0.1701]
 [ 0       0       0       1     ]]";

#[test]
fn rounded_matrix_is_refused_with_a_pose_that_is_accepted() {
    let bench = Bench::new();
    let refused = bench
        .run(format!("ik --matrix '{PRINTED_MATRIX}'"))
        .exits_with(2);
    let offered = refused.stderr.split("--pose ").nth(1).unwrap();
    let offered = offered.split(';').next().unwrap();
    let by_pose = bench.run(format!("ik --pose {offered} --json"));
    let by_pose = by_pose.exits_with(0).json();
    let by_matrix = format!("ik --matrix '{PRINTED_MATRIX}' --nearest-rotation --json");
    let by_matrix = bench.run(&by_matrix).exits_with(0).json();
    assert_eq!(solutions(&by_pose).len(), 8);
    for (pose, matrix) in solutions(&by_pose).iter().zip(solutions(&by_matrix)) {
        assert_eq!(pose["label"], matrix["label"]);
        let pairs = numbers(&pose["joints_rad"]).into_iter();
        for (a, b) in pairs.zip(numbers(&matrix["joints_rad"])) {
            assert!((a - b).abs() < ROUND_TRIP);
        }
    }
    // The paper's own vector is rounded too.
    for (matrix, (label, row)) in solutions(&by_matrix).iter().zip(TABLE_3) {
        assert_eq!(matrix["label"], label);
        for (joint, expected) in numbers(&matrix["joints_rad"]).iter().zip(row) {
            assert!(
                angle_difference(*joint, expected) < 2.0 * TABLE_3_RAD,
                "{label}"
            );
        }
    }
}

#[test]
fn exact_matrix_is_solved_like_its_vector() {
    let bench = Bench::new();
    // Half a turn about x.
    let by_matrix = "ik --matrix '1,0,0,0.3, 0,-1,0,0.2, 0,0,-1,0.1' --json";
    let by_matrix = bench.run(by_matrix).exits_with(0).json();
    let by_pose = "ik --pose 0.3,0.2,0.1,3.141592653589793,0,0 --json";
    let by_pose = bench.run(by_pose).exits_with(0).json();
    assert!(by_matrix["count"].as_u64().unwrap() >= 2);
    assert_eq!(by_matrix["count"], by_pose["count"]);
    for (a, b) in solutions(&by_matrix).iter().zip(solutions(&by_pose)) {
        let pairs = numbers(&a["joints_rad"]).into_iter();
        for (a, b) in pairs.zip(numbers(&b["joints_rad"])) {
            assert!(angle_difference(a, b) < ROUND_TRIP);
        }
    }
}

#[test]
fn every_arm_inverts_its_own_forward_kinematics() {
    let bench = Bench::new();
    let posture = "0.4,-1.3,1.5,-0.9,1.1,0.2";
    let arms = [
        "UR3", "UR3e", "UR5", "UR5e", "UR10", "UR10e", "UR16e", "UR20", "UR30",
    ];
    for arm in arms {
        let pose = bench.run(format!("fk --arm {arm} --joints {posture} --json"));
        let pose = pose.exits_with(0).json();
        assert_eq!(pose["arm"], arm);
        assert_eq!(pose["calibration"], Value::Null);
        let pose = &pose["flange_in_base"];
        let pose = [numbers(&pose["position_m"]), numbers(&pose["rotvec_rad"])].concat();
        let pose = comma_separated(&pose);
        let arm_in_lower_case = arm.to_lowercase();
        let answer = bench.run(format!("ik --arm {arm_in_lower_case} --pose {pose} --json"));
        let answer = answer.exits_with(0).json();
        assert_eq!(answer["arm"], arm);
        let wanted: Vec<f64> = posture.split(',').map(|q| q.parse().unwrap()).collect();
        let found = solutions(&answer).iter().any(|solution| {
            let joints = numbers(&solution["joints_rad"]);
            let mut pairs = joints.iter().zip(&wanted);
            pairs.all(|(a, b)| angle_difference(*a, *b) < 1e-9)
        });
        assert!(found, "{arm}: {answer:#}");
    }
}

#[test]
fn iteration_limit_is_kept_and_its_row_is_no_solution() {
    let bench = Bench::new();
    let run = |method: &str, limit: &str| {
        bench.run(format!(
            "ik --pose {TABLE_3_POSE} --method {method} --max-iterations {limit} --json"
        ))
    };
    let answer = run("gauss-newton", "1").exits_with(1).json();
    assert_eq!(answer["count"], 0);
    assert_eq!(answer["certificate"], "not_converged");
    assert_eq!(answer["nearest"][0]["kind"], "nearest");
    assert_eq!(answer["nearest"][0]["iterations"], 1);
}

#[test]
fn whole_turns_stay_within_the_limits_and_keep_the_residual() {
    let bench = Bench::new();
    let answer = bench.run(format!("ik --pose {TABLE_3_POSE} --wraps --json"));
    let answer = answer.exits_with(0).json();
    // Five joints have two full turns of range, the elbow one.
    assert_eq!(answer["count"], 8 * 32);
    // Nearest to the seed, which is zero, comes first.
    let from_zero = |solution: &Value| -> f64 {
        let joints = numbers(&solution["joints_rad"]);
        joints.iter().map(|joint| joint * joint).sum()
    };
    let distances: Vec<f64> = solutions(&answer).iter().map(from_zero).collect();
    assert!(distances.is_sorted());
    for solution in solutions(&answer) {
        assert_eq!(solution["within_limits"], true);
        let joints = numbers(&solution["joints_rad"]);
        assert!(joints.iter().all(|joint| joint.abs() <= TAU));
        assert!(joints[2].abs() <= PI);
    }
}

#[test]
fn gauss_newton_finds_the_solution_next_to_its_seed() {
    let bench = Bench::new();
    for (label, row) in TABLE_3 {
        let seed = comma_separated(&row.map(|joint| joint + 0.05));
        let answer = bench.run(format!(
            "ik --pose {TABLE_3_POSE} --method gauss-newton --seed {seed} --json"
        ));
        let answer = answer.exits_with(0).json();
        let solution = &solutions(&answer)[0];
        assert_eq!(solution["label"], label);
        assert_eq!(solution["kind"], "exact");
        assert!(solution["residual_m"].number() <= RESIDUAL);
    }
}
