//! Recordings of breath, several together.

use std::fmt::Write;

use crate::support::{Bench, Json};

/// Two minutes of sin^4 at 10 Hz, with ends of expiration that are off in turn by 0 and 1 mm.
fn trace(period_s: f64, amplitude_mm: f64) -> String {
    let mut text = "time_s;x [mm];y [mm];z [mm]\n".to_owned();
    for count in 0..1201_u32 {
        let time_s = 0.1 * f64::from(count);
        let breaths = time_s / period_s;
        let off_mm = 0.5 - 0.5 * libm::cos(std::f64::consts::PI * breaths);
        let height_mm = off_mm + amplitude_mm * libm::sin(std::f64::consts::PI * breaths).powi(4);
        writeln!(text, "{time_s:.1};-50;{height_mm:.4};120").unwrap();
    }
    text
}

/// Six breaths of one amplitude: what holds over them is what holds of each.
#[test]
fn several_recordings_have_quantiles_and_coverage_within_eighty_columns() {
    let bench = Bench::new();
    let mut files = Vec::new();
    for (number, period_s) in [4.0, 4.5, 5.0, 5.5, 6.0, 6.5].into_iter().enumerate() {
        let name = format!("patient_{number}.csv");
        bench.write(&name, trace(period_s, 10.0));
        files.push(name);
    }
    let files = files.join(" ");
    let answer = bench.run(format!("breath {files} --json")).exits_with(0);
    let answer = answer.json();
    assert_eq!(answer["schema_version"], 1);
    assert_eq!(answer["recordings"].list().len(), 6);
    let over = &answer["over_recordings"];
    assert!(over["not_enough"].is_null());
    let of = |statistic: &str| {
        let all = over["quantiles"].list().iter();
        let mut found = all.filter(|each| each["statistic"] == statistic);
        found.next().unwrap()["p90"].number()
    };
    // The 90th percentile of six is half way between the fifth and the sixth.
    assert!((of("period_s") - 6.25).abs() < 0.02, "{}", of("period_s"));
    assert!((of("amplitude_m") - 0.01).abs() < 2e-4);
    for level in over["level"].list() {
        assert_eq!(level["coverage"].list().len(), 6);
        assert!(level["bound"].number() < 0.11, "1 mm of 10 mm at most");
    }
    let text = bench
        .run_with(&[("COLUMNS", Some("80"))], format!("breath {files}"))
        .exits_with(0)
        .stdout;
    assert!(text.contains("over 6 recordings"), "{text}");
    assert!(text.lines().all(|line| line.chars().count() <= 80));
}

#[test]
fn two_markers_of_a_recording_are_shown_and_not_put_together() {
    let bench = Bench::new();
    let files: Vec<String> = (1..=5)
        .map(|number| format!("marker_{number}.csv"))
        .collect();
    for name in &files {
        bench.write(name, trace(5.0, 10.0));
    }
    let answer = bench
        .run(format!("breath {}", files.join(" ")))
        .exits_with(0);
    answer.says([
        "marker_5.csv",
        "not enough to tell (marker_1.csv and marker_2.csv have their breaths at the same times",
    ]);
}
