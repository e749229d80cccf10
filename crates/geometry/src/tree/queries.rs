//! Points and lines against a closed surface: nearest point, inside, crossings, first hit.

use nalgebra::{Point3, Vector3};

use super::line::{Crossing, Line};
use super::point_triangle::nearest_on_triangle;
use super::triangle_tree::{Parts, TriangleTree};
use crate::triangle_mesh::TriangleMesh;

/// Distance from the box around everything that is no rounding, relative to its size.
const BOX_SLACK: f64 = 1e-9;

/// Added to the direction of a ray, so that it follows none of the axes that surfaces like.
const SKEW: Vector3<f64> = Vector3::new(0.31, 0.17, 0.23);

impl TriangleMesh {
    /// How often the surface winds about a point: [`TriangleTree::winding_number`] without a tree,
    /// which takes far longer to build than to look at every triangle once.
    pub fn winding_number(&self, point: &Point3<f64>) -> i32 {
        let Some(ray) = Line::new(point.coords, SKEW) else {
            return 0;
        };
        let corners = |triangle: &[u32; 3]| triangle.map(|i| self.vertices_m[i as usize].coords);
        self.triangles
            .iter()
            .filter_map(|triangle| ray.crossing(&corners(triangle)))
            .map(|crossing| crossing.turns_ahead())
            .sum()
    }

    /// Parameter of the first triangle on a segment: [`TriangleTree::first_hit`] without a tree.
    pub fn first_hit(&self, from: &Point3<f64>, along: &Vector3<f64>) -> Option<f64> {
        let segment = Line::new(from.coords, *along)?;
        let corners = |triangle: &[u32; 3]| triangle.map(|i| self.vertices_m[i as usize].coords);
        self.triangles
            .iter()
            .filter_map(|triangle| segment.crossing(&corners(triangle)))
            .map(|crossing| crossing.at)
            .filter(|at| (0.0..=1.0).contains(at))
            .reduce(f64::min)
    }
}

impl TriangleTree {
    /// How often the surface winds about a point: 0 outside, 1 inside, 2 where two parts overlap.
    ///
    /// The crossings of a ray, outwards plus one and inwards minus one: a whole number for every
    /// closed surface, and exact but for points within rounding of the surface. A cavity, whose
    /// surface faces into it, is outside.
    pub fn winding_number(&self, point: &Point3<f64>) -> i32 {
        let point = point.coords;
        let root = self.root();
        if (root.nearest(&point) - point).norm() > BOX_SLACK * root.radius_m() {
            return 0;
        }
        // Away from the middle, where the ray is soon outside.
        let away = (point - root.centre)
            .try_normalize(0.0)
            .unwrap_or_else(Vector3::z);
        let Some(ray) = Line::new(point, away + SKEW) else {
            return 0;
        };
        let mut winding = 0;
        self.for_each_crossing(&ray, [0.0, f64::INFINITY], |crossing| {
            winding += crossing.turns_ahead();
        });
        winding
    }

    /// Whether a point is inside.
    pub fn contains(&self, point: &Point3<f64>) -> bool {
        self.winding_number(point) != 0
    }

    /// Where a line runs inside: the parameters `t` of `origin + t * direction`, in order.
    pub fn clip_line(&self, origin: &Point3<f64>, direction: &Vector3<f64>) -> Vec<(f64, f64)> {
        let Some(line) = Line::new(origin.coords, *direction) else {
            return Vec::new();
        };
        let mut crossings = Vec::new();
        self.for_each_crossing(&line, [f64::NEG_INFINITY, f64::INFINITY], |crossing| {
            crossings.push(crossing);
        });
        // Of crossings at one place, those that enter come first.
        crossings.sort_by(|a, b| a.at.total_cmp(&b.at).then(a.leaves.cmp(&b.leaves)));
        let (mut depth, mut entered) = (0, 0.0);
        let mut inside = Vec::new();
        for Crossing { at, leaves } in crossings {
            if depth == 0 && !leaves {
                entered = at;
            }
            depth += if leaves { -1 } else { 1 };
            if depth == 0 && leaves && at > entered {
                inside.push((entered, at));
            }
        }
        inside
    }

    /// Parameter, 0 at `from` and 1 at `from + along`, at which the segment first meets the surface;
    /// `None` if it does not. A segment that starts inside meets it where it leaves.
    pub fn first_hit(&self, from: &Point3<f64>, along: &Vector3<f64>) -> Option<f64> {
        let segment = Line::new(from.coords, *along)?;
        let mut first = None;
        let mut until = 1.0;
        let mut stack = Vec::with_capacity(64);
        let enters = |index: u32, until: f64| {
            let block = self.block(index);
            let enters = block.enters(&segment.origin, &segment.direction, [0.0, until])?;
            Some((enters, index))
        };
        stack.extend(enters(0, until));
        while let Some((earliest, index)) = stack.pop() {
            if earliest > until {
                continue;
            }
            match self.parts(index) {
                Parts::Boxes(boxes) => {
                    let [one, other] = boxes.map(|index| enters(index, until));
                    // The nearer one is on top.
                    if one.map(|it| it.0) <= other.map(|it| it.0) {
                        stack.extend(other.into_iter().chain(one));
                    } else {
                        stack.extend(one.into_iter().chain(other));
                    }
                }
                Parts::Triangles(triangles) => {
                    let hits = triangles.iter().filter_map(|it| segment.crossing(it));
                    for Crossing { at, .. } in hits {
                        if (0.0..=until).contains(&at) {
                            until = at;
                            first = Some(at);
                        }
                    }
                }
            }
        }
        first
    }

