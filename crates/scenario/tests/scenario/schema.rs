//! The published schemas and the reader of files: what one refuses the other refuses.

use std::sync::LazyLock;

use needlebench_input::Finding;
use needlebench_scenario::scenario::{parse_scenario, scenario_schema};
use needlebench_scenario::study::{parse_study, study_schema};
use serde_json::Value;

use crate::schema_probes::{Probe, probes};

/// What the reader dislikes about a probe.
fn findings(kind: &str, probe: &Probe) -> Vec<Finding> {
    let text = toml::to_string(&probe.document).unwrap();
    match kind {
        "scenario" => parse_scenario("p.toml", &text).err(),
        _ => parse_study("p.toml", &text).err(),
    }
    .unwrap_or_default()
}

type Read = (&'static str, Vec<(Probe, Vec<Finding>)>);

/// Every probe of both schemas, with what the reader dislikes about it: read once, which is what takes time here.
static READ: LazyLock<[Read; 2]> = LazyLock::new(|| {
    both().map(|(kind, schema)| {
        let read = probes(&schema).into_iter().map(|probe| {
            let found = findings(kind, &probe);
            (probe, found)
        });
        (kind, read.collect())
    })
});

fn both() -> [(&'static str, Value); 2] {
    [("scenario", scenario_schema()), ("study", study_schema())]
}

#[test]
fn the_reader_refuses_what_is_outside_the_schema_and_nothing_else() {
    for (kind, read) in &*READ {
        let refused = read.iter().filter(|(probe, _)| !probe.fits).count();
        assert!(
            refused > 50 && read.len() - refused > 50,
            "{kind}: {refused}"
        );
        for (probe, found) in read {
            assert_eq!(
                found.is_empty(),
                probe.fits,
                "{kind} {}: {found:?}\n{}",
                probe.key,
                probe.document
            );
        }
    }
}

#[test]
fn a_refused_value_is_named_with_its_key_and_line() {
    for (kind, read) in &*READ {
        for (probe, found) in read.iter().filter(|(probe, _)| !probe.fits) {
            if probe.key.contains(", ") {
                continue;
            }
            // Of a list of the wrong length the list is named, of a missing key its table's line.
            assert!(
                found
                    .iter()
                    .any(|each| each.key.as_ref() == Some(&probe.key)),
                "{kind} {}: {found:?}",
                probe.key
            );
            for each in found {
                let is_of_file = !each
                    .key
                    .as_ref()
                    .is_some_and(|key| key.contains(['.', '[']));
                assert!(each.line.is_some() || is_of_file, "{each:?}");
            }
        }
    }
}

/// Schemas of numbers, with their paths.
fn numbers<'a>(path: &str, value: &'a Value, found: &mut Vec<(String, &'a Value)>) {
    let is_number = value["type"] == "number" || value["type"] == "integer";
    if is_number {
        found.push((path.to_owned(), value));
    }
    match value {
        Value::Object(object) => {
            for (key, inner) in object.iter().filter(|(key, _)| *key != "default") {
                numbers(&format!("{path}/{key}"), inner, found);
            }
        }
        Value::Array(items) => {
            for (index, inner) in items.iter().enumerate() {
                numbers(&format!("{path}/{index}"), inner, found);
            }
        }
        _ => {}
    }
}

#[test]
fn every_number_of_the_schemas_has_a_least_and_a_greatest_value() {
    for ((kind, schema), least) in both().iter().zip([150, 15]) {
        let mut found = Vec::new();
        numbers("", schema, &mut found);
        assert!(found.len() > least, "{kind}: {}", found.len());
        for (path, number) in found {
            let above = number["exclusiveMinimum"].as_f64();
            let low = number["minimum"].as_f64().or(above);
            let high = number["maximum"].as_f64();
            assert!(low.is_some() && low < high, "{path}: {number}");
        }
    }
}

#[test]
fn every_key_with_a_unit_has_it_in_its_description_or_its_name_alone_says_it() {
    for (kind, schema) in both() {
        let sections = schema["definitions"].as_object().unwrap().values();
        for section in sections.chain([&schema]) {
            for (key, property) in section["properties"].as_object().into_iter().flatten() {
                let unit = match key.rsplit('_').next() {
                    Some("mm") => "mm",
                    Some("deg") => "deg",
                    Some("kg") => "kg",
                    Some("ms") => "ms",
                    _ => continue,
                };
                // An anchor's unit is that of its metric, and a quantile's that of its criterion.
                let is_number = property["type"] == "number" || property["type"] == "array";
                if !is_number {
                    continue;
                }
                let said = property["description"].as_str().unwrap_or_default();
                assert!(said.contains(unit), "{kind} {key}: {said}");
            }
        }
    }
}

#[test]
fn defaults_lie_in_their_ranges() {
    let text = "name = \"a\"";
    let scenario = parse_scenario("s.toml", text).unwrap();
    // Every default, written out.
    let text = toml::to_string(&scenario).unwrap();
    let written = text.lines().filter(|line| line.contains('=')).count();
    assert!(written > 40, "{text}");
    assert_eq!(parse_scenario("s.toml", &text).unwrap(), scenario);
}

#[test]
fn shipped_names_are_in_the_schema() {
    let schema = scenario_schema();
    let listed = |pointer: &str| -> Vec<&str> {
        let values = schema
            .pointer(pointer)
            .unwrap_or_else(|| panic!("{pointer}"));
        values
            .as_array()
            .unwrap()
            .iter()
            .filter_map(Value::as_str)
            .collect()
    };
    let of = |section: &str, key: &str| {
        listed(&format!(
            "/definitions/{section}/properties/{key}/anyOf/0/enum"
        ))
    };
    assert!(of("RobotSection", "urdf").contains(&"ur3"));
    assert_eq!(
        of("ToolSection", "urdf"),
        ["inline", "offset", "perpendicular", "parametric"]
    );
    let models = of("PhantomSection", "model");
    for name in needlebench_phantom::SIZE_PRESETS.iter().chain(&["none"]) {
        assert!(models.contains(name), "{name}");
    }
    let lesions = of("GoalSection", "lesion");
    assert!(
        lesions.contains(&"left_perihilar") && lesions.len() >= 6,
        "{lesions:?}"
    );
    assert!(of("CalibrationBlock", "arm").contains(&"population"));
}
