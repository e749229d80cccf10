//! Arms, couch and rail beside a chest.

use needlebench_geometry::mesh::check_closed;
use needlebench_imaging::{Label, Reconstruction};
use needlebench_volume::SurfaceTissue;

use super::reconstruct::{Solid, chest, grid, label_at, options, render, run};

/// Middle of each arm beside the chest, and radii of it and its bone, mm.
const ARM_MM: [f64; 2] = [165.0, 40.0];
const ARM_RADIUS_MM: f64 = 12.0;
const BONE_RADIUS_MM: f64 = 5.0;

/// The couch: half its width, and where its shells and the foam between them are, mm.
const COUCH_MM: f64 = 140.0;
const SHELLS_MM: [[f64; 2]; 2] = [[108.0, 111.0], [123.0, 126.0]];

/// A rail: middle and radius, mm.
const RAIL_MM: [f64; 2] = [-165.0, -70.0];
const RAIL_RADIUS_MM: f64 = 8.0;

fn cylinder([x, y]: [f64; 2], radius: f64, hu: f64) -> Solid {
    Solid(
        Box::new(move |p| libm::hypot(p.x - x, p.y - y) <= radius),
        hu,
    )
}

fn slab([from, to]: [f64; 2], hu: f64) -> Solid {
    Solid(
        Box::new(move |p| (from..to).contains(&p.y) && p.x.abs() < COUCH_MM),
        hu,
    )
}

/// The chest without its bed.
fn alone() -> Vec<Solid> {
    chest().into_iter().skip(1).collect()
}

pub(super) fn in_the_scanner() -> Vec<Solid> {
    let [upper, lower] = SHELLS_MM;
    let mut solids = vec![
        slab([upper[0], lower[1]], -960.0),
        slab(upper, -100.0),
        slab(lower, -100.0),
        cylinder(RAIL_MM, RAIL_RADIUS_MM, 100.0),
    ];
    for side in [-1.0, 1.0] {
        let at = [side * ARM_MM[0], ARM_MM[1]];
        solids.push(cylinder(at, ARM_RADIUS_MM, 40.0));
        solids.push(cylinder(at, BONE_RADIUS_MM, 900.0));
    }
    solids.extend(alone());
    solids
}

fn ml(made: &Reconstruction, label: Label) -> f64 {
    let facts = made.facts.iter().find(|it| it.label == label as u16);
    1e6 * facts.unwrap().volume_m3
}

#[test]
fn arms_couch_and_rail_stay_as_what_they_are() {
    let made = run(&render(&in_the_scanner(), grid()), &options()).unwrap();
    for (at_mm, wanted) in [
        ([ARM_MM[0], ARM_MM[1], 0.0], Label::Arms),
        ([-ARM_MM[0], ARM_MM[1] + 8.0, -60.0], Label::Arms),
        ([0.0, 109.5, 10.0], Label::Couch),
        // Foam, which is as light as air.
        ([30.0, 117.0, 10.0], Label::Couch),
        ([RAIL_MM[0], RAIL_MM[1], 0.0], Label::Objects),
    ] {
        assert_eq!(label_at(&made, at_mm), wanted as u16, "{at_mm:?}");
    }
    for at_mm in [[145.0, 60.0, 0.0], [0.0, 104.5, 0.0], [-165.0, -20.0, 0.0]] {
        assert_eq!(label_at(&made, at_mm), 0, "{at_mm:?} is air");
    }
    // Of the shapes, to half a voxel on either side.
    let length_mm = 64.0 * 3.0;
    let round = |radius: f64| std::f64::consts::PI * radius * radius * length_mm * 1e-3;
    for (label, wanted_ml, share) in [
        (Label::Arms, 2.0 * round(ARM_RADIUS_MM), 0.12),
        (Label::Objects, round(RAIL_RADIUS_MM), 0.2),
        (Label::Couch, 2.0 * COUCH_MM * 18.0 * length_mm * 1e-3, 0.12),
    ] {
        let found_ml = ml(&made, label);
        let error = (found_ml / wanted_ml - 1.0).abs();
        assert!(
            error < share,
            "{label:?}: {found_ml:.1} ml, not {wanted_ml:.1}"
        );
    }
    for name in ["arms", "couch", "objects"] {
        let surface = made.surfaces.iter().find(|it| it.name == name).unwrap();
        assert_eq!(surface.tissue, SurfaceTissue::Beside);
        assert!(check_closed(&surface.mesh).is_ok(), "{name}");
    }
}

#[test]
fn the_body_is_the_same_with_and_without_them() {
    let [with, without] =
        [in_the_scanner(), alone()].map(|it| run(&render(&it, grid()), &options()).unwrap());
    let of_body = |made: &Reconstruction| {
        let labels = made.labels.labels.iter();
        labels
            .map(|&label| label * u16::from(label < Label::Arms as u16))
            .collect::<Vec<u16>>()
    };
    assert!(of_body(&with) == of_body(&without));
    assert!(without.segmentation.beside.is_empty());
}
