//! Where a line of sight meets a solid, in closed form.

use std::sync::Arc;

use nalgebra::{Point3, UnitVector3, Vector3};

use crate::shape::{Shape, Solid};
use crate::tree::TriangleTree;
use crate::triangle_mesh::TriangleMesh;

/// A shape made ready for many lines of sight: what [`first_hit`] finds anew is found once.
#[derive(Debug, Clone)]
pub struct SightTarget(Target);

#[derive(Debug, Clone)]
enum Target {
    /// In closed form.
    Primitive(Shape),
    Hull(Vec<Face>),
    Surface(Arc<TriangleTree>),
}

/// A face of a convex polyhedron.
#[derive(Debug, Clone, Copy)]
struct Face {
    /// Of no particular length.
    outwards: Vector3<f64>,
    corner: Point3<f64>,
}

impl SightTarget {
    /// Of a shape.
    pub fn new(shape: &Shape) -> Self {
        Self(match shape {
            Shape::Convex(mesh) => Target::Hull(faces(&mesh.0).collect()),
            Shape::Mesh(mesh) => Target::Surface(Arc::clone(mesh.tree())),
            primitive => Target::Primitive(primitive.clone()),
        })
    }

    /// [`first_hit`], bit for bit. `likely` is the face that let the line before this one pass; it only saves
    /// time.
    pub fn first_hit(
        &self,
        from: &Point3<f64>,
        to: &Point3<f64>,
        likely: &mut usize,
    ) -> Option<f64> {
        let along = to - from;
        match &self.0 {
            Target::Primitive(shape) => first_hit(shape, from, to),
            Target::Surface(tree) => tree.first_hit(from, &along),
            Target::Hull(faces) => {
                // Lines that pass a solid mostly pass it before the same face.
                let passes = faces.get(*likely).map(|face| face.behind(from, &along));
                if passes.is_some_and(|inside| inside.hit().is_none()) {
                    return None;
                }
                let mut inside = Interval::ALL;
                for (index, face) in faces.iter().enumerate() {
                    let behind = face.behind(from, &along);
                    inside = inside.and(behind);
                    if behind.hit().is_none() {
                        *likely = index;
                    }
                    if inside.low >= inside.high {
                        break;
                    }
                }
                inside.hit()
            }
        }
    }
}

/// Parameter, 0 at `from` and 1 at `to`, at which the segment first is inside the shape; `None` if
/// it passes. Ends are in the shape's frame, m.
///
/// Convex shapes are met where the line is inside all their faces at once, so a segment that only
/// touches passes. A mesh is met at its first triangle; a segment that starts inside one is met
/// where it leaves.
pub fn first_hit(shape: &Shape, from: &Point3<f64>, to: &Point3<f64>) -> Option<f64> {
    let along = to - from;
    match shape {
        Shape::Mesh(mesh) => mesh.surface().first_hit(from, &along),
        convex => in_convex(convex, from, &along).hit(),
    }
}

impl Solid {
    /// The stretches of a segment that are inside, by their parameters: 0 at `from` and 1 at `to`, in their order. Ends are
    /// in the parent's frame, m.
    ///
    /// Exact for every shape; one stretch at most of a convex one.
    pub fn stretches(&self, from: &Point3<f64>, to: &Point3<f64>) -> Vec<[f64; 2]> {
        let local = self.parent_from_shape.inverse();
        let (from, to) = (local * from, local * to);
        let along = to - from;
        if let Shape::Mesh(mesh) = &self.shape {
            let Some(direction) = UnitVector3::try_new(along, 0.0) else {
                return Vec::new();
            };
            let length_m = along.norm();
            let stretches = mesh.tree().clip_line(&from, &direction).into_iter();
            let within = stretches.map(|(enters_m, leaves_m)| {
                [
                    (enters_m / length_m).max(0.0),
                    (leaves_m / length_m).min(1.0),
                ]
            });
            return within.filter(|[enters, leaves]| enters < leaves).collect();
        }
        let inside = in_convex(&self.shape, &from, &along);
        let stretch = inside.hit().map(|low| [low, inside.high]);
        stretch.into_iter().collect()
    }
}

