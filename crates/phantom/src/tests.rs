use crate::MarkerKind;
use std::collections::BTreeSet;
use std::f64::consts::TAU;

use nalgebra::Vector3;
use needlebench_geometry::{PreparedShape, Shape, separation};
use needlebench_kinematics::Pose;
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

use super::loft::assert_convex_and_closed;
use super::*;

/// Rounding of coordinates below 1 m, with two decimal digits to spare.
const ROUNDING_M: f64 = 1e-12;

fn every_size() -> impl Iterator<Item = Phantom> {
    SIZE_PRESETS
        .iter()
        .map(|name| Phantom::build(&Phantom::size_preset(name).unwrap()).unwrap())
}

fn part<'a>(phantom: &'a Phantom, name: &str) -> &'a Solid {
    let found = phantom.parts.iter().find(|part| part.name == name);
    &found.unwrap_or_else(|| panic!("no part {name}")).solid
}

fn faces(phantom: &Phantom, name: &str) -> HalfSpaces {
    HalfSpaces::of(part(phantom, name)).unwrap()
}

/// Points on the surface of a part, about 2 mm apart or closer.
fn surface(solid: &Solid) -> Vec<Point3<f64>> {
    const RINGS: usize = 24;
    const SPOKES: usize = 24;
    let local: Vec<Point3<f64>> = match &solid.shape {
        Shape::Capsule {
            radius_m,
            half_length_m,
        }
        | Shape::Cylinder {
            radius_m,
            half_length_m,
        } => (0..=RINGS)
            .flat_map(|ring| (0..SPOKES).map(move |spoke| (ring, spoke)))
            .map(|(ring, spoke)| {
                let (sine, cosine) = libm::sincos(TAU * spoke as f64 / SPOKES as f64);
                let z_m = half_length_m * (2.0 * ring as f64 / RINGS as f64 - 1.0);
                Point3::new(radius_m * cosine, radius_m * sine, z_m)
            })
            .collect(),
        Shape::Cuboid { half_extents_m } => [-1.0, 0.0, 1.0]
            .into_iter()
            .flat_map(|x| [-1.0, 1.0].map(|y| [x, y]))
            .flat_map(|[x, y]| (-12..=12).map(move |z| [x, y, f64::from(z) / 12.0]))
            .map(|corner| Point3::from(Vector3::from(corner).component_mul(half_extents_m)))
            .collect(),
        Shape::Convex(mesh) => edges(&mesh.0),
        Shape::Sphere { .. } | Shape::Mesh(_) => panic!("not a bone's shape"),
    };
    local
        .into_iter()
        .map(|point| solid.parent_from_shape * point)
        .collect()
}

/// Points on all edges of a mesh.
fn edges(mesh: &needlebench_geometry::TriangleMesh) -> Vec<Point3<f64>> {
    let at = |i: u32| mesh.vertices_m[i as usize].coords;
    let sides = mesh
        .triangles
        .iter()
        .flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]);
    sides
        .flat_map(|[a, b]| {
            (0..5).map(move |k| Point3::from(at(a).lerp(&at(b), 0.2 * f64::from(k))))
        })
        .collect()
}

#[test]
fn skin_is_as_broad_deep_and_long_as_stated() {
    for phantom in every_size() {
        let Shape::Convex(mesh) = &phantom.skin().shape else {
            panic!("the skin is a mesh");
        };
        let size = phantom.parameters.as_ref().unwrap();
        for (axis, size_mm) in [size.breadth_mm, size.depth_mm, size.length_mm]
            .into_iter()
            .enumerate()
        {
            let values = || mesh.0.vertices_m.iter().map(|vertex| vertex[axis]);
            let half_m = 0.5e-3 * size_mm;
            assert!((values().fold(f64::MIN, f64::max) - half_m).abs() < ROUNDING_M);
            assert!((values().fold(f64::MAX, f64::min) + half_m).abs() < ROUNDING_M);
        }
    }
}