    /// The point of the surface that is nearest to a point.
    pub fn nearest(&self, point: &Point3<f64>) -> Point3<f64> {
        let point = point.coords;
        let mut nearest = (f64::INFINITY, point);
        let lower = |index: u32| {
            let squared = (self.block(index).nearest(&point) - point).norm_squared();
            (squared, index)
        };
        let mut stack = Vec::with_capacity(64);
        stack.push(lower(0));
        while let Some((least, index)) = stack.pop() {
            if least >= nearest.0 {
                continue;
            }
            match self.parts(index) {
                Parts::Boxes(boxes) => {
                    let [one, other] = boxes.map(lower);
                    // The nearer one is on top.
                    if one.0 <= other.0 {
                        stack.extend([other, one]);
                    } else {
                        stack.extend([one, other]);
                    }
                }
                Parts::Triangles(triangles) => {
                    for triangle in triangles {
                        let here = nearest_on_triangle(&point, triangle);
                        let squared = (here - point).norm_squared();
                        if squared < nearest.0 {
                            nearest = (squared, here);
                        }
                    }
                }
            }
        }
        nearest.1.into()
    }

    /// All crossings with the triangles in boxes that the line meets within a range of its
    /// parameter, in no order that matters.
    fn for_each_crossing(&self, line: &Line, range: [f64; 2], mut visit: impl FnMut(Crossing)) {
        let mut stack = Vec::with_capacity(64);
        stack.push(0);
        while let Some(index) = stack.pop() {
            let block = self.block(index);
            if block.enters(&line.origin, &line.direction, range).is_none() {
                continue;
            }
            match self.parts(index) {
                Parts::Boxes(boxes) => stack.extend(boxes),
                Parts::Triangles(triangles) => {
                    for crossing in triangles.iter().filter_map(|it| line.crossing(it)) {
                        visit(crossing);
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use needlebench_numerics::random::SplitMix64;

    use super::*;
    use crate::sample_solids::{both, bowl, cuboid, inverted, random_points, torus};
    use crate::shape::Shape;

    /// Rounding of decimetres.
    const ROUNDING_M: f64 = 1e-15;

    /// The sum of the solid angles of all triangles over `4 pi` (Van Oosterom and Strackee, 1983).
    fn winding_by_solid_angles(mesh: &TriangleMesh, point: &Point3<f64>) -> f64 {
        let half_angles: f64 = mesh
            .triangles
            .iter()
            .map(|triangle| {
                let [a, b, c] = triangle.map(|i| mesh.vertices_m[i as usize] - point);
                let [la, lb, lc] = [a.norm(), b.norm(), c.norm()];
                let volume = a.dot(&b.cross(&c));
                let scale = la * lb * lc + a.dot(&b) * lc + b.dot(&c) * la + c.dot(&a) * lb;
                libm::atan2(volume, scale)
            })
            .sum();
        half_angles / TAU
    }

    /// A cube from -2 to 2 in squares of 1, so that lines of whole numbers meet its corners and edges.
    fn lattice_cube() -> TriangleMesh {
        let mut mesh = TriangleMesh {
            vertices_m: Vec::new(),
            triangles: Vec::new(),
        };
        for axis in 0..3 {
            for side in [-2.0, 2.0] {
                for (i, j) in (-2..2).flat_map(|i| (-2..2).map(move |j| (i, j))) {
                    let first = u32::try_from(mesh.vertices_m.len()).unwrap();
                    for (u, v) in [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)] {
                        let mut corner = Point3::origin();
                        corner[axis] = side;
                        corner[(axis + 1) % 3] = f64::from(u);
                        corner[(axis + 2) % 3] = f64::from(v);
                        mesh.vertices_m.push(corner);
                    }
                    for [a, b, c] in [[0, 1, 2], [0, 2, 3]] {
                        let triangle = [first + a, first + b, first + c];
                        let [x, y, z] = triangle;
                        mesh.triangles
                            .push(if side > 0.0 { triangle } else { [x, z, y] });
                    }
                }
            }
        }
        mesh
    }

    /// Vectors of whole numbers up to `reach`.
    fn lattice(reach: i32) -> impl Iterator<Item = Vector3<f64>> {
        let whole = move || (-reach..=reach).map(f64::from);
        whole().flat_map(move |x| {
            whole().flat_map(move |y| whole().map(move |z| Vector3::new(x, y, z)))
        })
    }

    #[test]
    fn winding_is_that_of_the_solid_angles() {
        let hollow = both(
            &cuboid([0.03, 0.02, 0.01]),
            &inverted(cuboid([0.01, 0.01, 0.005])),
            [0.0; 3],
        );
        let overlapping = both(
            &cuboid([0.03, 0.02, 0.01]),
            &cuboid([0.03, 0.02, 0.01]),
            [0.02, 0.01, 0.005],
        );
        let mut seen = [0; 3];
        for mesh in [bowl(), torus(24, 16), hollow, overlapping] {
            let tree = TriangleTree::new(&mesh);
            for point in random_points(&mesh, 2000) {
                let winding = tree.winding_number(&point);
                assert!((winding_by_solid_angles(&mesh, &point) - f64::from(winding)).abs() < 1e-6);
                assert_eq!(mesh.winding_number(&point), winding);
                seen[usize::try_from(winding).unwrap()] += 1;
            }
        }
        assert!(seen.iter().all(|&count| count > 100), "{seen:?}");
    }

    #[test]
    fn line_through_edges_and_corners_enters_and_leaves_where_it_should() {
        let cube = lattice_cube();
        let tree = TriangleTree::new(&cube);
        let mut through = 0;
        for origin in lattice(3) {
            for direction in lattice(2).filter(|direction| direction.norm() > 0.0) {
                // By the three slabs of the cube.
                let (mut enter, mut leave) = (f64::NEG_INFINITY, f64::INFINITY);
                let mut beside = false;
                for axis in 0..3 {
                    let rate = direction[axis];
                    if rate == 0.0 {
                        beside |= origin[axis].abs() >= 2.0;
                        continue;
                    }
                    let ends = [-2.0, 2.0].map(|end| (end - origin[axis]) / rate);
                    enter = enter.max(ends[0].min(ends[1]));
                    leave = leave.min(ends[0].max(ends[1]));
                }
                let found = tree.clip_line(&origin.into(), &direction);
                if beside || enter >= leave {
                    // It passes, or it runs in a face or along an edge.
                    continue;
                }
                through += 1;
                assert_eq!(found.len(), 1, "{origin} {direction} {found:?}");
                let (entered, left) = found[0];
                assert!((entered - enter).abs() < 1e-14 && (left - leave).abs() < 1e-14);
            }
        }
        assert!(through > 1000, "{through}");
    }

    #[test]
    fn line_through_both_poles_of_a_ball_is_inside_between_them() {
        // All edges of a pole meet there, which index orders and signs of zero get wrong.
        let ball = Shape::Sphere { radius_m: 0.05 }.surface(1e-4);
        for direction in [Vector3::z(), -Vector3::z()] {
            let inside = TriangleTree::new(&ball).clip_line(&Point3::origin(), &direction);
            assert_eq!(inside.len(), 1);
            let (enters_m, leaves_m) = inside[0];
            assert!((enters_m + 0.05).abs() < ROUNDING_M);
            assert!((leaves_m - 0.05).abs() < ROUNDING_M);
        }
    }

    #[test]
    fn segment_first_meets_what_asking_every_triangle_says() {
        let mut random = SplitMix64::new(11);
        for mesh in [
            Shape::Sphere { radius_m: 0.3 }.surface(1e-3),
            torus(48, 24),
            bowl(),
        ] {
            let tree = TriangleTree::new(&mesh);
            let reach_m = tree.root().radius_m();
            let mut coordinate = || random.uniform(-reach_m, reach_m);
            let (mut hits, mut passes) = (0, 0);
            for _ in 0..1000 {
                let from = Point3::new(coordinate(), coordinate(), coordinate());
                let along = Vector3::new(coordinate(), coordinate(), coordinate());
                let found = tree.first_hit(&from, &along);
                assert_eq!(found, mesh.first_hit(&from, &along));
                // What is behind the first hit, and what is before it, differ.
                if let Some(t) = found {
                    hits += 1;
                    let beside = |t: f64| tree.contains(&(from + along * t));
                    assert_eq!(beside(0.999 * t), tree.contains(&from));
                    assert_ne!(beside(t - 1e-9), beside(t + 1e-9));
                } else {
                    passes += 1;
                    assert_eq!(tree.contains(&from), tree.contains(&(from + along)));
                }
            }
            assert!(hits > 50 && passes > 50, "{hits} {passes}");
        }
    }

    #[test]
    fn nearest_point_is_that_of_the_nearest_triangle() {
        for mesh in [bowl(), torus(24, 16)] {
            let tree = TriangleTree::new(&mesh);
            for point in random_points(&mesh, 1000) {
                let by_all_m = mesh
                    .triangles
                    .iter()
                    .map(|triangle| {
                        let corners = triangle.map(|i| mesh.vertices_m[i as usize].coords);
                        (nearest_on_triangle(&point.coords, &corners) - point.coords).norm()
                    })
                    .fold(f64::INFINITY, f64::min);
                let found_m = (tree.nearest(&point) - point).norm();
                assert!((found_m - by_all_m).abs() < ROUNDING_M);
            }
        }
    }
}
