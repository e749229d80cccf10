use std::path::Path;

use needlebench_input::{Location, PackagePaths};
use needlebench_kinematics::{Pose, UrModel};

use super::data::TABLES;
use super::*;

use crate::{LoadedRobot, MissingInertia, read_robot};

const UR3: &str = include_str!("../../../../models/ur3/arm.toml");

/// A folder with an `arm.toml` of this text and the shipped UR3's URDF.
fn folder(text: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("arm.toml"), text).unwrap();
    let urdf = include_str!("../../../../models/ur3/ur3.urdf");
    std::fs::write(folder.path().join("ur3.urdf"), urdf).unwrap();
    folder
}

#[track_caller]
fn refused(from: &str, to: &str) -> Finding {
    assert!(UR3.contains(from), "{from}");
    let text = UR3.replacen(from, to, 1);
    let folder = folder(&text);
    let finding = Arm::of_reference("arm.toml", folder.path()).unwrap_err();
    let line = text.lines().position(|line| line.contains(to));
    if let Some(line) = line.filter(|_| !to.contains('\n')) {
        assert_eq!(finding.line, Some(line + 1), "{finding}");
    }
    finding
}

#[track_caller]
fn says(finding: &Finding, key: &str, texts: &[&str]) {
    assert_eq!(finding.key.as_deref(), Some(key), "{finding}");
    for text in texts {
        assert!(finding.to_string().contains(text), "{finding}");
    }
}

#[test]
fn lengths_of_shipped_arms_are_the_kernels() {
    let mut checked = 0;
    for arm in Arm::shipped() {
        if let Ok(model) = arm.data.name.parse::<UrModel>() {
            assert_eq!(arm.data.geometry.lengths(), model.geometry(), "{model}");
            checked += 1;
        }
    }
    assert!(checked > 0);
}

#[test]
fn shipped_arms_are_told_apart_by_their_lengths() {
    for a in Arm::shipped() {
        for b in Arm::shipped() {
            let apart_m = a.deviation_m(&b.data.geometry.lengths());
            assert!(
                a.key == b.key || apart_m > 3.0 * SAME_ARM_M,
                "{} {}",
                a.key,
                b.key
            );
        }
    }
}

/// A table is there with a source, or it is said why not.
#[test]
fn shipped_arms_have_every_table_or_say_why_not() {
    for arm in Arm::shipped() {
        let value = toml::Value::try_from(&arm.data).unwrap();
        // A calibration makes data those of one arm, and these are of a type.
        for table in TABLES.into_iter().filter(|table| *table != "calibration") {
            let is_there = value.get(table).is_some();
            let is_said = arm.data.lacks.contains_key(table);
            assert!(is_there != is_said, "{}: [{table}]", arm.key);
        }
    }
}

#[test]
fn unknown_keys_are_refused_with_the_likeliest() {
    let finding = refused("d1_m = 0.1519", "d1_mm = 151.9");
    says(&finding, "geometry.d1_mm", &["unknown key", "`d1_m`"]);
    let finding = refused("[payload]", "[payloat]");
    says(&finding, "payloat", &["did you mean `payload`?"]);
}

#[test]
fn values_that_cannot_be_are_refused_at_their_line() {
    let finding = refused("kg = 3.0", "kg = 3000.0");
    says(&finding, "payload.kg", &["3000 kg", "outside 0.1 to 100"]);
    let finding = refused("ratio = 1.0", "ratio = 0.5");
    says(&finding, "brakes.standing.ratio", &["outside 1 to 10"]);
    let finding = refused("stiction_nm = [4.0,", "stiction_nm = [3.1,");
    says(&finding, "friction.stiction_nm[0]", &["break-away"]);
}

#[test]
fn a_value_without_a_source_is_refused() {
    let finding = refused(
        "source = \"assumed: derived from UR3e values identified from a recorded run; models/ur3/README.md step 8\"",
        "source = \"assumed: \"",
    );
    says(
        &finding,
        "rotors.source",
        &["names no source", "a citation"],
    );
    let finding = refused(
        "source = \"assumed: derived from UR3e values identified from a recorded run; models/ur3/README.md step 8\"\n",
        "\n",
    );
    says(&finding, "rotors.source", &["is missing"]);
}

