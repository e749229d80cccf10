//! Programs on the virtual controller, from the command line: what they do is judged, and what they say is not.

use serde_json::Value;

use crate::support::{Bench, Json, workspace};

const QUIET: &str = "--engine rapier --no-pictures --no-page --quiet";

/// A folder with the scenario and the programs that ship.
fn bench() -> Bench {
    let bench = Bench::new();
    let folder = workspace().join("scenarios/robot");
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        bench.write(&name, std::fs::read(&path).unwrap());
    }
    bench
}

/// The report of a program with the first criterion that failed.
fn report(bench: &Bench, script: &str, more: &str, status: i32) -> Value {
    let command = format!("robot biopsy.toml --script {script} {QUIET} --json {more}");
    bench.run(command).exits_with(status).json()
}

fn program(report: &Value) -> &Value {
    &report["judged"]["program"]
}

fn failed(report: &Value) -> Vec<&str> {
    let all = report["criteria"].list().iter();
    all.filter(|each| each["pass"] == false)
        .map(|each| each["criterion"].word())
        .collect()
}

#[test]
fn a_good_program_passes_and_leaves_its_events() {
    let bench = bench();
    let command = format!("robot biopsy.toml --script biopsy.script {QUIET} --junit junit.xml");
    let answer = bench.run(command).exits_with(0);
    let first = answer.stdout.lines().next().unwrap();
    assert_eq!(
        first,
        "simulation: nothing real moves, no robot is connected"
    );
    answer.says(["PASS biopsy", "the program came to its end", "guide held"]);
    let events = bench.text("out/biopsy/events.csv");
    let lines: Vec<&str> = events.lines().collect();
    assert_eq!(lines[0], "time_s,line,event,text");
    assert!(
        lines[1].ends_with(",,output,digital output 0 on"),
        "{events}"
    );
    assert!(lines[2].ends_with(",27,message,guide held"), "{events}");
    assert!(
        lines[4].ends_with(",end,the program came to its end"),
        "{events}"
    );
    assert!(bench.text("junit.xml").contains("met: program_end"));
    // Another run of the same folder that is no program leaves none.
    bench.run(format!("run biopsy.toml {QUIET}")).exits_with(0);
    assert!(!bench.path("out/biopsy/events.csv").exists());
}

#[test]
fn two_runs_give_the_same_bytes() {
    let bench = bench();
    let made = ["--out one --jobs 1", "--out two --jobs 2"].map(|more| {
        report(&bench, "biopsy.script", more, 0);
        let folder = more.split(' ').nth(1).unwrap();
        let mut report = bench.read_json(&format!("{folder}/biopsy/report.json"));
        report.as_object_mut().unwrap().remove("timings");
        let recording = "pleural_lesion/Right-Up-Fold.rapier.csv";
        (
            report,
            bench.text(&format!("{folder}/biopsy/events.csv")),
            bench.text(&format!("{folder}/biopsy/{recording}")),
        )
    });
    assert!(made[0] == made[1]);
}

#[test]
fn a_way_through_the_patient_fails_with_its_line() {
    let bench = bench();
    let report = report(&bench, "through_the_patient.script", "", 1);
    let all = report["criteria"].list().iter();
    let tool = all.filter(|each| each["criterion"] == "min_clearance_mm.tool_phantom");
    let tool: Vec<&Value> = tool.collect();
    assert_eq!(tool.len(), 1);
    assert!(tool[0]["value"].as_f64().unwrap() < -30.0);
    assert!(tool[0]["detail"].word().contains("line 12 of the program"));
    let events = program(&report)["events"].list();
    let contact = events
        .iter()
        .find(|each| each["kind"] == "contact")
        .unwrap();
    assert_eq!(contact["line"], 12);
    assert_eq!(program(&report)["end"], "finished");
}

#[test]
fn a_program_that_ignores_a_failed_move_is_judged_by_the_arm() {
    let bench = bench();
    let report = report(&bench, "ignores_failed_move.script", "", 1);
    assert_eq!(program(&report)["end"], "finished");
    assert!(failed(&report).contains(&"guide_position"));
    let off_m = report["judged"]["holds"][0]["guide_off_m"]
        .as_f64()
        .unwrap();
    assert!(off_m > 0.2, "{off_m}");
}

