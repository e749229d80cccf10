//! Pairs of shapes of which the signed distance can be written down.

use std::f64::consts::FRAC_PI_2;
use std::sync::Arc;

use crate::common::Variety;
use nalgebra::{Point3, Translation3, UnitQuaternion, Vector3};
use needlebench_geometry::{
    ConvexMesh, PreparedShape, Shape, Solid, TriangleMesh, segment_clearance, separation,
};
use needlebench_kinematics::Pose;

/// Pairs that are solved in closed form: a few roundings of numbers about 1.
const CLOSED_FORM_M: f64 = 1e-14;

/// Pairs that are iterated: the solver's certificate, and as much again for rounding.
const ITERATED_M: f64 = 2e-10;

/// Coaxial pairs, where a circle of directions is equally good: 3 times the worst seen.
const COAXIAL_M: f64 = 1e-9;

fn sphere(radius_m: f64) -> Shape {
    Shape::Sphere { radius_m }
}

fn cylinder(radius_m: f64, half_length_m: f64) -> Shape {
    Shape::Cylinder {
        radius_m,
        half_length_m,
    }
}

fn capsule(radius_m: f64, half_length_m: f64) -> Shape {
    Shape::Capsule {
        radius_m,
        half_length_m,
    }
}

fn cuboid(x: f64, y: f64, z: f64) -> Shape {
    Shape::Cuboid {
        half_extents_m: Vector3::new(x, y, z),
    }
}

/// The same box as a mesh.
fn box_mesh(x: f64, y: f64, z: f64) -> Shape {
    let corner = |i: usize, bit: usize| if i & bit == 0 { -1.0 } else { 1.0 };
    let vertices_m =
        (0..8).map(|i| Point3::new(x * corner(i, 1), y * corner(i, 2), z * corner(i, 4)));
    Shape::Convex(Arc::new(ConvexMesh(TriangleMesh {
        vertices_m: vertices_m.collect(),
        triangles: Vec::new(),
    })))
}

fn at(x: f64, y: f64, z: f64) -> Pose {
    Pose::translation(x, y, z)
}

/// Distance in both orders, after a common motion that hides the alignment.
#[track_caller]
fn check(a: &Shape, a_pose: &Pose, b: &Shape, b_pose: &Pose, expected_m: f64, tolerance_m: f64) {
    let (pa, pb) = (PreparedShape::new(a), PreparedShape::new(b));
    let motion = Pose::new(Vector3::new(0.3, -0.2, 0.1), Vector3::new(0.7, 1.1, -0.4));
    for world in [Pose::identity(), motion] {
        for distance_m in [
            separation(&pa, &(world * a_pose), &pb, &(world * b_pose)).distance_m,
            separation(&pb, &(world * b_pose), &pa, &(world * a_pose)).distance_m,
        ] {
            let error_m = distance_m - expected_m;
            assert!(
                error_m.abs() <= tolerance_m,
                "{distance_m} instead of {expected_m}, off by {error_m:e}: {a:?} {b:?}"
            );
        }
    }
}

#[test]
fn spheres() {
    let mut variety = Variety::new(1);
    for _ in 0..200 {
        let (r1, r2) = (variety.between(0.0, 0.2), variety.between(0.0, 0.2));
        let (a, b) = (variety.pose(0.3), variety.pose(0.3));
        let expected_m = (a.translation.vector - b.translation.vector).norm() - r1 - r2;
        check(
            &sphere(r1),
            &a,
            &sphere(r2),
            &b,
            expected_m,
            10.0 * CLOSED_FORM_M,
        );
    }
    // Concentric: any way out is as short.
    check(
        &sphere(0.1),
        &at(0.0, 0.0, 0.0),
        &sphere(0.3),
        &at(0.0, 0.0, 0.0),
        -0.4,
        1e-15,
    );
}

#[test]
fn sphere_and_cuboid() {
    let (ball, block) = (sphere(0.05), cuboid(0.1, 0.2, 0.3));
    for (centre, expected_m) in [
        ([0.4, 0.0, 0.0], 0.3 - 0.05),
        ([0.1 + 0.03, 0.2 + 0.04, 0.1], 0.05 - 0.05),
        ([0.1 + 0.02, 0.2 + 0.06, 0.3 + 0.09], 0.11 - 0.05),
        ([0.07, 0.0, 0.0], -0.03 - 0.05),
        ([0.0, 0.0, 0.0], -0.1 - 0.05),
    ] {
        let [x, y, z] = centre;
        for b in [&block, &box_mesh(0.1, 0.2, 0.3)] {
            check(
                &ball,
                &at(x, y, z),
                b,
                &at(0.0, 0.0, 0.0),
                expected_m,
                ITERATED_M,
            );
        }
    }
}

