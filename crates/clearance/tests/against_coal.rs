//! Every pair of shapes against `tests/validation/clearance/reference.json`.

use std::sync::Arc;

use nalgebra::{Point3, Quaternion, Translation3, UnitQuaternion, Vector3};
use needlebench_cell::shape::{ConvexMesh, Shape, TriangleMesh};
use needlebench_clearance::{PreparedShape, separation};
use needlebench_kinematics::Pose;
use serde_json::Value;

const REFERENCE: &str = include_str!("../../../tests/validation/clearance/reference.json");

fn number(value: &Value) -> f64 {
    value.as_f64().expect("a number")
}

fn numbers(value: &Value) -> Vec<f64> {
    value
        .as_array()
        .expect("an array")
        .iter()
        .map(number)
        .collect()
}

fn shape(kind: &str, value: &Value) -> Shape {
    if kind == "convex" {
        let vertices_m = value.as_array().expect("vertices").iter().map(|v| {
            let v = numbers(v);
            Point3::new(v[0], v[1], v[2])
        });
        return Shape::Convex(Arc::new(ConvexMesh(TriangleMesh {
            vertices_m: vertices_m.collect(),
            triangles: Vec::new(),
        })));
    }
    let p = numbers(value);
    match kind {
        "sphere" => Shape::Sphere { radius_m: p[0] },
        "cylinder" => Shape::Cylinder {
            radius_m: p[0],
            half_length_m: p[1],
        },
        "capsule" => Shape::Capsule {
            radius_m: p[0],
            half_length_m: p[1],
        },
        _ => Shape::Cuboid {
            half_extents_m: Vector3::new(p[0], p[1], p[2]),
        },
    }
}

#[test]
fn dump() {
    let document: Value = serde_json::from_str(REFERENCE).expect("valid JSON");
    for pair in document["pairs"].as_array().unwrap() {
        let kinds: Vec<&str> = pair["kinds"]
            .as_array()
            .unwrap()
            .iter()
            .map(|k| k.as_str().unwrap())
            .collect();
        let mut apart = vec![];
        let mut inside = vec![];
        for case in pair["cases"].as_array().unwrap() {
            let i = case[0].as_u64().unwrap() as usize;
            let j = case[1].as_u64().unwrap() as usize;
            let a = PreparedShape::new(&shape(kinds[0], &document["shapes"][kinds[0]][i]));
            let b = PreparedShape::new(&shape(kinds[1], &document["shapes"][kinds[1]][j]));
            let v: Vec<f64> = (2..10).map(|k| number(&case[k])).collect();
            let pose = Pose::from_parts(
                Translation3::new(v[0], v[1], v[2]),
                UnitQuaternion::from_quaternion(Quaternion::new(v[6], v[3], v[4], v[5])),
            );
            let s = separation(&a, &Pose::identity(), &b, &pose);
            let e = s.distance_m - v[7];
            if e.abs() > 1e-9 {
                println!("   {i} {j} {v:?} -> {} ({e:.2e})", s.distance_m);
            }
            let w = (s.point_on_b - s.point_on_a - s.normal.into_inner() * s.distance_m).norm();
            if w > 1e-6 {
                println!("   {i} {j} {v:?} -> {} witness ({w:.2e})", s.distance_m);
            }
            if v[7] > 0.0 {
                apart.push(e)
            } else {
                inside.push(e)
            }
        }
        let worst = |e: &[f64]| {
            (
                e.iter().copied().fold(f64::INFINITY, f64::min) * 1e6,
                e.iter().copied().fold(f64::NEG_INFINITY, f64::max) * 1e6,
            )
        };
        println!(
            "{kinds:?} apart {:?} inside {:?} um",
            worst(&apart),
            worst(&inside)
        );
    }
}
