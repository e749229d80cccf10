//! `run`: the keys of its report, the files that it writes, and its exit status.

use std::collections::BTreeSet;
use std::sync::OnceLock;

use serde_json::Value;

use crate::support::{
    Bench, Json, SMALL, has_keys, holds, mujoco_is_ready, numbers, small_run, with_edit,
};

/// The report of `SMALL` in both engines.
fn report() -> &'static Value {
    static REPORT: OnceLock<Value> = OnceLock::new();
    REPORT.get_or_init(|| {
        mujoco_is_ready();
        let bench = Bench::with_scenario(SMALL);
        let answer = bench.run("run s.toml --json").exits_with(0);
        answer.json()
    })
}

fn configurations(report: &Value) -> &Vec<Value> {
    report["goals"][0]["configurations"].list()
}

#[test]
fn report_has_every_promised_key() {
    let report = report();
    has_keys(
        report,
        "schema_version scenario provenance goals verdict criteria",
    );
    assert_eq!(report["schema_version"], 1);
    assert_eq!(report["verdict"], "pass");
    assert_eq!(report["scenario"]["name"], "small");
    let goal = &report["goals"][0];
    assert_eq!(goal["name"], "pose");
    has_keys(&goal["recommended"], "label reason");
    for configuration in configurations(report) {
        has_keys(
            configuration,
            "label status rejections joints_rad roll_rad wrap ik_residual_m ik_residual_rad engines engine_difference clearance room",
        );
        assert_eq!(numbers(&configuration["joints_rad"]).len(), 6);
        assert_eq!(numbers(&configuration["wrap"]).len(), 6);
    }
}

#[test]
fn all_eight_configurations_are_reported_and_rejections_give_their_reason() {
    let labels: BTreeSet<&str> = configurations(report())
        .iter()
        .map(|each| each["label"].word())
        .collect();
    assert_eq!(labels.len(), 8);
    let mut rejected = 0;
    for configuration in configurations(report()) {
        let rejections = configuration["rejections"].list();
        let status = configuration["status"].word();
        assert_eq!(
            status,
            if rejections.is_empty() {
                "ok"
            } else {
                "rejected"
            }
        );
        for rejection in rejections {
            rejected += 1;
            has_keys(rejection, "rule value limit unit detail");
            assert_eq!(rejection["rule"], "needle_corridor");
            assert!(rejection["value"].as_f64() < rejection["limit"].as_f64());
        }
    }
    assert_eq!(rejected, 2);
}

#[test]
fn each_engine_reports_every_promised_metric() {
    for configuration in configurations(report()) {
        if configuration["status"] != "ok" {
            continue;
        }
        for engine in ["rapier", "mujoco"] {
            let measured = &configuration["engines"][engine];
            has_keys(
                measured,
                "tip_position_error_m needle_angle_error_rad guide_position_error_m lateral_error_m depth_error_m settling_time_s peak_tracking_error_m peak_torque_ratio contact",
            );
            assert_eq!(measured["contact"]["occurred"], false);
        }
        has_keys(
            &configuration["engine_difference"],
            "peak_tip_m settled_tip_m",
        );
    }
}

#[test]
fn clearances_name_pair_points_phase_and_time() {
    for configuration in configurations(report()) {
        let clearance = configuration["clearance"].as_object().unwrap();
        assert!(clearance["minimum_m"].is_number());
        for class in [
            "robot_phantom",
            "robot_table",
            "robot_mount",
            "self",
            "tool_phantom",
        ] {
            assert!(clearance.contains_key(class), "{class}");
        }
        // This cell has no gantry.
        assert!(!clearance.contains_key("robot_gantry"));
        for (_, found) in clearance.iter().filter(|(_, found)| found.is_object()) {
            // Sampled or attained, nothing is below what is proven.
            if let Some(proven_m) = found["certified_lower_bound_m"].as_f64() {
                assert!(proven_m <= found["minimum_m"].number());
            }
            has_keys(
                found,
                "minimum_m certified_lower_bound_m pair witness_points_m phase time_s",
            );
            assert_eq!(found["pair"].list().len(), 2);
            for point in found["witness_points_m"].list() {
                assert_eq!(numbers(point).len(), 3);
            }
        }
    }
}

