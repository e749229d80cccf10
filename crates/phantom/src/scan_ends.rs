//! Where a scan cuts the body.

use std::sync::OnceLock;

use nalgebra::{Point3, UnitVector3};
use needlebench_geometry::mesh::SurfaceIndex;
use needlebench_geometry::{Solid, TriangleMesh};

use crate::half_spaces::HalfSpaces;

/// A plane at which a scan ends, phantom frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ScanEnd {
    /// Away from what was scanned.
    pub normal: UnitVector3<f64>,
    /// Skin with `normal . p` above this was not seen, m.
    pub offset_m: f64,
}

/// The ends of a scan, and the faces at which they cut the body.
#[derive(Debug, Clone)]
pub(crate) struct ScanEnds {
    ends: Vec<ScanEnd>,
    seen: HalfSpaces,
    faces: OnceLock<Option<Faces>>,
}

/// How the body is cut.
#[derive(Debug, Clone)]
struct Faces {
    surface: SurfaceIndex,
    /// How far the body goes along the normal of each end, m.
    reach_m: Vec<f64>,
}

/// Faces follow from ends and skin.
impl PartialEq for ScanEnds {
    fn eq(&self, other: &Self) -> bool {
        self.ends == other.ends
    }
}

impl ScanEnds {
    pub fn new(ends: Vec<ScanEnd>) -> Self {
        Self {
            seen: HalfSpaces::new(ends.iter().map(|end| (end.normal, end.offset_m))),
            ends,
            faces: OnceLock::new(),
        }
    }

    /// Whether a point of the skin was seen.
    pub fn is_seen(&self, point: &Point3<f64>) -> bool {
        self.seen.depth_m(point) >= 0.0
    }

    /// How far a point is from where the body may go on: from the cut faces, and from what lies straight behind them, m.
    /// Infinite where nothing is cut.
    pub fn beyond_m(&self, skin: &Solid, point: &Point3<f64>) -> f64 {
        let faces = self.faces.get_or_init(|| self.faces(skin));
        let Some(faces) = faces else {
            return f64::INFINITY;
        };
        // Back along the normal of each end to where the body was cut.
        let mut point = *point;
        for (end, reach_m) in self.ends.iter().zip(&faces.reach_m) {
            let behind_m = end.normal.dot(&point.coords) - reach_m;
            point -= behind_m.max(0.0) * end.normal.into_inner();
        }
        faces.surface.distance_m(&point)
    }

    fn faces(&self, skin: &Solid) -> Option<Faces> {
        // A polyhedron is its own surface, whatever the fineness.
        let TriangleMesh {
            mut vertices_m,
            triangles,
        } = skin.shape.surface(0.0);
        for vertex in &mut vertices_m {
            *vertex = skin.parent_from_shape * *vertex;
        }
        let reach_m = self.ends.iter().map(|end| {
            let along_m = vertices_m.iter().map(|at| end.normal.dot(&at.coords));
            along_m.fold(f64::NEG_INFINITY, f64::max)
        });
        let reach_m = reach_m.collect();
        let is_cut: Vec<bool> = vertices_m.iter().map(|at| !self.is_seen(at)).collect();
        let triangles: Vec<_> = triangles
            .into_iter()
            .filter(|corners| corners.iter().all(|&corner| is_cut[corner as usize]))
            .collect();
        (!triangles.is_empty()).then(|| Faces {
            surface: SurfaceIndex::new(TriangleMesh {
                vertices_m,
                triangles,
            }),
            reach_m,
        })
    }
}