/// The part of a segment that is in a shape other than a mesh.
fn in_convex(shape: &Shape, from: &Point3<f64>, along: &Vector3<f64>) -> Interval {
    match shape {
        Shape::Sphere { radius_m } => in_ball(&from.coords, along, *radius_m),
        Shape::Cylinder {
            radius_m,
            half_length_m,
        } => in_tube(from, along, *radius_m).and(slab(from.z, along.z, *half_length_m)),
        Shape::Capsule {
            radius_m,
            half_length_m,
        } => {
            let tube = in_tube(from, along, *radius_m).and(slab(from.z, along.z, *half_length_m));
            [half_length_m, &-half_length_m]
                .map(|z| {
                    let from_end = from.coords - Vector3::new(0.0, 0.0, *z);
                    in_ball(&from_end, along, *radius_m)
                })
                .into_iter()
                .chain([tube])
                .filter(|part| part.low < part.high)
                .reduce(|a, b| Interval {
                    low: a.low.min(b.low),
                    high: a.high.max(b.high),
                })
                .unwrap_or(Interval::EMPTY)
        }
        Shape::Cuboid { half_extents_m } => (0..3)
            .map(|axis| slab(from[axis], along[axis], half_extents_m[axis]))
            .fold(Interval::ALL, Interval::and),
        Shape::Convex(mesh) => in_hull(&mesh.0, from, along),
        Shape::Mesh(_) => unreachable!("a mesh is asked for its triangles"),
    }
}

/// Part of a segment, by its parameters; empty if `low >= high`.
#[derive(Debug, Clone, Copy)]
struct Interval {
    low: f64,
    high: f64,
}

impl Interval {
    const ALL: Self = Self {
        low: 0.0,
        high: 1.0,
    };
    const EMPTY: Self = Self {
        low: 1.0,
        high: 0.0,
    };

    fn and(self, other: Self) -> Self {
        Self {
            low: self.low.max(other.low),
            high: self.high.min(other.high),
        }
    }

    fn hit(self) -> Option<f64> {
        (self.low < self.high).then_some(self.low)
    }
}

/// Where `|from + t along| <= radius_m`.
fn in_ball(from: &Vector3<f64>, along: &Vector3<f64>, radius_m: f64) -> Interval {
    below_zero(
        along.norm_squared(),
        from.dot(along),
        from.norm_squared() - radius_m * radius_m,
    )
}

/// Where the distance from the z axis is at most `radius_m`.
fn in_tube(from: &Point3<f64>, along: &Vector3<f64>, radius_m: f64) -> Interval {
    let (from, along) = (from.xy().coords, along.xy());
    below_zero(
        along.norm_squared(),
        from.dot(&along),
        from.norm_squared() - radius_m * radius_m,
    )
}

/// Where `a t^2 + 2 b t + c <= 0`, for `a >= 0`, within the segment.
fn below_zero(a: f64, b: f64, c: f64) -> Interval {
    if a <= 0.0 {
        return if c <= 0.0 {
            Interval::ALL
        } else {
            Interval::EMPTY
        };
    }
    let discriminant = b * b - a * c;
    if discriminant <= 0.0 {
        return Interval::EMPTY;
    }
    let root = discriminant.sqrt();
    Interval::ALL.and(Interval {
        low: (-b - root) / a,
        high: (-b + root) / a,
    })
}

/// Where `|from + t along| <= half_m` on one axis.
fn slab(from: f64, along: f64, half_m: f64) -> Interval {
    half_line(along, half_m - from).and(half_line(-along, half_m + from))
}

/// Where `t slope <= limit`, within the segment.
fn half_line(slope: f64, limit: f64) -> Interval {
    let mut inside = Interval::ALL;
    if slope > 0.0 {
        inside.high = inside.high.min(limit / slope);
    } else if slope < 0.0 {
        inside.low = inside.low.max(limit / slope);
    } else if limit < 0.0 {
        return Interval::EMPTY;
    }
    inside
}

fn in_hull(mesh: &TriangleMesh, from: &Point3<f64>, along: &Vector3<f64>) -> Interval {
    let mut inside = Interval::ALL;
    for face in faces(mesh) {
        inside = inside.and(face.behind(from, along));
        if inside.low >= inside.high {
            break;
        }
    }
    inside
}

fn faces(mesh: &TriangleMesh) -> impl Iterator<Item = Face> + '_ {
    mesh.triangles.iter().map(|triangle| {
        let [a, b, c] = triangle.map(|i| mesh.vertices_m[i as usize]);
        Face {
            outwards: (b - a).cross(&(c - a)),
            corner: a,
        }
    })
}

impl Face {
    /// The part of a segment that is behind it.
    #[inline]
    fn behind(&self, from: &Point3<f64>, along: &Vector3<f64>) -> Interval {
        let outwards = &self.outwards;
        half_line(outwards.dot(along), outwards.dot(&(self.corner - from)))
    }
}

#[cfg(test)]
mod tests {
    use needlebench_numerics::random::SplitMix64;

    use super::*;
    use crate::mesh::SolidMesh;
    use crate::triangle_mesh::ConvexMesh;

    /// Rounding of a few operations on metres.
    const ROUNDING: f64 = 1e-12;