#[test]
fn provenance_identifies_the_program_the_engines_and_every_input() {
    let provenance = &report()["provenance"];
    has_keys(
        provenance,
        "version git_revision source_sha256 arithmetic cargo_lock_sha256 engines inputs seed",
    );
    let names: Vec<&Value> = provenance["engines"]
        .list()
        .iter()
        .map(|engine| &engine["name"])
        .collect();
    assert_eq!(names, ["rapier", "mujoco"]);
    let inputs = provenance["inputs"].list();
    let roles: Vec<&Value> = inputs.iter().map(|input| &input["role"]).collect();
    assert_eq!(roles, ["scenario", "robot", "tool", "arm data", "phantom"]);
    for input in inputs {
        assert_eq!(input["sha256"].word().len(), 64);
    }
}

#[test]
fn results_folder_holds_what_the_report_lists() {
    let text = with_edit(SMALL, "pictures = false", "pictures = true");
    let bench = Bench::with_scenario(&text);
    let answer = bench.run("run s.toml --engine rapier --out results");
    let table = answer.exits_with(0).stdout;
    assert!(table.contains("PASS"), "{table}");
    let report = bench.read_json("results/small/report.json");
    let mut expected: BTreeSet<String> = [
        "report.json",
        "report.html",
        "junit.xml",
        "summary.md",
        "pose.budget.png",
        "pose.budget.svg",
        "pose.png",
        "pose.ranking.png",
        "pose.ranking.svg",
        "pose.room.png",
    ]
    .map(str::to_owned)
    .into();
    for configuration in configurations(&report) {
        let label = configuration["label"].word();
        assert!(table.contains(label), "{table}");
        for file in configuration["files"].list() {
            expected.insert(file.word().to_owned());
        }
    }
    // Eight pictures of the posture and of the room each, six recordings.
    assert_eq!(expected.len(), 10 + 16 + 6);
    let found: BTreeSet<String> = bench
        .tree("results/small")
        .iter()
        .map(|path| path.display().to_string())
        .collect();
    assert_eq!(found, expected);
    for path in bench.tree("results/small") {
        let bytes = bench.read(&format!("results/small/{}", path.display()));
        let is_png = path.extension().is_some_and(|extension| extension == "png");
        assert_eq!(
            bytes.starts_with(b"\x89PNG\r\n"),
            is_png,
            "{}",
            path.display()
        );
        let is_svg = path.extension().is_some_and(|extension| extension == "svg");
        assert_eq!(bytes.starts_with(b"<svg xmlns="), is_svg);
    }
}

#[test]
fn recording_has_a_row_per_period_and_a_number_in_every_column() {
    let bytes = small_run()
        .0
        .read("out/small/pose/Right-Up-Fold.rapier.csv");
    let text = String::from_utf8(bytes).unwrap();
    let mut lines = text.lines();
    let columns: Vec<&str> = lines.next().unwrap().split(',').collect();
    assert_eq!(columns[..2], ["time_s", "phase"]);
    let rows: Vec<Vec<&str>> = lines.map(|line| line.split(',').collect()).collect();
    // Motions of about 1.1 s, a row every 50 ms.
    assert!(rows.len() > 20, "{}", rows.len());
    let mut phases = Vec::new();
    for row in &rows {
        assert_eq!(row.len(), columns.len());
        phases.push(row[1]);
        for (column, word) in columns
            .iter()
            .zip(row)
            .filter(|(name, _)| **name != "phase")
        {
            let number: f64 = word.parse().unwrap();
            assert!(number.is_finite(), "{column}: {word}");
        }
    }
    phases.dedup();
    assert_eq!(phases, ["transfer", "approach", "hold"]);
}

