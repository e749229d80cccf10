//! What was measured of markers and target, and where a lesion really is.

use std::path::Path;

use nalgebra::{Matrix3, Point3};
use needlebench_input::Finding;
use needlebench_scenario::imperfections::{Imperfections, Localisation};
use needlebench_scenario::{Overrides, ResolvedScenario, resolve_scenario};

/// Rounding of a metre, and of roots of squares of millimetres.
const ROUNDING: f64 = 1e-12;

const MARKERS: &str =
    "markers_mm = [[-90, -80, 60], [90, -80, 60], [0, -110, -70], [20, -100, 90]]";

const GOAL: &str = "lesion = \"pleural_based\"\nentry_direction_deg = [20, 0]";

fn resolve(goal: &str, more: &str) -> Result<ResolvedScenario, Vec<Finding>> {
    let text = format!(
        "name = \"x\"\n[robot]\nbase_position_mm = [-900, 0, 800]\n[tool]\nneedle_length_mm = 400\n\
         [phantom]\nmodel = \"male-p50\"\nrest_on_table = false\nposition_mm = [0, 0, 1000]\n\
         [[goals]]\nname = \"g\"\n{goal}\n{more}\n"
    );
    resolve_scenario("x.toml", &text, Path::new(""), &Overrides::default())
}

fn imperfections(blocks: &str) -> Imperfections {
    resolve(GOAL, blocks).unwrap().imperfections.unwrap()
}

/// The one thing that is wrong, with a line.
#[track_caller]
fn refused(goal: &str, more: &str) -> Finding {
    let mut findings = resolve(goal, more).expect_err("it is to be refused");
    assert_eq!(findings.len(), 1, "{findings:#?}");
    let finding = findings.remove(0);
    assert!(
        finding.line.is_some() && finding.hint.is_some(),
        "{finding:#?}"
    );
    finding
}

#[track_caller]
fn is_refused(blocks: &str, key: &str, says: &str) {
    let finding = refused(GOAL, blocks);
    assert_eq!(finding.key.as_deref(), Some(key), "{finding:#?}");
    assert!(finding.message.contains(says), "{finding:#?}");
}

fn registration(covariances: &str) -> String {
    format!("[imperfections.registration]\n{MARKERS}\ncovariance_mm2 = {covariances}\n")
}

const SOUND: &str = "[0.04, 0.04, 0.25, 0.01, -0.02, 0.03]";

#[test]
fn covariances_are_read_in_their_order_and_in_metres() {
    let each = format!("[{SOUND}, {SOUND}, {SOUND}, [1, 2, 3, 0.1, 0.2, 0.3]]");
    let found = imperfections(&registration(&each)).registration.unwrap();
    let Localisation::Measured { covariances_m2 } = found.localisation else {
        panic!("they are measured");
    };
    assert_eq!(covariances_m2.len(), 4);
    let last = Matrix3::new(1.0, 0.1, 0.2, 0.1, 2.0, 0.3, 0.2, 0.3, 3.0) * 1e-6;
    assert!((covariances_m2[3] - last).amax() < ROUNDING * 1e-6);
    let text = format!("[imperfections.imaging]\ncovariance_mm2 = {SOUND}\n");
    let seen = imperfections(&text).imaging.unwrap();
    assert!(seen.is_measured);
    let given = Matrix3::new(0.04, 0.01, -0.02, 0.01, 0.04, 0.03, -0.02, 0.03, 0.25) * 1e-6;
    assert!((seen.root_m * seen.root_m.transpose() - given).amax() < ROUNDING * 1e-6);
}

#[test]
fn what_is_assumed_is_as_it_was() {
    let found = imperfections("[imperfections.registration]\n[imperfections.imaging]\n");
    let markers = found.registration.unwrap();
    assert_eq!(markers.places_m.len(), 6);
    assert_eq!(
        markers.localisation,
        Localisation::Assumed { rms_m: 0.5e-3 }
    );
    let seen = found.imaging.unwrap();
    assert!(!seen.is_measured);
    // A voxel of 2 mm, and a reader's 0.3 mm.
    let expected_m = (4.0_f64 / 12.0 + 0.09).sqrt() * 1e-3;
    assert!((seen.root_m[(2, 2)] - expected_m).abs() < ROUNDING);
}

