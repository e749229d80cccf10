//! Closed surfaces of solids that are not convex, and of a box.

use std::f64::consts::PI;

use nalgebra::Point3;
use needlebench_geometry::TriangleMesh;

/// A box from one corner to the other, counter-clockwise from outside.
pub fn box_mesh(low: [f64; 3], high: [f64; 3]) -> TriangleMesh {
    let pick = |i: usize, axis: usize| {
        if i >> axis & 1 == 0 {
            low[axis]
        } else {
            high[axis]
        }
    };
    let quads = [
        [0, 2, 3, 1],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 4, 6, 2],
        [1, 3, 7, 5],
    ];
    TriangleMesh {
        vertices_m: (0..8)
            .map(|i| Point3::new(pick(i, 0), pick(i, 1), pick(i, 2)))
            .collect(),
        triangles: quads
            .iter()
            .flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]])
            .collect(),
    }
}

/// The polygon in the plane, counter-clockwise and star-shaped about its first corner, drawn
/// from `-half` to `half` along z.
pub fn prism(polygon: &[[f64; 2]], half: f64) -> TriangleMesh {
    let n = u32::try_from(polygon.len()).expect("few corners");
    let corners = |z: f64| polygon.iter().map(move |&[x, y]| Point3::new(x, y, z));
    let mut triangles = Vec::new();
    for i in 1..n - 1 {
        triangles.push([0, i + 1, i]);
        triangles.push([n, n + i, n + i + 1]);
    }
    for i in 0..n {
        let j = (i + 1) % n;
        triangles.push([i, j, n + j]);
        triangles.push([i, n + j, n + i]);
    }
    TriangleMesh {
        vertices_m: corners(-half).chain(corners(half)).collect(),
        triangles,
    }
}

/// An L of two bars 0.1 m thick and 0.3 m long; the notch is at x > 0.1, y > 0.1.
pub fn angle_iron() -> TriangleMesh {
    prism(
        &[
            [0.1, 0.1],
            [0.1, 0.3],
            [0.0, 0.3],
            [0.0, 0.0],
            [0.3, 0.0],
            [0.3, 0.1],
        ],
        0.2,
    )
}

pub fn merged(parts: impl IntoIterator<Item = TriangleMesh>) -> TriangleMesh {
    let mut all = TriangleMesh {
        vertices_m: Vec::new(),
        triangles: Vec::new(),
    };
    for part in parts {
        let first = u32::try_from(all.vertices_m.len()).expect("few vertices");
        all.vertices_m.extend(part.vertices_m);
        let moved = part.triangles.iter().map(|t| t.map(|i| i + first));
        all.triangles.extend(moved);
    }
    all
}

pub fn inverted(mut mesh: TriangleMesh) -> TriangleMesh {
    for triangle in &mut mesh.triangles {
        triangle.swap(1, 2);
    }
    mesh
}

/// A torus about z.
pub fn torus(ring_m: f64, tube_m: f64, n: u32, m: u32) -> TriangleMesh {
    let mut vertices_m = Vec::new();
    let mut triangles = Vec::new();
    for i in 0..n {
        let (su, cu) = libm::sincos(2.0 * PI * f64::from(i) / f64::from(n));
        for j in 0..m {
            let (sv, cv) = libm::sincos(2.0 * PI * f64::from(j) / f64::from(m));
            let r = ring_m + tube_m * cv;
            vertices_m.push(Point3::new(r * cu, r * su, tube_m * sv));
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

/// A bowl: half a hollow ellipsoid, open upwards.
pub fn bowl() -> TriangleMesh {
    let (rings, sectors) = (8_u32, 14_u32);
    let mut vertices_m = Vec::new();
    for (radius, count) in [(0.2, rings), (0.17, rings)] {
        for ring in 0..=count {
            let (sin, cos) = libm::sincos(0.5 * PI * f64::from(ring) / f64::from(count));
            for sector in 0..sectors {
                let (st, ct) = libm::sincos(2.0 * PI * f64::from(sector) / f64::from(sectors));
                vertices_m.push(Point3::new(
                    radius * cos * ct,
                    radius * cos * st,
                    -radius * sin,
                ));
            }
        }
    }
    let at = |wall: u32, ring: u32, sector: u32| {
        (wall * (rings + 1) + ring) * sectors + sector % sectors
    };
    let mut triangles = Vec::new();
    let mut quad = |a, b, c, d| {
        triangles.push([a, b, c]);
        triangles.push([a, c, d]);
    };
    for s in 0..sectors {
        for r in 0..rings {
            quad(
                at(0, r, s),
                at(0, r + 1, s),
                at(0, r + 1, s + 1),
                at(0, r, s + 1),
            );
            quad(
                at(1, r, s),
                at(1, r, s + 1),
                at(1, r + 1, s + 1),
                at(1, r + 1, s),
            );
        }
        quad(at(0, 0, s), at(0, 0, s + 1), at(1, 0, s + 1), at(1, 0, s));
    }
    TriangleMesh {
        vertices_m,
        triangles,
    }
}