#[test]
fn criterion_that_is_not_met_exits_with_1() {
    let bench = Bench::with_scenario(&with_edit(
        SMALL,
        "max_tip_position_error_mm = 1\n",
        "max_tip_position_error_mm = 1e-12\n",
    ));
    let answer = bench.run("run s.toml --engine rapier --json");
    let report = answer.exits_with(1).json();
    assert_eq!(report["verdict"], "fail");
    let missed: BTreeSet<&str> = report["criteria"]
        .list()
        .iter()
        .filter(|criterion| criterion["pass"] == false)
        .map(|criterion| criterion["criterion"].word())
        .collect();
    let expected = ["max_tip_position_error_mm", "min_working_configurations"];
    assert_eq!(missed, BTreeSet::from(expected));
    for configuration in configurations(&report) {
        assert_ne!(configuration["status"], "ok");
    }
    assert_eq!(report["goals"][0]["recommended"], Value::Null);
}

#[test]
fn clearance_that_is_not_met_exits_with_1_and_names_the_pair() {
    let criterion = "[criteria.min_clearance_mm]\nrobot_phantom = 500\n[recording]";
    let bench = Bench::with_scenario(&with_edit(SMALL, "[recording]", criterion));
    let answer = bench.run("run s.toml --engine rapier --json");
    let report = answer.exits_with(1).json();
    let missed = report["criteria"]
        .list()
        .iter()
        .find(|criterion| criterion["pass"] == false)
        .unwrap();
    assert_eq!(missed["criterion"], "min_clearance_mm.robot_phantom");
    assert_eq!(missed["limit"], 0.5);
    let detail = missed["detail"].word();
    assert!(detail.contains("skin"), "{detail}");
}

#[test]
fn outcome_that_was_not_expected_exits_with_1() {
    let expected = "[goals.expected]\nLeft-Up-Unfold = \"ok\"\n[motion]";
    let bench = Bench::with_scenario(&with_edit(SMALL, "[motion]", expected));
    let answer = bench.run("run s.toml --engine rapier --json");
    let report = answer.exits_with(1).json();
    let missed = report["criteria"]
        .list()
        .iter()
        .find(|criterion| criterion["pass"] == false)
        .unwrap();
    assert_eq!(missed["label"], "Left-Up-Unfold");
    assert_eq!(missed["detail"], "expected ok, got needle_corridor");
}

#[test]
fn rejection_that_was_expected_exits_with_0() {
    let expected = "[goals.expected]\nevery = \"ok\"\nLeft-Down-Unfold = \"needle_corridor\"\n\
                    Left-Up-Unfold = \"needle_corridor\"\n[motion]";
    let bench = Bench::with_scenario(&with_edit(SMALL, "[motion]", expected));
    bench.run("run s.toml --engine rapier").exits_with(0);
}

#[test]
fn chosen_engine_is_the_only_one_that_runs() {
    mujoco_is_ready();
    let bench = Bench::with_scenario(SMALL);
    let by_mujoco = bench.run("run s.toml --engine mujoco --json").exits_with(0);
    let by_rapier = &small_run().1;
    for (answer, engine, other) in [
        (by_rapier, "rapier", "mujoco"),
        (&by_mujoco, "mujoco", "rapier"),
    ] {
        let report = answer.json();
        let configuration = &configurations(&report)[0];
        assert!(configuration["engines"][engine].is_object());
        assert_eq!(configuration["engines"][other], Value::Null);
        assert_eq!(configuration["engine_difference"], Value::Null);
    }
}

