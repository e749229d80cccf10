//! Bits.
use nalgebra::{Point3, Vector3};
use needlebench_geometry::{ConvexMesh, PreparedShape, Shape, SolidMesh, TriangleMesh, separation};
use needlebench_kinematics::Pose;
use std::f64::consts::{PI, TAU};
use std::sync::Arc;
use std::time::Instant;

fn torus(n: u32, m: u32) -> TriangleMesh {
    let (mut vertices_m, mut triangles) = (Vec::new(), Vec::new());
    for i in 0..n {
        let (su, cu) = libm::sincos(TAU * f64::from(i) / f64::from(n));
        for j in 0..m {
            let (sv, cv) = libm::sincos(TAU * f64::from(j) / f64::from(m));
            let r = 0.2 + 0.07 * cv;
            vertices_m.push(Point3::new(r * cu, r * su, 0.07 * sv));
            let at = |i: u32, j: u32| (i % n) * m + j % m;
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            triangles.push([a, b, c]);
            triangles.push([a, c, d]);
        }
    }
    TriangleMesh {
        vertices_m,
        triangles,
    }
}
fn ellipsoid(rings: u32, sectors: u32, half: Vector3<f64>) -> TriangleMesh {
    let mut vertices_m = vec![Point3::new(0.0, 0.0, half.z)];
    for ring in 1..rings {
        let (sin, cos) = libm::sincos(PI * f64::from(ring) / f64::from(rings));
        for sector in 0..sectors {
            let turn = TAU * f64::from(sector) / f64::from(sectors);
            vertices_m.push(Point3::new(
                half.x * sin * libm::cos(turn),
                half.y * sin * libm::sin(turn),
                half.z * cos,
            ));
        }
    }
    vertices_m.push(Point3::new(0.0, 0.0, -half.z));
    let at = |ring: u32, sector: u32| 1 + (ring - 1) * sectors + sector % sectors;
    let last = 1 + (rings - 1) * sectors;
    let mut triangles = Vec::new();
    for s in 0..sectors {
        triangles.push([0, at(1, s), at(1, s + 1)]);
        triangles.push([last, at(rings - 1, s + 1), at(rings - 1, s)]);
        for ring in 1..rings - 1 {
            let [a, b] = [at(ring, s), at(ring + 1, s)];
            let [d, c] = [at(ring, s + 1), at(ring + 1, s + 1)];
            triangles.push([a, b, c]);
            triangles.push([a, c, d]);
        }
    }
    TriangleMesh {
        vertices_m,
        triangles,
    }
}
struct Mix(u64);
impl Mix {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }
    fn u(&mut self, a: f64, b: f64) -> f64 {
        a + (b - a) * (self.next() >> 11) as f64 * 0.5_f64.powi(53)
    }
}
fn main() {
    let mut r = Mix(9);
    let mesh = |surface| Shape::Mesh(Arc::new(SolidMesh::new(surface)));
    let mut groups: Vec<(&str, Vec<Shape>)> = vec![("convex", Vec::new()), ("mesh", Vec::new())];
    for _ in 0..12 {
        let mut s = || r.u(0.01, 0.15);
        groups[0].1.extend([
            Shape::Sphere { radius_m: s() },
            Shape::Cylinder {
                radius_m: s(),
                half_length_m: s(),
            },
            Shape::Capsule {
                radius_m: s(),
                half_length_m: s(),
            },
            Shape::Cuboid {
                half_extents_m: Vector3::new(s(), s(), s()),
            },
            Shape::Convex(Arc::new(ConvexMesh(ellipsoid(
                6,
                9,
                Vector3::new(s(), s(), s()),
            )))),
            Shape::Convex(Arc::new(ConvexMesh(ellipsoid(
                3,
                5,
                Vector3::new(s(), s(), s()),
            )))),
        ]);
    }
    groups[1].1.extend([
        mesh(torus(24, 12)),
        mesh(torus(48, 24)),
        mesh(ellipsoid(12, 20, Vector3::new(0.1, 0.15, 0.2))),
    ]);
    let prepared: Vec<Vec<PreparedShape>> = groups
        .iter()
        .map(|g| g.1.iter().map(PreparedShape::new).collect())
        .collect();
    for (name, left, right, rounds) in [
        ("convex", 0, 0, 40),
        ("convex-mesh", 0, 1, 8),
        ("mesh-mesh", 1, 1, 30),
    ] {
        let (mut hash, mut count, mut deep) = (0xcbf2_9ce4_8422_2325_u64, 0_u32, 0_u32);
        let start = Instant::now();
        for _ in 0..rounds {
            for a in &prepared[left] {
                for b in &prepared[right] {
                    let reach = 0.35;
                    let pose = |r: &mut Mix| {
                        Pose::new(
                            Vector3::new(
                                r.u(-reach, reach),
                                r.u(-reach, reach),
                                r.u(-reach, reach),
                            ),
                            Vector3::new(r.u(-PI, PI), r.u(-PI, PI), r.u(-PI, PI)),
                        )
                    };
                    let (pa, pb) = (pose(&mut r), pose(&mut r));
                    let s = separation(a, &pa, b, &pb);
                    count += 1;
                    deep += u32::from(s.distance_m < 0.0);
                    for x in [
                        s.distance_m,
                        s.normal.x,
                        s.normal.y,
                        s.normal.z,
                        s.point_on_a.x,
                        s.point_on_a.y,
                        s.point_on_a.z,
                        s.point_on_b.x,
                        s.point_on_b.y,
                        s.point_on_b.z,
                    ] {
                        hash = (hash ^ x.to_bits()).wrapping_mul(0x0100_0000_01b3);
                    }
                }
            }
        }
        println!(
            "{name:12} {count:6} pairs, {deep:5} deep, bits {hash:016x}, {:.3} s",
            start.elapsed().as_secs_f64()
        );
    }
}