#[test]
fn a_program_that_never_ends_is_incomplete() {
    let bench = bench();
    let report_at = report(&bench, "never_ends.script", "--time-limit 8", 1);
    assert_eq!(report_at["verdict"], "incomplete");
    let open = report_at["not_judged"].list();
    assert_eq!(open.len(), 1);
    assert_eq!(open[0]["criterion"], "program_end");
    assert_eq!(open[0]["reason"], "the program had not ended after 8 s");
    // As far as is asked for, it is evaluated.
    for until in ["hold", "8"] {
        let asked = report(&bench, "never_ends.script", &format!("--until {until}"), 0);
        assert_eq!(asked["verdict"], "pass");
        assert_eq!(program(&asked)["end"], "as_asked");
    }
    let longer = report(&bench, "never_ends.script", "--until 8 --time-limit 7", 1);
    assert_eq!(longer["verdict"], "incomplete");
}

#[test]
fn exceptions_and_protective_stops_fail_at_their_place() {
    let bench = bench();
    for (name, text, said) in [
        (
            "exception.script",
            "def p():\n  x = [1, 2]\n  sleep(0.1)\n  y = x[5]\nend\n",
            "runtime exception at line 4, column",
        ),
        (
            "stop.script",
            "def p():\n  set_tcp(p[0, 0, 0, 0, 0, 0])\n  speedl([0, 0, -0.5, 0, 0, 0], 1.0)\n  sleep(5)\nend\n",
            "protective stop at line 3, column 3",
        ),
        (
            "tcp.script",
            "def p():\n  x = get_actual_tcp_pose()\nend\n",
            "line 2, column 7: get_actual_tcp_pose: the program sets no TCP",
        ),
    ] {
        bench.write(name, text);
        let report = report(&bench, name, "", 1);
        let first = &report["criteria"][0];
        assert_eq!(first["criterion"], "program_end");
        assert!(first["detail"].word().contains(said), "{first}");
        assert_eq!(report["verdict"], "fail");
    }
}

#[test]
fn what_the_controller_believes_is_noted_and_changes_no_arm() {
    let bench = bench();
    let good = bench.text("biopsy.script");
    bench.write(
        "believing.script",
        good.replace("set_payload(0.2434", "set_payload(0.0"),
    );
    let [good, believing] =
        ["biopsy.script", "believing.script"].map(|script| report(&bench, script, "", 0));
    let notes = believing["notes"].list();
    let said = "payload 0.000 kg set, 0.243 kg carried";
    assert!(notes.iter().any(|each| each == said), "{notes:?}");
    let [good, believing] = [good, believing].map(|mut each| each["goals"].take());
    assert_eq!(good, believing);
}

#[test]
fn what_is_no_program_is_refused() {
    let bench = bench();
    bench.write("wrong.script", "def f():\n  movej([0, 1\nend\n");
    bench.write("unknown.script", "def f():\n  move_it(1)\nend\n");
    bench.write("coarse.toml", {
        let text = bench.text("biopsy.toml");
        format!("{text}\n[engines]\ntimestep_ms = 1.5\n")
    });
    for (arguments, said) in [
        (
            "biopsy.toml --script nothing.script",
            "cannot read the program",
        ),
        ("biopsy.toml --script wrong.script", "wrong.script:3:1"),
        (
            "biopsy.toml --script unknown.script",
            "compile_error_name_not_found:move_it:",
        ),
        (
            "biopsy.toml --script biopsy.script --until dawn",
            "`program`, `hold` or a time in s",
        ),
        (
            "biopsy.toml --script biopsy.script --time-limit 0",
            "above 0 and at most 1800, in s",
        ),
        (
            "biopsy.toml --script biopsy.script --goal other",
            "the scenario has no goal `other`",
        ),
        (
            "coarse.toml --script biopsy.script",
            "a cycle of the controller of 2 ms is no whole number of steps of 1.5 ms",
        ),
    ] {
        let answer = bench.run(format!("robot {arguments} {QUIET}"));
        answer.exits_with(2).complains([said]);
    }
}
