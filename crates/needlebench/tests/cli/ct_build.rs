//! `needlebench ct build`, and runs that begin with a scan.

use std::fs;

use crate::support::{Bench, Json, has_keys, holds, numbers, workspace};

/// A chest of coarse pixels, with markers, lesions and a robot: about a tenth of a hospital's.
const SCAN: &str =
    "ct synth s.toml --out ct --markers ct-sphere --pixels 224 --preset thick-overlap --no-labels";

fn suite() -> String {
    fs::read_to_string(workspace().join("scenarios/supine_suite.toml")).unwrap()
}

/// A bench with a scan of the suite's patient.
fn scanned() -> Bench {
    let bench = Bench::with_scenario(&suite());
    bench.run(SCAN).exits_with(0);
    bench
}

/// Of the phantom: a little beside the middle of a lesion.
const LESION: &str = "nodule=-107,10,35";

#[test]
fn a_scan_becomes_a_patient_that_can_be_run() {
    let bench = scanned();
    let arguments = format!(
        "ct build ct/ct.nii.gz --out patient --lesion {LESION} --thickness-mm 5 --markers ct/marker_list.toml \
         --room s.toml"
    );
    let made = bench.run(format!("{arguments} --json"));
    let made = made.exits_with(0).json();
    has_keys(&made, "schema_version ok folder scenario report set_aside");
    let report = bench.read_json("patient/report.json");
    assert_eq!(made["report"], report);
    let truth = bench.read_json("ct/truth.json");

    // Every surface is there; the check below reads them.
    let names: Vec<&str> = report["surfaces"]
        .list()
        .iter()
        .map(|each| each["name"].word())
        .collect();
    for name in ["skin", "lung_left", "lung_right", "bone", "nodule"] {
        assert!(names.contains(&name), "{names:?}");
    }
    // The middle of the lesion, against the phantom's.
    let seen = numbers(&report["targets"][0]["center_m"]);
    let lesions = truth["lesions"].list();
    let real = lesions
        .iter()
        .find(|each| each["name"] == "pleural_based")
        .unwrap();
    for (seen, real) in seen.iter().zip(numbers(&real["center_m"])) {
        assert!((seen - real).abs() < 0.3e-3, "{seen} {real}");
    }
    // All markers, each the right one, and the robot's place to what touching them leaves.
    let registered = report["registration"]["markers"].list();
    assert_eq!(registered.len(), 8);
    let found = report["markers"]["found"].list();
    for marker in registered {
        let place = numbers(
            &found[usize::try_from(marker["detected"].as_u64().unwrap()).unwrap()]["center_m"],
        );
        let markers = truth["markers"].list();
        let real = markers
            .iter()
            .find(|each| each["name"] == marker["name"])
            .unwrap();
        for (seen, real) in place.iter().zip(numbers(&real["sphere_center_m"])) {
            assert!((seen - real).abs() < 0.15e-3, "{marker} {seen} {real}");
        }
    }
    let target = &report["targets"][0]["registration"];
    let rms_m = target["rms_m"].number();
    let matrix: Vec<Vec<f64>> = truth["robot_from_ct"].list().iter().map(numbers).collect();
    let off: f64 = numbers(&target["at_m"])
        .iter()
        .enumerate()
        .map(|(row, at)| {
            let place = matrix[row][3] + (0..3).map(|k| matrix[row][k] * seen[k]).sum::<f64>();
            (at - place).powi(2)
        })
        .sum();
    assert!(off.sqrt() < 4.0 * rms_m, "{off} {rms_m}");

    everything_is_in_the_overview(&report);

    // The scenario is taken as it is.
    let checked = bench.run("check patient/scenario.toml --json").json();
    let findings = checked.to_string();
    assert!(!findings.contains("phantom.parts"), "{findings}");
    // Pictures are left out with --json; the words say where the errors come from.
    let words = bench.run(&arguments).exits_with(0).stdout;
    holds(
        &words,
        [
            "FRE",
            "does not predict the TRE",
            "TRE",
            "needlebench check",
            "HU and shape",
            "heart, great vessels",
            "patient/slices/overview.png",
        ],
    );
    let picture = fs::read(bench.path("patient/slices/overview.png")).unwrap();
    assert!(picture.starts_with(b"\x89PNG"));
    a_room_that_is_not_the_markers_is_refused(&bench, &arguments);
    bench.run(&arguments).exits_with(0);
    nothing_outlives_its_build(&bench, &arguments);
}

