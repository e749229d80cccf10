//! Convex hulls.
//!
//! Quickhull (Barber, Dobkin and Huhdanpaa, 1996). On which side of a face a point is comes from
//! Shewchuk's adaptive predicate, which is exact: points in planes, on lines and on top of each
//! other, of which meshes are full, cannot break the surface. parry's hull is not used; the
//! documentation of this crate has the figures.

use std::cmp::Ordering;
use std::collections::BTreeMap;

use nalgebra::{Point3, Vector3};
use robust::{Coord3D, orient3d};

use crate::triangle_mesh::{ConvexMesh, TriangleMesh};

/// Distance by which a point may lie outside the hull that is made of it, relative to its size.
const HULL_TOLERANCE: f64 = 1e-9;

/// Thickness below which points count as flat, relative to their size.
const FLAT: f64 = 1e-6;

/// Why points have no convex hull.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum HullError {
    /// No points.
    #[error("it has no points")]
    NoPoints,
    /// No volume.
    #[error("its points lie in a plane: a hull needs a volume")]
    Flat,
    /// Coordinates so small or so large that products of three of them are not numbers.
    #[error("its convex hull is numerically degenerate")]
    Broken,
}

/// Whether points have a convex hull, without making it.
///
/// # Errors
/// As [`convex_hull`].
pub fn check_thickness(points: &[Point3<f64>]) -> Result<(), HullError> {
    Hull::around(points, 0.0).map(|_| ())
}

/// Convex hull of points, which contains every one of them within 1e-9 of its size.
///
/// # Errors
/// If the points have no volume: they are thinner than 1e-6 of their size.
pub fn convex_hull(points: &[Point3<f64>]) -> Result<ConvexMesh, HullError> {
    simplified_hull(points, 0.0)
}

/// Convex hull of some of the points; no other one is more than `left_out_m` outside.
///
/// # Errors
/// As [`convex_hull`].
pub fn simplified_hull(points: &[Point3<f64>], left_out_m: f64) -> Result<ConvexMesh, HullError> {
    let mut hull = Hull::around(points, left_out_m)?;
    hull.grow()?;
    Ok(hull.finish())
}

/// Farthest of some points by a measure; of equals the last one along x, y and z, which is never
/// between others.
fn farthest(
    points: &[Point3<f64>],
    of: impl Iterator<Item = usize>,
    measure: impl Fn(usize) -> f64,
) -> Option<usize> {
    let by_coordinates = |i: usize, j: usize| {
        let [a, b] = [i, j].map(|i| points[i]);
        (0..3)
            .map(|axis| a[axis].total_cmp(&b[axis]))
            .fold(Ordering::Equal, Ordering::then)
    };
    of.map(|i| (measure(i), i))
        .max_by(|a, b| {
            let order = a.0.total_cmp(&b.0);
            order.then_with(|| by_coordinates(a.1, b.1).then(b.1.cmp(&a.1)))
        })
        .map(|(_, i)| i)
}

struct Face {
    /// Counter-clockwise seen from outside.
    corners: [usize; 3],
    /// `neighbours[i]` is across the edge from corner `i` to the next.
    neighbours: [usize; 3],
    /// Twice the area.
    doubled_area: f64,
    /// Points in front of the face, for which it was the first found.
    outside: Vec<usize>,
    alive: bool,
}

/// Faces to ask, each once, in the order in which they were found.
struct Asked {
    /// Of each face the corner of the polar body: its normal over the distance of its plane from the centre, 1/m.
    polar: Vec<Vector3<f64>>,
    queue: Vec<usize>,
    next: usize,
    /// In which round a face was found last.
    found: Vec<u32>,
    round: u32,
}

impl Asked {
    fn of(hull: &Hull<'_>) -> Self {
        let polar = hull.faces.iter().map(|face| {
            let [a, b, c] = face.corners.map(|corner| hull.points[corner]);
            let normal = (b - a).cross(&(c - a));
            normal / normal.dot(&(a - hull.centre))
        });
        Self {
            polar: polar.collect(),
            queue: Vec::new(),
            next: 0,
            found: vec![0; hull.faces.len()],
            round: 0,
        }
    }

    /// How far out a point is by the plane of a face: 0 in the centre, 1 in the plane.
    fn reach(&self, face: usize, towards: &Vector3<f64>) -> f64 {
        self.polar[face].dot(towards)
    }

    /// Anew, from one face on.
    fn start(&mut self, face: usize) {
        if self.round == u32::MAX {
            self.found.fill(0);
            self.round = 0;
        }
        self.round += 1;
        self.queue.clear();
        self.next = 0;
        self.push(face);
    }

