//! Requirements that criteria stand for: the section `[requirements]` of scenarios and studies.

use std::collections::BTreeMap;
use std::sync::LazyLock;

use schemars::{Schema, SchemaGenerator, json_schema};
use serde::Serialize;
use serde_json::Value;

use crate::scenario::{CriteriaSection, EnvelopeSection, Iso9283Criteria, ReplaySection};
use crate::study::criteria::StudyCriteria;

/// Requirement by the key of the criterion that stands for it: `SRS-12: the needle's tip within 0.1 mm`.
pub type Requirements = BTreeMap<String, String>;

/// Keys of a section's criteria, with those of its tables behind a dot.
fn keys(section: &impl Serialize, prefix: &str) -> Vec<String> {
    let Ok(Value::Object(entries)) = serde_json::to_value(section) else {
        return Vec::new();
    };
    let all = entries.into_iter().flat_map(|(key, value)| match value {
        Value::Object(inner) => inner
            .into_iter()
            .map(|(name, _)| format!("{prefix}{key}.{name}"))
            .collect(),
        _ => vec![format!("{prefix}{key}")],
    });
    all.collect()
}

/// What is judged of a configuration and its goal without a limit in `[criteria]`.
const OF_GOALS: [&str; 2] = ["expected", "needle_route"];

/// Limits of `[events]`; those of a press are of any press.
const OF_EVENTS: [&str; 7] = [
    "events.max_retraction_deviation_mm",
    "events.press.max_balance_difference",
    "events.press.max_force_difference",
    "events.press.max_recovery_s",
    "events.press.max_tip_difference_mm",
    "events.stop.max_stopping_time_s",
    "events.stop.max_tip_distance_mm",
];

/// Criteria of scenarios, those of ISO 9283, of replays and of the engines' envelope among them.
static OF_SCENARIOS: LazyLock<Vec<String>> = LazyLock::new(|| {
    let mut all = keys(&CriteriaSection::default(), "");
    // How a criterion is measured, and no criterion itself.
    all.retain(|key| key != "settling_band_mm");
    all.extend(keys(&Iso9283Criteria::default(), ""));
    all.extend(keys(&ReplaySection::default(), ""));
    all.extend(keys(&EnvelopeSection::default(), "engines.envelope."));
    all.extend(OF_GOALS.iter().chain(&OF_EVENTS).map(ToString::to_string));
    all.sort();
    all
});

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

fn schema(names: &[String]) -> Schema {
    json_schema!({
        "type": "object",
        "propertyNames": { "enum": names },
        "additionalProperties": { "type": "string" },
    })
}

pub(crate) fn scenario_requirements(_: &mut SchemaGenerator) -> Schema {
    schema(&OF_SCENARIOS)
}

pub(crate) fn study_requirements(_: &mut SchemaGenerator) -> Schema {
    schema(&OF_STUDIES)
}

/// The requirement that a criterion stands for; that of an event's place in its list is that of all.
pub fn requirement_of<'a>(requirements: &'a Requirements, criterion: &str) -> Option<&'a str> {
    let plain: String = criterion
        .split('[')
        .enumerate()
        .map(|(index, part)| match (index, part.split_once(']')) {
            (1.., Some((_, after))) => after,
            _ => part,
        })
        .collect();
    requirements.get(&plain).map(String::as_str)
}

#[cfg(test)]
mod tests {
    use super::*;
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