/// What was found with its volume and how accurate it is, what was not, and what stands for it.
fn everything_is_in_the_overview(report: &serde_json::Value) {
    let overview = report["overview"].list();
    let row = |name: &str| {
        let mut rows = overview.iter().filter(|row| row["name"] == name);
        rows.next().unwrap_or_else(|| panic!("no {name}"))
    };
    for surface in report["surfaces"].list() {
        let found = row(surface["name"].word());
        let of_lesion = surface["tissue"] == "lesion";
        // Where the round field of view does not show the couch.
        let of_nothing = surface["name"] == "assumed_couch";
        if !of_lesion {
            assert_eq!(found["volume_m3"], surface["volume_m3"]);
        }
        if of_nothing {
            assert!(found["accuracy"].is_null(), "{found}");
        } else if !of_lesion {
            let p99_m = &surface["distance_from_voxels"]["p99_m"];
            assert_eq!(found["accuracy"]["surface_p99_m"], *p99_m);
        }
        let source = if of_lesion {
            "seed_and_hu"
        } else if of_nothing {
            "assumed"
        } else {
            "hu_and_shape"
        };
        assert_eq!(found["source"], source, "{found}");
    }
    assert_eq!(row("mediastinum")["source"], "assumed");
    assert_eq!(row("intercostal_vessels")["source"], "modelled");
    assert_eq!(row("abdominal")["source"], "not_found");
    let tre_m = &report["targets"][0]["registration"]["rms_m"];
    assert_eq!(row("markers")["accuracy"]["tre_rms_m"], *tre_m);
    // The sides at which notes say that the body is cut.
    let ends = row("field_of_view")["unknown"].word();
    let notes = report["remarks"].to_string();
    for side in ["left", "right", "anterior", "posterior"] {
        let is_cut = notes.contains(&format!("cuts the body on its {side} side"));
        assert_eq!(ends.contains(side), is_cut, "{ends}: {notes}");
    }
    assert!(ends.starts_with("skin at both ends"), "{ends}");
}

#[test]
fn the_patient_lies_as_in_the_scan() {
    let bench = Bench::with_scenario(PRONE);
    let synth = "ct synth s.toml --out ct --format dicom --pixels 192 --preset thick --no-labels";
    bench.run(synth).exits_with(0);
    let said = bench.run("ct info ct/dicom").exits_with(0).stdout;
    holds(&said, ["prone, head first (HFP)"]);
    let built = |more: &str| {
        bench.run(format!(
            "ct build ct/dicom --out patient --no-pictures {more}"
        ))
    };
    let said = built("").exits_with(0).stdout;
    holds(&said, ["lies prone as in the scan"]);
    // On the couch that they lie on in the scan.
    assert!(!said.contains(LEFT_OUT), "{said}");
    holds(&bench.text("patient/scenario.toml"), ["name = \"couch\""]);
    holds(
        &bench.text("patient/scenario.toml"),
        ["posture = \"prone\""],
    );
    let said = built("--patient-position left-lateral")
        .exits_with(0)
        .stdout;
    holds(&said, ["--patient-position left-lateral is taken", "(HFP)"]);
    holds(&said, [LEFT_OUT]);
    assert!(
        !bench
            .text("patient/scenario.toml")
            .contains("name = \"couch\"")
    );
    // The folder is whole without it.
    let routes = "ct routes patient --target 70,0,100 --no-robot --directions 100 --no-pictures";
    let found = bench.run(routes);
    assert!(found.stdout.contains("routes.json"), "{}", found.stderr);
    holds(
        &bench.text("patient/scenario.toml"),
        ["posture = \"left-lateral\""],
    );
    // Towards a gantry at the other end of the table.
    let room = PRONE.replace(
        "[table]",
        "[gantry]\nisocentre_mm = [-1200, 0, 900]\n\n[table]",
    );
    bench.write("room.toml", room);
    let said = built("--room room.toml").exits_with(0).stdout;
    holds(&said, ["the patient is turned"]);
    holds(&bench.text("patient/scenario.toml"), ["head_yaw_deg = 180"]);
}

/// What is said of a couch that is not under the patient.
const LEFT_OUT: &str = "the couch of the scan is not under the patient";

const PRONE: &str = r#"
name = "prone"

[robot]
urdf = "ur3"
base_position_mm = [-280, 350, 1050]
base_rpy_deg = [0, 0, 270]

[tool]
urdf = "perpendicular"

[phantom]
posture = "prone"

[table]
center_mm = [-300, 0]
top_height_mm = 780

[[goals]]
lesion = "pleural_based"
"#;

/// What `check` would refuse is refused by the build that makes it, with its results kept.
fn a_room_that_is_not_the_markers_is_refused(bench: &Bench, arguments: &str) {
    let room = PRONE.replace("top_height_mm = 780", "top_height_mm = 380");
    bench.write("low.toml", room);
    let arguments = arguments.replace("--room s.toml", "--room low.toml");
    let refused = bench.run(&arguments).exits_with(2);
    holds(
        &refused.stderr,
        [
            "above the table without support",
            "table.top_height_mm",
            "--room",
        ],
    );
    holds(&refused.stdout, ["results: patient"]);
    let answer = bench
        .run(format!("{arguments} --json"))
        .exits_with(2)
        .json();
    assert_eq!(answer["ok"], false);
    assert_eq!(answer["findings"][0]["key"], "phantom.position_mm");
    assert!(answer["report"]["surfaces"].list().len() > 3);
}

