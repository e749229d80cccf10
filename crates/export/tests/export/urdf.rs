//! URDF and SRDF.

use std::collections::BTreeSet;

use needlebench_export::urdf;
use needlebench_geometry::Shape;

use crate::{all_between, hanging, text};

#[test]
fn disabled_pairs_are_those_that_are_not_measured() {
    let resolved = hanging();
    let files = urdf(&resolved, "cell").unwrap();
    assert_eq!(files[1].name, "cell.srdf");
    let disabled = all_between(text(&files[1]), "<disable_collisions ", "/>");
    let count = resolved.cell.bodies.len();
    assert_eq!(
        disabled.len() + resolved.cell.pairs.len(),
        count * (count - 1) / 2
    );
    let pair = |a: &str, b: &str, reason: &str| {
        let wanted = format!("link1=\"{a}\" link2=\"{b}\" reason=\"{reason}\"");
        disabled.contains(&wanted.as_str())
    };
    assert!(pair("base_link", "shoulder_link", "Adjacent"));
    assert!(pair("wrist_3_link", "tool", "Never"));
    assert!(
        !disabled
            .iter()
            .any(|pair| pair.contains("forearm_link") && pair.contains("table"))
    );
}

#[test]
fn links_of_pairs_and_files_of_meshes_are_there() {
    let resolved = hanging();
    let files = urdf(&resolved, "My Cell").unwrap();
    let description = text(&files[0]);
    let links: BTreeSet<&str> = all_between(description, "<link name=\"", "\"")
        .into_iter()
        .collect();
    for link in all_between(text(&files[1]), "link1=\"", "\"") {
        assert!(links.contains(link), "{link}");
    }
    let names: BTreeSet<&str> = files.iter().map(|file| &*file.name).collect();
    let meshes = all_between(description, "filename=\"package://", "\"");
    assert!(!meshes.is_empty());
    for mesh in &meshes {
        assert!(mesh.starts_with("my_cell_meshes/"), "{mesh}");
        assert!(names.contains(mesh), "{mesh}");
    }
    // Every file of the package is of use.
    let used: BTreeSet<&str> = meshes.into_iter().collect();
    for name in names.iter().filter(|name| name.contains(".stl")) {
        assert!(used.contains(name), "{name}");
    }
}

/// Programs disagree about a link that does not say its mass.
#[test]
fn every_link_says_its_mass_and_all_weigh_what_the_arm_and_the_tool_do() {
    let resolved = hanging();
    let files = urdf(&resolved, "cell").unwrap();
    let description = text(&files[0]);
    let (_, links) = description.split_once("<link name=\"world\"/>").unwrap();
    for link in all_between(links, "<link name=\"", "</link>") {
        assert_eq!(link.matches("<inertial>").count(), 1, "{link}");
    }
    let masses = all_between(description, "<mass value=\"", "\"");
    assert_eq!(
        masses.len(),
        description.matches("<link ").count() - 1,
        "all but the world"
    );
    let whole: f64 = masses.iter().map(|mass| mass.parse::<f64>().unwrap()).sum();
    let cell = &resolved.cell;
    let arm: f64 = cell.robot.bodies.iter().map(|body| body.mass_kg).sum();
    assert!((whole - arm - cell.tool.body.mass_kg).abs() < 1e-9);
}

#[test]
fn a_capsule_is_a_cylinder_and_two_spheres() {
    let mut resolved = hanging();
    let body = resolved
        .cell
        .bodies
        .iter_mut()
        .find(|body| body.name == "table")
        .unwrap();
    body.solids.truncate(1);
    body.solids[0].shape = Shape::Capsule {
        radius_m: 0.125,
        half_length_m: 0.5,
    };
    let files = urdf(&resolved, "cell").unwrap();
    let link = all_between(text(&files[0]), "<link name=\"table\">", "</link>")[0];
    let collisions = all_between(link, "<collision ", "</collision>");
    assert_eq!(collisions.len(), 3);
    assert!(collisions[0].contains("<cylinder radius=\"0.125\" length=\"1\"/>"));
    assert!(collisions[1].contains("<sphere radius=\"0.125\"/>"));
    assert!(collisions[2].contains("<sphere radius=\"0.125\"/>"));
}
