//! Every class of clearance has exactly the pairs that its definition names.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use needlebench_cell::{Cell, LeftOut, PairRule, pair_rule, place_in_chain};
use needlebench_robot::Srdf;
use needlebench_scenario::{Overrides, load_robot, load_scenario};

/// A scenario with everything that a cell can have.
fn cell() -> Cell {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios/table3.toml");
    load_scenario(&path, &Overrides::default()).unwrap().cell
}

const LINKS: [&str; 6] = [
    "shoulder",
    "upper_arm",
    "forearm",
    "wrist_1",
    "wrist_2",
    "wrist_3",
];

type Pairs = BTreeSet<[String; 2]>;

fn ordered(a: &str, b: &str) -> [String; 2] {
    let mut pair = [a.to_owned(), b.to_owned()];
    pair.sort();
    pair
}

/// All of `some` with all of `others`.
fn product(some: &[&str], others: &[&str]) -> Pairs {
    let mut pairs = Pairs::new();
    for a in some {
        pairs.extend(others.iter().map(|b| ordered(a, b)));
    }
    pairs
}

fn pairs_by_class(cell: &Cell) -> BTreeMap<&'static str, Pairs> {
    let mut found: BTreeMap<&'static str, Pairs> = BTreeMap::new();
    for pair in &cell.pairs {
        let names = ordered(&cell.bodies[pair.a].name, &cell.bodies[pair.b].name);
        let new = found.entry(pair.class.name()).or_default().insert(names);
        assert!(new, "a pair is there twice");
    }
    found
}

#[test]
fn every_class_has_exactly_the_pairs_of_its_definition() {
    let moving = [&LINKS[..], &["tool", "guide_tube"]].concat();
    let mut own = Pairs::new();
    let chain = [&["base"], &LINKS[..]].concat();
    for (i, a) in chain.iter().enumerate() {
        // Not the next one, with which it shares a joint.
        own.extend(chain.iter().skip(i + 2).map(|b| ordered(a, b)));
    }
    // The tool is part of wrist 3, and wrist 2 its neighbour: but the tool reaches further.
    own.extend(product(&["tool", "guide_tube"], &chain[..6]));
    let behind_guide = [&chain[..], &["phantom", "table", "gantry", "mount"]].concat();
    let expected = BTreeMap::from([
        ("robot_phantom", product(&LINKS, &["phantom"])),
        ("robot_table", product(&moving, &["table"])),
        ("robot_gantry", product(&moving, &["gantry"])),
        ("robot_mount", product(&moving, &["mount"])),
        ("robot_person", product(&moving, &["doctor", "doctor_2"])),
        ("self", own),
        ("tool_phantom", product(&["tool"], &["phantom"])),
        ("guide_standoff", product(&["guide_tube"], &["phantom"])),
        (
            "needle_corridor",
            product(&["needle_corridor"], &behind_guide),
        ),
    ]);
    assert_eq!(pairs_by_class(&cell()), expected);
}

#[test]
fn what_is_left_out_shares_a_joint_or_cannot_move() {
    let cell = cell();
    let mut adjacent = 0;
    for (i, a) in cell.bodies.iter().enumerate() {
        for b in &cell.bodies[i + 1..] {
            let rule = pair_rule(a, b);
            assert_eq!(rule, pair_rule(b, a), "{} and {}", a.name, b.name);
            let joints = place_in_chain(a.frame).abs_diff(place_in_chain(b.frame));
            match rule {
                PairRule::Measured(_) => {}
                PairRule::LeftOut(LeftOut::Fixed) => assert_eq!(joints, 0),
                PairRule::LeftOut(LeftOut::Hand) => {
                    assert_eq!(a.name, "needle_corridor");
                    assert!(b.name.starts_with("doctor"), "{}", b.name);
                }
                PairRule::LeftOut(LeftOut::Adjacent) => {
                    assert_eq!(joints, 1);
                    adjacent += 1;
                }
            }
        }
    }
    assert_eq!(adjacent, 6);
}

#[test]
fn links_of_an_srdf_are_found_by_the_names_of_the_urdf() {
    let (cell, members) = (
        cell(),
        load_robot(&Overrides::default())
            .unwrap()
            .description
            .members,
    );
    let text = r#"<robot name="ur3">
  <disable_collisions link1="base_link_inertia" link2="forearm_link" reason="Never"/>
  <disable_collisions link1="tool0" link2="guide_tube" reason="Adjacent"/>
  <disable_collisions link1="forearm_lnk" link2="wrist_1_link" reason="Never"/>
  <disable_collisions link1="left_finger" link2="wrist_1_link" reason="Never"/>
</robot>"#;
    let srdf = Srdf::parse("arm.srdf", text).unwrap();
    let names = |pair: usize| {
        let bodies = srdf
            .bodies_of(&srdf.disabled[pair], &cell, &members)
            .unwrap();
        bodies.map(|body| cell.bodies[body].name.as_str())
    };
    assert_eq!(names(0), ["base", "forearm"]);
    assert_eq!(names(1), ["wrist_3", "guide_tube"]);
    let unknown = srdf
        .bodies_of(&srdf.disabled[2], &cell, &members)
        .unwrap_err();
    assert_eq!(unknown.line, Some(4));
    assert_eq!(
        unknown.hint.as_deref(),
        Some("did you mean 'forearm_link'?")
    );
    let foreign = srdf
        .bodies_of(&srdf.disabled[3], &cell, &members)
        .unwrap_err();
    assert!(foreign.message.contains("left_finger"), "{foreign}");
}