#[test]
fn every_mesh_of_every_size_is_convex_and_closed() {
    for phantom in every_size() {
        for part in &phantom.parts {
            if let Shape::Convex(mesh) = &part.solid.shape {
                assert!(assert_convex_and_closed(mesh) > 0.0, "{}", part.name);
            }
        }
    }
}

#[test]
fn every_lesion_of_every_size_is_inside_a_lung() {
    for phantom in every_size() {
        assert!(phantom.lesions.len() >= 5);
        for lesion in &phantom.lesions {
            let side = if lesion.center_m.x > 0.0 {
                "lung_left"
            } else {
                "lung_right"
            };
            assert_eq!(lesion.organ.as_deref(), Some(side), "{}", lesion.name);
            assert!((0.008..=0.030).contains(&lesion.diameter_m));
        }
    }
}

#[test]
fn bones_lie_under_soft_tissue() {
    /// The thinnest cover in the shipped sizes is 7.1 mm, over the first vertebra's end.
    const COVER_M: f64 = 0.006;
    for phantom in every_size() {
        for part in phantom.parts.iter().filter(|p| p.tissue == Tissue::Bone) {
            let depth_m = HalfSpaces::of(phantom.skin())
                .unwrap()
                .depth_of_solid_m(&part.solid);
            assert!(depth_m > COVER_M, "{}: {depth_m} m", part.name);
        }
    }
}

#[test]
fn no_bone_enters_lung_heart_or_liver() {
    for phantom in every_size() {
        for organ in ["lung_left", "lung_right", "heart", "liver"] {
            let faces = faces(&phantom, organ);
            for bone in phantom.parts.iter().filter(|p| p.tissue == Tissue::Bone) {
                for point in surface(&bone.solid) {
                    assert!(faces.depth_m(&point) < 0.0, "{} in {organ}", bone.name);
                }
            }
        }
    }
}

#[test]
fn lungs_heart_and_spine_are_apart() {
    for phantom in every_size() {
        let heart = part(&phantom, "heart");
        for name in ["lung_left", "lung_right"] {
            assert!(faces(&phantom, name).gap_m(heart) > 0.0, "{name}");
        }
        let left = part(&phantom, "lung_left");
        assert!(faces(&phantom, "lung_right").gap_m(left) > 0.0);
        for bone in &phantom.parts {
            if bone.organ.as_deref() == Some("spine") {
                assert!(faces(&phantom, "heart").gap_m(&bone.solid) > 0.0);
            }
        }
    }
}

#[test]
fn lungs_fill_the_rib_cage_without_reaching_the_ribs() {
    /// The ribs' inner side stays 3.5 mm off the nominal pleura; the lungs' tips, which are not
    /// scaled with the walls, pass it by up to 2 mm in the smallest size.
    const BEYOND_M: f64 = 2.5e-3;
    for phantom in every_size() {
        let envelope = Envelope::new(phantom.parameters.as_ref().unwrap()).unwrap();
        let mut breadth_m = 0.0;
        for name in ["lung_left", "lung_right"] {
            let solid = part(&phantom, name);
            let Shape::Convex(mesh) = &solid.shape else {
                panic!("a lung is a mesh");
            };
            let points = mesh
                .0
                .vertices_m
                .iter()
                .map(|p| solid.parent_from_shape * p);
            breadth_m += points.clone().map(|p| p.x.abs()).fold(0.0, f64::max);
            for p in points {
                let cage = envelope.cage_section(p.z).grown_by(BEYOND_M);
                let across = libm::pow((p.x / cage.half_width_m).abs(), cage.exponent);
                let along = ((p.y - cage.center_y_m) / cage.half_depth_m).abs();
                assert!(
                    across + libm::pow(along, cage.exponent) < 1.0,
                    "{name} at {p}"
                );
            }
        }
        assert!(breadth_m > 0.95 * 2.0 * envelope.widest_cage().half_width_m);
    }
}

