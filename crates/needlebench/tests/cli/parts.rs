//! Phantoms from STL files, in numbers.

use crate::made;
use crate::support::{Bench, Json};

#[test]
fn files_are_part_of_the_provenance_and_the_needle_keeps_from_the_bone() {
    let bench = Bench::with_scenario(include_str!("../cmd/fixtures/parts.toml"));
    made::write_into(&bench.path("."), "");
    bench.run("run s.toml --engine rapier");
    let report = bench.read_json("out/small/report.json");
    let inputs = report["provenance"]["inputs"].list();
    let parts: Vec<&str> = inputs
        .iter()
        .filter(|input| input["role"] == "phantom part")
        .map(|input| input["file"].word())
        .collect();
    assert_eq!(parts, ["skin.stl", "bone.stl", "lesion.stl"]);
    let goal = &report["goals"][0];
    assert_eq!(goal["lesion"], "nodule");
    let route = &goal["configurations"][0]["clearance"]["needle_route"];
    assert_eq!(route["pair"][1], "spine");
    // From the tip at y = -60 mm to the bone's face at y = 50 mm, less a half of 1.27 mm.
    let route_m = route["minimum_m"].number();
    assert!((route_m - (0.110 - 0.635e-3)).abs() < 1e-6, "{route_m}");
}
