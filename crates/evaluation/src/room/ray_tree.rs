//! Boxes about a mesh's triangles, so that a line of sight asks few of them.

use nalgebra::{Point3, Vector3};
use needlebench_cell::shape::TriangleMesh;

use super::ray::triangle_hit;

/// Triangles in a leaf.
const LEAF: usize = 4;
/// Boxes are this much larger than their triangles, m: far more than rounding moves a hit.
const ROOM_M: f64 = 1e-7;

/// A mesh's triangles in nested boxes.
#[derive(Debug)]
pub(super) struct RayTree {
    triangles_m: Vec<[Point3<f64>; 3]>,
    nodes: Vec<Node>,
}

#[derive(Debug)]
struct Node {
    low: Vector3<f64>,
    high: Vector3<f64>,
    first: usize,
    end: usize,
    /// The other child; the first one follows its parent. None in a leaf.
    second: Option<usize>,
}

impl RayTree {
    pub fn new(mesh: &TriangleMesh) -> Self {
        let corners = |t: &[u32; 3]| t.map(|i| mesh.vertices_m[i as usize]);
        let mut tree = Self {
            triangles_m: mesh.triangles.iter().map(corners).collect(),
            nodes: Vec::new(),
        };
        tree.split(0, tree.triangles_m.len());
        tree
    }

    fn split(&mut self, first: usize, end: usize) {
        let mut low = Vector3::repeat(f64::INFINITY);
        let mut high = Vector3::repeat(f64::NEG_INFINITY);
        for corner in self.triangles_m[first..end].iter().flatten() {
            low = low.inf(&corner.coords.add_scalar(-ROOM_M));
            high = high.sup(&corner.coords.add_scalar(ROOM_M));
        }
        let index = self.nodes.len();
        self.nodes.push(Node {
            low,
            high,
            first,
            end,
            second: None,
        });
        if end - first <= LEAF {
            return;
        }
        let axis = (high - low).imax();
        let middle = usize::midpoint(first, end);
        let key = |t: &[Point3<f64>; 3]| t[0][axis] + t[1][axis] + t[2][axis];
        self.triangles_m[first..end]
            .select_nth_unstable_by(middle - first, |a, b| key(a).total_cmp(&key(b)));
        self.split(first, middle);
        self.nodes[index].second = Some(self.nodes.len());
        self.split(middle, end);
    }

    /// Parameter of the first triangle on the segment, 0 at `from` and 1 at its end.
    pub fn first_hit(&self, from: &Point3<f64>, along: &Vector3<f64>) -> Option<f64> {
        let mut first: Option<f64> = None;
        let mut stack = vec![0];
        while let Some(index) = stack.pop() {
            let node = &self.nodes[index];
            if !node.is_met(from, along, first.unwrap_or(1.0)) {
                continue;
            }
            if let Some(second) = node.second {
                stack.extend([second, index + 1]);
                continue;
            }
            for triangle in &self.triangles_m[node.first..node.end] {
                if let Some(t) = triangle_hit(triangle, from, along) {
                    first = Some(first.map_or(t, |known| known.min(t)));
                }
            }
        }
        first
    }
}

impl Node {
    fn is_met(&self, from: &Point3<f64>, along: &Vector3<f64>, until: f64) -> bool {
        let (mut enter, mut leave) = (0.0_f64, until);
        for axis in 0..3 {
            if along[axis] == 0.0 {
                if from[axis] < self.low[axis] || from[axis] > self.high[axis] {
                    return false;
                }
                continue;
            }
            let a = (self.low[axis] - from[axis]) / along[axis];
            let b = (self.high[axis] - from[axis]) / along[axis];
            enter = enter.max(a.min(b));
            leave = leave.min(a.max(b));
        }
        enter <= leave
    }
}