#[test]
fn chest_wall_is_as_thick_as_stated_where_it_is_measured() {
    /// The lung keeps up to 7.1 mm from the cage there, since it closes towards its apex; nowhere is
    /// it nearer than the parameter says.
    const EXCESS_MM: f64 = 7.2;
    for phantom in every_size() {
        let size = phantom.parameters.as_ref().unwrap();
        for (name, sign) in [("lung_left", 1.0), ("lung_right", -1.0)] {
            let z_m = 0.42 * 0.5e-3 * size.length_mm;
            let in_front = Point3::new(sign * 0.25e-3 * size.breadth_mm, -1.0, z_m);
            let backwards = Vector3::y_axis();
            let (skin_m, _) = phantom.skin_intersection(&in_front, &backwards).unwrap();
            let (lung_m, _) = faces(&phantom, name)
                .clip_line(&in_front, &backwards)
                .unwrap();
            let excess_mm = 1e3 * (lung_m - skin_m) - size.chest_wall_mm;
            assert!((0.0..EXCESS_MM).contains(&excess_mm), "{name} {excess_mm}");
        }
    }
}

#[test]
fn anatomy_is_the_right_way_round() {
    let phantom = Phantom::build(&PhantomParameters::default()).unwrap();
    let center = |name: &str| part(&phantom, name).parent_from_shape.translation.vector;
    assert!(center("heart").x > 0.0 && center("heart").y < 0.0);
    assert!(center("liver").x < 0.0 && center("liver").z < center("lung_right").z);
    assert!(center("vertebra_t7").y > 0.0 && center("sternum_body").y < 0.0);
    assert!(center("vertebra_t1").z > center("vertebra_t12").z);
    assert!(center("lung_left").x > 0.0 && center("lung_right").x < 0.0);
    for number in 1..=12 {
        for (side, sign) in [("left", 1.0), ("right", -1.0)] {
            let organ = format!("rib_{side}_{number}");
            let of_rib = |part: &&PhantomPart| part.organ.as_deref() == Some(&organ);
            let pieces: Vec<_> = phantom.parts.iter().filter(of_rib).collect();
            let center = |part: &PhantomPart| part.solid.parent_from_shape.translation.vector;
            let (first, last) = (center(pieces[0]), center(pieces[pieces.len() - 1]));
            assert!(sign * center(pieces[4]).x > 0.0);
            assert!(first.z > last.z, "ribs descend forwards");
            assert!(first.y > last.y);
        }
    }
}

#[test]
fn part_names_are_unique_and_tissues_print_in_lower_case() {
    for phantom in every_size() {
        let names: BTreeSet<_> = phantom.parts.iter().map(|part| &part.name).collect();
        assert_eq!(names.len(), phantom.parts.len());
        for part in &phantom.parts {
            assert_eq!(part.name, part.solid.name);
            let json = serde_json::to_string(&part.tissue).unwrap();
            assert_eq!(json, format!("\"{}\"", part.tissue));
        }
        let tissues: BTreeSet<_> = phantom.parts.iter().map(|part| part.tissue).collect();
        assert_eq!(tissues.len(), 7);
    }
}

/// Pieces of the ribs' bone, of one side and rib.
fn rib<'a>(phantom: &'a Phantom, side: &str, number: usize) -> Vec<&'a Solid> {
    let organ = format!("rib_{side}_{number}");
    let pieces = phantom
        .parts
        .iter()
        .filter(|part| part.organ.as_ref() == Some(&organ));
    pieces.map(|part| &part.solid).collect()
}

#[test]
fn ribs_are_as_high_and_as_thick_as_stated() {
    /// The polyhedron is around the ellipse, by 1 / cos(pi / 16).
    const AROUND: f64 = 1.0197;
    for phantom in every_size() {
        let size = phantom.parameters.as_ref().unwrap();
        for number in 1..=12 {
            for piece in rib(&phantom, "left", number) {
                let Shape::Convex(mesh) = &piece.shape else {
                    panic!("a rib's piece is a polyhedron");
                };
                let extent_mm = needlebench_geometry::mesh::size_m(&mesh.0) * 1e3;
                for (measured_mm, stated_mm) in [
                    (extent_mm.x, size.rib_thickness_mm),
                    (extent_mm.y, size.rib_height_mm),
                ] {
                    assert!((stated_mm..AROUND * stated_mm).contains(&measured_mm));
                }
            }
        }
    }
}