    fn push(&mut self, face: usize) {
        if self.found[face] != self.round {
            self.found[face] = self.round;
            self.queue.push(face);
        }
    }

    fn pop(&mut self) -> Option<usize> {
        let face = self.queue.get(self.next).copied();
        self.next += 1;
        face
    }
}

struct Hull<'a> {
    points: &'a [Point3<f64>],
    /// Inside.
    centre: Point3<f64>,
    faces: Vec<Face>,
    /// From which height over a face a point is added, m.
    left_out_m: f64,
}

impl<'a> Hull<'a> {
    /// A tetrahedron of points that are far apart.
    fn around(points: &'a [Point3<f64>], left_out_m: f64) -> Result<Self, HullError> {
        let first = points.first().ok_or(HullError::NoPoints)?;
        let size_m = points
            .iter()
            .map(|point| (point - first).norm())
            .fold(0.0, f64::max);
        let all = || 0..points.len();
        let far = |measure: &dyn Fn(&Point3<f64>) -> f64| {
            farthest(points, all(), |i| measure(&points[i])).ok_or(HullError::NoPoints)
        };
        let a = far(&|point| -point.x)?;
        let b = far(&|point| (point - points[a]).norm())?;
        let along = (points[b] - points[a])
            .try_normalize(0.0)
            .ok_or(HullError::Flat)?;
        let c = far(&|point| (point - points[a]).cross(&along).norm())?;
        let normal = (points[c] - points[a])
            .cross(&along)
            .try_normalize(HULL_TOLERANCE * size_m)
            .ok_or(HullError::Flat)?;
        let height_m = |point: &Point3<f64>| (point - points[a]).dot(&normal).abs();
        let d = far(&height_m)?;
        // Also false for points that are not finite.
        let has_volume = height_m(&points[d]) > FLAT * size_m;
        if !has_volume {
            return Err(HullError::Flat);
        }
        let corners = [a, b, c, d].map(|i| points[i].coords);
        let mut hull = Self {
            points,
            centre: Point3::from(corners.iter().sum::<Vector3<f64>>() * 0.25),
            faces: Vec::new(),
            left_out_m: left_out_m.max(HULL_TOLERANCE * size_m),
        };
        let [b, c] = if hull.volume([a, b, c], d) < 0.0 {
            [b, c]
        } else {
            [c, b]
        };
        for (corners, neighbours) in [
            ([a, b, c], [1, 2, 3]),
            ([b, a, d], [0, 3, 2]),
            ([c, b, d], [0, 1, 3]),
            ([a, c, d], [0, 2, 1]),
        ] {
            hull.push(corners, neighbours);
        }
        hull.assign(all(), 0..4);
        Ok(hull)
    }

    /// Six times the signed volume of a face with a point: positive for a point in front of it. The
    /// sign is exact.
    fn volume(&self, corners: [usize; 3], point: usize) -> f64 {
        let [a, b, c, d] = [corners[0], corners[1], corners[2], point].map(|i| {
            let Point3 { coords } = self.points[i];
            Coord3D {
                x: coords.x,
                y: coords.y,
                z: coords.z,
            }
        });
        -orient3d(a, b, c, d)
    }

    /// Height of a point over a face, m.
    fn height_m(&self, face: usize, point: usize) -> f64 {
        let Face {
            corners,
            doubled_area,
            ..
        } = self.faces[face];
        self.volume(corners, point) / doubled_area
    }

    fn push(&mut self, corners: [usize; 3], neighbours: [usize; 3]) {
        let [a, b, c] = corners.map(|i| self.points[i]);
        self.faces.push(Face {
            corners,
            neighbours,
            doubled_area: (b - a).cross(&(c - a)).norm(),
            outside: Vec::new(),
            alive: true,
        });
    }

    /// Adds points until none is outside.
    fn grow(&mut self) -> Result<(), HullError> {
        let mut at = 0;
        loop {
            while at < self.faces.len() {
                let outside = self.faces[at].outside.iter().copied();
                let next = farthest(self.points, outside, |point| self.height_m(at, point));
                if let Some(point) = next {
                    self.add(point, at)?;
                }
                at += 1;
            }
            // A point is looked for over new faces only, which no rounding of heights makes miss it by
            // more than that: seen, not trusted.
            let outside = self.not_held();
            if self.assign(outside.into_iter(), 0..self.faces.len()) == 0 {
                return Ok(());
            }
            at = 0;
        }
    }