#[test]
fn sphere_and_cylinder() {
    let (ball, can) = (sphere(0.02), cylinder(0.1, 0.3));
    for (centre, expected_m) in [
        ([0.0, 0.25, 0.1], 0.15 - 0.02),
        ([0.03, 0.02, 0.4], 0.1 - 0.02),
        ([0.0, 0.1 + 0.03, 0.3 + 0.04], 0.05 - 0.02),
        ([0.06, 0.0, 0.1], -0.04 - 0.02),
        ([0.0, 0.0, -0.28], -0.02 - 0.02),
        ([0.0, 0.0, 0.0], -0.1 - 0.02),
    ] {
        let [x, y, z] = centre;
        check(
            &ball,
            &at(x, y, z),
            &can,
            &at(0.0, 0.0, 0.0),
            expected_m,
            10.0 * CLOSED_FORM_M,
        );
    }
    // A flat disc is left through its face, not through its side.
    check(
        &sphere(0.0133),
        &at(0.0, 0.0, 0.01),
        &cylinder(0.1309, 0.014),
        &at(0.0, 0.0, 0.0),
        -0.004 - 0.0133,
        CLOSED_FORM_M,
    );
}

#[test]
fn capsules() {
    let (a, b) = (capsule(0.03, 0.2), capsule(0.02, 0.1));
    let across = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), FRAC_PI_2);
    let crossed = |x: f64, y: f64, z: f64| Pose::from_parts(Translation3::new(x, y, z), across);
    let origin = at(0.0, 0.0, 0.0);
    let tolerance_m = 10.0 * CLOSED_FORM_M;
    check(
        &a,
        &origin,
        &b,
        &at(0.15, 0.0, 0.05),
        0.15 - 0.05,
        tolerance_m,
    );
    check(&a, &origin, &b, &at(0.0, 0.0, 0.5), 0.2 - 0.05, tolerance_m);
    check(
        &a,
        &origin,
        &b,
        &at(0.06, 0.0, 0.3 + 0.08),
        0.1 - 0.05,
        tolerance_m,
    );
    check(
        &a,
        &origin,
        &b,
        &crossed(0.15, 0.0, 0.1),
        0.15 - 0.05,
        tolerance_m,
    );
    check(
        &a,
        &origin,
        &b,
        &crossed(0.0, 0.3, 0.0),
        0.2 - 0.05,
        tolerance_m,
    );
    check(
        &a,
        &origin,
        &b,
        &crossed(0.01, 0.0, 0.0),
        0.01 - 0.05,
        tolerance_m,
    );
    // Crossing and coinciding axes have no volume in common: the radii alone part them.
    check(
        &a,
        &origin,
        &b,
        &crossed(0.0, 0.05, 0.1),
        -0.05,
        tolerance_m,
    );
    check(&a, &origin, &b, &at(0.0, 0.0, 0.05), -0.05, tolerance_m);
    check(
        &sphere(0.01),
        &at(0.0, 0.03, 0.24),
        &a,
        &origin,
        0.05 - 0.04,
        tolerance_m,
    );
}

#[test]
fn nearly_parallel_capsules() {
    let (a, b) = (capsule(0.01, 0.4), capsule(0.01, 0.4));
    for angle in [1e-3, 1e-6, 1e-8, 1e-10, 1e-12, 1e-15] {
        // The axes cross over the middle at a height of 1 mm.
        let turned = Pose::new(Vector3::new(0.0, 0.001, 0.0), Vector3::y() * angle);
        check(&a, &at(0.0, 0.0, 0.0), &b, &turned, 0.001 - 0.02, 1e-12);
    }
}

#[test]
fn aligned_cuboids() {
    let mut variety = Variety::new(2);
    for _ in 0..300 {
        let mut size_m = || variety.between(0.01, 0.2);
        let (ha, hb) = (
            Vector3::new(size_m(), size_m(), size_m()),
            Vector3::new(size_m(), size_m(), size_m()),
        );
        let offset = variety.vector(0.3);
        let gaps = offset.abs() - ha - hb;
        let expected_m = if gaps.max() > 0.0 {
            gaps.map(|gap| gap.max(0.0)).norm()
        } else {
            gaps.max()
        };
        let b_pose = at(offset.x, offset.y, offset.z);
        let a = cuboid(ha.x, ha.y, ha.z);
        for b in [cuboid(hb.x, hb.y, hb.z), box_mesh(hb.x, hb.y, hb.z)] {
            check(&a, &at(0.0, 0.0, 0.0), &b, &b_pose, expected_m, ITERATED_M);
        }
    }
}

/// So slender that the extreme points along all three axes lie on one line.
#[test]
fn rod_inside_a_bar() {
    let half = Vector3::new(0.547, 0.0024, 0.0235);
    let (radius_m, half_length_m) = (0.0006, 0.616);
    let axes = [
        Vector3::y() * FRAC_PI_2,
        Vector3::x() * FRAC_PI_2,
        Vector3::zeros(),
    ];
    for (along, turn) in axes.into_iter().enumerate() {
        let mut extent = half;
        extent[along] += half_length_m;
        check(
            &cuboid(half.x, half.y, half.z),
            &at(0.0, 0.0, 0.0),
            &capsule(radius_m, half_length_m),
            &Pose::new(Vector3::zeros(), turn),
            -extent.min() - radius_m,
            ITERATED_M,
        );
    }
}