    fn shapes() -> Vec<Shape> {
        let half = Vector3::new(0.3, 0.2, 0.1);
        let cuboid = Shape::Cuboid {
            half_extents_m: half,
        };
        let surface = cuboid.surface(1e-3);
        vec![
            Shape::Sphere { radius_m: 0.3 },
            Shape::Cylinder {
                radius_m: 0.2,
                half_length_m: 0.3,
            },
            Shape::Capsule {
                radius_m: 0.15,
                half_length_m: 0.2,
            },
            cuboid,
            Shape::Convex(Arc::new(ConvexMesh(surface.clone()))),
            Shape::Mesh(Arc::new(SolidMesh::new(surface))),
        ]
    }

    fn inside(shape: &Shape, p: &Point3<f64>) -> bool {
        match shape {
            Shape::Sphere { radius_m } => p.coords.norm() < *radius_m,
            Shape::Cylinder {
                radius_m,
                half_length_m,
            } => p.z.abs() < *half_length_m && libm::hypot(p.x, p.y) < *radius_m,
            Shape::Capsule {
                radius_m,
                half_length_m,
            } => {
                let z = p.z - p.z.clamp(-half_length_m, *half_length_m);
                Vector3::new(p.x, p.y, z).norm() < *radius_m
            }
            _ => p.x.abs() < 0.3 && p.y.abs() < 0.2 && p.z.abs() < 0.1,
        }
    }

    #[test]
    fn a_segment_is_met_where_its_first_inner_point_lies() {
        /// Steps along the segment; what is shorter than one of them may be missed by the walk.
        const STEPS: u32 = 2000;
        let mut random = SplitMix64::new(7);
        let mut coordinate = || random.uniform(-0.6, 0.6);
        let (mut hits, mut passes) = (0, 0);
        for shape in shapes() {
            let (target, mut likely) = (SightTarget::new(&shape), usize::MAX);
            for _ in 0..100 {
                let from = Point3::new(coordinate(), coordinate(), coordinate());
                let to = Point3::new(coordinate(), coordinate(), coordinate());
                if inside(&shape, &from) {
                    continue;
                }
                let at = |t: f64| from + (to - from) * t;
                let walked = (0..=STEPS)
                    .map(|k| f64::from(k) / f64::from(STEPS))
                    .find(|t| inside(&shape, &at(*t)));
                let found = first_hit(&shape, &from, &to);
                assert_eq!(target.first_hit(&from, &to, &mut likely), found);
                match (walked, found) {
                    (Some(walked), Some(found)) => {
                        hits += 1;
                        assert!(
                            found <= walked && walked - found <= 1.0 / f64::from(STEPS) + ROUNDING
                        );
                    }
                    (None, None) => passes += 1,
                    (None, Some(found)) => {
                        // The walk has stepped over a corner: just behind the hit is inside.
                        assert!(inside(&shape, &at(found + 1e-6)), "{shape:?}");
                    }
                    (Some(_), None) => panic!("{shape:?} missed"),
                }
            }
        }
        assert!(hits > 100 && passes > 100, "{hits} {passes}");
    }

    /// Against walks along the segments; corners that a step passes over may be missed by the walk.
    #[test]
    fn stretches_of_a_segment_are_its_inner_points() {
        const STEPS: u32 = 1000;
        let mut random = SplitMix64::new(8);
        let mut found = 0;
        for shape in shapes() {
            let solid = Solid {
                name: "solid".into(),
                shape: shape.clone(),
                parent_from_shape: needlebench_kinematics::Pose::translation(0.1, -0.2, 0.05),
            };
            for _ in 0..100 {
                let mut point = || Point3::from([(); 3].map(|()| random.uniform(-0.6, 0.6)));
                let (from, to) = (point(), point());
                let stretches = solid.stretches(&from, &to);
                found += stretches.len();
                for k in 0..=STEPS {
                    let at = f64::from(k) / f64::from(STEPS);
                    let local = solid.parent_from_shape.inverse() * (from + (to - from) * at);
                    let near = |end: &f64| (end - at).abs() < 1e-9;
                    let is_in = stretches.iter().any(|[a, b]| (*a..=*b).contains(&at));
                    let is_edge = stretches.iter().flatten().any(near);
                    assert!(is_edge || is_in == inside(&shape, &local), "{shape:?} {at}");
                }
            }
        }
        assert!(found > 100, "{found}");
    }

    #[test]
    fn a_segment_that_only_touches_passes() {
        let from = Point3::new(-1.0, 0.3, 0.0);
        let to = Point3::new(1.0, 0.3, 0.0);
        assert_eq!(
            first_hit(&Shape::Sphere { radius_m: 0.3 }, &from, &to),
            None
        );
        assert!(first_hit(&Shape::Sphere { radius_m: 0.3001 }, &from, &to).is_some());
    }
}
