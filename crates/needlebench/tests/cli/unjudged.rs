//! What was not judged never passes, and is said on the first screen.

use serde_json::Value;

use crate::support::{Bench, Json, SMALL, holds, with_edit, workspace};

/// The shipped arm with a camera that is drawn and has no collision shape.
fn with_camera(bench: &Bench) {
    let urdf = std::fs::read_to_string(workspace().join("models/ur3/ur3.urdf")).unwrap();
    let camera = r#"
      <link name="camera_link"><visual><geometry><box size="0.1 0.1 0.1"/></geometry></visual></link>
      <joint name="camera_joint" type="fixed"><parent link="wrist_3_link"/><child link="camera_link"/></joint>
    </robot>"#;
    bench.write("arm.urdf", urdf.replace("</robot>", camera));
}

#[test]
fn parts_without_a_shape_leave_their_classes_open() {
    let bench = Bench::with_scenario(&with_edit(SMALL, "[robot]", "[robot]\nurdf = \"arm.urdf\""));
    with_camera(&bench);
    let report = bench
        .run("run s.toml --engine rapier --json")
        .exits_with(1)
        .json();
    assert_eq!(report["verdict"], "incomplete");
    let open = report["not_judged"].list();
    let of_skin: Vec<_> = open
        .iter()
        .filter(|each| each["criterion"] == "min_clearance_mm.robot_phantom")
        .collect();
    assert!(!of_skin.is_empty(), "{open:?}");
    holds(
        of_skin[0]["reason"].word(),
        ["no collision shape", "camera_link"],
    );
    let passed = report["criteria"].list().iter();
    let passed = passed.filter(|each| each["criterion"] == "min_clearance_mm.robot_phantom");
    assert_eq!(passed.count(), 0);
}

#[test]
fn a_part_that_needs_no_shape_is_named_on_the_first_screen() {
    let stated = "[robot]\nurdf = \"arm.urdf\"\nshape.camera_link = \"none\"";
    let bench = Bench::with_scenario(&with_edit(SMALL, "[robot]", stated));
    with_camera(&bench);
    let answer = bench.run("run s.toml --engine rapier").exits_with(0);
    holds(
        &answer.stdout,
        ["PASS small", "without a collision shape", "camera_link"],
    );
    // A name that no link has is a slip.
    bench.write(
        "t.toml",
        with_edit(SMALL, "[robot]", "[robot]\nshape.camera_lnk = \"none\""),
    );
    let answer = bench.run("check t.toml").exits_with(2);
    holds(&answer.stderr, ["camera_lnk"]);
}

#[test]
fn an_arm_stripped_of_its_shapes_is_judged_by_what_is_known_of_it() {
    let urdf = std::fs::read_to_string(workspace().join("models/ur3/ur3.urdf")).unwrap();
    let mut bare = urdf;
    while let Some(start) = bare.find("<collision") {
        let end = start + bare[start..].find("</collision>").unwrap() + "</collision>".len();
        bare.replace_range(start..end, "");
    }
    let bench = Bench::with_scenario(&with_edit(
        SMALL,
        "[robot]",
        "[robot]\nurdf = \"bare.urdf\"",
    ));
    bench.write("bare.urdf", bare);
    bench.write("whole.toml", SMALL);
    let least = |scenario: &str| {
        let answer = bench.run(format!(
            "run {scenario} --engine rapier --json --out out_{scenario}"
        ));
        let report = answer.exits_with(0).json();
        let configurations = report["goals"][0]["configurations"].list().clone();
        let statuses: Vec<String> = configurations
            .iter()
            .map(|each| each["status"].word().to_owned())
            .collect();
        let clearances: Vec<f64> = configurations
            .iter()
            .filter_map(|each| each["clearance"]["minimum_m"].as_f64())
            .collect();
        (statuses, clearances)
    };
    let (bare, whole) = (least("s.toml"), least("whole.toml"));
    assert_eq!(bare.0, whole.0);
    for (own, known) in bare.1.iter().zip(&whole.1) {
        assert!((own - known).abs() < 1e-9, "{own} {known}");
    }
    let screen = bench
        .run("run s.toml --engine rapier --out said")
        .exits_with(0);
    let said = ["has no collision geometry", "are added to it"];
    holds(&screen.stdout, said);
    // Beside the verdict of every report, not at its end.
    let mut folders = std::fs::read_dir(bench.path("said")).unwrap();
    let folder = folders.find_map(|each| Some(each.ok()?.path()).filter(|path| path.is_dir()));
    let folder = folder.unwrap();
    let read = |file: &str| std::fs::read_to_string(folder.join(file)).unwrap();
    holds(read("summary.md").split("\n## ").next().unwrap(), said);
    assert_eq!(read("summary.md").matches(said[0]).count(), 7);
    let junit = bench.run("run s.toml --engine rapier --out said --junit said/junit.xml");
    junit.exits_with(0);
    let junit = std::fs::read_to_string(bench.path("said/junit.xml")).unwrap();
    let property = junit
        .split("<property ")
        .filter(|each| each.contains(said[0]));
    assert_eq!(property.count(), 7);
}