#[test]
fn cylinders() {
    let (a, b) = (cylinder(0.1, 0.3), cylinder(0.05, 0.2));
    let across = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), FRAC_PI_2);
    let crossed = |x: f64, y: f64, z: f64| Pose::from_parts(Translation3::new(x, y, z), across);
    let origin = at(0.0, 0.0, 0.0);
    // Side by side, rim over rim, end to end.
    check(&a, &origin, &b, &at(0.25, 0.0, 0.1), 0.1, ITERATED_M);
    check(
        &a,
        &origin,
        &b,
        &at(0.15 + 0.03, 0.0, 0.5 + 0.04),
        0.05,
        ITERATED_M,
    );
    check(&a, &origin, &b, &at(0.02, 0.01, 0.6), 0.1, ITERATED_M);
    // Crossed, one cap towards the other's side.
    check(&a, &origin, &b, &crossed(0.25, 0.0, 0.1), 0.1, ITERATED_M);
    check(&a, &origin, &b, &crossed(0.0, 0.4, 0.1), 0.1, ITERATED_M);
    // Penetrating: sides, ends, one inside the other.
    check(&a, &origin, &b, &at(0.12, 0.0, 0.1), -0.03, ITERATED_M);
    check(&a, &origin, &b, &at(0.02, 0.0, 0.47), -0.03, ITERATED_M);
    check(&a, &origin, &b, &crossed(0.13, 0.0, 0.0), -0.02, ITERATED_M);
    check(&a, &origin, &b, &at(0.0, 0.0, 0.0), -0.15, COAXIAL_M);
    check(&a, &origin, &b, &at(0.0, 0.0, 0.1), -0.15, COAXIAL_M);
    check(
        &a,
        &origin,
        &capsule(0.01, 0.2),
        &at(0.0, 0.0, 0.0),
        -0.11,
        COAXIAL_M,
    );
}

#[test]
fn cylinder_on_a_plate() {
    let plate = cuboid(0.5, 0.5, 0.01);
    for gap_m in [0.1, 1e-6, 0.0, -1e-6, -0.015] {
        for other in [&plate, &box_mesh(0.5, 0.5, 0.01)] {
            let standing = at(0.1, 0.05, 0.2 + 0.01 + gap_m);
            check(
                &cylinder(0.05, 0.2),
                &standing,
                other,
                &at(0.0, 0.0, 0.0),
                gap_m,
                ITERATED_M,
            );
            let lying = Pose::new(
                Vector3::new(0.1, 0.05, 0.05 + 0.01 + gap_m),
                Vector3::y() * FRAC_PI_2,
            );
            check(
                &cylinder(0.05, 0.2),
                &lying,
                other,
                &at(0.0, 0.0, 0.0),
                gap_m,
                ITERATED_M,
            );
            check(
                &capsule(0.05, 0.2),
                &lying,
                other,
                &at(0.0, 0.0, 0.0),
                gap_m,
                ITERATED_M,
            );
        }
    }
}

#[test]
fn needle_line_against_solids() {
    let solid = |name: &str, shape, parent_from_shape| Solid {
        name: name.into(),
        shape,
        parent_from_shape,
    };
    let solids = [
        solid("rib", capsule(0.006, 0.05), at(0.03, 0.0, 0.0)),
        solid("vessel", sphere(0.01), at(0.0, 0.004, 0.02)),
        solid("organ", cuboid(0.1, 0.1, 0.1), at(0.0, 0.0, -0.3)),
    ];
    let world_from_parent = Pose::new(Vector3::new(0.4, 0.1, -0.2), Vector3::new(0.3, -0.9, 0.2));
    let ends = [Point3::new(0.0, -0.1, 0.0), Point3::new(0.0, 0.1, 0.0)];
    let [from, to] = ends.map(|end| world_from_parent * end);
    let found = segment_clearance(&from, &to, 0.001, &solids, &world_from_parent);
    let expected_m = [0.03 - 0.006 - 0.001, 0.02 - 0.01 - 0.001, 0.2 - 0.001];
    for (separation, expected_m) in found.iter().zip(expected_m) {
        assert!((separation.distance_m - expected_m).abs() <= ITERATED_M);
    }
    assert_eq!(found.len(), 3);
    // A line of no length is a ball.
    let middle = nalgebra::center(&from, &to);
    let ball = segment_clearance(&middle, &middle, 0.002, &solids, &world_from_parent);
    assert!((ball[0].distance_m - (0.03 - 0.006 - 0.002)).abs() <= ITERATED_M);
}