#[test]
fn an_error_is_measured_or_assumed_and_not_both() {
    let four = format!("[{SOUND}, {SOUND}, {SOUND}, {SOUND}]");
    is_refused(
        &format!("{}localisation_error_mm = 0.5\n", registration(&four)),
        "imperfections.registration.localisation_error_mm",
        "contradicts `covariance_mm2`",
    );
    for (name, value) in [("voxel_mm", "[0.7, 0.7, 2.0]"), ("reader_mm", "0.4")] {
        is_refused(
            &format!("[imperfections.imaging]\ncovariance_mm2 = {SOUND}\n{name} = {value}\n"),
            &format!("imperfections.imaging.{name}"),
            "contradicts `covariance_mm2`",
        );
    }
}

#[test]
fn each_marker_has_one_covariance() {
    is_refused(
        &registration(&format!("[{SOUND}, {SOUND}, {SOUND}]")),
        "imperfections.registration.covariance_mm2",
        "3 covariances for 4 markers",
    );
    // Of the markers that are assumed where none are given nothing can have been measured.
    let six = [SOUND; 6].join(", ");
    is_refused(
        &format!("[imperfections.registration]\ncovariance_mm2 = [{six}]\n"),
        "imperfections.registration.covariance_mm2",
        "without their markers",
    );
}

#[test]
fn what_is_no_covariance_is_refused_with_the_marker_and_its_line() {
    for bad in [
        "[0.04, -0.04, 0.25, 0, 0, 0]",
        "[0.04, 0.04, 0, 0, 0, 0]",
        "[0.04, 0.04, 0.25, 0.05, 0, 0]",
        "[100, 1e-8, 1, 0, 0, 0]",
    ] {
        let each = format!("[{SOUND}, {SOUND}, {bad}, {SOUND}]");
        let key = "imperfections.registration.covariance_mm2[2]";
        is_refused(
            &registration(&each),
            key,
            "the covariance of marker 3 has a variance of",
        );
        let text = format!("[imperfections.imaging]\ncovariance_mm2 = {bad}\n");
        is_refused(
            &text,
            "imperfections.imaging.covariance_mm2",
            "not positive definite",
        );
    }
}

/// A goal whose lesion really is this far from where it is planned to be, mm.
fn goal_off_by(off_mm: [f64; 3]) -> (String, Point3<f64>) {
    let planned = resolve(GOAL, "").unwrap();
    assert_eq!(planned.goals[0].true_target_m, None);
    let to_phantom = planned.phantom.unwrap().world_from_phantom.inverse();
    let planned_mm = (to_phantom * planned.goals[0].target_m).coords * 1e3;
    let [x, y, z] = std::array::from_fn(|axis| planned_mm[axis] + off_mm[axis]);
    let goal = format!("{GOAL}\ntrue_target_mm = [{x}, {y}, {z}]");
    (goal, Point3::new(x, y, z) * 1e-3)
}

#[test]
fn a_true_target_is_placed_with_the_phantom_and_changes_nothing_else() {
    let (goal, in_phantom) = goal_off_by([3.0, -2.0, 5.0]);
    let planned = resolve(GOAL, "").unwrap();
    let resolved = resolve(&goal, "").unwrap();
    let placed = resolved.phantom.as_ref().unwrap();
    let found = resolved.goals[0].true_target_m.unwrap();
    assert!((found - placed.world_from_phantom * in_phantom).norm() < ROUNDING);
    let without = needlebench_scenario::Goal {
        true_target_m: None,
        ..resolved.goals[0].clone()
    };
    assert_eq!(without, planned.goals[0]);
}

#[test]
fn a_true_target_that_cannot_be_meant_is_refused() {
    for (off_mm, says) in [
        ([0.0, 40.0, 31.0], "50.6 mm from the planned one"),
        ([0.0, -400.0, 0.0], "outside the phantom"),
    ] {
        let finding = refused(&goal_off_by(off_mm).0, "");
        assert_eq!(finding.key.as_deref(), Some("goals[0].true_target_mm"));
        assert!(finding.message.contains(says), "{finding:#?}");
        assert!(finding.hint.unwrap().contains("planned to be at"));
    }
}

#[test]
fn a_limit_without_a_true_target_is_refused() {
    for name in ["max_true_target_error_mm", "max_true_target_lateral_mm"] {
        let criteria = format!("[criteria]\n{name} = 3\n");
        is_refused(
            &criteria,
            &format!("criteria.{name}"),
            "no goal has a true target",
        );
        resolve(&goal_off_by([1.0, 0.0, 0.0]).0, &criteria).expect("there is one");
    }
}
