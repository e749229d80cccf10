//! Level and drift of a breath.

use std::fmt::Write as _;
use std::path::Path;

use nalgebra::Vector3;
use needlebench_input::Finding;
use needlebench_scenario::imperfections::{Breathing, Imperfections};
use needlebench_scenario::{Overrides, ResolvedScenario, resolve_scenario};
use tempfile::TempDir;

/// Rounding.
const ROUNDING: f64 = 1e-15;

fn imperfections(keys: &str) -> Result<Imperfections, Vec<Finding>> {
    Ok(resolve(keys, Path::new(""))?.imperfections.unwrap())
}

fn resolve(keys: &str, base: &Path) -> Result<ResolvedScenario, Vec<Finding>> {
    let text = format!(
        "name = \"x\"\n[robot]\nbase_position_mm = [-900, 0, 800]\n[tool]\nneedle_length_mm = 400\n\
         [phantom]\nmodel = \"male-p50\"\nrest_on_table = false\nposition_mm = [0, 0, 1000]\n\
         [[goals]]\nname = \"g\"\nlesion = \"pleural_based\"\nentry_direction_deg = [20, 0]\n\
         [imperfections.registration]\n[imperfections.skin_markers]\n[imperfections.breathing]\n{keys}\n"
    );
    resolve_scenario("x.toml", &text, base, &Overrides::default())
}

fn breathing(keys: &str) -> Breathing {
    imperfections(keys).unwrap().breathing.unwrap()
}

#[test]
fn level_and_drift_are_there_where_they_are_asked_for() {
    let usual = breathing("");
    assert_eq!(usual.phase_spread, Some(0.08));
    assert!(usual.level_sd.is_none() && usual.drift_m.is_none());

    let all = imperfections("since_image_s = 60\nheld_s = 20").unwrap();
    let held = all.breathing.unwrap();
    let level_sd = (0.045_f64.powi(2) + 0.102_f64.powi(2)).sqrt();
    assert!((held.level_sd.unwrap() - level_sd).abs() < ROUNDING);
    assert_eq!(held.phase_spread, Some(0.0));
    let drift_m = held.drift_m.unwrap();
    assert_eq!(drift_m[0], Vector3::zeros());
    assert!((drift_m[1] - Vector3::new(0.0, 0.0, 3e-3)).norm() < ROUNDING);
    // Markers are seen at their own phase.
    let markers = all.skin_markers.unwrap().breathing;
    assert_eq!(markers.phase_spread, Some(0.08));
    assert!(markers.level_sd.is_none() && markers.drift_m.is_none());

    let own = "since_image_s = 10\nlevel_at_once = 0.3\nlevel_per_s = 0.04\nheld_s = 5\n\
               skin_drift_mm_s = [0, 0.2, 0]\ntarget_drift_mm_s = [0, 0, 0.1]";
    let held = breathing(own);
    assert!((held.level_sd.unwrap() - 0.5).abs() < ROUNDING);
    let drift_m = held.drift_m.unwrap();
    assert!((drift_m[0] - Vector3::new(0.0, 1e-3, 0.0)).norm() < ROUNDING);
    assert!((drift_m[1] - Vector3::new(0.0, 0.0, 0.5e-3)).norm() < ROUNDING);

    let free = breathing("since_image_s = 60\nfree = true");
    assert!(free.phase_spread.is_none() && free.level_sd.is_some());
}

#[test]
fn keys_that_contradict_each_other_are_refused() {
    for (keys, key, says) in [
        (
            "level_at_once = 0.1",
            "level_at_once",
            "without `since_image_s`",
        ),
        (
            "level_per_s = 0.001",
            "level_per_s",
            "without `since_image_s`",
        ),
        (
            "skin_drift_mm_s = [0, 0, 0]",
            "skin_drift_mm_s",
            "without `held_s`",
        ),
        (
            "target_drift_mm_s = [0, 0, 0.1]",
            "target_drift_mm_s",
            "without `held_s`",
        ),
        (
            "recordings = [\"a.csv\"]",
            "recordings",
            "without `since_image_s`",
        ),
        (
            "since_image_s = 60\nrecordings = [\"a.csv\"]\nlevel_per_s = 0",
            "level_per_s",
            "contradicts `recordings`",
        ),
        ("since_image_s = 60\nrecordings = []", "recordings", "1"),
        (
            "held_s = 12\nfree = true",
            "held_s",
            "`held_s = 12` s contradicts",
        ),
        (
            "since_image_s = 60\nphase_spread = 0.08",
            "phase_spread",
            "contradicts `since_image_s`",
        ),
        ("since_image_s = -1", "since_image_s", "s"),
        (
            "since_image_s = 60\nlevel_at_once = 5",
            "level_at_once",
            "5",
        ),
        ("held_s = 300", "held_s", "300"),
        (
            "held_s = 10\ntarget_drift_mm_s = [0, 0, 15]",
            "target_drift_mm_s[2]",
            "mm/s",
        ),
    ] {
        let findings = imperfections(keys).expect_err(keys);
        assert_eq!(findings.len(), 1, "{findings:#?}");
        let (finding, wanted) = (&findings[0], format!("imperfections.breathing.{key}"));
        assert_eq!(
            finding.key.as_deref(),
            Some(wanted.as_str()),
            "{finding:#?}"
        );
        assert!(finding.message.contains(says), "{finding:#?}");
        assert!(
            finding.line.is_some() && finding.hint.is_some(),
            "{finding:#?}"
        );
    }
}