/// Of a folder that is built once more, with markers elsewhere.
fn nothing_outlives_its_build(bench: &Bench, arguments: &str) {
    let plan = bench.text("patient/scenario.toml");
    bench.write("patient/planned.toml", &plan);
    bench.write("patient/room.toml", suite());
    bench.write("patient/session.toml", "build_sha256 = \"5f\"");
    bench.write("patient/routes.json", "{}");
    // The same build once more leaves what was made of it.
    let same = bench.run(format!("{arguments} --json")).json();
    assert!(same["set_aside"].is_null(), "{}", same["set_aside"]);
    // A scenario that was edited is kept.
    bench.write("patient/scenario.toml", format!("{plan}# mine\n"));
    let same = bench.run(format!("{arguments} --json")).json();
    assert_eq!(
        same["set_aside"]["names"],
        serde_json::json!(["scenario.toml"])
    );
    let mine = format!(
        "patient/{}/scenario.toml",
        same["set_aside"]["folder"].word()
    );
    assert!(bench.text(&mine).ends_with("# mine\n"));

    let markers = bench.text("ct/marker_list.toml");
    let moved = markers.replace("frame = \"base_link\"", "frame = \"base\"");
    assert_ne!(markers, moved);
    bench.write("moved.toml", moved);
    let arguments = arguments.replace("ct/marker_list.toml", "moved.toml");
    let made = bench
        .run(format!("{arguments} --json"))
        .exits_with(0)
        .json();
    let names: Vec<&str> = made["set_aside"]["names"]
        .list()
        .iter()
        .map(Json::word)
        .collect();
    let derived = [
        "report.json",
        "planned.toml",
        "routes.json",
        "scenario.toml",
        "session.toml",
        "slices",
    ];
    assert_eq!(names, derived);
    let former = format!("patient/{}", made["set_aside"]["folder"].word());
    assert_eq!(bench.text(&format!("{former}/planned.toml")), plan);
    assert!(bench.path("patient/room.toml").exists());

    // The former plan is of no use, wherever it is.
    bench.write("patient/planned.toml", &plan);
    let check = |file: &str| bench.run(format!("check {file}")).exits_with(2).stderr;
    let refused = check("patient/planned.toml");
    holds(
        &refused,
        ["phantom.build.sha256", "another build", "plan again"],
    );
    let refused = check(&format!("{former}/planned.toml"));
    holds(&refused, ["phantom.parts[0].file"]);

    // Nor are surfaces of another build, or what a build left that was interrupted.
    let bone = bench.path("patient/surfaces/bone.stl");
    let mut bytes = fs::read(&bone).unwrap();
    bytes[0] += 1;
    fs::write(&bone, bytes).unwrap();
    let refused = check("patient/scenario.toml");
    holds(
        &refused,
        ["bone.stl is not the surface", "build the folder again"],
    );
    fs::remove_file(bench.path("patient/report.json")).unwrap();
    let refused = check("patient/scenario.toml");
    holds(&refused, ["phantom.build.report", "interrupted"]);
}

#[test]
fn a_run_begins_with_a_scan_and_is_measured_against_the_true_lesion() {
    let text = fs::read_to_string(workspace().join("scenarios/ct/chest.toml")).unwrap();
    let text = text.replace(
        "slices = \"biopsy\"",
        "slices = \"thick_overlap\"\npixels = 224",
    );
    // One needle is enough here.
    let (first, rest) = text.split_once("# Second intercostal space").unwrap();
    let (_, rest) = rest.split_once("[planning]").unwrap();
    let bench = Bench::with_scenario(&format!("{first}[planning]{rest}"));
    let arguments = "run s.toml --engine rapier --no-page --no-pictures --quiet --json";
    let report = bench.run(arguments).exits_with(0).json();
    assert_eq!(report["verdict"], "pass");
    let criteria = report["criteria"].to_string();
    assert!(criteria.contains("max_true_target_error_mm"), "{criteria}");
    // What was planned for is what was found, not what is there.
    let scenario = bench.text("out/ct_chest/ct/scenario.toml");
    holds(&scenario, ["true_target_mm", "[[phantom.parts]]"]);
    assert!(!scenario.contains("[ct]"), "{scenario}");
    // It can be run again as it is, and gives the same.
    let again = bench.run("run out/ct_chest/ct/scenario.toml --engine rapier --no-page --no-pictures --quiet --json --out again");
    let again = again.exits_with(0).json();
    assert_eq!(again["criteria"], report["criteria"]);
}
