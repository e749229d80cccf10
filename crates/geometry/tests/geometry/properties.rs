//! What holds for any two convex shapes.

use std::sync::Arc;

use crate::common::Variety;
use crate::common::solids::{bowl, torus};
use nalgebra::{Point3, Translation3, Vector3};
use needlebench_geometry::sample_solids::ellipsoid;
use needlebench_geometry::{
    ConvexMesh, Placement, PreparedShape, PreparedSolids, Separation, Shape, Solid, TriangleMesh,
    is_nearer, separation,
};
use needlebench_kinematics::Pose;

/// Distances of shapes of centimetres to metres are reproduced to this; rounding and the
/// solver's certificate of 1e-10 m.
const REPRODUCED_M: f64 = 1e-9;

/// Witness points against distance and normal.
const WITNESS_M: f64 = 1e-9;

/// Witness points against the surfaces. In penetration a face stands for a smooth surface, which
/// is off by its sagitta, the certificate's width.
const ON_SURFACE_M: f64 = 1e-8;

fn placed_pairs(seed: u64, count: usize, mut visit: impl FnMut(Pair)) {
    let mut variety = Variety::new(seed);
    for _ in 0..count {
        let shapes = [variety.shapes(), variety.shapes()];
        for a in &shapes[0] {
            for b in &shapes[1] {
                visit(Pair {
                    a: PreparedShape::new(a),
                    b: PreparedShape::new(b),
                    a_pose: variety.pose(0.15),
                    b_pose: variety.pose(0.15),
                    motion: variety.pose(1.0),
                    kinds: format!("{a:?} {b:?}"),
                });
            }
        }
    }
}

struct Pair {
    a: PreparedShape,
    b: PreparedShape,
    a_pose: Pose,
    b_pose: Pose,
    motion: Pose,
    kinds: String,
}

impl Pair {
    fn separation(&self) -> Separation {
        separation(&self.a, &self.a_pose, &self.b, &self.b_pose)
    }
}

#[test]
fn the_order_of_the_shapes_does_not_matter() {
    placed_pairs(11, 200, |pair| {
        let forth = pair.separation();
        let back = separation(&pair.b, &pair.b_pose, &pair.a, &pair.a_pose);
        let error_m = forth.distance_m - back.distance_m;
        assert!(error_m.abs() <= REPRODUCED_M, "{error_m:e} {}", pair.kinds);
    });
}

#[test]
fn a_common_motion_changes_nothing() {
    placed_pairs(12, 200, |pair| {
        let there = pair.separation();
        let elsewhere = separation(
            &pair.a,
            &(pair.motion * pair.a_pose),
            &pair.b,
            &(pair.motion * pair.b_pose),
        );
        let error_m = there.distance_m - elsewhere.distance_m;
        assert!(error_m.abs() <= REPRODUCED_M, "{error_m:e} {}", pair.kinds);
    });
}

#[test]
fn witness_points_lie_on_both_surfaces_a_distance_apart() {
    let point = PreparedShape::new(&Shape::Sphere { radius_m: 0.0 });
    placed_pairs(13, 200, |pair| {
        let found = pair.separation();
        let normal = found.normal.into_inner();
        assert!((normal.norm() - 1.0).abs() < 1e-12);
        let between = found.point_on_b - found.point_on_a - normal * found.distance_m;
        assert!(between.norm() <= WITNESS_M, "{between:?} {}", pair.kinds);
        for (witness, shape, pose) in [
            (found.point_on_a, &pair.a, &pair.a_pose),
            (found.point_on_b, &pair.b, &pair.b_pose),
        ] {
            let witness = Pose::from_parts(Translation3::from(witness.coords), pose.rotation);
            let off_m = separation(&point, &witness, shape, pose).distance_m;
            assert!(off_m.abs() <= ON_SURFACE_M, "{off_m:e} {}", pair.kinds);
        }
    });
}

#[test]
fn moving_by_the_distance_makes_them_touch() {
    placed_pairs(14, 200, |pair| {
        let found = pair.separation();
        let step = Translation3::from(found.normal.into_inner() * found.distance_m);
        let touching = separation(&pair.a, &(step * pair.a_pose), &pair.b, &pair.b_pose);
        let left_m = touching.distance_m;
        assert!(left_m.abs() <= REPRODUCED_M, "{left_m:e} {}", pair.kinds);
    });
}

#[test]
fn thin_and_long_shapes_are_reproduced_too() {
    let mut variety = Variety::new(15);
    for _ in 0..3000 {
        // Needles of 0.6 mm, plates of a millimetre, tables of two metres.
        let mut size_m = || libm::pow(10_f64, variety.between(-3.3, 0.3));
        let half_extents_m = Vector3::new(size_m(), size_m(), size_m());
        let plate = PreparedShape::new(&Shape::Cuboid { half_extents_m });
        let rod = PreparedShape::new(&Shape::Cylinder {
            radius_m: size_m(),
            half_length_m: size_m(),
        });
        let (a, b) = (variety.pose(0.5), variety.pose(0.5));
        let forth = separation(&plate, &a, &rod, &b).distance_m;
        let back = separation(&rod, &b, &plate, &a).distance_m;
        // 10 times more than for ordinary shapes, like the sizes.
        let error_m = forth - back;
        assert!(error_m.abs() <= 10.0 * REPRODUCED_M, "{error_m:e}");
    }
}