#[test]
fn several_scenarios_come_in_one_document_and_the_worst_status_counts() {
    let bench = Bench::with_scenario(SMALL);
    let text = with_edit(SMALL, "name = \"small\"", "name = \"strict\"");
    let strict = with_edit(
        &text,
        "max_peak_torque_ratio = 1",
        "max_peak_torque_ratio = 0.01",
    );
    bench.write("strict.toml", strict);
    let answer = bench.run("run s.toml strict.toml --engine rapier --json --junit all.xml");
    let answer = answer.exits_with(1).json();
    has_keys(&answer, "schema_version results");
    let verdicts: Vec<&Value> = answer["results"]
        .list()
        .iter()
        .map(|result| &result["verdict"])
        .collect();
    assert_eq!(verdicts, ["pass", "fail"]);
    assert!(bench.path("out/small/report.json").is_file());
    assert!(bench.path("out/strict/report.json").is_file());
    let junit = bench.text("all.xml");
    holds(&junit, ["<testsuites", "small", "strict", "<failure"]);
    // Each case says how long it took, and what was judged against which limit.
    let cases = || junit.split("<testcase ").skip(1);
    assert_eq!(cases().count(), 18);
    for case in cases() {
        let open = case.split_once('>').unwrap().0;
        // What was skipped took none.
        let has_run = !case.contains("<skipped");
        assert_eq!(open.contains(" time=\""), has_run, "{case}");
        assert!(!has_run || case.contains("limit "), "{case}");
    }
}

#[test]
fn summary_is_appended_to_the_page_of_a_ci_step() {
    let bench = Bench::with_scenario(SMALL);
    bench.write("step.md", "before\n");
    let step = bench.path("step.md").display().to_string();
    let answer = bench.run_with(
        &[("GITHUB_STEP_SUMMARY", Some(&step))],
        "run s.toml --engine rapier",
    );
    answer.exits_with(0);
    let page = bench.text("step.md");
    let summary = bench.text("out/small/summary.md");
    assert!(page.starts_with("before\n") && page.contains(summary.trim()));
}

#[test]
fn robot_of_the_command_line_is_the_one_that_is_reported() {
    let bench = Bench::with_scenario(SMALL);
    bench.write(
        "arm.urdf",
        include_str!("../../../../models/ur3/ur3.urdf").replace("\"ur3\"", "\"mine\""),
    );
    let answer = bench.run("run s.toml --engine rapier --robot arm.urdf --json");
    let report = answer.exits_with(0).json();
    assert_eq!(report["provenance"]["inputs"][1]["file"], "arm.urdf");
    // The shipped numbers under another name give the shipped results.
    let shipped = small_run().1.json();
    assert_eq!(
        configurations(&report)[0]["engines"],
        configurations(&shipped)[0]["engines"]
    );
}

#[test]
fn reader_that_stops_reading_changes_neither_status_nor_files() {
    let text = with_edit(
        SMALL,
        "max_peak_torque_ratio = 1",
        "max_peak_torque_ratio = 0.01",
    );
    let bench = Bench::with_scenario(&text);
    for more in ["--json", ""] {
        let arguments = format!("run s.toml --engine rapier --junit j.xml {more}");
        let (reader, writer) = std::io::pipe().unwrap();
        drop(reader);
        let status = bench.command(&arguments).stdout(writer).status().unwrap();
        assert_eq!(status.code(), Some(1), "{more:?}");
        assert!(bench.path("j.xml").is_file());
        std::fs::remove_file(bench.path("j.xml")).unwrap();
    }
}

#[test]
fn quiet_run_writes_nothing_to_standard_error() {
    let bench = Bench::with_scenario(SMALL);
    let run = "run s.toml --engine rapier";
    let quiet = format!("{run} --quiet");
    assert_eq!(bench.run(&quiet).exits_with(0).stderr, "");
    // As does a job that has switched progress off.
    let off = [("NEEDLEBENCH_PROGRESS", Some("off"))];
    assert_eq!(bench.run_with(&off, run).exits_with(0).stderr, "");
    // In a log there are lines of progress alone.
    let lines = bench.run(run).exits_with(0).stderr;
    assert!(lines.lines().all(|line| line.starts_with('[')), "{lines}");
}