#[test]
fn what_engines_differ_by_takes_two_of_them() {
    let limit = "[criteria]\nmax_engine_difference_peak_mm = 1.0";
    let text = with_edit(SMALL, "[criteria]", limit);
    // The scenario's own choice leaves it open; the command's is said.
    let alone = with_edit(
        &text,
        "[engines.envelope]",
        "[engines]\nrun = [\"rapier\"]\n[engines.envelope]",
    );
    let bench = Bench::with_scenario(&alone);
    let report = bench.run("run s.toml --json").exits_with(1).json();
    assert_eq!(report["verdict"], "incomplete");
    assert_eq!(
        report["not_judged"][0]["criterion"],
        "max_engine_difference_peak_mm"
    );
    bench.write("t.toml", text);
    let answer = bench.run("run t.toml --engine rapier").exits_with(0);
    holds(
        &answer.stdout,
        ["rapier alone", "max_engine_difference_peak_mm"],
    );
}

/// A limit that nothing misses, for each criterion of the schema that has a number: `[key, value]`.
fn lenient_criteria() -> Vec<[String; 2]> {
    let bench = Bench::with_scenario(SMALL);
    let schema = bench.run("schema scenario").exits_with(0).json();
    let of = |name: &str| {
        schema["definitions"][name]["properties"]
            .as_object()
            .unwrap()
    };
    let limit = |key: &str, known: &Value| {
        let end = if key.starts_with("max") {
            "maximum"
        } else {
            "minimum"
        };
        let text = known.to_string();
        let from = text.find(&format!("\"{end}\":"))? + end.len() + 3;
        let until = text[from..].find([',', '}'])?;
        Some(text[from..][..until].to_owned())
    };
    let mut found = Vec::new();
    for (key, known) in of("CriteriaSection") {
        let is_limit = key.starts_with("max_") || key.starts_with("min_");
        if is_limit
            && key != "min_working_configurations"
            && let Some(value) = limit(key, known)
        {
            found.push([key.clone(), value]);
        }
    }
    for (class, known) in of("ClearanceCriteria") {
        let key = format!("min_clearance_mm.{class}");
        let value = limit(&key, known).unwrap();
        found.push([key, value]);
    }
    found
}

