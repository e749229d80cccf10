//! A polytope that grows inside the difference of two cores (van den Bergen's expanding polytope).
//!
//! The overlap along any face's normal is an upper bound of the depth. The least distance of a
//! face from the origin is a lower bound, since the polytope is inside the difference. The face
//! that carries the lower bound is pushed out until both agree.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use nalgebra::{Matrix3, Vector3};

use super::difference::{Difference, Vertex};
use super::simplex::Simplex;

/// Gap between the bounds that is aimed at, m.
const DEPTH_GAP_M: f64 = 1e-10;

/// After this many expansions [`RELAXED_GAP_M`] is enough: a whole circle of directions may be
/// equally good (coaxial cylinders), and each halving of the gap then costs 1.4 times the faces.
const PATIENT_EXPANSIONS: u32 = 300;

/// Gap that ends a long search, m. The depth is polished afterwards and is far better than that.
const RELAXED_GAP_M: f64 = 2e-7;

/// Bound on the expansions; reached only by coaxial shapes of metres.
const MAX_EXPANSIONS: u32 = 3000;

/// Height over a face, relative to the difference's extent, that is rounding.
const FLAT: f64 = 1e-14;

/// Extent relative to the largest below which a difference counts as flat.
const THIN: f64 = 1e-11;

/// Overlap of two cores along a unit vector from A to B: how far apart it takes to part them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Overlap {
    pub overlap_m: f64,
    pub normal: Vector3<f64>,
}

impl Overlap {
    pub fn along(difference: &mut Difference<'_>, normal: Vector3<f64>) -> Self {
        Self {
            overlap_m: normal.dot(&difference.support(&normal).x),
            normal,
        }
    }
}

/// How the growth of a polytope ended.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum End {
    /// The gap between the bounds is closed.
    Certified(Overlap),
    /// The gap is small, after a long search.
    Relaxed(Overlap),
    /// The distance is certainly larger than the cutoff.
    BeyondCutoff,
    /// Rounding has made the surface inconsistent.
    Inconsistent,
}

/// Why there is no polytope to grow.
#[derive(Debug)]
pub(crate) enum NoPolytope {
    /// The difference has no volume; its extent along the unit vector `across` is rounding.
    Flat { across: Vector3<f64> },
    /// The distance is certainly larger than the cutoff.
    BeyondCutoff,
}

#[derive(Debug, Clone, Copy)]
struct Face {
    corners: [usize; 3],
    /// `neighbours[i]` is across the edge from corner `i` to the next.
    neighbours: [usize; 3],
    normal: Vector3<f64>,
    offset_m: f64,
    alive: bool,
}

/// A face in the queue; the least offset comes first.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Nearest {
    offset_m: f64,
    face: usize,
}

impl Eq for Nearest {}

impl Ord for Nearest {
    fn cmp(&self, other: &Self) -> Ordering {
        other
            .offset_m
            .total_cmp(&self.offset_m)
            .then(other.face.cmp(&self.face))
    }
}

