//! Triangle meshes against closed forms, against the solver for convex shapes where the mesh is
//! convex, and against brute force over all triangles. Run with `--nocapture` for the table.

use std::f64::consts::PI;
use std::sync::Arc;

use crate::common::Variety;
use crate::common::solids::{angle_iron, bowl, box_mesh, inverted, merged, torus};
use nalgebra::{Isometry3, Point3, Vector3};
use needlebench_geometry::mesh::{open_edges, read_stl};
use needlebench_geometry::sample_solids::ellipsoid;
use needlebench_geometry::{
    ConvexMesh, PreparedShape, Separation, Shape, Solid, SolidMesh, TriangleMesh,
    segment_clearance, separation,
};
use needlebench_kinematics::Pose;

/// Largest overestimate of a signed distance, the unsafe side: the goal.
const OVERESTIMATE_M: f64 = 1e-9;

/// Largest underestimate: the certificate of 1e-10 m and rounding.
const UNDERESTIMATE_M: f64 = 1e-9;

/// Penetration that a reported way out may leave: the certificate and rounding.
const LEFT_M: f64 = 1e-9;

fn solid_mesh(surface: TriangleMesh) -> Shape {
    Shape::Mesh(Arc::new(SolidMesh::new(surface)))
}

fn convex(surface: TriangleMesh) -> Shape {
    Shape::Convex(Arc::new(ConvexMesh(surface)))
}

fn gap(a: &Shape, a_pose: &Pose, b: &Shape, b_pose: &Pose) -> Separation {
    separation(
        &PreparedShape::new(a),
        a_pose,
        &PreparedShape::new(b),
        b_pose,
    )
}

// ---- An independent distance of triangles, edge by edge ----

type Triangle = [Vector3<f64>; 3];

fn point_to_segment_m(p: Vector3<f64>, a: Vector3<f64>, b: Vector3<f64>) -> f64 {
    let ab = b - a;
    let t = (p - a).dot(&ab) / ab.norm_squared();
    (a + ab
        * if t.is_finite() {
            t.clamp(0.0, 1.0)
        } else {
            0.0
        }
        - p)
        .norm()
}

fn point_to_triangle_m(p: Vector3<f64>, t: &Triangle) -> f64 {
    let normal = (t[1] - t[0]).cross(&(t[2] - t[0])).normalize();
    let height = (p - t[0]).dot(&normal);
    let foot = p - normal * height;
    let inside = (0..3).all(|i| (t[(i + 1) % 3] - t[i]).cross(&(foot - t[i])).dot(&normal) >= 0.0);
    if inside {
        return height.abs();
    }
    (0..3)
        .map(|i| point_to_segment_m(p, t[i], t[(i + 1) % 3]))
        .fold(f64::INFINITY, f64::min)
}

/// Alternating projections end at the closest points of two segments; the closed form at the
/// lines' common perpendicular is checked where it is on both.
fn segments_m(a: [Vector3<f64>; 2], b: [Vector3<f64>; 2]) -> f64 {
    let ends = [
        point_to_segment_m(a[0], b[0], b[1]),
        point_to_segment_m(a[1], b[0], b[1]),
        point_to_segment_m(b[0], a[0], a[1]),
        point_to_segment_m(b[1], a[0], a[1]),
    ];
    let (u, v, w) = (a[1] - a[0], b[1] - b[0], b[0] - a[0]);
    let normal = u.cross(&v);
    let squared = normal.norm_squared();
    let mut least = ends.into_iter().fold(f64::INFINITY, f64::min);
    if squared > 0.0 {
        let s = w.cross(&v).dot(&normal) / squared;
        let t = w.cross(&u).dot(&normal) / squared;
        if (0.0..=1.0).contains(&s) && (0.0..=1.0).contains(&t) {
            least = least.min((w.dot(&normal) / squared.sqrt()).abs());
        }
    }
    least
}

/// Of two triangles that do not cross.
fn triangles_m(a: &Triangle, b: &Triangle) -> f64 {
    let mut least = f64::INFINITY;
    for i in 0..3 {
        least = least
            .min(point_to_triangle_m(a[i], b))
            .min(point_to_triangle_m(b[i], a));
        for j in 0..3 {
            least = least.min(segments_m([a[i], a[(i + 1) % 3]], [b[j], b[(j + 1) % 3]]));
        }
    }
    least
}

