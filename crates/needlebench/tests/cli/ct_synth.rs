//! `needlebench ct synth`: volumes of phantoms with the truth beside them.

use std::fs;

use serde_json::Value;

use crate::support::{Answer, Bench, Json, has_keys, numbers, workspace};

/// Coarse enough to take no time.
const COARSE: &str = "--pixels 96 --pixel-mm 3.6 --preset thick --increment-mm 20";

fn synth(bench: &Bench, subject: &str, out: &str, more: &str) -> Answer {
    let answer = bench.run(format!("ct synth '{subject}' --out {out} {COARSE} {more}"));
    answer.exits_with(0)
}

fn suite() -> String {
    fs::read_to_string(workspace().join("scenarios/supine_suite.toml")).unwrap()
}

fn matrix(value: &Value) -> Vec<Vec<f64>> {
    value.list().iter().map(numbers).collect()
}

#[test]
fn a_scenario_gives_a_volume_labels_and_a_truth_that_names_the_robot() {
    let bench = Bench::with_scenario(&suite());
    let more = "--json --markers ct-sphere --format both";
    let made = synth(&bench, "s.toml", "ct", more).json();
    has_keys(&made, "schema_version folder files truth");
    let truth = bench.read_json("ct/truth.json");
    assert_eq!(made["truth"], truth);
    let keys = "scanner materials_hu seed ct_from_index robot_from_ct lesions markers";
    has_keys(&truth, keys);
    let size = numbers(&truth["size"]);
    assert_eq!(size[..2], [96.0, 96.0]);
    assert_eq!(bench.tree("ct/dicom").len() as f64, size[2]);
    for list in ["lesions", "markers"] {
        let alone = bench.read_json(&format!("ct/{list}.json"));
        assert_eq!(alone[list], truth[list]);
        assert_eq!(alone["frame"], "ct");
    }
    let names = bench.read_json("ct/labels.json");
    let named = |name: &str| {
        names["labels"]
            .list()
            .iter()
            .any(|label| label["name"] == name)
    };
    for name in [
        "skin",
        "lung_left",
        "rib_right_4",
        "lesion_right_upper_lobe",
        "marker_1",
        "mattress",
    ] {
        assert!(named(name), "{name}");
    }
    // A sphere of 8 mm touches the skin, 1 mm of disc lies on it.
    let marker = &truth["markers"][0];
    let [face, sphere, normal] =
        ["center_m", "sphere_center_m", "normal"].map(|key| numbers(&marker[key]));
    for axis in 0..3 {
        assert!((face[axis] - sphere[axis] - 5e-3 * normal[axis]).abs() < 1e-12);
    }
    let rigid = matrix(&truth["robot_from_ct"]);
    assert_eq!(rigid[3], [0.0, 0.0, 0.0, 1.0]);
    for row in &rigid[..3] {
        let norm: f64 = row[..3].iter().map(|x| x * x).sum();
        assert!((norm - 1.0).abs() < 1e-12);
    }
}

#[test]
fn the_same_call_gives_the_same_bytes_on_any_number_of_threads() {
    let bench = Bench::new();
    for (out, jobs) in [("one", "1"), ("two", "3")] {
        synth(&bench, "male-p50-supine", out, &format!("--jobs {jobs}"));
    }
    for name in ["ct.nii.gz", "labels.nii.gz", "truth.json", "labels.json"] {
        assert_eq!(
            bench.read(&format!("one/{name}")),
            bench.read(&format!("two/{name}")),
            "{name}"
        );
    }
    assert!(bench.read_json("one/truth.json")["robot_from_ct"].is_null());
}

#[test]
fn a_file_of_sizes_is_scanned_and_markers_that_ct_cannot_see_are_said_to_be() {
    let bench = Bench::new();
    let file = workspace().join("models/chest_phantom/female-p5.toml");
    let answer = synth(&bench, file.to_str().unwrap(), "ct", "--no-labels");
    answer.says(["--markers ct-sphere"]);
    assert!(!bench.path("ct/labels.nii.gz").exists());
}