#[test]
fn every_joint_has_one_stop() {
    let elbow = "[[brakes.stops]]\njoint = \"elbow\"";
    let finding = refused(elbow, "[[brakes.stops]]\njoint = \"elbo\"");
    says(
        &finding,
        "brakes.stops[2].joint",
        &["did you mean `elbow`?"],
    );
    let finding = refused(elbow, "[[brakes.stops]]\njoint = \"shoulder_pan\"");
    says(&finding, "brakes.stops[2].joint", &["has two stops"]);
    let finding = refused("\ntime_s = 0.092", "\n");
    says(
        &finding,
        "brakes.stops[2].time_s",
        &["is missing", "`like`"],
    );
    let finding = refused("like = \"elbow\"", "like = \"wrist_2\"");
    says(&finding, "brakes.stops[3].like", &["no figures of its own"]);
}

#[test]
fn what_lacks_is_a_table_that_is_not_there() {
    let lacks = |line: &str| format!("[lacks]\n{line}\n\n[payload]");
    let finding = refused("[payload]", &lacks("breaks = \"none\""));
    says(&finding, "lacks.breaks", &["did you mean `brakes`?"]);
    let finding = refused("[payload]", &lacks("brakes = \"none\""));
    says(&finding, "lacks.brakes", &["`[brakes]` is there"]);
}

#[test]
fn an_arm_is_named_in_any_case_or_by_its_file_or_folder() {
    let here = Path::new("");
    assert_eq!(
        Arm::of_reference("UR3", here).unwrap().path(),
        "models/ur3/arm.toml"
    );
    let folder = folder(UR3);
    for reference in ["arm.toml", "."] {
        let arm = Arm::of_reference(reference, folder.path()).unwrap();
        assert_eq!(arm.data.name, "UR3");
    }
    let finding = Arm::of_reference("ur33", here).unwrap_err().to_string();
    assert!(finding.contains("did you mean `ur3"), "{finding}");
    let finding = Arm::of_reference("none/arm.toml", here)
        .unwrap_err()
        .to_string();
    assert!(finding.contains("one of ur10"), "{finding}");
}

fn read(folder: &Path, urdf: &str) -> Result<LoadedRobot, Finding> {
    let packages = PackagePaths::default();
    let missing = MissingInertia::default();
    let urdf = Location::Disk(folder.join(urdf));
    read_robot(&urdf, &packages, &missing, Pose::identity(), None, None)
}

#[test]
fn data_beside_a_urdf_are_that_urdfs() {
    let text = UR3.replacen("name = \"UR3\"", "name = \"mine\"", 1);
    let folder = folder(&text);
    let robot = read(folder.path(), "ur3.urdf").unwrap();
    let used = robot.description.arm.as_ref().unwrap();
    assert_eq!(used.recognition, Recognition::Own);
    assert_eq!(robot.description.arm_name, "mine");
    // Another URDF in the same folder is not that arm's own.
    let urdf = folder.path().join("ur3.urdf");
    std::fs::copy(urdf, folder.path().join("other.urdf")).unwrap();
    let robot = read(folder.path(), "other.urdf").unwrap();
    let used = robot.description.arm.as_ref().unwrap();
    assert_eq!(
        (used.recognition, used.arm.key.as_str()),
        (Recognition::Lengths, "ur3")
    );
    let note = "arm data: ur3 (models/ur3/arm.toml), recognised by its lengths";
    assert!(
        robot.description.notes.iter().any(|each| each == note),
        "{:?}",
        robot.description.notes
    );
}

#[test]
fn data_that_contradict_their_own_urdf_are_refused() {
    let folder = folder(&UR3.replacen("a2_m = -0.24365", "a2_m = -0.25365", 1));
    let finding = read(folder.path(), "ur3.urdf").unwrap_err();
    says(
        &finding,
        "geometry",
        &["differ", "10.00 mm", "a2 -0.243650"],
    );
}
