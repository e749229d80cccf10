//! The people in the room: what is refused, what is reported, what is judged.

use serde_json::Value;

use crate::support::{Bench, Json, SMALL, holds, small_run_wide, with_edit};

/// `SMALL` with people.
fn with_people(people: &str) -> String {
    format!("{SMALL}\n{people}")
}

fn rooms(report: &Value) -> Vec<&Value> {
    let configurations = report["goals"][0]["configurations"].list();
    configurations.iter().map(|each| &each["room"]).collect()
}

#[test]
fn room_is_reported_for_every_posture_with_people_or_without() {
    let people = "[people]\nprefer_side = \"right\"\nprefer_elbow = \"up\"\n\
                  [[people.persons]]\nside = \"feet\"\nstature = \"female-p5\"\n";
    let bench = Bench::with_scenario(&with_people(people));
    let report = bench
        .run("run s.toml --engine rapier --json")
        .exits_with(0)
        .json();
    for room in rooms(&report) {
        for key in ["free_fraction", "sight_fraction"] {
            assert!((0.0..=1.0).contains(&room[key].number()), "{key}");
        }
        assert_eq!(room["sight"].list().len(), 1);
        assert_eq!(room["sight"][0]["side"], "feet");
        assert_eq!(room["sight"][0]["stature_m"], 1.505);
        assert_eq!(
            room["preferred_side_free_fraction"],
            room["regions"]["right"]
        );
        assert_eq!(room["elbow_as_preferred"], room["elbow_up"]);
    }

    let (bench, answer) = small_run_wide();
    answer.says(["free space and line of sight"]);
    let report = bench.read_json("out/small/report.json");
    for room in rooms(&report) {
        // The default: a doctor in three statures, across the patient from the robot.
        assert_eq!(room["sight"].list().len(), 3);
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
        .run("run s.toml --engine rapier --json")
        .exits_with(1)
        .json();
    let results = report["criteria"].list();
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
        assert!(each["detail"].word().starts_with("blocked by "));
    }
}

/// A doctor at a place in the world, mm.
fn doctor_at(place: [f64; 2]) -> String {
    let [x, y] = place;
    with_people(&format!(
        "[[people.persons]]\nposition_mm = [{x}, {y}]\nstatures_mm = [1700]\n"
    ))
}

#[test]
fn nobody_stands_inside_the_arm() {
    for place in [[350.0, -150.0], [250.0, -150.0]] {
        let bench = Bench::with_scenario(&doctor_at(place));
        let answer = bench.run("check s.toml").exits_with(2);
        holds(&answer.stderr, ["the start posture collides", "physician"]);
    }
}

#[test]
fn arm_and_tool_keep_away_from_people_on_every_motion() {
    // Out of the way; then within the floor of what had been the nearest approach.
    let run = |text: &str| {
        let bench = Bench::with_scenario(text);
        bench.run("run s.toml --engine rapier --json").json()
    };
    let least_m = |report: &Value| {
        let configurations = report["goals"][0]["configurations"].list().clone();
        let of_people = configurations.into_iter().filter_map(|each| {
            let class = each["clearance"].get("robot_person")?.clone();
            Some((
                class["minimum_m"].number(),
                class["pair"][1].word().to_owned(),
            ))
        });
        of_people.min_by(|a, b| a.0.total_cmp(&b.0)).unwrap()
    };
    let far = [-600.0, -150.0];
    let (free_m, whom) = least_m(&run(&doctor_at(far)));
    assert_eq!(whom, "doctor");
    assert!(free_m > 0.05, "{free_m}");
    let judged = with_edit(
        &doctor_at(far),
        "[criteria]",
        &format!(
            "[criteria]\nmin_clearance_mm.robot_person = {}",
            free_m * 1e3 + 5.0
        ),
    );
    let report = run(&judged);
    let missed = report["criteria"].list().iter().filter(|each| {
        each["criterion"] == "min_clearance_mm.robot_person" && each["pass"] == false
    });
    assert!(missed.count() > 0);
    // Nearer by all but 20 mm of that: below what is kept from people.
    let near = [far[0] + free_m * 1e3 - 20.0, far[1]];
    let report = run(&doctor_at(near));
    let rejected = report["goals"][0]["configurations"].list().iter();
    let mut reasons = rejected.flat_map(|each| each["rejections"].list());
    assert!(
        reasons.any(|each| each["detail"].word().contains("physician")),
        "{report:#}"
    );
}
