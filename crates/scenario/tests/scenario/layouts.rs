//! Layouts that cannot exist are refused with the key at fault; odd ones are noted.

use std::path::{Path, PathBuf};

use needlebench_input::Finding;
use needlebench_scenario::{
    Change, KeyPath, Overrides, ResolvedScenario, ScenarioFamily, resolve_scenario,
};

fn scenarios() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios")
}

/// `supine_suite.toml` with some of its text replaced.
fn changed(edits: &[(&str, &str)]) -> Result<ResolvedScenario, Vec<Finding>> {
    let path = scenarios().join("supine_suite.toml");
    let mut text = std::fs::read_to_string(path).unwrap();
    for (from, to) in edits {
        assert!(text.contains(from), "{from}");
        text = text.replacen(from, to, 1);
    }
    resolve_scenario("s.toml", &text, &scenarios(), &Overrides::default())
}

const BASE: &str = "[-280, 350, 1050]";
const TABLE: &str = "center_mm = [-300, 0]";
const GANTRY: &str = "isocentre_mm = [800, 0, 900]";
const PATIENT: &str = "head_yaw_deg = 0";

#[test]
fn layouts_that_cannot_exist_are_refused_at_the_key_that_places_them() {
    let base = "robot.base_position_mm";
    let patient = "phantom.position_mm";
    for (edits, key, words) in [
        (
            vec![(BASE, "[-280, 350, -1050]")],
            base,
            "mm below the floor",
        ),
        (
            vec![(BASE, "[-280, 350, -30]"), ("[mount]", "")],
            base,
            "mm below the floor",
        ),
        (
            vec![(BASE, "[-280, 5000, 1050]")],
            base,
            "m from the robot's base",
        ),
        (
            vec![(BASE, "[-280, 2400, 1050]")],
            base,
            "m from the robot's base",
        ),
        (
            vec![(BASE, "[-700, 0, 1050]")],
            base,
            "mount.column overlaps",
        ),
        (vec![(BASE, "[0, 0, 1500]")], base, "overlaps the table"),
        (
            vec![(BASE, "[-700, 0, 750]"), ("[mount]", "")],
            base,
            "overlaps the table",
        ),
        (
            vec![(BASE, "[800, 900, 1050]")],
            base,
            "overlaps the gantry",
        ),
        (
            vec![
                (BASE, "[0, 0, 1500]"),
                ("[table]\ncenter_mm = [-300, 0]\ntop_height_mm = 780", ""),
                (PATIENT, "rest_on_table = false\nposition_mm = [0, 0, 950]"),
            ],
            base,
            "the robot's mount overlaps",
        ),
        (
            vec![(PATIENT, "rest_on_table = false")],
            patient,
            "mm below the floor",
        ),
        (
            vec![(PATIENT, "rest_on_table = false\nposition_mm = [0, 0, 300]")],
            patient,
            "is below the table",
        ),
        (
            vec![(PATIENT, "rest_on_table = false\nposition_mm = [0, 0, 800]")],
            patient,
            "overlaps the table",
        ),
        (
            vec![(PATIENT, "position_mm = [0, 0, -60]")],
            patient,
            "overlaps the table",
        ),
        (
            vec![(PATIENT, "position_mm = [0, 0, 3000]")],
            patient,
            "is 3000 mm above the table without support",
        ),
        (
            vec![(
                PATIENT,
                "rest_on_table = false\nposition_mm = [0, 4000, 3000]",
            )],
            patient,
            "above the floor",
        ),
        (
            vec![(
                PATIENT,
                "rest_on_table = false\nposition_mm = [420, 260, 910]",
            )],
            patient,
            "overlaps the gantry's housing",
        ),
        (
            vec![(GANTRY, "isocentre_mm = [600, 300, 900]")],
            "table.center_mm",
            "gantry's housing",
        ),
        (
            vec![(GANTRY, "isocentre_mm = [800, 0, 100]")],
            "gantry.isocentre_mm",
            "below the floor",
        ),
        (
            vec![(
                "top_height_mm = 780",
                "top_height_mm = 300\nthickness_mm = 400",
            )],
            "table.thickness_mm",
            "below the floor",
        ),
        (
            vec![
                (BASE, "[-280, 350, 100]"),
                (
                    "[tool]",
                    "[start]\njoints_deg = [0, 60, 0, 0, 0, 0]\n[tool]",
                ),
            ],
            "start.joints_deg",
            "below the floor",
        ),
    ] {
        let findings = changed(&edits).expect_err(words);
        let found = &findings[0];
        assert_eq!(found.key.as_deref(), Some(key), "{edits:?}: {found}");
        assert!(found.message.contains(words), "{words}: {found}");
        assert!(found.line.is_some() && found.hint.is_some(), "{found}");
    }
}

#[test]
fn a_guide_that_stands_metres_away_is_the_flange_poses_fault() {
    let path = scenarios().join("table3.toml");
    let text = std::fs::read_to_string(path).unwrap();
    let text = text.replacen("[194.2, -359.3, 170.1]", "[194.2, -3593.0, 170.1]", 1);
    // The needle goes where the guide goes, so nothing of the patient can be there.
    let text = text
        .replacen(
            "position_mm = [155.0, -609.5, 0]",
            "position_mm = [155.0, -3843.2, 0]",
            1,
        )
        .replacen("center_mm = [300, -598]", "center_mm = [300, -3831.7]", 1)
        .replacen("[1300, -598, 900]", "[1300, -3831.7, 900]", 1);
    let findings = resolve_scenario("s.toml", &text, &scenarios(), &Overrides::default());
    let found = &findings.unwrap_err()[0];
    assert_eq!(
        found.key.as_deref(),
        Some("goals[0].flange_pose.position_mm"),
        "{found}"
    );
}

