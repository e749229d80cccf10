//! Convex hulls.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{Point3, Vector3};

use crate::shape::{ConvexMesh, TriangleMesh};

/// Distance by which a point may lie outside the hull that is made of it, relative to its size.
const HULL_TOLERANCE: f64 = 1e-9;

/// Convex hull of points: quickhull, checked to contain every point within 1e-9 of its size.
///
/// # Errors
/// Says why, if the points are flat, or if rounding broke the hull (it is checked, not trusted).
pub fn convex_hull(points: &[Point3<f64>]) -> Result<ConvexMesh, String> {
    hull_within(points, 0.0)
}

/// A hull that rounding does not break and that leaves out what is no more than about
/// `left_out_m` outside; it is convex all the same.
///
/// Many points in a plane or on a line, which cuts through a surface leave, make faces without an
/// area of their own where the tolerance is next to none. If that breaks the hull, the points are
/// moved by up to 1e-8 of its size (1e-6 if need be), the same way every time.
pub(super) fn robust_hull(points: &[Point3<f64>], left_out_m: f64) -> Result<ConvexMesh, String> {
    let mut hull = hull_within(points, left_out_m);
    let Some(first) = points.first() else {
        return hull;
    };
    let size = points
        .iter()
        .map(|p| (p - first).norm())
        .fold(0.0, f64::max);
    for share in [1e-8, 1e-7, 1e-6] {
        if hull.is_ok() {
            break;
        }
        let moved: Vec<Point3<f64>> = (1_u32..)
            .zip(points)
            .map(|(i, point)| {
                let step = |each: f64| (f64::from(i) * each).fract() - 0.5;
                let way = [
                    0.819_172_513_396_2,
                    0.671_043_606_703_8,
                    0.549_700_477_901_9,
                ];
                point + Vector3::from(way.map(step)) * (share * size)
            })
            .collect();
        hull = hull_within(&moved, left_out_m);
    }
    hull
}

fn hull_within(points: &[Point3<f64>], left_out_m: f64) -> Result<ConvexMesh, String> {
    let mut hull = Hull::around(points)?;
    hull.left_out_m = hull.tolerance_m.max(left_out_m);
    hull.grow()?;
    hull.finish()
}

struct Face {
    vertices: [usize; 3],
    normal: nalgebra::Vector3<f64>,
    offset: f64,
    /// Points in front of the face, for which it was the first found.
    outside: Vec<usize>,
}

struct Hull<'a> {
    points: &'a [Point3<f64>],
    faces: Vec<Face>,
    /// From which height over a face a point sees it.
    tolerance_m: f64,
    /// From which height over a face a point is added.
    left_out_m: f64,
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
            left_out_m: tolerance_m,
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
            outside: Vec::new(),
        })
    }

    fn height(&self, face: &Face, point: usize) -> f64 {
        face.normal.dot(&self.points[point].coords) - face.offset
    }

    /// Adds points until none is outside that was seen to be.
    fn grow(&mut self) -> Result<(), String> {
        let all = 0..self.faces.len();
        self.assign(0..self.points.len(), all);
        let mut at = 0;
        // Rounding must not make it go round in circles: no point is added twice.
        let mut added = vec![false; self.points.len()];
        while at < self.faces.len() {
            let face = &self.faces[at];
            let farthest = face.outside.iter().copied().max_by(|&i, &j| {
                let order = self.height(face, i).total_cmp(&self.height(face, j));
                order.then(j.cmp(&i))
            });
            match farthest {
                Some(point) if added[point] => {
                    return Err("rounding broke its convex hull".to_owned());
                }
                Some(point) => {
                    added[point] = true;
                    self.add(point)?;
                    at = 0;
                }
                None => at += 1,
            }
        }
        Ok(())
    }

    /// Gives each point to the first of some faces that it is in front of.
    fn assign(&mut self, points: impl Iterator<Item = usize>, faces: std::ops::Range<usize>) {
        for point in points {
            let in_front = faces
                .clone()
                .find(|&face| self.height(&self.faces[face], point) > self.left_out_m);
            if let Some(face) = in_front {
                self.faces[face].outside.push(point);
            }
        }
    }

    fn add(&mut self, point: usize) -> Result<(), String> {
        let (hidden, visible): (Vec<Face>, Vec<Face>) = std::mem::take(&mut self.faces)
            .into_iter()
            .partition(|face| self.height(face, point) <= self.tolerance_m);
        self.faces = hidden;
        // Edges of visible faces whose twin belongs to a hidden one.
        let mut horizon = BTreeSet::new();
        for face in &visible {
            let [a, b, c] = face.vertices;
            for (from, to) in [(a, b), (b, c), (c, a)] {
                if !horizon.remove(&(to, from)) {
                    horizon.insert((from, to));
                }
            }
        }
        let first_new = self.faces.len();
        for (from, to) in horizon {
            let face = self.face([from, to, point])?;
            self.faces.push(face);
        }
        // What was in front of a face that is gone is inside now or in front of a new one.
        let orphans = visible.into_iter().flat_map(|face| face.outside);
        self.assign(
            orphans.filter(|&orphan| orphan != point),
            first_new..self.faces.len(),
        );
        Ok(())
    }

    fn finish(self) -> Result<ConvexMesh, String> {
        let worst = self
            .faces
            .iter()
            .flat_map(|face| (0..self.points.len()).map(|i| self.height(face, i)))
            .fold(f64::NEG_INFINITY, f64::max);
        // What is dropped is within the tolerance of a face, but for rounding.
        if worst > 10.0 * self.left_out_m {
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
