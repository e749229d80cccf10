//! A convex piece, a capsule and a segment against a triangle mesh that is not convex.

use std::f64::consts::{PI, TAU};
use std::hint::black_box;
use std::sync::Arc;
use std::time::Instant;

use nalgebra::{Point3, Translation3, UnitQuaternion, Vector3};
use needlebench_geometry::mesh::convex_hull;
use needlebench_geometry::{PreparedShape, Shape, SolidMesh, TriangleMesh, separation};
use needlebench_kinematics::Pose;
use needlebench_numerics::random::SplitMix64;
use serde_json::{Value, json};

/// Poses of each pair of shapes.
const POSES: usize = 200;

/// Times that every pose is asked for; the quickest counts.
const PASSES: usize = 3;

/// Vertices of the convex piece: on a sphere, so that all of them are extreme.
const HULL_VERTICES: usize = 100;

/// Subdivisions of an icosahedron: `20 * 4^5 = 20480` triangles.
const SUBDIVISIONS: usize = 5;

/// All poses are between these from the mesh's middle, m: beside it, never in it.
const DISTANCE_M: [f64; 2] = [0.31, 0.8];

/// What `compare.py` gives to Coal: shapes, poses, our distances and times.
pub(crate) fn export(seed: u64) -> Value {
    let mut random = SplitMix64::new(seed);
    let mesh = bumpy_sphere();
    let surface = TriangleMesh {
        vertices_m: mesh.vertices_m.clone(),
        triangles: mesh.triangles.clone(),
    };
    let solid = Shape::Mesh(Arc::new(SolidMesh::new(mesh)));
    let points: Vec<Point3<f64>> = (0..HULL_VERTICES)
        .map(|_| Point3::from(direction(&mut random) * 0.05))
        .collect();
    let hull = convex_hull(&points).expect("points on a sphere have a hull");
    let others = [
        ("convex", Shape::Convex(Arc::new(hull))),
        (
            "capsule",
            Shape::Capsule {
                radius_m: 0.02,
                half_length_m: 0.1,
            },
        ),
        // A segment is a capsule without a radius.
        (
            "segment",
            Shape::Capsule {
                radius_m: 0.0,
                half_length_m: 0.1,
            },
        ),
    ];
    let prepared_mesh = PreparedShape::new(&solid);
    let cases: Vec<Value> = others
        .iter()
        .map(|(name, shape)| case(name, shape, &prepared_mesh, &mut random))
        .collect();
    json!({"mesh": super::triangles("mesh", &surface), "cases": cases})
}

fn case(name: &str, shape: &Shape, mesh: &PreparedShape, random: &mut SplitMix64) -> Value {
    let prepared = PreparedShape::new(shape);
    let poses: Vec<Pose> = (0..POSES)
        .map(|_| {
            let place = direction(random) * random.uniform(DISTANCE_M[0], DISTANCE_M[1]);
            let turn = direction(random) * random.uniform(0.0, PI);
            Pose::from_parts(Translation3::from(place), UnitQuaternion::new(turn))
        })
        .collect();
    let distances: Vec<f64> = poses
        .iter()
        .map(|pose| separation(&prepared, pose, mesh, &Pose::identity()).distance_m)
        .collect();
    // The quickest of a few passes, pose by pose: the median and the worst are over the poses.
    let times: Vec<f64> = poses
        .iter()
        .map(|pose| {
            (0..PASSES)
                .map(|_| {
                    let start = Instant::now();
                    black_box(separation(
                        &prepared,
                        black_box(pose),
                        mesh,
                        &Pose::identity(),
                    ));
                    start.elapsed().as_secs_f64()
                })
                .fold(f64::INFINITY, f64::min)
        })
        .collect();
    json!({
        "name": name,
        "shape": super::shape(shape),
        "mesh_from_shape": poses.iter().map(super::pose).collect::<Vec<Value>>(),
        "distance_m": distances,
        "time_s": times,
    })
}

fn direction(random: &mut SplitMix64) -> Vector3<f64> {
    let z = random.uniform(-1.0, 1.0);
    let turn = random.uniform(-PI, PI);
    let across = (1.0 - z * z).sqrt();
    Vector3::new(across * libm::cos(turn), across * libm::sin(turn), z)
}

/// A subdivided icosahedron of 0.15 m with hollows and ridges of 0.03 m.
fn bumpy_sphere() -> TriangleMesh {
    let mut mesh = icosahedron();
    for _ in 0..SUBDIVISIONS {
        mesh = subdivided(&mesh);
    }
    for vertex in &mut mesh.vertices_m {
        let unit = vertex.coords / vertex.coords.norm();
        let bump =
            libm::sin(9.0 * unit.x) * libm::sin(7.0 * unit.y + 1.0) * libm::cos(8.0 * unit.z);
        *vertex = Point3::from(unit * (0.15 + 0.03 * bump));
    }
    mesh
}

fn icosahedron() -> TriangleMesh {
    // Poles and two rings of five.
    let mut vertices_m = vec![Point3::new(0.0, 0.0, 1.0)];
    let height = 1.0 / f64::sqrt(5.0);
    let across = 2.0 * height;
    for k in 0..10 {
        let turn = TAU * f64::from(k) / 10.0;
        let z = if k % 2 == 0 { height } else { -height };
        vertices_m.push(Point3::new(
            across * libm::cos(turn),
            across * libm::sin(turn),
            z,
        ));
    }
    vertices_m.push(Point3::new(0.0, 0.0, -1.0));
    let mut triangles = Vec::new();
    for k in 0..10_u32 {
        let at = |offset: u32| 1 + (k + offset) % 10;
        let [side, cap] = if k % 2 == 0 {
            [[at(0), at(1), at(2)], [0, at(0), at(2)]]
        } else {
            [[at(0), at(2), at(1)], [11, at(2), at(0)]]
        };
        triangles.extend([side, cap]);
    }
    TriangleMesh {
        vertices_m,
        triangles,
    }
}

/// Every triangle in four; edges' middles are pushed onto the unit sphere.
fn subdivided(mesh: &TriangleMesh) -> TriangleMesh {
    let mut vertices_m = mesh.vertices_m.clone();
    let mut middles = std::collections::BTreeMap::new();
    let mut middle = |a: u32, b: u32| -> u32 {
        *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
            let sum = vertices_m[a as usize].coords + vertices_m[b as usize].coords;
            vertices_m.push(Point3::from(sum / sum.norm()));
            u32::try_from(vertices_m.len() - 1).expect("far fewer than 2^32 vertices")
        })
    };
    let mut triangles = Vec::with_capacity(4 * mesh.triangles.len());
    for &[a, b, c] in &mesh.triangles {
        let [ab, bc, ca] = [middle(a, b), middle(b, c), middle(c, a)];
        triangles.extend([[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]);
    }
    TriangleMesh {
        vertices_m,
        triangles,
    }
}
