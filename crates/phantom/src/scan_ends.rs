//! Where a scan cuts the body.

use std::sync::Arc;

use nalgebra::{Point3, UnitVector3, Vector3};
use needlebench_geometry::mesh::{connected_parts, simplified_hull, weld};
use needlebench_geometry::{ConvexMesh, Shape, Solid, TriangleMesh};
use needlebench_kinematics::Pose;

use crate::half_spaces::HalfSpaces;

/// A plane at which a scan ends, phantom frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ScanEnd {
    /// Away from what was scanned.
    pub normal: UnitVector3<f64>,
    /// Skin with `normal . p` above this was not seen, m.
    pub offset_m: f64,
    /// How far behind the plane parts of [`Tissue::Assumed`](crate::Tissue::Assumed) stand for the body, m; 0 where
    /// none do.
    pub assumed_m: f64,
}

/// The ends of a scan.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct ScanEnds {
    ends: Vec<ScanEnd>,
    seen: HalfSpaces,
}

/// How far the body may go on behind a cut, m: farther than anybody is tall.
const GOES_ON_M: f64 = 3.0;

/// What a hull may leave out of its points, m: a tenth of what a clearance beside it has to spare.
const LEFT_OUT_M: f64 = 5e-4;

impl ScanEnds {
    pub fn new(ends: Vec<ScanEnd>) -> Self {
        Self {
            seen: HalfSpaces::new(ends.iter().map(|end| (end.normal, end.offset_m))),
            ends,
        }
    }

    /// Whether a point of the skin was seen.
    pub fn is_seen(&self, point: &Point3<f64>) -> bool {
        self.seen.depth_m(point) >= 0.0
    }

    /// See `Phantom::unseen_body`.
    pub fn unseen_body(
        &self,
        skin: &Solid,
        assumed: &[&Solid],
        is_modelled: impl Fn(&Point3<f64>) -> bool,
    ) -> Vec<Solid> {
        let open = self.ends.iter().filter(|end| end.assumed_m <= 0.0);
        let mut found = self.behind(open, skin, &is_modelled);
        // Where what is assumed ends.
        let ends = self.ends.iter().filter(|end| end.assumed_m > 0.0);
        let far = Self::new(ends.map(ScanEnd::beyond_assumed).collect());
        for solid in assumed {
            found.extend(far.behind(far.ends.iter(), solid, &is_modelled));
        }
        let solid = |(index, hull): (usize, ConvexMesh)| Solid {
            name: format!("unseen_{}", index + 1),
            shape: Shape::Convex(Arc::new(hull)),
            parent_from_shape: Pose::identity(),
        };
        found.into_iter().enumerate().map(solid).collect()
    }

    /// What of a surface is behind some of the ends, and on from there.
    fn behind<'e>(
        &self,
        ends: impl Iterator<Item = &'e ScanEnd>,
        solid: &Solid,
        is_modelled: impl Fn(&Point3<f64>) -> bool,
    ) -> Vec<ConvexMesh> {
        // A polyhedron is its own surface, whatever the fineness.
        let mut surface = solid.shape.surface(0.0);
        for vertex in &mut surface.vertices_m {
            *vertex = solid.parent_from_shape * *vertex;
        }
        weld(&mut surface);
        let TriangleMesh {
            vertices_m,
            triangles,
        } = surface;
        let is_known: Vec<bool> = vertices_m
            .iter()
            .map(|at| !self.is_seen(at) && is_modelled(at))
            .collect();
        let mut found = Vec::new();
        for end in ends {
            let depth_m = |corner: u32| end.depth_m(&vertices_m[corner as usize]);
            let is_cut = |corners: &&[u32; 3]| {
                let mut behind = corners.iter().filter(|&&corner| depth_m(corner) < 0.0);
                behind.any(|&corner| !is_known[corner as usize])
            };
            let cut = TriangleMesh {
                triangles: triangles.iter().filter(is_cut).copied().collect(),
                vertices_m: vertices_m.clone(),
            };
            for part in connected_parts(&cut) {
                let corners = part.iter().map(|&face| cut.triangles[face]);
                let corners = corners.map(|face| face.map(|corner| vertices_m[corner as usize]));
                let behind = corners.flat_map(|face| end.behind(&face));
                found.extend(hull(&self.extruded(end, behind)));
            }
        }
        found
    }

    /// Points on an end or behind it, and how far the body goes on from them along the normals of all that they are behind.
    fn extruded(
        &self,
        own: &ScanEnd,
        points: impl Iterator<Item = Point3<f64>>,
    ) -> Vec<Point3<f64>> {
        let mut all = Vec::new();
        for point in points {
            let is_behind = |end: &&ScanEnd| *end == own || end.depth_m(&point) < 0.0;
            let ends = self.ends.iter().filter(is_behind);
            all.extend(ends.map(|end| point + GOES_ON_M * end.normal.into_inner()));
            all.push(point);
        }
        all
    }
}

impl ScanEnd {
    /// The plane up to which the body is assumed.
    fn beyond_assumed(&self) -> Self {
        Self {
            offset_m: self.offset_m + self.assumed_m,
            ..*self
        }
    }

    /// How far a point is before the plane, m; negative behind it.
    fn depth_m(&self, point: &Point3<f64>) -> f64 {
        self.offset_m - self.normal.dot(&point.coords)
    }

    /// Corners of the part of a triangle that is behind the plane.
    fn behind(&self, triangle: &[Point3<f64>; 3]) -> Vec<Point3<f64>> {
        let mut corners = Vec::with_capacity(4);
        for (at, corner) in triangle.iter().enumerate() {
            let next = &triangle[(at + 1) % 3];
            let [here_m, there_m] = [corner, next].map(|each| self.depth_m(each));
            if here_m < 0.0 {
                corners.push(*corner);
            }
            if (here_m < 0.0) != (there_m < 0.0) {
                corners.push(corner + (next - corner) * (here_m / (here_m - there_m)));
            }
        }
        corners
    }
}

/// The hull of points; of such as lie in a plane, that of boxes about them.
fn hull(points: &[Point3<f64>]) -> Option<ConvexMesh> {
    let thick = || {
        let corners = (0..8).map(|corner| {
            Vector3::from_fn(|axis, _| {
                if corner >> axis & 1 == 0 {
                    LEFT_OUT_M
                } else {
                    -LEFT_OUT_M
                }
            })
        });
        let corners: Vec<Vector3<f64>> = corners.collect();
        let points = points.iter();
        let all = points.flat_map(|point| corners.iter().map(move |corner| point + corner));
        let all: Vec<Point3<f64>> = all.collect();
        simplified_hull(&all, LEFT_OUT_M).ok()
    };
    simplified_hull(points, LEFT_OUT_M).ok().or_else(thick)
}