fn triangles_of(mesh: &TriangleMesh, pose: &Isometry3<f64>) -> Vec<Triangle> {
    let placed: Vec<_> = mesh.vertices_m.iter().map(|v| (pose * v).coords).collect();
    let corners = |t: &[u32; 3]| t.map(|i| placed[i as usize]);
    mesh.triangles.iter().map(corners).collect()
}

fn brute_force_m(a: &[Triangle], b: &[Triangle]) -> f64 {
    let mut least = f64::INFINITY;
    for one in a {
        for other in b {
            least = least.min(triangles_m(one, other));
        }
    }
    least
}

/// The surface of what the brute force can take, and the radius around it.
fn faceted(shape: &Shape) -> (TriangleMesh, f64) {
    match shape {
        Shape::Cuboid { half_extents_m: h } => (box_mesh([-h.x, -h.y, -h.z], [h.x, h.y, h.z]), 0.0),
        Shape::Convex(mesh) => (mesh.0.clone(), 0.0),
        Shape::Mesh(mesh) => (mesh.surface().clone(), 0.0),
        Shape::Sphere { radius_m } => (needle(1e-13), *radius_m),
        Shape::Capsule {
            radius_m,
            half_length_m,
        } => (needle(*half_length_m), *radius_m),
        Shape::Cylinder { .. } => unreachable!("a cylinder has no facets"),
    }
}

/// A segment as a triangle that is thinner than an atom.
fn needle(half: f64) -> TriangleMesh {
    TriangleMesh {
        vertices_m: vec![
            Point3::new(0.0, 0.0, -half),
            Point3::new(0.0, 0.0, half),
            Point3::new(1e-13, 0.0, 0.0),
        ],
        triangles: vec![[0, 1, 2]],
    }
}

#[derive(Default)]
struct Row {
    cases: [usize; 2],
    over_m: f64,
    under_m: f64,
}

impl Row {
    fn add(&mut self, found_m: f64, expected_m: f64) {
        self.cases[usize::from(expected_m < 0.0)] += 1;
        self.over_m = self.over_m.max(found_m - expected_m);
        self.under_m = self.under_m.max(expected_m - found_m);
    }

    fn check(&self, name: &str) {
        println!(
            "{name:28} apart {:4} in {:4} over {:8.1e} under {:8.1e}",
            self.cases[0], self.cases[1], self.over_m, self.under_m
        );
        assert!(self.over_m <= OVERESTIMATE_M, "{name} {:e}", self.over_m);
        assert!(self.under_m <= UNDERESTIMATE_M, "{name} {:e}", self.under_m);
    }
}

const NAMES: [&str; 5] = ["sphere", "cylinder", "capsule", "cuboid", "convex"];

#[test]
fn a_convex_mesh_is_what_the_convex_solver_says_on_both_sides() {
    let mut variety = Variety::new(31);
    for (kind, name) in NAMES.iter().enumerate() {
        let mut row = Row::default();
        for _ in 0..60 {
            let shape = variety.shapes()[kind].clone();
            let half = Vector3::from_fn(|_, _| variety.between(0.05, 0.2));
            let (mesh, reference) = if variety.between(0.0, 1.0) < 0.5 {
                let mesh = box_mesh((-half).into(), half.into());
                (
                    mesh,
                    Shape::Cuboid {
                        half_extents_m: half,
                    },
                )
            } else {
                let mesh = ellipsoid(9, 11, half);
                (mesh.clone(), convex(mesh))
            };
            let mesh = solid_mesh(mesh);
            let (a, b) = (variety.pose(0.2), variety.pose(0.05));
            let expected_m = gap(&shape, &a, &reference, &b).distance_m;
            row.add(gap(&shape, &a, &mesh, &b).distance_m, expected_m);
            row.add(gap(&mesh, &b, &shape, &a).distance_m, expected_m);
        }
        row.check(&format!("{name}, convex mesh"));
    }
}

