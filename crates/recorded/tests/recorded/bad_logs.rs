//! Logs with something wrong: each is said, and nothing is guessed.

use needlebench_input::Finding;
use needlebench_recorded::{
    AngleUnit, LogKind, ReadOptions, RecordedRun, TimeUnit, arm_fits, read_log,
};
use needlebench_scenario::LogColumns;

use crate::common::{Sheet, read_text, shipped, shipped_text};

fn sheet() -> Sheet {
    Sheet::of(&shipped_text())
}

fn refused(text: &str) -> Finding {
    let findings = read_text(text, &ReadOptions::default()).unwrap_err();
    findings.into_iter().next().unwrap()
}

fn hint(finding: &Finding) -> &str {
    finding.hint.as_deref().unwrap_or("")
}

fn same(a: &RecordedRun, b: &RecordedRun) {
    assert_eq!(a.len(), b.len());
    for (a, b) in a.actual_q.iter().zip(&b.actual_q) {
        assert!((a - b).amax() < 1e-12);
    }
    for (a, b) in a.time_s.iter().zip(&b.time_s) {
        assert!((a - b).abs() < 1e-6);
    }
}

#[test]
fn degrees_are_found_and_read_when_said() {
    let mut sheet = sheet();
    let angles = [
        "target_q_",
        "target_qd_",
        "target_qdd_",
        "actual_q_",
        "actual_qd_",
    ];
    sheet.change(&angles, f64::to_degrees);
    let finding = refused(&sheet.text());
    assert!(hint(&finding).contains("--angle-unit deg"), "{finding}");
    assert!(finding.line.is_some());
    let options = ReadOptions {
        angle: Some(AngleUnit::Degrees),
        ..ReadOptions::default()
    };
    let whole = read_log(&shipped(), &ReadOptions::default()).unwrap();
    same(&read_text(&sheet.text(), &options).unwrap(), &whole);
}

#[test]
fn degrees_of_angles_alone_are_found_by_their_speeds() {
    let mut sheet = sheet();
    // Small angles, which could be radians.
    sheet.change(&["target_q_", "actual_q_"], |q| {
        (q.to_degrees() / 100.0) % 6.0
    });
    let finding = refused(&sheet.text());
    assert!(finding.message.contains("times as fast"), "{finding}");
}

#[test]
fn milliseconds_are_found_and_read_when_said() {
    let mut sheet = sheet();
    sheet.change(&["timestamp"], |t| (t * 1e3).round());
    let finding = refused(&sheet.text());
    assert!(hint(&finding).contains("--time-unit ms"), "{finding}");
    let options = ReadOptions {
        time: Some(TimeUnit::Milliseconds),
        ..ReadOptions::default()
    };
    let whole = read_log(&shipped(), &ReadOptions::default()).unwrap();
    same(&read_text(&sheet.text(), &options).unwrap(), &whole);
    // Said wrongly, the motion itself objects.
    let findings = read_text(&shipped_text(), &options).unwrap_err();
    assert!(
        findings[0].message.contains("times as fast"),
        "{}",
        findings[0]
    );
}

#[test]
fn semicolons_with_decimal_commas_are_read_and_said() {
    let text = shipped_text().replace(',', ";").replace('.', ",");
    let run = read_text(&text, &ReadOptions::default()).unwrap();
    same(
        &run,
        &read_log(&shipped(), &ReadOptions::default()).unwrap(),
    );
    assert!(run.notes[0].contains("semicolons"), "{:?}", run.notes);
}

#[test]
fn blanks_of_the_rtde_recorder_are_read() {
    let text = shipped_text().replace(',', " ");
    let run = read_text(&text, &ReadOptions::default()).unwrap();
    same(
        &run,
        &read_log(&shipped(), &ReadOptions::default()).unwrap(),
    );
}

#[test]
fn a_gap_ends_a_stretch() {
    let mut sheet = sheet();
    sheet.rows.drain(300..340);
    let run = read_text(&sheet.text(), &ReadOptions::default()).unwrap();
    assert_eq!(run.stretches, [0..300, 300..848]);
    assert!(
        run.notes[0].contains("1 gap in the clock"),
        "{:?}",
        run.notes
    );
    assert!(run.notes[0].contains("line 302"), "{:?}", run.notes);
}

