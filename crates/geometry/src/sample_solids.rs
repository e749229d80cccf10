//! Small solids, most of them not convex, to try things on: for tests, benchmarks and examples.

use std::f64::consts::{PI, TAU};

use nalgebra::{Point3, Vector3};

use crate::measure::{extent_m, size_m};
use crate::shape::Shape;
use crate::triangle_mesh::TriangleMesh;

/// A box about the origin.
pub fn cuboid(half_m: [f64; 3]) -> TriangleMesh {
    Shape::Cuboid {
        half_extents_m: Vector3::from(half_m),
    }
    .surface(1e-4)
}

/// Prism along z over a polygon that is counter-clockwise and star-shaped about its first corner.
pub fn prism(polygon: &[[f64; 2]], height_m: f64) -> TriangleMesh {
    let n = u32::try_from(polygon.len()).expect("few corners");
    let vertices_m = [0.0, height_m]
        .into_iter()
        .flat_map(|z| polygon.iter().map(move |[x, y]| Point3::new(*x, *y, z)))
        .collect();
    let mut triangles = Vec::new();
    for k in 1..n - 1 {
        triangles.push([0, k + 1, k]);
        triangles.push([n, n + k, n + k + 1]);
    }
    for k in 0..n {
        let next = (k + 1) % n;
        triangles.push([k, next, n + next]);
        triangles.push([k, n + next, n + k]);
    }
    TriangleMesh {
        vertices_m,
        triangles,
    }
}

/// An L of two arms, 0.1 m long and 0.02 m wide, 0.03 m high.
pub fn ell() -> TriangleMesh {
    prism(
        &[
            [0.02, 0.02],
            [0.02, 0.1],
            [0.0, 0.1],
            [0.0, 0.0],
            [0.1, 0.0],
            [0.1, 0.02],
        ],
        0.03,
    )
}

/// Surface of revolution about z through profile points (radius, height), the first and the last
/// of which lie on the axis; the solid is to the left of the profile.
pub(crate) fn revolved(profile: &[[f64; 2]], around: u32) -> TriangleMesh {
    let inner = &profile[1..profile.len() - 1];
    let rings = u32::try_from(inner.len()).expect("few rings");
    let mut vertices_m = vec![
        Point3::new(0.0, 0.0, profile[0][1]),
        Point3::new(0.0, 0.0, profile[profile.len() - 1][1]),
    ];
    for [radius, z] in inner {
        for k in 0..around {
            let (sine, cosine) = libm::sincos(TAU * f64::from(k) / f64::from(around));
            vertices_m.push(Point3::new(radius * cosine, radius * sine, *z));
        }
    }
    let at = |ring: u32, k: u32| 2 + ring * around + k % around;
    let mut triangles = Vec::new();
    for k in 0..around {
        triangles.push([0, at(0, k + 1), at(0, k)]);
        triangles.push([1, at(rings - 1, k), at(rings - 1, k + 1)]);
        for ring in 1..rings {
            triangles.push([at(ring - 1, k), at(ring - 1, k + 1), at(ring, k + 1)]);
            triangles.push([at(ring - 1, k), at(ring, k + 1), at(ring, k)]);
        }
    }
    TriangleMesh {
        vertices_m,
        triangles,
    }
}

/// A cup that is open towards +z: 0.1 m wide and 0.05 m deep, with walls of 0.01 m.
pub fn bowl() -> TriangleMesh {
    revolved(
        &[
            [0.0, 0.0],
            [0.05, 0.0],
            [0.05, 0.05],
            [0.04, 0.05],
            [0.04, 0.01],
            [0.0, 0.01],
        ],
        24,
    )
}

/// A ring about z: 0.05 m to the middle of a tube of 0.02 m.
pub fn torus(around: u32, about: u32) -> TriangleMesh {
    let mut vertices_m = Vec::new();
    for i in 0..around {
        let (s, c) = libm::sincos(TAU * f64::from(i) / f64::from(around));
        for j in 0..about {
            let (t, d) = libm::sincos(TAU * f64::from(j) / f64::from(about));
            let radius = 0.05 + 0.02 * d;
            vertices_m.push(Point3::new(radius * c, radius * s, 0.02 * t));
        }
    }
    let at = |i: u32, j: u32| (i % around) * about + j % about;
    let mut triangles = Vec::new();
    for i in 0..around {
        for j in 0..about {
            triangles.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
            triangles.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
        }
    }
    TriangleMesh {
        vertices_m,
        triangles,
    }
}

/// An ellipsoid about the origin: `2 + (rings - 1) * sectors` vertices on its surface.
pub fn ellipsoid(rings: u32, sectors: u32, half_m: Vector3<f64>) -> TriangleMesh {
    let mut vertices_m = vec![Point3::new(0.0, 0.0, half_m.z)];
    for ring in 1..rings {
        let (sin, cos) = libm::sincos(PI * f64::from(ring) / f64::from(rings));
        for sector in 0..sectors {
            let turn = TAU * f64::from(sector) / f64::from(sectors);
            vertices_m.push(Point3::new(
                half_m.x * sin * libm::cos(turn),
                half_m.y * sin * libm::sin(turn),
                half_m.z * cos,
            ));
        }
    }
    vertices_m.push(Point3::new(0.0, 0.0, -half_m.z));
    let at = |ring: u32, sector: u32| 1 + (ring - 1) * sectors + sector % sectors;
    let last = 1 + (rings - 1) * sectors;
    let mut triangles = Vec::new();
    for sector in 0..sectors {
        triangles.push([0, at(1, sector), at(1, sector + 1)]);
        triangles.push([last, at(rings - 1, sector + 1), at(rings - 1, sector)]);
        for ring in 1..rings - 1 {
            let [a, b] = [at(ring, sector), at(ring + 1, sector)];
            let [d, c] = [at(ring, sector + 1), at(ring + 1, sector + 1)];
            triangles.push([a, b, c]);
            triangles.push([a, c, d]);
        }
    }
    TriangleMesh {
        vertices_m,
        triangles,
    }
}

/// The mesh with every triangle turned inside out.
pub fn inverted(mut mesh: TriangleMesh) -> TriangleMesh {
    for triangle in &mut mesh.triangles {
        triangle.swap(1, 2);
    }
    mesh
}

/// Two meshes as one; the second is moved.
pub fn both(a: &TriangleMesh, b: &TriangleMesh, by_m: [f64; 3]) -> TriangleMesh {
    let offset = u32::try_from(a.vertices_m.len()).expect("few vertices");
    let mut mesh = a.clone();
    let moved = b.vertices_m.iter().map(|v| v + Vector3::from(by_m));
    mesh.vertices_m.extend(moved);
    let shifted = b.triangles.iter().map(|t| t.map(|v| v + offset));
    mesh.triangles.extend(shifted);
    mesh
}

/// Points in and around the box of a mesh, the same on every machine.
pub fn random_points(mesh: &TriangleMesh, count: u32) -> Vec<Point3<f64>> {
    let [low, _] = extent_m(mesh);
    let size = size_m(mesh);
    (0..count)
        .map(|i| {
            // A lattice of irrational steps.
            let part = |step: f64| 1.2 * (f64::from(i + 1) * step).fract() - 0.1;
            let share = [0.819_172_513, 0.671_043_606, 0.549_700_477].map(part);
            low + size.component_mul(&Vector3::from(share))
        })
        .collect()
}