#[test]
fn layouts_that_are_odd_are_noted() {
    for (edits, words) in [
        (
            vec![("[mount]", "")],
            "is 1050 mm above the floor without a [mount]",
        ),
        (vec![("[mount]", "")], "robot_mount` is not evaluated"),
        (
            vec![(TABLE, "center_mm = [-950, 0]")],
            "extend beyond its end",
        ),
        (
            vec![(PATIENT, "position_mm = [0, 0, 100]")],
            "100 mm above the table",
        ),
        (
            vec![(GANTRY, "isocentre_mm = [800, 0, 880]")],
            "20 mm below the floor",
        ),
        (
            vec![(
                "role = \"assistant\"\nposition_mm = [-800, 450]",
                "role = \"assistant\"\nside = \"left\"",
            )],
            " overlap, ",
        ),
    ] {
        let resolved = changed(&edits).unwrap_or_else(|found| panic!("{}", found[0]));
        let notes = &resolved.notes;
        assert!(
            notes.iter().any(|note| note.contains(words)),
            "{words}: {notes:#?}"
        );
    }
    let sound = changed(&[]).unwrap();
    let words = ["floor", "above the table", "beyond", "support"];
    for note in &sound.notes {
        assert!(!words.iter().any(|word| note.contains(word)), "{note}");
    }
}

#[test]
fn a_robot_on_the_table_or_the_floor_stands_on_something() {
    for place in ["[-700, 0, 780]", "[-280, 350, 0]"] {
        let resolved = changed(&[(BASE, place), ("[mount]", "")]);
        let resolved = resolved.unwrap_or_else(|found| panic!("{}", found[0]));
        assert!(
            !resolved
                .notes
                .iter()
                .any(|note| note.contains("on nothing")),
            "{place}"
        );
    }
}

#[test]
fn a_layout_of_a_study_that_cannot_exist_is_refused_with_its_key() {
    let path = scenarios().join("studies/chest.toml");
    let family = ScenarioFamily::load(&path, &Overrides::default()).unwrap();
    let goal = family.goals().next().unwrap().to_owned();
    for (key, value) in [
        ("robot.base_position_mm[1]", 100.0),
        ("robot.base_position_mm[2]", -200.0),
        ("phantom.position_mm[2]", -50.0),
        ("phantom.position_mm[2]", 900.0),
    ] {
        let path = KeyPath::parse(key).unwrap();
        let findings = family
            .vary(&goal, &[(path, Change::Set(value.into()))])
            .unwrap_err();
        let place = key.split('[').next();
        assert_eq!(
            findings[0].key.as_deref(),
            place,
            "{key} {value}: {}",
            findings[0]
        );
    }
}

#[test]
fn criteria_are_switched_off_by_name_alone() {
    let limit = "max_tip_position_error_mm = 0.001";
    let off = changed(&[(limit, "max_tip_position_error_mm = \"off\"")]).unwrap();
    assert_eq!(off.scenario.criteria.max_tip_position_error_mm, None);
    for (from, to, key) in [
        (
            limit,
            "max_tip_position_error_mm = -1",
            "max_tip_position_error_mm",
        ),
        (
            limit,
            "max_tip_position_error_mm = 1e9",
            "max_tip_position_error_mm",
        ),
        ("self = 7", "self = 1e308", "min_clearance_mm.self"),
        (
            "robot_table = 15",
            "robot_table = -1e9",
            "min_clearance_mm.robot_table",
        ),
        (
            "robot_table = 15",
            "robot_table = \"of\"",
            "min_clearance_mm.robot_table",
        ),
        (
            "max_peak_torque_ratio = 0.8",
            "max_peak_torque_ratio = 10",
            "max_peak_torque_ratio",
        ),
    ] {
        let findings = changed(&[(from, to)]).unwrap_err();
        assert_eq!(
            findings[0].key,
            Some(format!("criteria.{key}")),
            "{}",
            findings[0]
        );
        let text = findings[0].to_string();
        assert!(text.contains("off"), "{text}");
        assert!(text.len() < 300, "numbers have no hundred zeros: {text}");
    }
}

#[test]
fn what_is_switched_off_stays_off_in_every_layout_of_a_study() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("s.toml");
    let text = std::fs::read_to_string(scenarios().join("studies/chest.toml")).unwrap();
    let limit = "max_tip_position_error_mm = 0.001";
    assert!(text.contains(limit));
    std::fs::write(
        &path,
        text.replace(limit, "max_tip_position_error_mm = \"off\""),
    )
    .unwrap();
    let family = ScenarioFamily::load(&path, &Overrides::default()).unwrap();
    let goal = family.goals().next().unwrap().to_owned();
    let key = KeyPath::parse("criteria.max_needle_angle_error_deg").unwrap();
    let varied = family
        .vary(&goal, &[(key, Change::Set(0.2.into()))])
        .unwrap();
    assert_eq!(varied.scenario.criteria.max_tip_position_error_mm, None);
    assert_eq!(
        varied.scenario.criteria.max_needle_angle_error_deg,
        Some(0.2)
    );
}