/// Whatever is taken away that a criterion needs, PASS means that it was judged, or that the first screen says that
/// the command left it out.
#[test]
fn no_criterion_passes_that_was_not_judged() {
    let criteria = lenient_criteria();
    assert!(criteria.len() > 20, "{criteria:?}");
    let own = (
        "[engines.envelope]",
        "[engines]\nrun = [\"rapier\"]\n[engines.envelope]",
    );
    let bare = ("[mount]\n", "");
    let empty = (
        "[table]\ncenter_mm = [300, -598]\ntop_height_mm = 763.5\n",
        "",
    );
    let ways: [(&str, &[(&str, &str)]); 4] = [
        (" --engine rapier", &[]),
        ("", &[own]),
        (" --engine rapier", &[bare, empty]),
        ("", &[own, bare]),
    ];
    let (start, end) = (
        SMALL.find("[criteria]").unwrap(),
        SMALL.find("[recording]").unwrap(),
    );
    let judged = |[key, value]: &[String; 2], (arguments, edits): &(&str, &[(&str, &str)])| {
        let own = format!("[criteria]\n{key} = {value}\n");
        let text = format!("{}{own}{}", &SMALL[..start], &SMALL[end..]);
        let text = edits
            .iter()
            .fold(text, |text, (from, to)| with_edit(&text, from, to));
        let bench = Bench::with_scenario(&text);
        let answer = bench.run(format!("run s.toml{arguments} --json --no-page --jobs 1"));
        if answer.status == Some(2) {
            holds(&answer.stderr, [key.as_str()]);
            return [0, 0];
        }
        let report = answer.json();
        if report["verdict"] != "pass" {
            return [0, 1];
        }
        let is_of = |each: &&Value| each["criterion"] == key.as_str();
        let judged = report["criteria"].list().iter().filter(is_of).count();
        let configurations = report["goals"][0]["configurations"].list().iter();
        let working = configurations.filter(|each| each["status"] == "ok").count();
        let notes = report["notes"].to_string();
        assert!(
            judged >= working.max(1) || notes.contains(key.as_str()),
            "{key}{arguments} {edits:?}: {judged} of {working} judged"
        );
        [1, 0]
    };
    let of_way = |way| {
        let all = criteria.iter().map(|criterion| judged(criterion, way));
        all.fold([0, 0], |sum, each| [sum[0] + each[0], sum[1] + each[1]])
    };
    // The last one to end otherwise.
    let counts: Vec<[usize; 2]> = std::thread::scope(|scope| {
        let ways = ways.iter().map(|way| scope.spawn(move || of_way(way)));
        let ways: Vec<_> = ways.collect();
        ways.into_iter().map(|way| way.join().unwrap()).collect()
    });
    let [passed, open] = [0, 1].map(|kind| counts.iter().map(|each| each[kind]).sum::<usize>());
    assert!(passed > 40 && open > 8, "{passed} {open}");
}

#[test]
fn a_study_whose_engine_carries_out_no_motion_has_no_answer() {
    // The servo does not come to rest with so much damping.
    let stiff =
        format!("{SMALL}[controller]\ndamping_nms_rad = [6000, 6000, 6000, 6000, 6000, 6000]\n");
    let bench = Bench::with_scenario(&stiff);
    bench.write(
        "study.toml",
        "name = \"broken\"\nscenario = \"s.toml\"\nmode = \"dynamic\"\nengines = [\"rapier\"]\nseed = 1\n\
         [sampling]\nsamples = 2\n[[factors]]\nname = \"along\"\nkey = \"phantom.position_mm[0]\"\n\
         range = [-5, 5]\nrelative = true\n",
    );
    let answer = bench
        .run("study study.toml --quiet --no-page")
        .exits_with(1);
    holds(
        &answer.stdout,
        [
            "INCOMPLETE",
            "no answer",
            "rapier could not execute",
            ", not evaluated",
        ],
    );
    assert!(!answer.stdout.contains("feasible in"), "{}", answer.stdout);
}

/// SMALL with a scan that ends at a plane of the patient.
fn cut_at(bench: &Bench, normal: &str, offset_mm: u32) {
    let cut = format!("\n[[phantom.cuts]]\nnormal = {normal}\noffset_mm = {offset_mm}\n");
    bench.write("s.toml", format!("{SMALL}{cut}"));
}

/// Labels of the configurations of a run's goal that are not rejected, with the number of criteria not evaluated.
fn moved(report: &Value) -> Vec<(&str, u64)> {
    let configurations = report["goals"][0]["configurations"].list().iter();
    let moved = configurations.filter(|each| each["status"] != "rejected");
    moved
        .map(|each| (each["label"].word(), each["not_judged"].as_u64().unwrap()))
        .collect()
}

/// Why a clearance is not evaluated, everywhere in these words.
const UNSEEN: &str = "where the scan ends, the unseen body may be nearer";

