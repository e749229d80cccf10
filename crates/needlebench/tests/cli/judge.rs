//! Motions from files, judged by the program: its own come back, foreign ones fail by name.

use std::path::Path;

use serde_json::Value;

use crate::support::{Bench, Json, workspace};

/// A folder with the paper's scenario and a motion of straight joint-space lines.
fn bench() -> Bench {
    let bench = Bench::new();
    for path in [
        "scenarios/table3.toml",
        "guide/examples/straight_line.yaml",
        "guide/examples/to_the_needle.script",
    ] {
        let name = Path::new(path)
            .file_name()
            .unwrap()
            .to_string_lossy()
            .into_owned();
        bench.write(&name, std::fs::read(workspace().join(path)).unwrap());
    }
    bench
}

const QUIET: &str = "--engine rapier --no-pictures --no-page --quiet --json";

/// The report of a run, and the configuration that it recommends.
fn recommended(bench: &Bench) -> (Value, String) {
    let run: Value = bench
        .run(format!("run table3.toml --out ran {QUIET}"))
        .exits_with(0)
        .json();
    let label = run["goals"][0]["recommended"]["label"].word().to_owned();
    (run, label)
}

/// A configuration of the report's goal.
fn configuration<'r>(run: &'r Value, label: &str) -> &'r Value {
    let mut all = run["goals"][0]["configurations"].list().iter();
    all.find(|each| each["label"] == label).unwrap()
}

#[test]
fn exported_motions_are_judged_as_the_plan_was() {
    let bench = bench();
    let (run, label) = recommended(&bench);
    let planned = configuration(&run, &label);
    bench
        .run("export table3.toml --as trajectory --json")
        .exits_with(0);
    for extension in ["json", "yaml", "csv"] {
        let file = format!("out/table3/export/pose/{label}.trajectory.{extension}");
        let answer: Value = bench
            .run(format!(
                "judge table3.toml --motion {file} --out {extension} {QUIET}"
            ))
            .exits_with(0)
            .json();
        assert_eq!(answer["verdict"], run["verdict"]);
        let judged = &answer["goals"][0]["configurations"][0];
        assert_eq!(judged["label"], label.as_str());
        for key in [
            "clearance",
            "tip_rms",
            "self_clearance",
            "corridor_clearance",
        ] {
            let [known, found] = [planned, judged].map(|each| each["metrics"][key].as_f64());
            if let (Some(known), Some(found)) = (known, found) {
                assert!(
                    (known - found).abs() < 1e-3,
                    "{extension} {key} {known} {found}"
                );
            }
        }
        let own = &answer["judged"]["holds"][0]["plans"][0];
        assert_eq!(own["label"], label.as_str());
        assert_eq!(answer["judged"]["holds"][0]["turns"].list().len(), 6);
    }
}

#[test]
fn a_corner_fails_by_name_and_every_result_is_written() {
    let bench = bench();
    let answer = bench.run(
        "judge table3.toml --motion straight_line.yaml --engine rapier --no-pictures --quiet --junit junit.xml --record mcap",
    );
    let answer = answer.exits_with(1);
    let text = answer.stdout.as_str();
    for said in [
        "FAILED pose Right-Up-Fold joint_acceleration",
        "straight joint-space lines at constant speed",
        "extended to the scenario's hold",
        "needlebench's plan, same configuration (Right-Up-Fold)",
        "needle guide to skin",
    ] {
        // Lines are broken where they are long.
        let words: Vec<&str> = text.split_whitespace().collect();
        assert!(words.join(" ").contains(said), "{said}: {text}");
    }
    let junit = bench.text("junit.xml");
    assert!(junit.contains("joint_acceleration") && junit.contains("joint_speed"));
    let report = bench.read_json("out/table3/report.json");
    assert_eq!(report["judged"]["file"], "straight_line.yaml");
    assert!(bench.path("out/table3/report.html").exists());
    // The recording says whose motion it is.
    let recorded = "out/table3/pose/Right-Up-Fold.rapier.mcap";
    let bytes = std::fs::read(bench.path(recorded)).unwrap();
    let says = |text: &str| {
        bytes
            .windows(text.len())
            .any(|part| part == text.as_bytes())
    };
    assert!(says("motion_sha256") && says("straight_line.yaml"));
    let files = report["goals"][0]["configurations"][0]["files"].list();
    assert!(
        files
            .iter()
            .any(|name| name == "pose/Right-Up-Fold.rapier.mcap")
    );
}

