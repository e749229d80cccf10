//! Every pair of shapes against `tests/validation/clearance/reference.json`, which
//! `make_reference.py` beside it made with Coal, Qhull and SciPy; and Coal and parry against the
//! same. Run with `--nocapture` for the table.

use std::sync::Arc;

use nalgebra::{Point3, Quaternion, Translation3, UnitQuaternion, Vector3};
use needlebench_geometry::{ConvexMesh, PreparedShape, Shape, TriangleMesh, separation};
use needlebench_kinematics::Pose;
use parry3d_f64::math::{Pose as ParryPose, Rotation, Vector};
use parry3d_f64::shape::SharedShape;
use serde_json::Value;

const REFERENCE: &str = include_str!("../../../../tests/validation/clearance/reference.json");

/// Largest difference from the reference: twice the worst seen, which is the width of the
/// reference's own certificate. The goal was 1e-6.
const ERROR_M: f64 = 2e-9;

/// Largest overestimate of a signed distance, the unsafe side: 3 times the worst seen.
const OVERESTIMATE_M: f64 = 2e-10;

/// Agreement of Coal and of parry with the reference where shapes are apart: 2 times and 3 times
/// the worst seen. Shows that the reference is right.
const COAL_APART_M: f64 = 1e-8;
const PARRY_APART_M: f64 = 2e-8;

/// An error that is no longer rounding, m.
const MISS_M: f64 = 1e-6;

struct Case {
    a: Shape,
    b: Shape,
    a_from_b: Pose,
    reference_m: f64,
    coal_m: Option<f64>,
}

struct KindPair {
    kinds: [String; 2],
    cases: Vec<Case>,
}

fn numbers(value: &Value) -> Vec<f64> {
    let numbers = value.as_array().expect("an array").iter();
    numbers.map(|x| x.as_f64().expect("a number")).collect()
}

fn shape(kind: &str, value: &Value) -> Shape {
    if kind == "convex" {
        let vertices = value.as_array().expect("vertices").iter().map(numbers);
        return Shape::Convex(Arc::new(ConvexMesh(TriangleMesh {
            vertices_m: vertices.map(|v| Point3::new(v[0], v[1], v[2])).collect(),
            // Without its surface a mesh is scanned; `properties.rs` shows that walking agrees.
            triangles: Vec::new(),
        })));
    }
    let size = numbers(value);
    match kind {
        "sphere" => Shape::Sphere { radius_m: size[0] },
        "cylinder" => Shape::Cylinder {
            radius_m: size[0],
            half_length_m: size[1],
        },
        "capsule" => Shape::Capsule {
            radius_m: size[0],
            half_length_m: size[1],
        },
        "cuboid" => Shape::Cuboid {
            half_extents_m: Vector3::new(size[0], size[1], size[2]),
        },
        _ => panic!("unknown kind {kind}"),
    }
}

fn reference() -> Vec<KindPair> {
    let document: Value = serde_json::from_str(REFERENCE).expect("valid JSON");
    let pairs = document["pairs"].as_array().expect("pairs");
    pairs
        .iter()
        .map(|pair| {
            let kinds = [0, 1].map(|i| pair["kinds"][i].as_str().expect("a kind").to_owned());
            let cases = pair["cases"].as_array().expect("cases").iter().map(|case| {
                let [a, b] = [0, 1].map(|side: usize| {
                    let kind = &kinds[side];
                    let index = case[side].as_u64().expect("an index");
                    let index = usize::try_from(index).expect("a small index");
                    shape(kind, &document["shapes"][kind][index])
                });
                let at = |i: usize| case[i].as_f64().expect("a number");
                Case {
                    a,
                    b,
                    a_from_b: Pose::from_parts(
                        Translation3::new(at(2), at(3), at(4)),
                        UnitQuaternion::from_quaternion(Quaternion::new(
                            at(8),
                            at(5),
                            at(6),
                            at(7),
                        )),
                    ),
                    reference_m: at(9),
                    coal_m: case[10].as_f64(),
                }
            });
            KindPair {
                cases: cases.collect(),
                kinds,
            }
        })
        .collect()
}