/// Between a rib and the next there is room: the narrowest place of each space beyond the ribs' angles.
#[test]
fn neighbouring_ribs_are_apart() {
    const LEAST_M: f64 = 3e-3;
    for phantom in every_size() {
        for number in 1..12 {
            let below = rib(&phantom, "right", number + 1);
            for piece in rib(&phantom, "right", number) {
                for other in &below {
                    let gap_m = distance_m(piece, other);
                    assert!(gap_m > LEAST_M, "{} {}: {gap_m}", piece.name, other.name);
                }
            }
        }
    }
}

fn distance_m(a: &Solid, b: &Solid) -> f64 {
    let [first, second] = [a, b].map(|solid| PreparedShape::new(&solid.shape));
    separation(&first, &a.parent_from_shape, &second, &b.parent_from_shape).distance_m
}

#[test]
fn vessels_run_under_their_rib_and_out_of_the_lung() {
    for phantom in every_size() {
        // Rib 1 lies flat in the dome, and its broad side turns along its course.
        for number in 2..=12 {
            let organ = format!("intercostal_vessels_left_{number}");
            let vessels = phantom
                .parts
                .iter()
                .filter(|part| part.organ.as_ref() == Some(&organ));
            let bone = rib(&phantom, "left", number);
            for (vessel, rib) in vessels.zip(&bone[1..]) {
                let apart_m = distance_m(&vessel.solid, rib);
                // 7.2 mm under the rib's edge beside the spine, less their radius; in the groove further on.
                assert!(
                    (-2.8e-3..5.3e-3).contains(&apart_m),
                    "{}: {apart_m}",
                    vessel.name
                );
                let down_m = rib.parent_from_shape.translation.z
                    - vessel.solid.parent_from_shape.translation.z;
                assert!(down_m > 0.0, "{}", vessel.name);
            }
        }
    }
}

#[test]
fn airways_are_apart_from_bones_and_arteries() {
    for phantom in every_size() {
        let is_airway = |part: &&PhantomPart| {
            ["trachea", "main_bronchus_left", "main_bronchus_right"]
                .map(Some)
                .contains(&part.organ.as_deref())
        };
        for airway in phantom.parts.iter().filter(is_airway) {
            for part in &phantom.parts {
                let is_vessel = part.tissue == Tissue::Vessel
                    && !part.name.starts_with("mammary")
                    && !part.name.starts_with("intercostal");
                if part.tissue == Tissue::Bone || is_vessel {
                    let apart_m = distance_m(&airway.solid, &part.solid);
                    assert!(apart_m > 0.0, "{} {}: {apart_m}", airway.name, part.name);
                }
            }
        }
    }
}

#[test]
fn no_shipped_lesion_lies_across_a_fissure_and_each_is_in_the_lobe_that_it_is_named_after() {
    for phantom in every_size() {
        for lesion in &phantom.lesions {
            let ball = part(&phantom, &format!("lesion_{}", lesion.name));
            let side = if lesion.center_m.x > 0.0 {
                "left"
            } else {
                "right"
            };
            let fissures = phantom
                .parts
                .iter()
                .filter(|part| part.tissue == Tissue::Fissure);
            for fissure in fissures.filter(|part| part.name.ends_with(side)) {
                let apart_m = distance_m(ball, &fissure.solid);
                assert!(apart_m > 0.0, "{} {}: {apart_m}", lesion.name, fissure.name);
            }
            let oblique = part(&phantom, &format!("fissure_oblique_{side}"));
            let faces = HalfSpaces::of(oblique).unwrap();
            let lower = faces
                .clip_line(&lesion.center_m, &Vector3::z_axis())
                .is_some_and(|(enters_m, _)| enters_m > 0.0);
            if lesion.name.contains("lower") {
                assert!(lower, "{}", lesion.name);
            }
            if lesion.name.contains("upper") {
                assert!(!lower, "{}", lesion.name);
            }
        }
    }
}

