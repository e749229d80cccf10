//! `clearance`.

use std::collections::BTreeSet;

use serde_json::Value;

use crate::support::{Bench, Json, SMALL, has_keys, numbers};

const POSTURE: &str = "0,-1.57,-1,-1.57,1.57,0";

fn answer() -> Value {
    let bench = Bench::with_scenario(SMALL);
    let answer = bench.run(format!("clearance s.toml --joints {POSTURE} --json"));
    answer.exits_with(0).json()
}

fn point(value: &Value) -> [f64; 3] {
    numbers(value).try_into().unwrap()
}

/// Distances are printed with 17 digits; the points come out of the same computation.
const ROUNDING_M: f64 = 1e-9;

#[test]
fn every_pair_is_listed_once_with_points_as_far_apart_as_its_distance() {
    let answer = answer();
    has_keys(&answer, "schema_version classes pairs");
    let mut seen = BTreeSet::new();
    for pair in answer["pairs"].list() {
        has_keys(pair, "pair class distance_m witness_points_m");
        let key = (pair["pair"].to_string(), pair["class"].to_string());
        assert!(seen.insert(key), "{pair:#} is listed twice");
        let distance_m = pair["distance_m"].number();
        let [a, b] = [0, 1].map(|end| point(&pair["witness_points_m"][end]));
        let apart_m = (0..3)
            .map(|axis| (a[axis] - b[axis]).powi(2))
            .sum::<f64>()
            .sqrt();
        assert!((apart_m - distance_m.abs()).abs() < ROUNDING_M, "{pair:#}");
    }
    // Seven links and the tool against phantom, table and mount are among them.
    assert!(seen.len() > 8 * 3, "{}", seen.len());
}

#[test]
fn class_minima_are_the_least_of_their_pairs() {
    let answer = answer();
    let classes = answer["classes"].as_object().unwrap();
    for (class, found) in classes {
        has_keys(found, "minimum_m pair witness_points_m");
        let least = answer["pairs"]
            .list()
            .iter()
            .filter(|pair| pair["class"] == class.as_str())
            .map(|pair| pair["distance_m"].number())
            .fold(f64::INFINITY, f64::min);
        let minimum_m = found["minimum_m"].number();
        assert!(
            (minimum_m - least).abs() < ROUNDING_M,
            "{class}: {minimum_m} {least}"
        );
    }
}

#[test]
fn class_without_a_part_in_the_cell_is_absent() {
    let answer = answer();
    let classes: Vec<&str> = answer["classes"]
        .as_object()
        .unwrap()
        .keys()
        .map(String::as_str)
        .collect();
    for class in [
        "robot_phantom",
        "robot_table",
        "robot_mount",
        "self",
        "tool_phantom",
        "needle_corridor",
    ] {
        assert!(classes.contains(&class), "{classes:?}");
    }
    assert!(!classes.contains(&"robot_gantry"), "{classes:?}");
}