#[test]
fn two_clocks_are_refused() {
    let mut jump = sheet();
    let time = jump.column("timestamp");
    for row in &mut jump.rows[400..] {
        row[time] = (row[time].parse::<f64>().unwrap() + 1.6e9).to_string();
    }
    let finding = refused(&jump.text());
    assert!(finding.message.contains("jumps"), "{finding}");
    assert_eq!(finding.line, Some(402));
    let mut back = sheet();
    back.rows.rotate_left(400);
    let finding = refused(&back.text());
    assert!(finding.message.contains("goes back"), "{finding}");
    let mut two = sheet();
    two.names[1] = "time".to_owned();
    let finding = refused(&two.text());
    assert!(finding.message.contains("2 clocks"), "{finding}");
    let mut slow = sheet();
    slow.change(&["timestamp"], |t| 1_550_000.0 + (t - 1_550_000.0) * 1.3);
    let finding = refused(&slow.text());
    assert!(hint(&finding).contains("two clocks"), "{finding}");
}

#[test]
fn what_is_cut_off_is_left_out_and_said() {
    let text = shipped_text();
    let cut = &text[..text.len() - 300];
    let run = read_text(cut, &ReadOptions::default()).unwrap();
    assert_eq!(run.len(), 887);
    assert!(
        run.notes[0].contains("line 889, the last one"),
        "{:?}",
        run.notes
    );
    // A line that is short in the middle is no cut.
    let mut sheet = sheet();
    sheet.rows[100].truncate(50);
    let finding = refused(&sheet.text());
    assert!(finding.message.contains("50 values"), "{finding}");
    assert_eq!(finding.line, Some(102));
}

#[test]
fn numbers_that_are_none_are_left_out_and_said() {
    let mut sheet = sheet();
    let (current, q) = (sheet.column("actual_current_2"), sheet.column("actual_q_0"));
    sheet.rows[10][current] = "nan".to_owned();
    sheet.rows[20][q] = "inf".to_owned();
    sheet.rows[30][q] = String::new();
    let run = read_text(&sheet.text(), &ReadOptions::default()).unwrap();
    assert_eq!(run.len(), 885);
    assert!(
        run.notes[0].starts_with("3 of 888 rows left out"),
        "{:?}",
        run.notes
    );
    assert!(run.notes[0].contains("line 12"), "{:?}", run.notes);
    sheet.rows[40][q] = "12a".to_owned();
    let finding = refused(&sheet.text());
    assert_eq!(
        (finding.line, finding.key.as_deref()),
        (Some(42), Some("actual_q_0"))
    );
}

#[test]
fn a_column_without_numbers_counts_as_missing() {
    let mut sheet = sheet();
    sheet.change(&["target_moment_"], |_| f64::NAN);
    let run = read_text(&sheet.text(), &ReadOptions::default()).unwrap();
    assert_eq!((run.len(), run.target_moment_nm), (888, None));
    assert!(
        run.notes[0].contains("target_moment is not used"),
        "{:?}",
        run.notes
    );
}

#[test]
fn a_log_without_targets_says_what_it_is_good_for() {
    let mut sheet = sheet();
    sheet.without(&["target_"]);
    let run = read_text(&sheet.text(), &ReadOptions::default()).unwrap();
    assert!(run.target.is_none() && run.tcp.is_some());
    assert!(
        run.notes[0].contains("nothing to replay"),
        "{:?}",
        run.notes
    );
}

#[test]
fn rows_in_other_modes_are_cut_out_and_counted() {
    let mut sheet = sheet();
    let (mode, safety) = (sheet.column("robot_mode"), sheet.column("safety_mode"));
    for row in &mut sheet.rows[100..110] {
        row[mode] = "5".to_owned();
    }
    for row in &mut sheet.rows[200..230] {
        row[safety] = "3".to_owned();
    }
    let run = read_text(&sheet.text(), &ReadOptions::default()).unwrap();
    assert_eq!(run.len(), 848);
    assert_eq!(run.stretches, [0..100, 100..190, 190..848]);
    assert!(run.notes[0].starts_with("10 of 888 rows left out in which the robot was not running"));
    assert!(run.notes[1].starts_with("30 of 888 rows left out in a protective stop"));
}