    /// Gives each point to the first of some faces that it is in front of; how many there are.
    fn assign(
        &mut self,
        points: impl Iterator<Item = usize>,
        faces: std::ops::Range<usize>,
    ) -> usize {
        let mut assigned = 0;
        for point in points {
            let in_front = faces.clone().find(|&face| {
                self.faces[face].alive && self.height_m(face, point) > self.left_out_m
            });
            if let Some(face) = in_front {
                self.faces[face].outside.push(point);
                assigned += 1;
            }
        }
        assigned
    }

    /// Points that may be outside by more than is left out: all that are, and hardly any other.
    ///
    /// Of each point only those faces are asked that it can be in front of: the one that the ray from the centre
    /// through the point passes, and all that are connected with it by faces that the point is in front of. A point
    /// behind the first is inside; the faces that a point outside sees are connected, and the first is one of them.
    fn not_held(&self) -> Vec<usize> {
        let Some(mut at) = self.faces.iter().position(|face| face.alive) else {
            return Vec::new();
        };
        let mut asked = Asked::of(self);
        let mut is_held = |point: &usize| {
            let Some((passed, reach)) = self.passed_face(at, *point, &mut asked) else {
                return false;
            };
            // Neighbours in a mesh are neighbours in its list of vertices, mostly.
            at = passed;
            reach <= 1.0 || self.is_held(passed, *point, &mut asked)
        };
        (0..self.points.len())
            .filter(|point| !is_held(point))
            .collect()
    }