#[test]
fn same_parameters_give_the_same_phantom() {
    assert!(every_size().eq(every_size()));
}

#[test]
fn markers_lie_on_the_skin_and_never_in_it() {
    for phantom in every_size() {
        let thickness_m = 1e-3 * phantom.parameters.as_ref().unwrap().marker_thickness_mm;
        assert!(phantom.markers.len() >= 6);
        for marker in &phantom.markers {
            let on_skin = marker.center_m - thickness_m * marker.normal.into_inner();
            assert!(phantom.skin_signed_depth(&on_skin).abs() < ROUNDING_M);
            assert!((phantom.skin_signed_depth(&marker.center_m) + thickness_m).abs() < ROUNDING_M);
        }
        for part in phantom.parts.iter().filter(|p| p.tissue == Tissue::Marker) {
            assert!(HalfSpaces::of(phantom.skin()).unwrap().gap_m(&part.solid) > -ROUNDING_M);
        }
    }
}

#[test]
fn ct_markers_hold_a_sphere_between_skin_and_disc_and_leave_all_else_as_it_is() {
    for plain in every_size() {
        let mut parameters = plain.parameters.clone().unwrap();
        parameters.marker_kind = MarkerKind::CtSphere;
        let phantom = Phantom::build(&parameters).unwrap();
        let sphere_m = 1e-3 * parameters.marker_sphere_mm;
        let skin = HalfSpaces::of(phantom.skin()).unwrap();
        for (marker, disc) in phantom.markers.iter().zip(&plain.markers) {
            let raised = disc.center_m + sphere_m * disc.normal.into_inner();
            assert!((marker.center_m - raised).norm() < ROUNDING_M);
            assert_eq!(marker.normal, disc.normal);
            assert_eq!(disc.sphere, None);
            let sphere = marker.sphere.unwrap();
            assert_eq!(sphere.diameter_m, sphere_m);
            let above_skin_m = -phantom.skin_signed_depth(&sphere.center_m);
            assert!((above_skin_m - 0.5 * sphere_m).abs() < ROUNDING_M);
            let name = format!("{}.sphere", marker.name);
            let part = phantom.parts.iter().find(|part| part.name == name);
            let place = part.unwrap().solid.parent_from_shape.translation.vector;
            assert_eq!(place, sphere.center_m.coords);
        }
        for part in phantom.parts.iter().filter(|p| p.tissue == Tissue::Marker) {
            assert!(skin.gap_m(&part.solid) > -ROUNDING_M);
        }
        let anatomy = |phantom: &Phantom| {
            let parts = phantom.parts.iter().filter(|p| p.tissue != Tissue::Marker);
            parts.cloned().collect::<Vec<_>>()
        };
        assert_eq!(anatomy(&phantom), anatomy(&plain));
    }
}

#[test]
fn markers_can_be_told_apart_by_their_distances() {
    /// Well above the error with which a marker can be located in CT (0.5 mm).
    const DISTINCT_M: f64 = 1e-3;
    /// A marker's distances to all others, sorted.
    fn signature(phantom: &Phantom, index: usize) -> Vec<f64> {
        let center_m = phantom.markers[index].center_m;
        let others = phantom
            .markers
            .iter()
            .map(|m| (m.center_m - center_m).norm());
        let mut distances_m: Vec<f64> = others.collect();
        distances_m.sort_by(f64::total_cmp);
        distances_m
    }
    for phantom in every_size() {
        for a in 0..phantom.markers.len() {
            for b in 0..a {
                let widest_m = signature(&phantom, a)
                    .iter()
                    .zip(signature(&phantom, b))
                    .map(|(x, y)| (x - y).abs())
                    .fold(0.0, f64::max);
                assert!(widest_m > DISTINCT_M, "markers {a} and {b}");
            }
        }
    }
}