#[test]
fn two_convex_meshes_are_what_the_convex_solver_says_on_both_sides() {
    let mut variety = Variety::new(32);
    let mut row = Row::default();
    for _ in 0..40 {
        let [one, other] =
            [0, 1].map(|_| ellipsoid(6, 7, Vector3::from_fn(|_, _| variety.between(0.05, 0.2))));
        let (a, b) = (variety.pose(0.2), variety.pose(0.05));
        let expected_m = gap(&convex(one.clone()), &a, &convex(other.clone()), &b).distance_m;
        let found = gap(&solid_mesh(one), &a, &solid_mesh(other), &b);
        row.add(found.distance_m, expected_m);
    }
    row.check("convex mesh, convex mesh");
}

#[test]
fn apart_every_shape_is_as_far_as_brute_force_over_all_triangles_says() {
    let mut variety = Variety::new(33);
    let meshes = [torus(0.2, 0.06, 18, 10), bowl(), angle_iron()];
    for kind in [0, 2, 3, 4, 5] {
        let mut row = Row::default();
        for round in 0..24 {
            let mesh = &meshes[round % 3];
            let shape = match kind {
                5 => solid_mesh(torus(0.1, 0.02, 7, 4)),
                kind => variety.shapes()[kind].clone(),
            };
            let (a, b) = (variety.pose(0.35), variety.pose(0.1));
            let found_m = gap(&shape, &a, &solid_mesh(mesh.clone()), &b).distance_m;
            let (surface, radius_m) = faceted(&shape);
            let expected_m =
                brute_force_m(&triangles_of(&surface, &a), &triangles_of(mesh, &b)) - radius_m;
            if found_m > 0.0 {
                row.add(found_m, expected_m);
            }
        }
        assert!(row.cases[0] >= 10);
        let name = NAMES.get(kind).copied().unwrap_or("mesh");
        row.check(&format!("{name}, brute force"));
    }
}

#[test]
fn cylinders_keep_the_distance_of_the_nearest_triangle() {
    let mut variety = Variety::new(34);
    let mesh = torus(0.2, 0.06, 12, 8);
    let mut row = Row::default();
    for _ in 0..30 {
        let shape = variety.shapes()[1].clone();
        let (a, b) = (variety.pose(0.4), variety.pose(0.1));
        let found_m = gap(&shape, &a, &solid_mesh(mesh.clone()), &b).distance_m;
        let least_m = triangles_of(&mesh, &Pose::identity())
            .into_iter()
            .map(|corners| {
                let alone = TriangleMesh {
                    vertices_m: corners.map(Point3::from).to_vec(),
                    triangles: Vec::new(),
                };
                gap(&shape, &a, &convex(alone), &b).distance_m
            })
            .fold(f64::INFINITY, f64::min);
        if found_m > 0.0 {
            row.add(found_m, least_m);
        }
    }
    assert!(row.cases[0] >= 10);
    row.check("cylinder, brute force");
}