impl PartialOrd for Nearest {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

/// An edge of the hole that a new vertex tears: its face beyond, and the edge's index there.
#[derive(Debug, Clone, Copy)]
struct Rim {
    beyond: usize,
    edge: usize,
}

/// Rounding has made the polytope's surface inconsistent.
#[derive(Debug)]
struct Inconsistent;

fn farthest<const N: usize>(
    vertices: [Vertex; N],
    measure: impl Fn(&Vector3<f64>) -> f64,
) -> Vertex {
    vertices
        .into_iter()
        .max_by(|one, two| measure(&one.x).total_cmp(&measure(&two.x)))
        .expect("called with two or four vertices")
}

pub(crate) struct Polytope {
    vertices: Vec<Vertex>,
    faces: Vec<Face>,
    queue: BinaryHeap<Nearest>,
    flat_m: f64,
    rim: Vec<Rim>,
    stack: Vec<Rim>,
}

impl Polytope {
    /// A tetrahedron of support points. It need not contain the origin: faces that the origin is
    /// in front of are expanded first.
    ///
    /// Each support point is an overlap too: where one is below the cutoff's, nothing needs to grow. By as much as a depth
    /// may be overestimated, so that what is told of any cutoff is the same.
    pub fn around(
        difference: &mut Difference<'_>,
        axes: &Matrix3<f64>,
        cutoff_m: f64,
    ) -> Result<Self, NoPolytope> {
        let ends = |difference: &mut Difference<'_>, direction: &Vector3<f64>| {
            let [ahead, behind] = [*direction, -direction].map(|along| {
                let vertex = difference.support(&along);
                (vertex, -along.dot(&vertex.x))
            });
            if ahead.1.max(behind.1) > cutoff_m + RELAXED_GAP_M {
                Err(NoPolytope::BeyondCutoff)
            } else {
                Ok([ahead.0, behind.0])
            }
        };
        let length_m = |[one, other]: &[Vertex; 2]| (one.x - other.x).norm();
        let mut longest = ends(difference, &axes.column(0).into())?;
        let other = ends(difference, &axes.column(1).into())?;
        let another = ends(difference, &axes.column(2).into())?;
        for candidate in [other, another] {
            if length_m(&candidate) > length_m(&longest) {
                longest = candidate;
            }
        }
        let [first, second] = longest;
        let extent_m = first.x.norm().max(second.x.norm());
        let flat_m = FLAT * extent_m;
        let thin_m = THIN * extent_m;
        let Some(edge) = (second.x - first.x).try_normalize(thin_m) else {
            return Err(NoPolytope::Flat {
                across: Vector3::z(),
            });
        };
        // A difference that is no wider than this edge along two directions across it is a line.
        let mut side = Vector3::zeros();
        side[edge.iamin()] = 1.0;
        let one_side = edge.cross(&side).normalize();
        let other_side = edge.cross(&one_side);
        let from_edge = |x: &Vector3<f64>| (x - first.x).cross(&edge).norm();
        let [a, b] = ends(difference, &one_side)?;
        let [c, d] = ends(difference, &other_side)?;
        let third = farthest([a, b, c, d], from_edge);
        let Some(normal) = edge.cross(&(third.x - first.x)).try_normalize(thin_m) else {
            return Err(NoPolytope::Flat { across: one_side });
        };
        let from_face = |x: &Vector3<f64>| (x - first.x).dot(&normal);
        let fourth = farthest(ends(difference, &normal)?, |x| from_face(x).abs());
        let height_m = from_face(&fourth.x);
        if height_m.abs() <= thin_m {
            return Err(NoPolytope::Flat { across: normal });
        }
        // Counter-clockwise from outside: the fourth vertex is behind the face of the others.
        let (second, third) = if height_m > 0.0 {
            (third, second)
        } else {
            (second, third)
        };
        let mut polytope = Self {
            vertices: vec![first, second, third, fourth],
            faces: Vec::with_capacity(128),
            queue: BinaryHeap::with_capacity(128),
            flat_m,
            rim: Vec::new(),
            stack: Vec::new(),
        };
        for (corners, neighbours) in [
            ([0, 1, 2], [1, 2, 3]),
            ([1, 0, 3], [0, 3, 2]),
            ([2, 1, 3], [0, 1, 3]),
            ([0, 2, 3], [0, 2, 1]),
        ] {
            polytope.push(corners, neighbours);
        }
        Ok(polytope)
    }

    /// Pushes the nearest face out until its distance and the least overlap agree.
    pub fn grow(
        &mut self,
        difference: &mut Difference<'_>,
        cutoff_m: f64,
        best: &mut Option<Overlap>,
    ) -> End {
        let mut expansions = 0;
        while let Some(Nearest { face, offset_m }) = self.queue.pop() {
            let Face { normal, alive, .. } = self.faces[face];
            if !alive {
                continue;
            }
            let vertex = difference.support(&normal);
            let overlap_m = normal.dot(&vertex.x);
            let least = match *best {
                Some(best) if best.overlap_m <= overlap_m => best,
                _ => Overlap { overlap_m, normal },
            };
            *best = Some(least);
            if -least.overlap_m > cutoff_m {
                return End::BeyondCutoff;
            }
            let gap_m = least.overlap_m - offset_m;
            expansions += 1;
            if gap_m <= DEPTH_GAP_M {
                return End::Certified(least);
            }
            if (expansions >= PATIENT_EXPANSIONS && gap_m <= RELAXED_GAP_M)
                || expansions >= MAX_EXPANSIONS
            {
                return End::Relaxed(least);
            }
            if self.expand(face, vertex).is_err() {
                return End::Inconsistent;
            }
        }
        End::Inconsistent
    }