/// Breaths of exactly 5 s and of one amplitude upon a straight line, at 10 Hz: their ends are off by the line's slope
/// times the time, at 5, 15, 30, 60 and 120 s alike. `late_s` keeps recordings apart.
fn trace(amplitude_mm: f64, slope_mm_s: f64, late_s: f64) -> String {
    let mut text = "time_s,x_mm,y_mm,z_mm\n".to_owned();
    for sample in 0..1500 {
        let time_s = 0.1 * f64::from(sample);
        let sine = libm::sin(std::f64::consts::PI * (time_s - late_s) / 5.0);
        let along_mm = amplitude_mm * sine.powi(4) + slope_mm_s * time_s;
        let [x, y, z] = [0.36, -0.48, 0.8].map(|axis| 100.0 + axis * along_mm);
        let _ = writeln!(text, "{time_s:.1},{x:.6},{y:.6},{z:.6}");
    }
    text
}

/// So many of five recordings with amplitudes from 8 to 16 mm, whose level is off by 0.0005 to 0.0025 of them in a
/// second.
fn recordings(count: u8) -> (TempDir, String) {
    let folder = tempfile::tempdir().unwrap();
    let names: Vec<String> = (0..count)
        .map(|index| {
            let (name, at) = (format!("{index}.csv"), f64::from(index));
            let amplitude_mm = 8.0 + 2.0 * at;
            let slope_mm_s = 0.0005 * (at + 1.0) * amplitude_mm;
            let text = trace(amplitude_mm, slope_mm_s, at);
            std::fs::write(folder.path().join(&name), text).unwrap();
            format!("\"{name}\"")
        })
        .collect();
    let keys = format!("since_image_s = 60\nrecordings = [{}]\n", names.join(", "));
    (folder, keys)
}

/// Highest samples of a curved trace at 10 Hz, and what is rounded in the files.
const OF_SAMPLES: f64 = 0.01;

#[test]
fn recordings_give_level_amplitude_and_period() {
    let (folder, keys) = recordings(5);
    let resolved = resolve(&keys, folder.path()).unwrap();
    let all = resolved.imperfections.as_ref().unwrap();
    let breathing = all.breathing.unwrap();
    // Between the fourth and the fifth of five, at 0.6: 0.0023 of the amplitude in a second, and 15.2 mm.
    let level_sd = breathing.level_sd.unwrap();
    assert!((level_sd / 0.138 - 1.0).abs() < OF_SAMPLES, "{level_sd}");
    let skin_m = Vector3::new(0.0, -15.2e-3, 0.0);
    assert!((breathing.skin_m - skin_m).norm() < OF_SAMPLES * skin_m.norm());
    assert!((breathing.period_s - 5.0).abs() < OF_SAMPLES);
    assert_eq!(breathing.target_m, Vector3::new(0.0, -2e-3, -8e-3));
    assert!(breathing.is_level_measured);
    let markers = &all.skin_markers.as_ref().unwrap().breathing;
    assert_eq!(markers.skin_m, breathing.skin_m);
    assert!(
        resolved
            .notes
            .iter()
            .any(|note| note.contains("breath from 5 recordings"))
    );
    let read = all.sources.iter().filter(|source| {
        let is_csv = Path::new(&source.file)
            .extension()
            .is_some_and(|end| end == "csv");
        is_csv && source.sha256.len() == 64
    });
    assert_eq!(read.count(), 5);

    // What is given stays.
    let given = format!("{keys}skin_mm = [0, -5, 0]\nperiod_s = 4\n");
    let resolved = resolve(&given, folder.path()).unwrap();
    let breathing = resolved.imperfections.unwrap().breathing.unwrap();
    assert_eq!(breathing.skin_m, Vector3::new(0.0, -5e-3, 0.0));
    assert_eq!(breathing.period_s, 4.0);
    assert!((breathing.level_sd.unwrap() - level_sd).abs() < ROUNDING);
}

#[test]
fn four_recordings_are_not_enough_to_tell() {
    let (folder, keys) = recordings(4);
    let resolved = resolve(&keys, folder.path()).unwrap();
    let breathing = resolved.imperfections.as_ref().unwrap().breathing.unwrap();
    let usual = self::breathing("since_image_s = 60");
    assert_eq!(breathing, usual);
    assert!(!breathing.is_level_measured);
    let note = resolved
        .notes
        .iter()
        .find(|note| note.contains("not enough to tell"));
    assert!(note.is_some_and(|note| note.contains("4 recordings, and 5 are needed")));
}

#[test]
fn recordings_that_cannot_be_read_are_named() {
    let (folder, keys) = recordings(5);
    let gone = folder.path().join("3.csv");
    std::fs::remove_file(&gone).unwrap();
    let finding = resolve(&keys, folder.path()).unwrap_err().remove(0);
    let key = "imperfections.breathing.recordings[3]";
    assert_eq!(finding.key.as_deref(), Some(key), "{finding:#?}");
    assert!(finding.line.is_some() && finding.message.contains("3.csv"));

    // No unit: a scenario has no option for it.
    std::fs::write(&gone, trace(9.0, 0.01, 3.0).replace("_mm", "")).unwrap();
    let finding = resolve(&keys, folder.path()).unwrap_err().remove(0);
    assert!(finding.file.ends_with("3.csv"), "{finding:#?}");
    let hint = finding.hint.expect("a way out");
    assert!(hint.contains("x_mm") && !hint.contains("--"), "{hint}");
}

#[test]
fn levels_beyond_what_was_recorded_are_said_to_be_extrapolated() {
    let is_said = |keys: &str| {
        let notes = resolve(keys, Path::new("")).unwrap().notes;
        notes.iter().any(|note| note.contains("300 s extrapolated"))
    };
    assert!(is_said("since_image_s = 300") && !is_said("since_image_s = 120"));
}
