//! Level and drift of a breath.

use std::path::Path;

use nalgebra::Vector3;
use needlebench_input::Finding;
use needlebench_scenario::imperfections::{Breathing, Imperfections};
use needlebench_scenario::{Overrides, resolve_scenario};

/// Rounding.
const ROUNDING: f64 = 1e-15;

fn imperfections(keys: &str) -> Result<Imperfections, Vec<Finding>> {
    let text = format!(
        "name = \"x\"\n[robot]\nbase_position_mm = [-900, 0, 800]\n[tool]\nneedle_length_mm = 400\n\
         [phantom]\nmodel = \"male-p50\"\nrest_on_table = false\nposition_mm = [0, 0, 1000]\n\
         [[goals]]\nname = \"g\"\nlesion = \"pleural_based\"\nentry_direction_deg = [20, 0]\n\
         [imperfections.registration]\n[imperfections.skin_markers]\n[imperfections.breathing]\n{keys}\n"
    );
    let resolved = resolve_scenario("x.toml", &text, Path::new(""), &Overrides::default())?;
    Ok(resolved.imperfections.unwrap())
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