    fn push(&mut self, corners: [usize; 3], neighbours: [usize; 3]) {
        let [a, b, c] = corners.map(|i| self.vertices[i].x);
        // From the shortest two edges: the longest one of a sliver cancels most.
        let (ab, bc, ca) = (b - a, c - b, a - c);
        let (la, lb, lc) = (ab.norm_squared(), bc.norm_squared(), ca.norm_squared());
        let cross = if la >= lb && la >= lc {
            bc.cross(&ca)
        } else if lb >= lc {
            ca.cross(&ab)
        } else {
            ab.cross(&bc)
        };
        let face = self.faces.len();
        let normal = cross.try_normalize(0.0).unwrap_or_else(Vector3::zeros);
        let offset_m = normal.dot(&((a + b + c) / 3.0));
        // A face without area has no normal and bounds nothing; its neighbours do.
        if normal != Vector3::zeros() {
            self.queue.push(Nearest { offset_m, face });
        }
        self.faces.push(Face {
            corners,
            neighbours,
            normal,
            offset_m,
            alive: true,
        });
    }

    /// Whether `vertex` is in front of the face across the given edge, or in line with the edge,
    /// in which case the new face there would have no area.
    fn is_torn(&self, rim: Rim, vertex: &Vertex) -> bool {
        let face = &self.faces[rim.beyond];
        if face.normal.dot(&vertex.x) - face.offset_m > self.flat_m {
            return true;
        }
        let from = self.vertices[face.corners[rim.edge]].x;
        let to = self.vertices[face.corners[(rim.edge + 1) % 3]].x;
        let edge = to - from;
        let height = edge.cross(&(vertex.x - from)).norm();
        height <= self.flat_m * edge.norm()
    }

    /// Takes `vertex` into the polytope; `seed` is a face that it is in front of.
    fn expand(&mut self, seed: usize, vertex: Vertex) -> Result<(), Inconsistent> {
        let apex = self.vertices.len();
        self.rim.clear();
        self.stack.clear();
        self.tear(seed, 0, 3);
        while let Some(step) = self.stack.pop() {
            if !self.faces[step.beyond].alive {
                continue;
            }
            if self.is_torn(step, &vertex) {
                // The two edges after the one it was entered by, so that the rim is in order.
                self.tear(step.beyond, step.edge + 1, 2);
            } else {
                self.rim.push(step);
            }
        }
        // The rim of a hole without islands is one closed loop, met in order.
        let count = self.rim.len();
        if count < 3 {
            return Err(Inconsistent);
        }
        self.vertices.push(vertex);
        let first = self.faces.len();
        for i in 0..count {
            let Rim { beyond, edge } = self.rim[i];
            if !self.faces[beyond].alive {
                return Err(Inconsistent);
            }
            let corners = self.faces[beyond].corners;
            let (to, from) = (corners[edge], corners[(edge + 1) % 3]);
            let next = self.rim[(i + 1) % count];
            let next_corners = self.faces[next.beyond].corners;
            if next_corners[(next.edge + 1) % 3] != to {
                return Err(Inconsistent);
            }
            let face = first + i;
            self.faces[beyond].neighbours[edge] = face;
            let previous = first + (i + count - 1) % count;
            let following = first + (i + 1) % count;
            self.push([from, to, apex], [beyond, following, previous]);
        }
        Ok(())
    }

    /// Removes a face and visits its neighbours across `count` edges from `edge` on.
    fn tear(&mut self, face: usize, edge: usize, count: usize) {
        self.faces[face].alive = false;
        // Last in, first out: pushed backwards, they are visited in order.
        for i in (0..count).rev() {
            let edge = (edge + i) % 3;
            let beyond = self.faces[face].neighbours[edge];
            let back = self.faces[beyond]
                .neighbours
                .iter()
                .position(|&neighbour| neighbour == face);
            if let Some(edge) = back {
                self.stack.push(Rim { beyond, edge });
            }
        }
    }

    /// Point of core A that makes up the polytope's point nearest to a difference.
    pub(crate) fn nearest_on_a(&self, difference: &Vector3<f64>) -> Vector3<f64> {
        let mut nearest: Option<Simplex> = None;
        for face in self.faces.iter().filter(|face| face.alive) {
            let corners = face.corners.map(|i| Vertex {
                x: self.vertices[i].x - difference,
                ..self.vertices[i]
            });
            let simplex = Simplex::triangle(&corners);
            if nearest.is_none_or(|nearest| simplex.is_closer_than(&nearest)) {
                nearest = Some(simplex);
            }
        }
        nearest.map_or_else(Vector3::zeros, |nearest| nearest.on_a())
    }
}
