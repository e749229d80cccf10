//! Closed surfaces of any number of triangles, and poses near them.

use std::sync::Arc;

use nalgebra::{Point3, Vector3};
use needlebench_geometry::{ConvexMesh, Shape, SolidMesh, TriangleMesh};

/// Numbers that look random and are the same every time (splitmix64).
pub struct Variety(pub u64);

impl Variety {
    /// Uniform in [low, high).
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^= z >> 31;
        low + (high - low) * ((z >> 11) as f64 / (1_u64 << 53) as f64)
    }

    pub fn vector(&mut self, reach: f64) -> Vector3<f64> {
        Vector3::from_fn(|_, _| self.between(-reach, reach))
    }

    /// A unit vector, evenly over all directions.
    pub fn direction(&mut self) -> Vector3<f64> {
        loop {
            let vector = self.vector(1.0);
            if (0.01..1.0).contains(&vector.norm()) {
                return vector.normalize();
            }
        }
    }
}

/// An icosahedron with every edge cut into `cuts`, pushed out to the unit sphere: `20 cuts^2`
/// triangles.
pub fn sphere(cuts: u32) -> TriangleMesh {
    let golden = 0.5 * (1.0 + 5.0_f64.sqrt());
    let mut corners = Vec::new();
    for one in [-1.0, 1.0] {
        for other in [-golden, golden] {
            corners.push(Vector3::new(0.0, one, other));
            corners.push(Vector3::new(one, other, 0.0));
            corners.push(Vector3::new(other, 0.0, one));
        }
    }
    // Corners at the shortest distance, 2, are neighbours; counter-clockwise from outside.
    let near = |i: usize, j: usize| ((corners[i] - corners[j]).norm() - 2.0).abs() < 1e-9;
    let mut points: Vec<[i64; 3]> = Vec::new();
    let mut faces = Vec::new();
    for i in 0..12 {
        for j in 0..12 {
            for k in 0..12 {
                let is_first = i < j && i < k && near(i, j) && near(j, k) && near(k, i);
                let normal = (corners[j] - corners[i]).cross(&(corners[k] - corners[i]));
                if is_first && normal.dot(&corners[i]) > 0.0 {
                    faces.push([corners[i], corners[j], corners[k]]);
                }
            }
        }
    }
    let n = f64::from(cuts);
    let mut soup = Vec::new();
    let at = |[a, b, c]: &[Vector3<f64>; 3], i: u32, j: u32| {
        let (u, v) = (f64::from(i) / n, f64::from(j) / n);
        (a + (b - a) * u + (c - a) * v).normalize()
    };
    for face in &faces {
        for i in 0..cuts {
            for j in 0..cuts - i {
                soup.push([at(face, i, j), at(face, i + 1, j), at(face, i, j + 1)]);
                if i + j + 1 < cuts {
                    soup.push([
                        at(face, i + 1, j),
                        at(face, i + 1, j + 1),
                        at(face, i, j + 1),
                    ]);
                }
            }
        }
    }
    // Corners that are equal but for rounding are one vertex.
    #[expect(
        clippy::cast_possible_truncation,
        reason = "a coordinate within the unit sphere, in units of 1e-9"
    )]
    let mut order: Vec<(usize, [i64; 3])> = soup
        .iter()
        .flatten()
        .map(|v| [v.x, v.y, v.z].map(|x| (x * 1e9).round() as i64))
        .enumerate()
        .collect();
    order.sort_by_key(|&(i, key)| (key, i));
    let flat: Vec<Vector3<f64>> = soup.into_iter().flatten().collect();
    let mut index = vec![0_u32; flat.len()];
    let mut vertices_m = Vec::new();
    for (i, key) in order {
        if points.last() != Some(&key) {
            points.push(key);
            vertices_m.push(Point3::from(flat[i]));
        }
        index[i] = u32::try_from(vertices_m.len() - 1).expect("few vertices");
    }
    TriangleMesh {
        vertices_m,
        triangles: index.chunks(3).map(|t| [t[0], t[1], t[2]]).collect(),
    }
}

/// A body of the size of a chest with ripples of a few millimetres, so that it is not convex.
pub fn chest(cuts: u32) -> TriangleMesh {
    let mut mesh = sphere(cuts);
    for vertex in &mut mesh.vertices_m {
        let v = vertex.coords;
        let ripple =
            1.0 + 0.03 * libm::sin(9.0 * v.x) * libm::cos(7.0 * v.y) * libm::sin(8.0 * v.z);
        *vertex = Point3::new(0.17 * v.x, 0.11 * v.y, 0.28 * v.z) * ripple;
    }
    mesh
}

pub fn solid(surface: TriangleMesh) -> Shape {
    Shape::Mesh(Arc::new(SolidMesh::new(surface)))
}

/// A convex piece of about 100 vertices, 10 cm long.
pub fn piece() -> Shape {
    let mut mesh = sphere(3);
    for vertex in &mut mesh.vertices_m {
        *vertex = Point3::new(0.03 * vertex.x, 0.03 * vertex.y, 0.05 * vertex.z);
    }
    Shape::Convex(Arc::new(ConvexMesh(mesh)))
}