#[test]
fn what_is_in_a_notch_a_hole_or_a_cavity_is_free() {
    let ball = |radius_m: f64| Shape::Sphere { radius_m };
    let at = Pose::translation;
    let mut row = Row::default();
    let mut check = |a: &Shape, at_a: Pose, b: &TriangleMesh, expected_m: f64| {
        let motion = Pose::new(Vector3::new(0.3, -0.2, 0.1), Vector3::new(0.7, 1.1, -0.4));
        let b = solid_mesh(b.clone());
        for world in [Pose::identity(), motion] {
            row.add(gap(a, &(world * at_a), &b, &world).distance_m, expected_m);
            row.add(gap(&b, &world, a, &(world * at_a)).distance_m, expected_m);
        }
    };
    // In the notch of the L, where its hull is.
    let iron = angle_iron();
    check(&ball(0.02), at(0.15, 0.16, 0.0), &iron, 0.03);
    let cube = Shape::Cuboid {
        half_extents_m: Vector3::repeat(0.03),
    };
    check(&cube, at(0.15, 0.14, 0.1), &iron, 0.01);
    // In the bars: the shortest way out is across.
    check(&ball(0.02), at(0.04, 0.25, 0.0), &iron, -0.06);
    check(&ball(0.02), at(0.25, 0.07, 0.0), &iron, -0.05);
    check(&cube, at(0.25, 0.09, 0.0), &iron, -0.04);
    check(&cube, at(0.09, 0.25, 0.0), &iron, -0.04);
    // Touching the inner edge of the notch's corner from a bar's inside.
    check(&ball(0.0), at(0.25, 0.02, 0.0), &iron, -0.02);
    // In a cavity, and in the wall around it.
    let hollow = merged([
        box_mesh([-0.2; 3], [0.2; 3]),
        inverted(box_mesh([-0.1; 3], [0.1; 3])),
    ]);
    check(&ball(0.03), at(0.02, 0.0, 0.0), &hollow, 0.05);
    check(&cube, at(0.0, 0.0, 0.05), &hollow, 0.02);
    check(&ball(0.01), at(0.17, 0.0, 0.0), &hollow, -0.04);
    check(&ball(0.01), at(0.13, 0.0, 0.0), &hollow, -0.04);
    // Wholly inside, far from the surface, without a triangle touched.
    let block = box_mesh([-0.2, -0.3, -0.4], [0.2, 0.3, 0.4]);
    check(&ball(0.01), at(0.05, 0.0, 0.0), &block, -0.16);
    check(&cube, at(0.0, 0.2, 0.0), &block, -0.13);
    // Two parts that overlap are one solid.
    let pair = merged([
        box_mesh([-0.2, -0.1, -0.1], [0.05, 0.1, 0.1]),
        box_mesh([-0.05, -0.1, -0.1], [0.2, 0.1, 0.1]),
    ]);
    check(&ball(0.01), at(0.0, 0.0, 0.08), &pair, -0.03);
    // A mesh within a mesh, without the surfaces meeting.
    let inner = solid_mesh(box_mesh([-0.01; 3], [0.01; 3]));
    check(&inner, at(0.1, 0.0, 0.0), &block, -0.11);
    check(&inner, at(0.0, 0.02, 0.0), &hollow, 0.07);
    row.check("notch, cavity, closed form");
}

#[test]
fn a_ball_in_the_hole_of_a_torus_is_free() {
    // Flat facets are at most this much inside the round torus.
    let (ring_m, tube_m, n, m) = (0.2, 0.06, 120, 60);
    let sag_m = |r: f64, n: u32| r * (1.0 - libm::cos(PI / f64::from(n)));
    let coarse_m = sag_m(ring_m + tube_m, n) + sag_m(tube_m, m);
    let mesh = PreparedShape::new(&solid_mesh(torus(ring_m, tube_m, n, m)));
    let mut variety = Variety::new(35);
    for _ in 0..100 {
        let p = variety.vector(0.3);
        let exact_m = libm::hypot(libm::hypot(p.x, p.y) - ring_m, p.z) - tube_m;
        let ball = PreparedShape::new(&Shape::Sphere { radius_m: 0.0 });
        let at = Pose::translation(p.x, p.y, p.z);
        let found_m = separation(&ball, &at, &mesh, &Pose::identity()).distance_m;
        assert!((found_m - exact_m).abs() <= coarse_m, "{found_m} {exact_m}");
    }
}

/// Depth by trying many directions, each with bisection of the first length that is free.
fn depth_by_brute_force_m(shape: &Shape, a: &Pose, mesh: &Shape, b: &Pose) -> f64 {
    let (shape, mesh) = (PreparedShape::new(shape), PreparedShape::new(mesh));
    let free = |way: Vector3<f64>| {
        let moved = Pose::from(way) * a;
        separation(&shape, &moved, &mesh, b).distance_m >= 0.0
    };
    let (count, step_m) = (60, 0.003);
    let golden = PI * (3.0 - 5.0_f64.sqrt());
    let mut least_m = f64::INFINITY;
    for i in 0..count {
        let z = 1.0 - (2.0 * f64::from(i) + 1.0) / f64::from(count);
        let (sin, cos) = libm::sincos(golden * f64::from(i));
        let across = (1.0 - z * z).sqrt();
        let u = Vector3::new(across * cos, across * sin, z);
        let mut length_m = 0.0;
        while length_m < least_m && length_m < 1.0 {
            if free(u * length_m) {
                least_m = length_m;
            }
            length_m += step_m;
        }
    }
    least_m
}

