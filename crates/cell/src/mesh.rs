//! Meshes from STL files, and their convex hulls.

use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};

use nalgebra::Point3;

use crate::shape::{ConvexMesh, TriangleMesh};

/// Reads a binary or text STL; `scale` multiplies the coordinates (URDF's `scale`).
pub(crate) fn read_stl(bytes: &[u8], scale: [f64; 3]) -> Result<TriangleMesh, String> {
    let bytes = with_plain_header(bytes);
    let mesh = stl_io::read_stl(&mut std::io::Cursor::new(bytes)).map_err(|e| e.to_string())?;
    let vertices_m: Vec<Point3<f64>> = mesh
        .vertices
        .iter()
        .map(|v| {
            Point3::new(
                f64::from(v[0]) * scale[0],
                f64::from(v[1]) * scale[1],
                f64::from(v[2]) * scale[2],
            )
        })
        .collect();
    if let Some(bad) = vertices_m
        .iter()
        .position(|v| !v.coords.iter().all(|c| c.is_finite()))
    {
        return Err(format!("vertex {bad} is not finite"));
    }
    if mesh.faces.is_empty() {
        return Err("it has no triangles".to_owned());
    }
    let index = |i: usize| u32::try_from(i).map_err(|_| "more than 2^32 vertices".to_owned());
    // A mirrored surface would be inside out.
    let order = if scale.iter().product::<f64>() < 0.0 {
        [0, 2, 1]
    } else {
        [0, 1, 2]
    };
    let triangles = mesh
        .faces
        .iter()
        .map(|face| {
            Ok([
                index(face.vertices[order[0]])?,
                index(face.vertices[order[1]])?,
                index(face.vertices[order[2]])?,
            ])
        })
        .collect::<Result<_, String>>()?;
    Ok(TriangleMesh {
        vertices_m,
        triangles,
    })
}

/// Header of a binary STL: free text and the number of triangles.
const STL_HEADER_BYTES: usize = 84;
const STL_TRIANGLE_BYTES: usize = 50;

/// The file with a header from which its kind can be told: some writers start binary files with
/// `solid`, and some give the solid of a text file no name.
fn with_plain_header(bytes: &[u8]) -> Cow<'_, [u8]> {
    let count = bytes
        .get(80..STL_HEADER_BYTES)
        .and_then(|count| count.try_into().ok())
        .map(u32::from_le_bytes);
    let is_binary = count.is_some_and(|count| {
        Some(bytes.len() - STL_HEADER_BYTES) == (count as usize).checked_mul(STL_TRIANGLE_BYTES)
    });
    if is_binary {
        let mut plain = bytes.to_vec();
        plain[..80].fill(0);
        return plain.into();
    }
    match bytes.strip_prefix(b"solid") {
        Some(rest) if rest.starts_with(b"\n") || rest.starts_with(b"\r") => {
            [b"solid unnamed", rest].concat().into()
        }
        _ => bytes.into(),
    }
}

/// Distance by which a point may lie outside the hull that is made of it, relative to its size.
const HULL_TOLERANCE: f64 = 1e-9;

/// Convex hull of points: incremental, checked to contain every point within 1e-9 of its size.
///
/// # Errors
/// Says why, if the points are flat, or if rounding broke the hull (it is checked, not trusted).
pub fn convex_hull(points: &[Point3<f64>]) -> Result<ConvexMesh, String> {
    let mut hull = Hull::around(points)?;
    // Far points first: most of the others are then inside and cost one look.
    let centre = points
        .iter()
        .fold(nalgebra::Vector3::zeros(), |sum, p| sum + p.coords)
        / points.len() as f64;
    let mut order: Vec<usize> = (0..points.len()).collect();
    order.sort_by(|&a, &b| {
        let distance = |i: usize| (points[i].coords - centre).norm_squared();
        distance(b).total_cmp(&distance(a)).then(a.cmp(&b))
    });
    for i in order {
        hull.add(i)?;
    }
    hull.finish()
}

struct Face {
    vertices: [usize; 3],
    normal: nalgebra::Vector3<f64>,
    offset: f64,
}

struct Hull<'a> {
    points: &'a [Point3<f64>],
    faces: Vec<Face>,
    tolerance_m: f64,
}

