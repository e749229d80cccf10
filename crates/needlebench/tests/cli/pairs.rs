//! `pairs`.

use serde_json::Value;

use crate::support::{Answer, Bench, Json, SMALL, has_keys};

/// Postures enough to see a pair that collides at one in ten, and boxes enough to prove pairs
/// with two joints between them.
const QUICK: &str = "--samples 200 --proof-boxes 5000";

fn run(bench: &Bench, more: &str) -> Answer {
    bench.run(format!("pairs s.toml {QUICK} {more}"))
}

const SRDF: &str = r#"<?xml version="1.0"?>
<robot name="ur3">
  <disable_collisions link1="upper_arm_link" link2="forearm_link" reason="Adjacent"/>
  <disable_collisions link1="forearm_link" link2="wrist_3_link" reason="Never"/>
  <disable_collisions link1="forearm_lnk" link2="wrist_1_link" reason="Never"/>
</robot>
"#;

fn state_of<'v>(answer: &'v Value, first: &str, second: &str) -> &'v Value {
    answer["pairs"]
        .list()
        .iter()
        .find(|pair| {
            let names = pair["pair"].list();
            names.contains(&first.into()) && names.contains(&second.into())
        })
        .unwrap()
}

#[test]
fn every_pair_of_bodies_has_a_state_and_its_evidence() {
    let bench = Bench::with_scenario(SMALL);
    let answer = run(&bench, "--json");
    let answer = answer.exits_with(0).json();
    has_keys(&answer, "schema_version samples seed pairs");
    let pairs = answer["pairs"].list();
    // Thirteen bodies: base, six links, tool, guide tube, corridor, phantom, table, mount.
    assert_eq!(pairs.len(), 13 * 12 / 2);
    for pair in pairs {
        has_keys(
            pair,
            "pair class state measured joints_between least_m least_joints_rad collision_rate",
        );
        assert_eq!(pair["measured"] == true, pair["class"].is_string());
    }
    assert_eq!(
        state_of(&answer, "forearm", "upper_arm")["state"],
        "adjacent"
    );
    assert_eq!(state_of(&answer, "forearm", "wrist_3")["state"], "checked");
    let never = state_of(&answer, "wrist_1", "wrist_3");
    assert_eq!(never["state"], "never");
    assert!(never["nearest_m"]["lower"].number() > 0.0);
    assert_eq!(never["measured"], true);
    assert_eq!(state_of(&answer, "table", "mount")["state"], "fixed");
}

#[test]
fn an_srdf_that_disables_what_collides_is_bad_input() {
    let bench = Bench::with_scenario(SMALL);
    bench.write("arm.srdf", SRDF);
    let answer = run(&bench, "--srdf arm.srdf").exits_with(2);
    answer.says(["1 justified, 0 unproven, 1 refuted, 1 with unknown links"]);
    answer.complains([
        "arm.srdf:4",
        "forearm_link and wrist_3_link",
        "disabled as 'Never'",
        "elbow",
        "did you mean 'forearm_link'?",
    ]);
}

#[test]
fn what_it_writes_it_agrees_with() {
    let bench = Bench::with_scenario(SMALL);
    run(&bench, "--write-srdf own.srdf").exits_with(0);
    let answer = run(&bench, "--srdf own.srdf --json").exits_with(0).json();
    let disabled = answer["srdf"]["disabled"].list();
    assert!(disabled.len() >= 7, "{disabled:#?}");
    for pair in disabled {
        assert_eq!(pair["verdict"], "justified", "{pair:#}");
    }
    // Links by their names in the URDF, which is what other programs know.
    assert!(
        disabled
            .iter()
            .any(|pair| pair["links"][0] == "wrist_1_link")
    );
}