#[test]
fn clearances_near_a_cut_of_the_scan_are_left_open() {
    let bench = Bench::with_scenario(SMALL);
    // What is highest of the chest, under the tool, was not seen.
    cut_at(&bench, "[0.0, -1.0, 0.0]", 60);
    let report = bench
        .run("run s.toml --engine rapier --json")
        .exits_with(1)
        .json();
    assert_eq!(report["verdict"], "incomplete");
    assert!(report["goals"][0]["recommended"].is_null());
    assert!(moved(&report).iter().all(|(_, open)| *open > 0));
    let open = report["not_judged"].list();
    let (of_goal, of_configurations): (Vec<&Value>, Vec<&Value>) =
        open.iter().partition(|each| each["label"].is_null());
    assert_eq!(of_goal.len(), 1);
    holds(
        of_goal[0]["criterion"].word(),
        ["min_working_configurations"],
    );
    assert!(!of_configurations.is_empty());
    for each in of_configurations {
        holds(each["criterion"].word(), ["min_clearance_mm."]);
        assert_eq!(each["reason"], UNSEEN);
    }
    let answer = bench.run("run s.toml --engine rapier").exits_with(1);
    holds(&answer.stdout, ["INCOMPLETE", "not evaluated", UNSEEN]);
    // Before any motion, too.
    let answer = bench.run("check s.toml").exits_with(1);
    holds(
        &answer.stdout,
        ["0 of 8 configurations feasible", "not evaluated", UNSEEN],
    );
    // The patient's left side is far from all that moves.
    cut_at(&bench, "[1.0, 0.0, 0.0]", 100);
    bench.run("run s.toml --engine rapier").exits_with(0);
    bench.run("check s.toml").exits_with(0);
}

#[test]
fn what_is_open_near_a_cut_is_not_recommended() {
    let bench = Bench::with_scenario(SMALL);
    cut_at(&bench, "[0.0, -1.0, 0.0]", 80);
    let report = bench
        .run("run s.toml --engine rapier --json")
        .exits_with(1)
        .json();
    let moved = moved(&report);
    let known: Vec<&str> = moved
        .iter()
        .filter_map(|(label, open)| (*open == 0).then_some(*label))
        .collect();
    assert!(!known.is_empty() && known.len() < moved.len(), "{moved:?}");
    let goal = &report["goals"][0];
    let order = goal["ranking"]["order"].list().iter();
    assert!(order.map(Json::word).all(|label| known.contains(&label)));
    assert!(known.contains(&goal["recommended"]["label"].word()));
    // A study's rows of the same, in each mode that needs no engine: what is open is no success.
    for mode in ["static", "planned"] {
        bench.write(
            "study.toml",
            format!(
                "name = \"{mode}\"\nscenario = \"s.toml\"\nmode = \"{mode}\"\nseed = 1\n[sampling]\nsamples = 1\n\
                 [[factors]]\nname = \"along\"\nkey = \"phantom.position_mm[0]\"\nrange = [-0.001, 0.001]\n\
                 relative = true\n"
            ),
        );
        let study = bench
            .run("study study.toml --json --quiet --no-page")
            .json();
        let rows = study["overall"]["configurations"].list();
        let count = |key: &str| -> u64 { rows.iter().map(|row| row[key].as_u64().unwrap()).sum() };
        assert!(count("not_judged") > 0, "{mode}");
        assert!(count("ok") > 0 && count("ok") + count("not_judged") == moved.len() as u64);
        let details = study["overall"].to_string();
        holds(&details, ["scan_ends "]);
    }
}

#[test]
fn nothing_enters_through_a_cut_of_the_scan() {
    let bench = Bench::with_scenario(SMALL);
    cut_at(&bench, "[-1.0, 0.0, 0.0]", 100);
    let answer = bench.run("check s.toml").exits_with(2);
    holds(
        &answer.stderr,
        ["goals[0].flange_pose", "the entry is where the scan ends"],
    );
    cut_at(&bench, "[0.0, 0.0, 0.0]", 100);
    let answer = bench.run("check s.toml").exits_with(2);
    holds(&answer.stderr, ["phantom.cuts[0].normal", "no length"]);
}