impl<'a> Hull<'a> {
    fn around(points: &'a [Point3<f64>]) -> Result<Self, String> {
        let flat = || "its points lie in a plane: a hull needs a volume".to_owned();
        let first = points.first().ok_or("it has no points")?;
        let size = points
            .iter()
            .map(|p| (p - first).norm())
            .fold(0.0, f64::max);
        let tolerance_m = HULL_TOLERANCE * size;
        let farthest = |measure: &dyn Fn(&Point3<f64>) -> f64| {
            (0..points.len())
                .max_by(|&i, &j| measure(&points[i]).total_cmp(&measure(&points[j])))
                .unwrap_or(0)
        };
        let a = farthest(&|p| -p.x);
        let b = farthest(&|p| (p - points[a]).norm());
        let ab = (points[b] - points[a])
            .try_normalize(0.0)
            .ok_or_else(flat)?;
        let c = farthest(&|p| (p - points[a]).cross(&ab).norm());
        let normal = (points[c] - points[a])
            .cross(&ab)
            .try_normalize(tolerance_m)
            .ok_or_else(flat)?;
        let d = farthest(&|p| (p - points[a]).dot(&normal).abs());
        if (points[d] - points[a]).dot(&normal).abs() <= 1e3 * tolerance_m {
            return Err(flat());
        }
        let mut hull = Self {
            points,
            faces: Vec::new(),
            tolerance_m,
        };
        for (vertices, opposite) in [
            ([a, b, c], d),
            ([a, b, d], c),
            ([a, c, d], b),
            ([b, c, d], a),
        ] {
            let mut face = hull.face(vertices)?;
            if hull.height(&face, opposite) > 0.0 {
                face = hull.face([vertices[0], vertices[2], vertices[1]])?;
            }
            hull.faces.push(face);
        }
        Ok(hull)
    }

    fn face(&self, vertices: [usize; 3]) -> Result<Face, String> {
        let [a, b, c] = vertices.map(|i| self.points[i]);
        let normal = (b - a)
            .cross(&(c - a))
            .try_normalize(0.0)
            .ok_or("three of its points lie on a line where the hull needs a face")?;
        Ok(Face {
            vertices,
            normal,
            offset: normal.dot(&a.coords),
        })
    }

    fn height(&self, face: &Face, point: usize) -> f64 {
        face.normal.dot(&self.points[point].coords) - face.offset
    }

    fn add(&mut self, point: usize) -> Result<(), String> {
        let visible: Vec<bool> = self
            .faces
            .iter()
            .map(|face| self.height(face, point) > self.tolerance_m)
            .collect();
        if !visible.contains(&true) {
            return Ok(());
        }
        // Edges of visible faces whose twin belongs to a hidden one.
        let mut horizon = BTreeSet::new();
        for (face, _) in self.faces.iter().zip(&visible).filter(|(_, seen)| **seen) {
            let [a, b, c] = face.vertices;
            for (from, to) in [(a, b), (b, c), (c, a)] {
                if !horizon.remove(&(to, from)) {
                    horizon.insert((from, to));
                }
            }
        }
        let mut seen = visible.iter();
        self.faces
            .retain(|_| !seen.next().copied().unwrap_or(false));
        for (from, to) in horizon {
            let face = self.face([from, to, point])?;
            self.faces.push(face);
        }
        Ok(())
    }

    fn finish(self) -> Result<ConvexMesh, String> {
        let worst = self
            .faces
            .iter()
            .flat_map(|face| (0..self.points.len()).map(|i| self.height(face, i)))
            .fold(f64::NEG_INFINITY, f64::max);
        if worst > 10.0 * self.tolerance_m {
            return Err(format!("its convex hull misses a point by {worst:.1e} m"));
        }
        let mut kept = BTreeMap::new();
        let mut vertices_m = Vec::new();
        let mut triangles = Vec::with_capacity(self.faces.len());
        for face in &self.faces {
            let mut triangle = [0; 3];
            for (corner, &vertex) in triangle.iter_mut().zip(&face.vertices) {
                *corner = *kept.entry(vertex).or_insert_with(|| {
                    vertices_m.push(self.points[vertex]);
                    u32::try_from(vertices_m.len() - 1).expect("fewer than 2^32 hull vertices")
                });
            }
            triangles.push(triangle);
        }
        Ok(ConvexMesh(TriangleMesh {
            vertices_m,
            triangles,
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_hull_of_a_filled_box_is_its_eight_corners() {
        let mut points = Vec::new();
        for x in -3..=3 {
            for y in -3..=3 {
                for z in -3..=3 {
                    points.push(Point3::new(f64::from(x), f64::from(y), f64::from(z) * 0.5));
                }
            }
        }
        let hull = convex_hull(&points).unwrap().0;
        assert_eq!(hull.vertices_m.len(), 8);
        assert_eq!(hull.triangles.len(), 12);
    }

    #[test]
    fn the_hull_of_a_sphere_keeps_every_point() {
        let points: Vec<_> = (0..500)
            .map(|i| {
                let z = 1.0 - (2.0 * f64::from(i) + 1.0) / 500.0;
                let (s, c) = (f64::from(i) * 2.399_963).sin_cos();
                let r = (1.0 - z * z).sqrt();
                Point3::new(r * c, r * s, z)
            })
            .collect();
        let hull = convex_hull(&points).unwrap().0;
        assert_eq!(hull.vertices_m.len(), 500);
        assert_eq!(hull.triangles.len(), 2 * 500 - 4);
    }

    #[test]
    fn flat_points_have_no_hull() {
        let points =
            [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]].map(|[x, y]| Point3::new(x, y, 0.3));
        assert!(convex_hull(&points).unwrap_err().contains("plane"));
    }
}