#[test]
fn lesion_outside_the_skin_is_refused_and_one_in_the_wall_has_no_organ() {
    let mut parameters = PhantomParameters::default();
    parameters.lesions[0].center_mm = [0.0, -125.0, 0.0];
    assert!(matches!(
        Phantom::build(&parameters),
        Err(PhantomError::LesionOutsideSkin { lesion, .. }) if lesion == "right_upper_lobe"
    ));
    parameters.lesions[0].center_mm = [0.0, -110.0, 0.0];
    let phantom = Phantom::build(&parameters).unwrap();
    assert_eq!(phantom.lesions[0].organ, None);
}

#[test]
fn marker_above_the_skin_is_refused() {
    let mut parameters = PhantomParameters::default();
    parameters.markers[0].height_mm = 203.0;
    assert!(matches!(
        Phantom::build(&parameters),
        Err(PhantomError::MarkerOffSkin { marker, .. }) if marker == "marker_1"
    ));
}

#[test]
fn walls_that_leave_no_room_are_refused() {
    let thick = |change: fn(&mut PhantomParameters)| {
        let mut parameters = PhantomParameters::default();
        change(&mut parameters);
        Phantom::build(&parameters).unwrap_err()
    };
    for error in [
        thick(|p| p.lateral_wall_mm = 110.0),
        thick(|p| p.chest_wall_mm = 140.0),
        thick(|p| p.chest_wall_mm = 16.0),
    ] {
        assert!(matches!(error, PhantomError::NoRoom { .. }), "{error}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { rng_seed: RngSeed::Fixed(7), ..ProptestConfig::with_cases(48) })]

    #[test]
    fn any_size_builds_a_closed_convex_skin_or_says_why_not(
        breadth_mm in 150.0..600.0_f64,
        depth_mm in 120.0..600.0_f64,
        length_mm in 200.0..700.0_f64,
        wall_mm in 15.0..80.0_f64,
    ) {
        let parameters = PhantomParameters {
            breadth_mm,
            depth_mm,
            length_mm,
            chest_wall_mm: wall_mm + 8.0,
            lateral_wall_mm: wall_mm,
            lesions: Vec::new(),
            markers: Vec::new(),
            ..PhantomParameters::default()
        };
        if let Ok(phantom) = Phantom::build(&parameters) {
            let Shape::Convex(mesh) = &phantom.skin().shape else {
                unreachable!("the skin is a mesh");
            };
            prop_assert!(assert_convex_and_closed(mesh) > 0.0);
        }
    }

    #[test]
    fn line_enters_and_leaves_on_the_skin(
        target in prop::array::uniform3(-0.09..0.09_f64),
        direction in prop::array::uniform3(-1.0..1.0_f64),
        back_m in 0.0..2.0_f64,
    ) {
        prop_assume!(Vector3::from(direction).norm() > 0.1);
        let phantom = Phantom::build(&PhantomParameters::default()).unwrap();
        let direction = UnitVector3::new_normalize(Vector3::from(direction));
        let inside = Point3::from(target);
        prop_assert!(phantom.skin_contains(&inside));
        let origin = inside - back_m * direction.into_inner();
        let (enter_m, leave_m) = phantom.skin_intersection(&origin, &direction).unwrap();
        prop_assert!(enter_m < back_m && back_m < leave_m);
        for s in [enter_m, leave_m] {
            let point = origin + s * direction.into_inner();
            prop_assert!(phantom.skin_signed_depth(&point).abs() < ROUNDING_M);
        }
    }
}

/// Volumes, in litres, as models/chest_phantom/README.md states them.
#[test]
fn volumes_are_as_documented() {
    const ROUNDED_L: f64 = 0.0051;
    for (size, volumes_l) in [
        ("male-p50", [1.18, 1.50, 0.43, 0.76, 21.1]),
        ("male-p50-supine", [1.08, 1.37, 0.23, 0.41, 19.6]),
    ] {
        let phantom = Phantom::build(&Phantom::size_preset(size).unwrap()).unwrap();
        let names = ["lung_left", "lung_right", "heart", "liver", "skin"];
        for (name, stated_l) in names.into_iter().zip(volumes_l) {
            let Shape::Convex(mesh) = &part(&phantom, name).shape else {
                panic!("{name} is a mesh");
            };
            let volume_l = 1e3 * needlebench_geometry::mesh::volume_m3(&mesh.0);
            let rounded_l = if name == "skin" {
                10.0 * ROUNDED_L
            } else {
                ROUNDED_L
            };
            assert!(
                (volume_l - stated_l).abs() < rounded_l,
                "{size} {name}: {volume_l}"
            );
        }
    }
}

/// The unseen is what lies behind the plane, straight behind the face: distances by hand.
#[test]
fn a_cut_body_may_go_on_behind_its_cut() {
    let whole = Phantom::build(&Phantom::size_preset("male-p50-supine").unwrap()).unwrap();
    assert!(whole.is_skin_seen(&Point3::new(0.0, 0.0, 1.0)));
    assert!(whole.unseen_body(|_| false).is_empty());
    let half_m = 0.5e-3 * whole.parameters.as_ref().unwrap().length_mm;
    let cut = whole.with_scan_ends(vec![ScanEnd {
        normal: Vector3::z_axis(),
        offset_m: half_m - 5e-3,
        assumed_m: 0.0,
    }]);
    assert!(cut.is_skin_seen(&Point3::new(0.0, 0.0, half_m - 6e-3)));
    assert!(!cut.is_skin_seen(&Point3::new(0.0, 0.0, half_m - 4e-3)));
    assert!(cut.unseen_body(|_| true).is_empty());
    let unseen = cut.unseen_body(|_| false);
    let [unseen] = &unseen[..] else {
        panic!("one face, {} solids", unseen.len())
    };
    let faces = HalfSpaces::of(unseen).unwrap();
    for (place, wanted_m) in [
        // On the plane, between the skin's vertices; before it; and behind the end of what may be.
        ([0.0, 0.0, half_m - 5e-3], 0.0),
        ([0.0, 0.0, half_m - 0.1], -0.095),
        ([0.0, 0.0, half_m + 3.1], -0.1),
    ] {
        let depth_m = faces.depth_m(&Point3::from(place));
        assert!(
            (depth_m - wanted_m).abs() < ROUNDING_M,
            "{place:?} {depth_m}"
        );
    }
    // As wide as the skin at the end, however far behind it; a hull leaves out 0.5 mm.
    let skin = cut.skin().shape.surface(0.0).vertices_m;
    let at_end: Vec<_> = skin.iter().filter(|at| at.z > half_m - 5e-3).collect();
    assert!(at_end.len() > 20);
    let widest_m = at_end.iter().map(|at| at.x).fold(0.0, f64::max);
    for behind_m in [0.3, 1.0, 2.5] {
        let behind = Vector3::new(0.0, 0.0, behind_m);
        for at in &at_end {
            assert!(faces.depth_m(&(*at + behind)) > -6e-4);
        }
        for beside_m in [0.02, 0.2] {
            let beside = Point3::new(widest_m + beside_m, 0.0, half_m + behind_m);
            let distance_m = -faces.depth_m(&beside);
            assert!(
                (beside_m - distance_m).abs() < 2e-3,
                "{beside_m} {distance_m}"
            );
        }
    }
}

/// Behind what is assumed the body goes on from there, as wide as that is.
#[test]
fn a_body_that_is_assumed_goes_on_from_where_it_ends() {
    let whole = Phantom::build(&Phantom::size_preset("male-p50-supine").unwrap()).unwrap();
    let half_m = 0.5e-3 * whole.parameters.as_ref().unwrap().length_mm;
    let end = ScanEnd {
        normal: Vector3::z_axis(),
        offset_m: half_m - 5e-3,
        assumed_m: 0.3,
    };
    let assumed = PhantomPart {
        name: "assumed".to_owned(),
        tissue: Tissue::Assumed,
        organ: None,
        solid: Solid {
            name: "assumed".to_owned(),
            shape: Shape::Cuboid {
                half_extents_m: Vector3::new(0.2, 0.1, 0.151),
            },
            parent_from_shape: Pose::translation(0.0, 0.0, half_m - 5e-3 + 0.15),
        },
        color_rgba: SKIN_RGBA,
    };
    let cut = whole.with_beside(vec![assumed]).with_scan_ends(vec![end]);
    let unseen = cut.unseen_body(|_| false);
    let [unseen] = &unseen[..] else {
        panic!("one face, {} solids", unseen.len())
    };
    let faces = HalfSpaces::of(unseen).unwrap();
    for (behind_m, wanted_m) in [(0.2, -0.1), (0.3, 0.0), (0.35, 0.05), (3.4, -0.099)] {
        let depth_m = faces.depth_m(&Point3::new(0.0, 0.0, end.offset_m + behind_m));
        assert!((depth_m - wanted_m).abs() < 1e-6, "{behind_m} {depth_m}");
    }
    assert!(!cut.is_skin_seen(&Point3::new(0.0, 0.0, half_m)));
}

/// Against the solids that hold each tenth of a millimetre of the way.
#[test]
fn layers_of_a_needle_are_the_solids_that_it_passes() {
    let phantom = Phantom::build(&Phantom::size_preset("male-p50-supine").unwrap()).unwrap();
    let is_in = |at: &Point3<f64>, wanted: &dyn Fn(&PhantomPart) -> bool| {
        phantom
            .parts
            .iter()
            .any(|part| wanted(part) && part.solid.contains(at))
    };
    let (mut passed, mut refused) = (0, 0);
    for lesion in &phantom.lesions {
        for step in 0..24 {
            let angle = f64::from(step) * TAU / 24.0;
            let (sine, cosine) = libm::sincos(angle);
            let outwards = UnitVector3::new_normalize(Vector3::new(cosine, sine, 0.1));
            let (_, leaves_m) = phantom
                .skin_intersection(&lesion.center_m, &outwards)
                .unwrap();
            let entry = lesion.center_m + outwards.into_inner() * leaves_m;
            let at = |share: f64| entry + (lesion.center_m - entry) * share;
            let is_bone = |part: &PhantomPart| part.tissue == Tissue::Bone;
            let meets_bone = (0..=1000).any(|k| is_in(&at(f64::from(k) / 1000.0), &is_bone));
            let layers = match phantom.layers(&entry, &lesion.center_m) {
                Ok(layers) => layers,
                Err(LayersError::Bone(_)) => {
                    refused += 1;
                    continue;
                }
            };
            assert!(!meets_bone);
            passed += 1;
            assert_eq!(layers[0].tissue, Passed::Fat);
            let length_m: f64 = layers.iter().map(|layer| layer.length_m).sum();
            assert!((length_m - leaves_m).abs() < ROUNDING_M);
            for k in 0..1000 {
                let share = (f64::from(k) + 0.5) / 1000.0;
                let mut end_m = 0.0;
                let layer = layers.iter().find(|layer| {
                    end_m += layer.length_m;
                    end_m > share * length_m
                });
                let begin_m = end_m - layer.unwrap().length_m;
                let from_end_m = (end_m - share * length_m).min(share * length_m - begin_m);
                if from_end_m < 1.1e-3 {
                    // Short stretches are those beside them.
                    continue;
                }
                let is_lesion = |part: &PhantomPart| part.tissue == Tissue::Lesion;
                let is_lung = |part: &PhantomPart| {
                    part.tissue == Tissue::Organ && part.name.starts_with("lung_")
                };
                let wanted = if is_in(&at(share), &is_lesion) {
                    Passed::Lesion
                } else if is_in(&at(share), &is_lung) {
                    Passed::Lung
                } else {
                    Passed::Wall
                };
                let found = layer.unwrap().tissue;
                assert!(found == wanted || (found, wanted) == (Passed::Fat, Passed::Wall));
            }
        }
    }
    assert!(passed > 20 && refused > 20, "{passed} {refused}");
}
