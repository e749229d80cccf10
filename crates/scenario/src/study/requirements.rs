//! Criteria of studies that `[requirements]` may name.

use std::sync::LazyLock;

use schemars::{Schema, SchemaGenerator};

use super::criteria::StudyCriteria;
use crate::requirements::{keys, schema};

/// Criteria of studies.
static OF_STUDIES: LazyLock<Vec<String>> = LazyLock::new(|| {
    let mut all = keys(&StudyCriteria::default(), "");
    all.retain(|key| !["confidence", "working_configurations"].contains(&key.as_str()));
    // A table by configuration, which is empty by default.
    if !all.iter().any(|key| key == "min_success_rate") {
        all.push("min_success_rate".to_owned());
    }
    all.sort();
    all
});

pub(super) fn study_requirements(_: &mut SchemaGenerator) -> Schema {
    schema(&OF_STUDIES)
}

#[cfg(test)]
mod tests {
    use crate::requirements::{Requirements, requirement_of};
    use crate::scenario::parse_scenario;
    use crate::study::parse_study;

    fn scenario(requirements: &str) -> Result<Requirements, Vec<String>> {
        let text = format!("name = \"s\"\n[requirements]\n{requirements}\n");
        let found = parse_scenario("s.toml", &text);
        found
            .map(|scenario| scenario.requirements)
            .map_err(|findings| findings.iter().map(ToString::to_string).collect())
    }

    #[test]
    fn requirements_name_criteria_of_every_kind() {
        let found = scenario(
            "max_tip_position_error_mm = \"SRS-12: tip\"\n\
             \"min_clearance_mm.robot_phantom\" = \"SRS-3\"\n\
             max_repeatability_mm = \"SRS-4\"\n\
             \"engines.envelope.peak_tip_um\" = \"SRS-5\"\n\
             \"events.press.max_force_difference\" = \"SRS-6\"",
        );
        let found = found.unwrap();
        assert_eq!(found.len(), 5);
        let of = |criterion: &str| requirement_of(&found, criterion);
        assert_eq!(of("min_clearance_mm.robot_phantom"), Some("SRS-3"));
        assert_eq!(of("events.press[1].max_force_difference"), Some("SRS-6"));
        assert_eq!(of("allow_contact"), None);
        let study = parse_study(
            "s.toml",
            "name = \"s\"\nscenario = \"x.toml\"\n[[factors]]\nname = \"a\"\nkey = \"seed\"\nvalues = [1]\n\
             [requirements]\nmin_layouts_working = \"SRS-1\"\nmin_success_rate = \"SRS-2\"\n",
        );
        assert_eq!(study.unwrap().requirements.len(), 2);
    }

    #[test]
    fn criteria_that_there_are_not_are_refused_with_the_nearest() {
        for (text, parts) in [
            (
                "max_tip_positon_error_mm = \"a\"",
                ["s.toml:3:", "did you mean `max_tip_position_error_mm`?"],
            ),
            (
                "settling_band_mm = \"a\"",
                ["s.toml:3:", "settling_band_mm"],
            ),
            ("max_tip_rms_mm = 3", ["s.toml:3:", "max_tip_rms_mm"]),
        ] {
            let found = scenario(text).unwrap_err();
            assert_eq!(found.len(), 1, "{found:?}");
            for part in parts {
                assert!(found[0].contains(part), "{found:?}");
            }
        }
    }
}