#[test]
fn an_exported_program_is_judged_as_the_plan_was() {
    let bench = bench();
    let (run, label) = recommended(&bench);
    let planned = configuration(&run, &label);
    bench
        .run("export table3.toml --as urscript --out program.script")
        .exits_with(0);
    let answer: Value = bench
        .run(format!("judge table3.toml --motion program.script {QUIET}"))
        .json();
    assert_eq!(answer["judged"]["format"], "URScript program");
    let judged = &answer["goals"][0]["configurations"][0];
    assert_eq!(judged["label"], label.as_str());
    // The posture is the same to the digits of the program, and so is what is measured there.
    for key in ["clearance", "tip_rms", "corridor_clearance"] {
        let [known, found] = [planned, judged].map(|each| each["metrics"][key].as_f64());
        if let (Some(known), Some(found)) = (known, found) {
            assert!((known - found).abs() < 1e-3, "{key} {known} {found}");
        }
    }
    assert!(
        answer["judged"]["holds"][0]["guide_off_m"]
            .as_f64()
            .unwrap()
            < 1e-6
    );
}

/// One door is as the other.
#[test]
fn a_program_is_judged_as_by_robot() {
    let bench = bench();
    // An exception on the way: where the arm stands then is judged.
    bench.write("poses.script", "\nmovel(p[0.2, 0, 0.3, 0, 3, 0])\n");
    for (name, status) in [("to_the_needle.script", 0), ("poses.script", 1)] {
        let reports = [
            format!("judge table3.toml --motion {name} --out judged"),
            format!("robot table3.toml --script {name} --out robot"),
        ]
        .map(|command| {
            let mut report: Value = bench
                .run(format!("{command} {QUIET}"))
                .exits_with(status)
                .json();
            report.as_object_mut().unwrap().remove("timings");
            report
        });
        assert_eq!(reports[0], reports[1]);
    }
    // What stands in no report is refused.
    let free = "judge table3.toml --motion poses.script --free";
    bench.run(free).exits_with(2).complains([
        "line 2, column 1: movel: the program sets no TCP before this",
        "`needlebench robot` judges what a program did before",
    ]);
    bench
        .run("judge table3.toml --motion to_the_needle.script --free")
        .exits_with(0);
}

#[test]
fn a_program_is_judged_with_what_it_makes_its_controller_believe() {
    let bench = bench();
    let good = "judge table3.toml --motion to_the_needle.script --no-page --engine rapier --no-pictures --quiet --wide";
    let answer = bench.run(good);
    let words: Vec<&str> = answer.stdout.split_whitespace().collect();
    let text = words.join(" ");
    for said in [
        "URScript program",
        "Right-Up-Fold, roll 0.0 deg; deviation from the goal: joints 0.000 deg",
        "moves reach their acceleration in 0.14 s",
    ] {
        assert!(text.contains(said), "{said}: {text}");
    }
    assert!(!text.contains("payload"));
    let program = bench.text("to_the_needle.script");
    let believing = program
        .replace("set_payload(0.2434", "set_payload(0.0")
        .replace("set_tcp(p[0.07,", "set_tcp(p[0.08,");
    bench.write("believing.script", believing);
    let answer = bench.run(good.replace("to_the_needle", "believing"));
    let words: Vec<&str> = answer.stdout.split_whitespace().collect();
    let text = words.join(" ");
    for said in [
        "payload 0.000 kg set, 0.243 kg carried",
        "TCP 10.0 mm and 0.0 deg off the guide's exit",
    ] {
        assert!(text.contains(said), "{said}: {text}");
    }
}