#[test]
fn a_simulators_log_is_told() {
    let mut sheet = sheet();
    for joint in 0..6 {
        let (from, to) = (
            sheet.column(&format!("target_q_{joint}")),
            sheet.column(&format!("actual_q_{joint}")),
        );
        for row in &mut sheet.rows {
            row[to] = row[from].clone();
        }
    }
    // Whatever it says that it draws.
    for current_a in [0.0, 10.6] {
        sheet.change(&["actual_robot_current"], |_| current_a);
        let run = read_text(&sheet.text(), &ReadOptions::default()).unwrap();
        assert_eq!(run.kind, LogKind::Simulator);
        let told = |note: &String| {
            note.contains("equal the set-points bit for bit")
                && note.contains(&format!("{current_a} A in every row"))
        };
        assert!(run.notes.iter().any(told), "{:?}", run.notes);
    }
}

#[test]
fn a_simulator_with_noisy_encoders_is_told_by_its_power() {
    let mut sheet = sheet();
    sheet.change(&["actual_robot_current"], |_| 10.6);
    let kind = |sheet: &Sheet| {
        read_text(&sheet.text(), &ReadOptions::default())
            .unwrap()
            .kind
    };
    // One sign alone may be a column that was filled in.
    assert_eq!(kind(&sheet), LogKind::Arm);
    for joint in 0..6 {
        let (from, to) = (
            sheet.column(&format!("target_current_{joint}")),
            sheet.column(&format!("actual_current_{joint}")),
        );
        for row in &mut sheet.rows {
            row[to] = row[from].clone();
        }
    }
    assert_eq!(kind(&sheet), LogKind::Simulator);
}

#[test]
fn columns_of_other_names_are_read_by_a_table() {
    let mut sheet = sheet();
    sheet.change(&["actual_q_", "target_q_"], f64::to_degrees);
    for name in &mut sheet.names {
        *name = match name.as_str() {
            "timestamp" => "clock".to_owned(),
            _ if name.starts_with("actual_q_") => name.replace("actual_q_", "m"),
            _ if name.starts_with("target_q_") => name.replace("target_q_", "s"),
            _ => format!("x_{name}"),
        };
    }
    let finding = refused(&sheet.text());
    assert!(hint(&finding).contains("--columns"), "{finding}");
    let list = |prefix: &str| {
        let names: Vec<String> = (0..6).map(|joint| format!("\"{prefix}{joint}\"")).collect();
        names.join(", ")
    };
    let map = format!(
        "time = {{ column = \"clock\", unit = \"s\" }}\n\
         actual_q = {{ columns = [{}], unit = \"deg\" }}\n\
         target_q = {{ columns = [{}], unit = \"deg\" }}\n",
        list("m"),
        list("s")
    );
    let options = |map: String| ReadOptions {
        columns: Some(LogColumns::parse("map.toml".to_owned(), map).unwrap()),
        ..ReadOptions::default()
    };
    let run = read_text(&sheet.text(), &options(map.clone())).unwrap();
    same(
        &run,
        &read_log(&shipped(), &ReadOptions::default()).unwrap(),
    );
    assert_eq!(run.notes.len(), 2, "{:?}", run.notes);
    // Slopes of the set-points are their speeds.
    let whole = read_log(&shipped(), &ReadOptions::default()).unwrap();
    let (own, given) = (run.target.unwrap(), whole.target.unwrap());
    let rms = own
        .iter()
        .zip(&given)
        .map(|(a, b)| (a.velocity - b.velocity).norm_squared());
    let rms = (rms.sum::<f64>() / 888.0).sqrt();
    assert!(rms < 0.05, "{rms}");
    let findings = read_text(&sheet.text(), &options(map.replace("m3", "m9"))).unwrap_err();
    assert_eq!(findings[0].line, Some(2), "{}", findings[0]);
}

#[test]
fn another_arms_log_is_not_this_arms() {
    let run = read_log(&shipped(), &ReadOptions::default()).unwrap();
    let fits = arm_fits(&run);
    let of = |arm: &str| fits.iter().find(|fit| fit.arm == arm).unwrap().rms_m;
    assert!(of("UR3") > 30.0 * of("UR3e"));
}

#[test]
fn what_is_no_log_is_refused() {
    for text in ["", "a,b\n1,2\n", "\u{0}\u{1}\n"] {
        read_text(text, &ReadOptions::default()).unwrap_err();
    }
    let text = shipped_text();
    let few: Vec<&str> = text.lines().take(8).collect();
    let few = few.join("\n") + "\n";
    assert!(refused(&few).message.contains("too few"));
    let missing = read_log("nowhere.csv".as_ref(), &ReadOptions::default()).unwrap_err();
    assert!(missing[0].message.contains("cannot read"), "{}", missing[0]);
}
