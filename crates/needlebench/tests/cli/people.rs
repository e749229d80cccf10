//! The people in the room: what is refused, what is reported, what is judged.

use serde_json::Value;

use crate::support::{Bench, Finding, SMALL, with_edit};

/// `SMALL` with people.
fn with_people(people: &str) -> String {
    format!("{SMALL}\n{people}")
}

#[track_caller]
fn refused(people: &str) -> Finding {
    let text = with_people(people);
    let bench = Bench::with_scenario(&text);
    let answer = bench.run(&["check", "s.toml", "--json"]).exits_with(2);
    Finding::only(&answer, &text).in_file("s.toml")
}

#[test]
fn person_inside_the_table_is_refused() {
    refused("[[people.persons]]\nposition_mm = [146, -598]")
        .at("position_mm = [146,")
        .key("people.persons[0].position_mm")
        .says("would stand inside the");
    refused("[[people.persons]]\nside = \"left\"\ndistance_mm = 150")
        .at("distance_mm")
        .key("people.persons[0].distance_mm")
        .hints("leave the distance out");
}

#[test]
fn person_inside_the_robots_base_is_refused() {
    refused("[[people.persons]]\nrole = \"assistant\"\nposition_mm = [0, 0]")
        .key("people.persons[0].position_mm")
        .says("the assistant would stand inside the mount");
}

#[test]
fn stature_in_metres_is_refused() {
    refused("[[people.persons]]\nstatures_mm = [1.75]")
        .at("statures_mm")
        .key("people.persons[0].statures_mm[0]")
        .hints("did you give metres?");
}

#[test]
fn two_places_and_two_statures_are_refused() {
    refused("[[people.persons]]\nside = \"left\"\nposition_mm = [0, -1300]")
        .key("people.persons[0].position_mm")
        .hints("leave one of them out");
    refused("[[people.persons]]\nstature = \"male-p50\"\nstatures_mm = [1750]")
        .key("people.persons[0].stature")
        .hints("leave one of them out");
}

#[test]
fn side_that_faces_the_table_is_refused() {
    refused("[[people.persons]]\nside = \"back\"")
        .at("side = ")
        .key("people.persons[0].side")
        .hints("one of head, feet, left, right");
    refused("[people]\nprefer_side = \"front\"").key("people.prefer_side");
}

#[test]
fn unknown_words_are_refused_with_those_that_are_known() {
    refused("[[people.persons]]\nrole = \"docter\"").hints("did you mean `doctor`?");
    refused("[people]\nprefer_elbow = \"high\"").hints("one of up, down");
}

fn rooms(report: &Value) -> Vec<&Value> {
    let configurations = report["goals"][0]["configurations"].as_array().unwrap();
    configurations.iter().map(|each| &each["room"]).collect()
}

#[test]
fn room_is_reported_for_every_posture_with_people_or_without() {
    let people = "[people]\nprefer_side = \"right\"\nprefer_elbow = \"up\"\n\
                  [[people.persons]]\nside = \"feet\"\nstature = \"female-p5\"\n";
    let bench = Bench::with_scenario(&with_people(people));
    let report = bench
        .run(&["run", "s.toml", "--engine", "rapier", "--json"])
        .exits_with(0)
        .json();
    for room in rooms(&report) {
        for key in ["free_fraction", "sight_fraction"] {
            assert!((0.0..=1.0).contains(&room[key].as_f64().unwrap()), "{key}");
        }
        assert_eq!(room["sight"].as_array().unwrap().len(), 1);
        assert_eq!(room["sight"][0]["side"], "feet");
        assert_eq!(room["sight"][0]["stature_m"], 1.505);
        assert_eq!(
            room["preferred_side_free_fraction"],
            room["regions"]["right"]
        );
        assert_eq!(room["elbow_as_preferred"], room["elbow_up"]);
    }

    let bench = Bench::with_scenario(SMALL);
    let answer = bench.run(&["run", "s.toml", "--engine", "rapier", "--wide"]);
    assert!(answer.exits_with(0).stdout.contains("room for people"));
    let report = bench.read_json("out/small/report.json");
    for room in rooms(&report) {
        // The default: a doctor in three statures, across the patient from the robot.
        assert_eq!(room["sight"].as_array().unwrap().len(), 3);
        assert_eq!(room["sight"][0]["side"], "left");
        assert_eq!(room["elbow_as_preferred"], Value::Null);
    }
}

#[test]
fn room_criteria_are_judged_and_name_what_blocks() {
    let limits = "[criteria]\nmin_free_fraction = 0.99\nmin_sight_fraction = 0.01\n\
                  min_hand_cone_deg = 80\n";
    let bench = Bench::with_scenario(&with_edit(SMALL, "[criteria]\n", limits));
    let report = bench
        .run(&["run", "s.toml", "--engine", "rapier", "--json"])
        .exits_with(1)
        .json();
    let results = report["criteria"].as_array().unwrap();
    let of = |key: &str| -> Vec<&Value> {
        let named = |each: &&Value| each["criterion"] == key;
        results.iter().filter(named).collect()
    };
    let missed = |key: &str| of(key).iter().all(|each| each["pass"] == false);
    assert!(missed("min_free_fraction") && missed("min_hand_cone_deg"));
    assert!(
        of("min_sight_fraction")
            .iter()
            .all(|each| each["pass"] == true)
    );
    for each in of("min_hand_cone_deg") {
        assert!(each["detail"].as_str().unwrap().starts_with("blocked by "));
    }
}
