//! Where a scan cuts the body.

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

/// The ends of a scan.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct ScanEnds {
    ends: Vec<ScanEnd>,
    seen: HalfSpaces,
}

/// Where a body may go on behind the ends of its scan: the faces of the cuts, and what lies straight behind them.
#[derive(Debug, Clone)]
pub struct UnseenBody {
    faces: SurfaceIndex,
    /// Normals of the ends, and how far the body goes along them, m.
    reaches: Vec<(UnitVector3<f64>, f64)>,
}

impl UnseenBody {
    /// How far a point (phantom frame) is from it, m.
    pub fn distance_m(&self, point: &Point3<f64>) -> f64 {
        // Back along the normal of each end to where the body was cut.
        let mut point = *point;
        for (normal, reach_m) in &self.reaches {
            let behind_m = normal.dot(&point.coords) - reach_m;
            point -= behind_m.max(0.0) * normal.into_inner();
        }
        self.faces.distance_m(&point)
    }
}

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
        is_modelled: impl Fn(&Point3<f64>) -> bool,
    ) -> Option<UnseenBody> {
        // A polyhedron is its own surface, whatever the fineness.
        let TriangleMesh {
            mut vertices_m,
            triangles,
        } = skin.shape.surface(0.0);
        for vertex in &mut vertices_m {
            *vertex = skin.parent_from_shape * *vertex;
        }
        let reaches = self.ends.iter().map(|end| {
            let along_m = vertices_m.iter().map(|at| end.normal.dot(&at.coords));
            (end.normal, along_m.fold(f64::NEG_INFINITY, f64::max))
        });
        let reaches = reaches.collect();
        let is_cut = |at: &Point3<f64>| !self.is_seen(at);
        let is_cut: Vec<bool> = vertices_m.iter().map(is_cut).collect();
        let triangles: Vec<_> = triangles
            .into_iter()
            .filter(|corners| {
                let corners = corners.map(|corner| corner as usize);
                corners.iter().all(|&corner| is_cut[corner])
                    && !corners
                        .iter()
                        .all(|&corner| is_modelled(&vertices_m[corner]))
            })
            .collect();
        (!triangles.is_empty()).then(|| UnseenBody {
            faces: SurfaceIndex::new(TriangleMesh {
                vertices_m,
                triangles,
            }),
            reaches,
        })
    }
}