/// A mesh with its surface is walked along its edges; without, or if it is dented, all vertices
/// are scanned. The hull is the same.
#[test]
fn walking_a_mesh_finds_what_scanning_finds() {
    let convex =
        |mesh: TriangleMesh| PreparedShape::new(&Shape::Convex(Arc::new(ConvexMesh(mesh))));
    let round = ellipsoid(14, 15, Vector3::new(0.17, 0.11, 0.28));
    let scanned = TriangleMesh {
        triangles: Vec::new(),
        ..round.clone()
    };
    // A dent is no part of the hull, and its neighbours make a walk stop short.
    let mut dented = round.clone();
    for dent in &mut dented.vertices_m[50..54] {
        *dent = Point3::from(dent.coords * 0.8);
    }
    let dented_scanned = TriangleMesh {
        triangles: Vec::new(),
        ..dented.clone()
    };
    let rod = PreparedShape::new(&Shape::Cylinder {
        radius_m: 0.02,
        half_length_m: 0.1,
    });
    let mut variety = Variety::new(16);
    for [walked, scanned] in [
        [convex(round), convex(scanned)],
        [convex(dented), convex(dented_scanned)],
    ] {
        for _ in 0..500 {
            let (a, b) = (variety.pose(0.25), variety.pose(0.1));
            let one = separation(&rod, &a, &walked, &b).distance_m;
            let other = separation(&rod, &a, &scanned, &b).distance_m;
            assert!((one - other).abs() <= REPRODUCED_M, "{one} {other}");
        }
    }
}

#[test]
fn degenerate_shapes_have_finite_distances() {
    let flat = [
        Shape::Cylinder {
            radius_m: 0.0,
            half_length_m: 0.1,
        },
        Shape::Cylinder {
            radius_m: 0.1,
            half_length_m: 0.0,
        },
        Shape::Cuboid {
            half_extents_m: Vector3::new(0.1, 0.1, 0.0),
        },
        Shape::Cuboid {
            half_extents_m: Vector3::zeros(),
        },
        Shape::Convex(Arc::new(ConvexMesh(TriangleMesh {
            vertices_m: Vec::new(),
            triangles: Vec::new(),
        }))),
    ];
    for a in &flat {
        for b in &flat {
            let (a, b) = (PreparedShape::new(a), PreparedShape::new(b));
            let origin = Pose::identity();
            // What has no volume cannot penetrate.
            let touching_m = separation(&a, &origin, &b, &origin).distance_m;
            assert!(touching_m.abs() <= 0.1, "{touching_m}");
            let apart_m = separation(&a, &origin, &b, &Pose::translation(1.0, 0.0, 0.0)).distance_m;
            assert!((0.79..=1.0).contains(&apart_m), "{apart_m}");
        }
    }
}

#[test]
fn prepared_solids_contain_what_solids_contain() {
    let mut variety = Variety::new(31);
    let (mut inside, mut all) = (0, 0);
    for _ in 0..40 {
        let meshes = [
            Shape::of_surface(bowl()),
            Shape::of_surface(torus(0.08, 0.03, 24, 12)),
        ];
        let shapes = variety.shapes().into_iter().chain(meshes);
        let solids: Vec<Solid> = shapes
            .map(|shape| Solid {
                name: String::new(),
                shape,
                parent_from_shape: variety.pose(0.05),
            })
            .collect();
        let prepared = PreparedSolids::new(&solids);
        for _ in 0..60 {
            let point = Point3::from(variety.vector(0.15));
            for (index, solid) in solids.iter().enumerate() {
                let here = solid.contains(&point);
                assert_eq!(
                    prepared.contains(index, &point),
                    here,
                    "{point} {:?}",
                    solid.shape
                );
                inside += usize::from(here);
                all += 1;
            }
        }
    }
    assert!(
        inside > all / 10 && inside < all * 9 / 10,
        "{inside} of {all}"
    );
}

#[test]
fn what_is_nearer_than_a_limit_is_told_without_its_depth() {
    let mut variety = Variety::new(37);
    let (mut near, mut deep, mut all) = (0, 0, 0);
    for _ in 0..60 {
        let meshes = || {
            [
                Shape::of_surface(bowl()),
                Shape::of_surface(torus(0.08, 0.03, 24, 12)),
            ]
        };
        let mut shapes = || {
            variety
                .shapes()
                .into_iter()
                .chain(meshes())
                .collect::<Vec<_>>()
        };
        let [ones, others] = [shapes(), shapes()];
        for one in &ones {
            for other in &others {
                let (a, b) = (PreparedShape::new(one), PreparedShape::new(other));
                let [a_pose, b_pose] = [variety.pose(0.15), variety.pose(0.15)];
                let found_m = separation(&a, &a_pose, &b, &b_pose).distance_m;
                let b_from_a = Placement::new(&b_pose).inverse_after(&Placement::new(&a_pose));
                for limit_m in [
                    -0.02,
                    0.0,
                    1e-6,
                    0.008,
                    0.05,
                    found_m + 1e-8,
                    found_m - 1e-8,
                ] {
                    assert_eq!(
                        is_nearer(&a, &b, &b_from_a, limit_m),
                        found_m < limit_m,
                        "{found_m} {limit_m} {one:?} {other:?}"
                    );
                    all += 1;
                    near += usize::from(found_m < limit_m);
                }
                deep += usize::from(found_m < -1e-3);
            }
        }
    }
    assert!(near > all / 10 && near < all * 9 / 10, "{near} of {all}");
    assert!(deep > 300, "{deep}");
}