#[test]
fn a_reported_way_out_parts_the_shapes_and_is_short() {
    let mut variety = Variety::new(36);
    let meshes = [torus(0.2, 0.06, 14, 8), bowl(), angle_iron()];
    let mut ratios = Vec::new();
    for round in 0..60 {
        let mesh = solid_mesh(meshes[round % 3].clone());
        let shape = match round % 6 {
            5 => solid_mesh(angle_iron()),
            kind => variety.shapes()[kind].clone(),
        };
        let (a, b) = (variety.pose(0.25), variety.pose(0.05));
        let found = gap(&shape, &a, &mesh, &b);
        if found.distance_m >= 0.0 {
            continue;
        }
        let between = found.point_on_b - found.point_on_a;
        let off = between - found.normal.into_inner() * found.distance_m;
        assert!(off.norm() <= 1e-12, "{off:?}");
        let out = Pose::from(found.normal.into_inner() * found.distance_m) * a;
        let left_m = gap(&shape, &out, &mesh, &b).distance_m;
        assert!(left_m.abs() <= LEFT_M, "{round} {left_m:e}");
        if ratios.len() < 8 {
            let brute_m = depth_by_brute_force_m(&shape, &a, &mesh, &b);
            ratios.push(-found.distance_m / brute_m);
        }
    }
    ratios.sort_by(f64::total_cmp);
    println!("depth over brute force: {ratios:.3?}");
    // The brute force is coarse: 3 mm and some 15 degrees.
    assert!(ratios[ratios.len() / 2] <= 1.02);
    assert!(ratios[ratios.len() - 1] <= 1.25);
}

#[test]
fn a_needle_route_runs_past_a_mesh() {
    let solids = [Solid {
        name: "iron".into(),
        shape: solid_mesh(angle_iron()),
        parent_from_shape: Pose::translation(0.1, 0.0, 0.0),
    }];
    let route = segment_clearance(
        &Point3::new(0.25, 0.13, -0.3),
        &Point3::new(0.25, 0.13, 0.3),
        0.001,
        &solids,
        &Pose::identity(),
    );
    assert!((route[0].distance_m - 0.029).abs() <= UNDERESTIMATE_M);
}

#[test]
fn a_position_that_is_no_number_has_no_distance() {
    let mesh = solid_mesh(angle_iron());
    let nowhere = Pose::translation(f64::NAN, 0.0, 0.0);
    for (a, b) in [(nowhere, Pose::identity()), (Pose::identity(), nowhere)] {
        assert!(gap(&mesh, &a, &mesh, &b).distance_m.is_nan());
    }
}

/// A cube as a text STL, whose corners are `noise` where every other triangle has 0.
fn noisy_cube(noise: &str) -> String {
    let corner = |index: usize| [index >> 2 & 1, index >> 1 & 1, index & 1];
    let faces = [
        [0, 1, 3],
        [0, 3, 2],
        [4, 6, 7],
        [4, 7, 5],
        [0, 4, 5],
        [0, 5, 1],
        [2, 3, 7],
        [2, 7, 6],
        [0, 2, 6],
        [0, 6, 4],
        [1, 5, 7],
        [1, 7, 3],
    ];
    let mut text = "solid cube\n".to_owned();
    for (number, face) in faces.iter().enumerate() {
        text += "facet normal 0 0 0\nouter loop\n";
        for &index in face {
            text += "vertex";
            for side in corner(index) {
                text += match (side, number % 2) {
                    (1, _) => " 200.0",
                    (_, 0) => " 0.0",
                    _ => noise,
                };
            }
            text += "\n";
        }
        text += "endloop\nendfacet\n";
    }
    text + "endsolid cube\n"
}

#[test]
fn corners_as_near_as_rounding_are_one() {
    for noise in [" 2.731848e-16", " -1e-7", " 1.0e-5"] {
        let text = noisy_cube(noise);
        for text in [text.clone(), text.to_ascii_uppercase()] {
            let mesh = read_stl(text.as_bytes(), [1e-3; 3]).unwrap();
            assert_eq!(
                (mesh.vertices_m.len(), open_edges(&mesh)),
                (8, 0),
                "{noise}"
            );
        }
    }
    // What is apart stays apart.
    let mesh = read_stl(noisy_cube(" 0.01").as_bytes(), [1e-3; 3]).unwrap();
    assert!(open_edges(&mesh) > 0);
}