/// parry's own answer, asked in millimetres because its tolerances are absolute.
fn parry_distance_m(case: &Case) -> Option<f64> {
    let shape = |shape: &Shape| match shape {
        Shape::Sphere { radius_m } => SharedShape::ball(radius_m * 1e3),
        Shape::Cylinder {
            radius_m,
            half_length_m,
        } => SharedShape::cylinder(half_length_m * 1e3, radius_m * 1e3),
        Shape::Capsule {
            radius_m,
            half_length_m,
        } => SharedShape::capsule_z(half_length_m * 1e3, radius_m * 1e3),
        Shape::Cuboid { half_extents_m: h } => SharedShape::cuboid(h.x * 1e3, h.y * 1e3, h.z * 1e3),
        Shape::Convex(mesh) => {
            let vertices = mesh.0.vertices_m.iter();
            let vertices: Vec<_> = vertices
                .map(|v| Vector::new(v.x * 1e3, v.y * 1e3, v.z * 1e3))
                .collect();
            SharedShape::convex_hull(&vertices).expect("vertices of a hull")
        }
        Shape::Mesh(_) => unreachable!("the reference has convex shapes only"),
    };
    let pose = |pose: Pose, shape: &Shape| {
        // parry's cylinders are about y.
        let turned = if matches!(shape, Shape::Cylinder { .. }) {
            pose * Pose::rotation(Vector3::x() * std::f64::consts::FRAC_PI_2)
        } else {
            pose
        };
        let (t, r) = (turned.translation.vector * 1e3, turned.rotation);
        ParryPose::from((
            Vector::new(t.x, t.y, t.z),
            Rotation::from_xyzw(r.i, r.j, r.k, r.w),
        ))
    };
    let contact = parry3d_f64::query::contact(
        &pose(Pose::identity(), &case.a),
        &*shape(&case.a),
        &pose(case.a_from_b, &case.b),
        &*shape(&case.b),
        1e9,
    );
    Some(contact.ok()??.dist * 1e-3)
}

/// Errors of one method on one pair of kinds, m.
#[derive(Default)]
struct Errors {
    /// Both signs of distance: apart, penetrating.
    by_sign: [Vec<f64>; 2],
    unanswered: usize,
}

impl Errors {
    fn note(&mut self, answer_m: Option<f64>, reference_m: f64) {
        match answer_m {
            Some(answer_m) => {
                self.by_sign[usize::from(reference_m <= 0.0)].push(answer_m - reference_m);
            }
            None => self.unanswered += 1,
        }
    }

    fn largest(&self, sign: usize) -> f64 {
        self.by_sign[sign]
            .iter()
            .fold(0.0, |max, e| e.abs().max(max))
    }

    fn quartile(&self, sign: usize) -> f64 {
        let mut errors: Vec<_> = self.by_sign[sign].iter().map(|e| e.abs()).collect();
        errors.sort_by(f64::total_cmp);
        errors[errors.len() * 3 / 4]
    }

    fn overestimate(&self) -> f64 {
        self.by_sign.iter().flatten().copied().fold(0.0, f64::max)
    }

    fn misses(&self) -> usize {
        let misses = self.by_sign.iter().flatten().filter(|e| e.abs() > MISS_M);
        self.unanswered + misses.count()
    }
}

#[test]
fn every_pair_of_shapes_agrees_with_the_reference() {
    println!(
        "                       ours, um: apart          penetrating              | Coal, um: \
         apart, penetrating, misses | parry, um: apart, penetrating, misses"
    );
    for pair in reference() {
        let mut ours = Errors::default();
        let mut coal = Errors::default();
        let mut parry = Errors::default();
        for case in &pair.cases {
            let (a, b) = (PreparedShape::new(&case.a), PreparedShape::new(&case.b));
            let separation = separation(&a, &Pose::identity(), &b, &case.a_from_b);
            ours.note(Some(separation.distance_m), case.reference_m);
            coal.note(case.coal_m, case.reference_m);
            parry.note(parry_distance_m(case), case.reference_m);
        }
        let [a, b] = &pair.kinds;
        println!(
            "{a:9}{b:9} {} + {:3} q75 {:7.1e} max {:7.1e}  q75 {:7.1e} max {:7.1e} over {:7.1e} | \
             {:7.1e} {:7.1e} {:3} | {:7.1e} {:7.1e} {:3}",
            ours.by_sign[0].len(),
            ours.by_sign[1].len(),
            ours.quartile(0) * 1e6,
            ours.largest(0) * 1e6,
            ours.quartile(1) * 1e6,
            ours.largest(1) * 1e6,
            ours.overestimate() * 1e6,
            coal.largest(0) * 1e6,
            coal.largest(1) * 1e6,
            coal.misses(),
            parry.largest(0) * 1e6,
            parry.largest(1) * 1e6,
            parry.misses(),
        );
        // Of the records of the checks, which take the largest.
        println!(
            "figure shapes_nm {:e}",
            ours.largest(0).max(ours.largest(1)) * 1e9
        );
        println!("figure shapes_over_nm {:e}", ours.overestimate() * 1e9);
        assert!(ours.by_sign.iter().all(|errors| errors.len() >= 90));
        assert!(ours.largest(0) <= ERROR_M, "{a}-{b} apart");
        assert!(ours.largest(1) <= ERROR_M, "{a}-{b} penetrating");
        assert!(ours.overestimate() <= OVERESTIMATE_M, "{a}-{b}");
        assert!(coal.largest(0) <= COAL_APART_M, "Coal on {a}-{b}");
        assert!(parry.largest(0) <= PARRY_APART_M, "parry on {a}-{b}");
    }
}