#[test]
fn what_is_no_motion_of_this_scenario_is_refused() {
    let bench = bench();
    bench.write("program.urp", "x");
    bench.write("wrong.script", "def f():\n  movej([0, 1\nend\n");
    bench.write("deg.csv", "t,shoulder_pan_deg\n0,0\n");
    for (arguments, said) in [
        ("--motion nothing.json", "cannot read the motion"),
        (
            "--motion program.urp",
            "a motion is not read from a program (.urp)",
        ),
        (
            "--motion program.urp",
            "judge the .script that PolyScope saves",
        ),
        ("--motion nothing.script", "cannot read the program"),
        (
            "--motion wrong.script",
            "column 1: `,` between elements is missing before `end`",
        ),
        (
            "--motion to_the_needle.script --of actual",
            "--of is about logs, and this is a program",
        ),
        (
            "--motion to_the_needle.script --between lines",
            "--between is about points, and this is a program",
        ),
        (
            "--motion straight_line.yaml --tcp flange",
            "--tcp is about programs, and this is none",
        ),
        ("--motion deg.csv", "is in degrees"),
        (
            "--motion straight_line.yaml --goal other",
            "the scenario has no goal `other`",
        ),
        (
            "--motion straight_line.yaml --between cubics",
            "the points have no velocities",
        ),
        (
            "--motion straight_line.yaml --stretch 2",
            "--stretch is about logs",
        ),
        (
            "--motion straight_line.yaml --of actual",
            "--of is about logs",
        ),
    ] {
        let answer = bench
            .run(format!("judge table3.toml {arguments}"))
            .exits_with(2);
        answer.complains([said]);
    }
}

/// The answers of `ik`, and what a team's solver would have left out of them.
#[test]
fn answers_are_judged_against_the_complete_set() {
    let bench = bench();
    let known: Value = bench
        .run("ik table3.toml --goal pose --json")
        .exits_with(0)
        .json();
    let solutions: Vec<Value> = known["solutions"]
        .list()
        .iter()
        .map(|each| each["joints_rad"].clone())
        .collect();
    let write = |name: &str, solutions: &[Value]| {
        let question = serde_json::json!([{ "goal": "pose", "solutions": solutions }]);
        bench.write(name, question.to_string());
    };
    write("all.json", &solutions);
    write("some.json", &solutions[..6]);
    let answer = bench
        .run("judge table3.toml --answers all.json")
        .exits_with(0);
    assert!(
        answer
            .stdout
            .starts_with("PASS table3: 8 of 8 answers right, 8 of 8 solutions answered"),
        "{}",
        answer.stdout
    );
    let answer = bench
        .run("judge table3.toml --answers some.json --junit junit.xml --json")
        .exits_with(1);
    let report: Value = answer.json();
    assert_eq!(report["verdict"], "fail");
    let junit = bench.text("junit.xml");
    assert!(
        junit.contains("tests=\"8\" skipped=\"0\" failures=\"2\""),
        "{junit}"
    );
    bench
        .run("judge table3.toml --answers some.json --partial --junit junit.xml")
        .exits_with(0);
    assert!(
        bench
            .text("junit.xml")
            .contains("skipped=\"2\" failures=\"0\"")
    );
    assert!(!bench.path("out").exists());
    for (arguments, said) in [
        ("--answers nothing.csv", "cannot read the answers"),
        (
            "--answers all.json --goal other",
            "the scenario has no goal `other`",
        ),
        ("--answers all.json --engine rapier", "cannot be used with"),
        ("--answers all.json --tolerance 0", "above 0 and at most 1"),
        (
            "--motion straight_line.yaml --partial",
            "cannot be used with",
        ),
        ("", "--motion <FILE>"),
    ] {
        let answer = bench
            .run(format!("judge table3.toml {arguments}"))
            .exits_with(2);
        answer.complains([said]);
    }
}

#[test]
fn a_motion_to_no_goal_is_judged_by_its_clearances() {
    let bench = bench();
    let half = bench.text("straight_line.yaml");
    // Its last point left out, it ends in the air.
    let end = half.rfind("\n- positions").unwrap();
    bench.write("half.yaml", &half[..=end]);
    let quiet = "--engine rapier --no-pictures --no-page --quiet";
    bench
        .run(format!(
            "judge table3.toml --motion half.yaml --out held {quiet}"
        ))
        .exits_with(2)
        .complains(["stands at no goal", "--free"]);
    let answer = bench.run("judge table3.toml --motion half.yaml --free --junit junit.xml --json");
    let report: Value = answer.exits_with(1).json();
    let failed = report["criteria"].list().iter();
    let failed: Vec<&Value> = failed.filter(|each| each["pass"] == false).collect();
    assert_eq!(failed.len(), 1, "{failed:?}");
    assert_eq!(failed[0]["criterion"], "joint_acceleration");
    assert!(
        bench
            .text("junit.xml")
            .contains("min_clearance_mm.robot_phantom")
    );
    assert!(!bench.path("out").exists());
}