    /// The face that the ray from the centre through a point passes, and how far out the point is, 1 on the face; none
    /// from a face without an area.
    ///
    /// A face's reach is the share of the way from the centre to its plane that the point has gone. The faces'
    /// normals over their planes' distances are the corners of the polar body, which is convex: the reach is linear
    /// there, so a face that none of its neighbours surpasses has the greatest one. Faces of one plane are one corner
    /// there, and their neighbours are asked together.
    fn passed_face(&self, from: usize, point: usize, asked: &mut Asked) -> Option<(usize, f64)> {
        /// Reaches that differ by less are those of one plane.
        const ONE_PLANE: f64 = 1e-9;
        let towards = self.points[point] - self.centre;
        let (mut at, mut best) = (from, asked.reach(from, &towards));
        // Not of a face without an area.
        if !best.is_finite() {
            return None;
        }
        loop {
            asked.start(at);
            let farther = 'plane: loop {
                let Some(face) = asked.pop() else {
                    break None;
                };
                for beyond in self.faces[face].neighbours {
                    let reach = asked.reach(beyond, &towards);
                    if reach > best {
                        break 'plane Some((beyond, reach));
                    }
                    if reach > best - ONE_PLANE * best.abs() {
                        asked.push(beyond);
                    }
                }
            };
            match farther {
                Some(farther) => (at, best) = farther,
                None => return Some((at, best)),
            }
        }
    }

    /// Whether a point is outside by no more than is left out; `passed` is the face that its ray passes.
    fn is_held(&self, passed: usize, point: usize, asked: &mut Asked) -> bool {
        asked.start(passed);
        while let Some(face) = asked.pop() {
            if self.volume(self.faces[face].corners, point) <= 0.0 {
                continue;
            }
            if self.height_m(face, point) > self.left_out_m {
                return false;
            }
            for beyond in self.faces[face].neighbours {
                asked.push(beyond);
            }
        }
        true
    }

    /// Takes in a point that sees a face: all faces that it sees make way for new ones to their rim.
    fn add(&mut self, point: usize, seen: usize) -> Result<(), HullError> {
        let mut visible = vec![seen];
        self.faces[seen].alive = false;
        // Edges of visible faces across which is a hidden one.
        let mut rim = Vec::new();
        let mut next = 0;
        while let Some(&face) = visible.get(next) {
            next += 1;
            for edge in 0..3 {
                let beyond = self.faces[face].neighbours[edge];
                if !self.faces[beyond].alive {
                    continue;
                }
                if self.volume(self.faces[beyond].corners, point) > 0.0 {
                    self.faces[beyond].alive = false;
                    visible.push(beyond);
                } else {
                    let corners = self.faces[face].corners;
                    rim.push((corners[edge], corners[(edge + 1) % 3], beyond));
                }
            }
        }
        // The rim is one loop: each corner starts one edge and ends another.
        let first_new = self.faces.len();
        let starts: BTreeMap<usize, usize> = (first_new..)
            .zip(&rim)
            .map(|(face, &(from, ..))| (from, face))
            .collect();
        let ends: BTreeMap<usize, usize> = (first_new..)
            .zip(&rim)
            .map(|(face, &(_, to, _))| (to, face))
            .collect();
        if starts.len() != rim.len() || !starts.keys().eq(ends.keys()) {
            return Err(HullError::Broken);
        }
        for (face, &(from, to, beyond)) in (first_new..).zip(&rim) {
            let across = &mut self.faces[beyond];
            let edge = (0..3).find(|&k| across.corners[k] == to).unwrap_or(0);
            across.neighbours[edge] = face;
            self.push([from, to, point], [beyond, starts[&to], ends[&from]]);
        }
        // What was in front of a face that is gone is inside now or in front of a new one.
        let orphans: Vec<usize> = visible
            .into_iter()
            .flat_map(|face| std::mem::take(&mut self.faces[face].outside))
            .filter(|&orphan| orphan != point)
            .collect();
        let new = first_new..self.faces.len();
        self.assign(orphans.into_iter(), new);
        Ok(())
    }

    fn finish(self) -> ConvexMesh {
        let mut kept = BTreeMap::new();
        let mut vertices_m = Vec::new();
        let mut triangles = Vec::new();
        for face in self.faces.iter().filter(|face| face.alive) {
            triangles.push(face.corners.map(|vertex| {
                *kept.entry(vertex).or_insert_with(|| {
                    vertices_m.push(self.points[vertex]);
                    u32::try_from(vertices_m.len() - 1).expect("fewer than 2^32 hull vertices")
                })
            }));
        }
        ConvexMesh(TriangleMesh {
            vertices_m,
            triangles,
        })
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use nalgebra::{Rotation3, Vector3};

    use super::super::check::check_closed;
    use super::*;
    use crate::measure::volume_m3;

    /// Points at which exporters of CAD and of this crate leave corners: rings along a cylinder, in
    /// single precision and turned, so that none of its planes and lines is one exactly.
    fn turned_cylinder(spokes: u32, rings: u32) -> Vec<Point3<f64>> {
        let turn = Rotation3::from_euler_angles(0.3, 0.7, 1.1);
        #[expect(clippy::cast_possible_truncation, reason = "what is tested")]
        let single = |value: f64| f64::from((1e3 * value) as f32) * 1e-3;
        let places = (0..rings).flat_map(|ring| (0..spokes).map(move |spoke| (ring, spoke)));
        places
            .map(|(ring, spoke)| {
                let (sine, cosine) = libm::sincos(TAU * f64::from(spoke) / f64::from(spokes));
                let z_m = 0.1 * f64::from(ring) / f64::from(rings - 1);
                let point = turn * Point3::new(0.03 * cosine, 0.03 * sine, z_m);
                point.map(single)
            })
            .collect()
    }

    /// Height of the point that is farthest outside, m, and whether the surface bends outwards at
    /// every edge, by the exact predicate.
    fn judged(points: &[Point3<f64>], hull: &TriangleMesh) -> (f64, bool) {
        let coordinates = |p: &Point3<f64>| Coord3D {
            x: p.x,
            y: p.y,
            z: p.z,
        };
        let (mut outside_m, mut convex) = (0.0_f64, true);
        for triangle in &hull.triangles {
            let [a, b, c] = triangle.map(|i| hull.vertices_m[i as usize]);
            let doubled_area = (b - a).cross(&(c - a)).norm();
            let [a, b, c] = [a, b, c].map(|corner| coordinates(&corner));
            let volume = |p: &Point3<f64>| -orient3d(a, b, c, coordinates(p));
            convex &= hull.vertices_m.iter().all(|vertex| volume(vertex) <= 0.0);
            let heights_m = points.iter().map(|point| volume(point) / doubled_area);
            outside_m = heights_m.fold(outside_m, f64::max);
        }
        (outside_m, convex)
    }

    fn assert_hull(points: &[Point3<f64>], hull: &TriangleMesh, left_out_m: f64) {
        let facts = check_closed(hull).unwrap();
        assert_eq!((facts.components, facts.shared_edges), (1, 0));
        assert_eq!(2 * hull.vertices_m.len(), hull.triangles.len() + 4);
        let (outside_m, convex) = judged(points, hull);
        assert!(outside_m <= left_out_m && convex, "{outside_m} {convex}");
    }

    fn filled_box() -> Vec<Point3<f64>> {
        let whole = || (-3..=3).map(f64::from);
        whole()
            .flat_map(|x| {
                whole().flat_map(move |y| whole().map(move |z| Point3::new(x, y, 0.5 * z)))
            })
            .collect()
    }

    /// Two circles about an axis of coordinates: each in one plane, with hundreds of faces.
    fn drum(spokes: u32) -> Vec<Point3<f64>> {
        let angles = (0..spokes).map(|spoke| TAU * f64::from(spoke) / f64::from(spokes));
        angles
            .flat_map(|angle| {
                let (sine, cosine) = libm::sincos(angle);
                [-0.05, 0.05].map(|z_m| Point3::new(0.3 * cosine, 0.3 * sine, z_m))
            })
            .collect()
    }

    #[test]
    fn the_hull_of_a_filled_box_is_its_eight_corners() {
        let hull = convex_hull(&filled_box()).unwrap().0;
        assert_eq!(hull.vertices_m.len(), 8);
        assert_eq!(hull.triangles.len(), 12);
        assert!((volume_m3(&hull) - 6.0 * 6.0 * 3.0).abs() < 1e-12);
    }

    #[test]
    fn the_hull_of_a_sphere_keeps_every_point() {
        let points: Vec<_> = (0..500)
            .map(|i| {
                let z = 1.0 - (2.0 * f64::from(i) + 1.0) / 500.0;
                let (s, c) = libm::sincos(f64::from(i) * 2.399_963);
                let r = (1.0 - z * z).sqrt();
                Point3::new(r * c, r * s, z)
            })
            .collect();
        let hull = convex_hull(&points).unwrap().0;
        assert_eq!(hull.vertices_m.len(), 500);
        assert_hull(&points, &hull, 1e-9);
    }

    /// While a hull grows, the points outside of it are those that some face sees, asked one by one.
    #[test]
    fn points_outside_are_found_by_few_faces() {
        for points in [
            filled_box(),
            turned_cylinder(64, 5),
            turned_cylinder(256, 9),
            drum(300),
        ] {
            let mut hull = Hull::around(&points, 2e-5).unwrap();
            let mut rounds = 0_usize;
            loop {
                let next = hull.faces.iter().position(|face| !face.outside.is_empty());
                if next.is_none() || rounds.is_power_of_two() {
                    let seen_by_any: Vec<usize> = (0..points.len())
                        .filter(|&point| {
                            (0..hull.faces.len()).any(|face| {
                                hull.faces[face].alive
                                    && hull.height_m(face, point) > hull.left_out_m
                            })
                        })
                        .collect();
                    assert_eq!(hull.not_held(), seen_by_any, "after {rounds} points");
                }
                let Some(face) = next else { break };
                let point = hull.faces[face].outside[0];
                hull.add(point, face).unwrap();
                rounds += 1;
            }
            assert!(rounds > 2, "{rounds}");
        }
    }

    #[test]
    fn planes_lines_and_copies_do_not_break_it() {
        let turn = Rotation3::from_euler_angles(0.3, 0.7, 1.1);
        let turned: Vec<_> = filled_box().iter().map(|point| turn * point).collect();
        let thin: Vec<_> = (turned.iter())
            .map(|point| Point3::new(point.x, point.y, 1e-5 * point.z))
            .collect();
        let copies: Vec<_> = (0..4)
            .flat_map(|k| {
                let moved = Vector3::repeat(1e-10 * f64::from(k));
                turned.iter().map(move |point| point + moved)
            })
            .collect();
        for points in [
            filled_box(),
            turned,
            thin,
            copies,
            turned_cylinder(64, 5),
            turned_cylinder(256, 9),
        ] {
            let hull = convex_hull(&points).unwrap().0;
            assert_hull(&points, &hull, 1e-8);
        }
    }

    #[test]
    fn what_is_left_out_is_no_further_outside_than_was_said() {
        let points = turned_cylinder(256, 9);
        let hull = simplified_hull(&points, 2e-5).unwrap().0;
        // The chord of every other spoke is within 9e-6 m of the circle, so half of the corners would do.
        let [kept, all] =
            [&hull, &convex_hull(&points).unwrap().0].map(|hull| hull.vertices_m.len());
        assert!(3 * kept < 2 * all, "{kept} of {all}");
        assert_hull(&points, &hull, 2e-5);
    }

    #[test]
    fn flat_points_have_no_hull() {
        let points =
            [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]].map(|[x, y]| Point3::new(x, y, 0.3));
        assert_eq!(convex_hull(&points), Err(HullError::Flat));
        assert_eq!(convex_hull(&[]), Err(HullError::NoPoints));
        assert_eq!(convex_hull(&[points[0]; 5]), Err(HullError::Flat));
        let nowhere = [Point3::new(f64::NAN, 0.0, 0.0); 4];
        assert_eq!(convex_hull(&nowhere), Err(HullError::Flat));
    }
}
