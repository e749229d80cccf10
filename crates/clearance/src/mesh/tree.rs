//! A flat tree of boxes around the triangles of a closed surface, each turned to fit its patch.
//!
//! A patch of a smooth surface is a thin slab. Boxes along the axes cannot be thin there, turned
//! ones are: their slack falls with the square of the patch's size, and a search for the nearest
//! triangle visits a number of boxes that grows with the logarithm of the triangles.

use std::cmp::Ordering;

use nalgebra::{Matrix3, Vector3};
use needlebench_cell::shape::TriangleMesh;

use crate::core::Placement;

/// Triangles in a leaf: their own plane tests cost about as much as a further box.
const LEAF_TRIANGLES: usize = 4;

/// A box along axes of its own around some triangles.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Node {
    pub centre: Vector3<f64>,
    /// From the centre to the middles of three faces, at right angles.
    half: [Vector3<f64>; 3],
    /// `1 / |half|^2`, or zero.
    inverse_squared: [f64; 3],
    /// Leaf: its first triangle. Else: the second child; the first one follows its parent.
    next: u32,
    /// Triangles of a leaf; zero for all others.
    count: u32,
}

impl Node {
    /// Largest `direction . x` over the box.
    #[inline]
    pub fn high(&self, direction: &Vector3<f64>) -> f64 {
        direction.dot(&self.centre) + self.reach(direction)
    }

    /// Least `direction . x` over the box.
    #[inline]
    pub fn low(&self, direction: &Vector3<f64>) -> f64 {
        direction.dot(&self.centre) - self.reach(direction)
    }

    #[inline]
    fn reach(&self, direction: &Vector3<f64>) -> f64 {
        direction.dot(&self.half[0]).abs()
            + direction.dot(&self.half[1]).abs()
            + direction.dot(&self.half[2]).abs()
    }

    /// Point of the box nearest to `point`.
    #[inline]
    pub fn nearest(&self, point: &Vector3<f64>) -> Vector3<f64> {
        let offset = point - self.centre;
        (0..3).fold(self.centre, |nearest, i| {
            let along = offset.dot(&self.half[i]) * self.inverse_squared[i];
            nearest + self.half[i] * along.clamp(-1.0, 1.0)
        })
    }

    /// Whether a ray from `origin` may meet the box.
    #[inline]
    pub fn is_met(&self, origin: &Vector3<f64>, direction: &Vector3<f64>) -> bool {
        let offset = origin - self.centre;
        let (mut enter, mut leave) = (0.0_f64, f64::INFINITY);
        for half in &self.half {
            let squared = half.norm_squared() * (1.0 + RAY_SLACK) + RAY_SLACK * RAY_SLACK;
            let (at, rate) = (offset.dot(half), direction.dot(half));
            if rate == 0.0 {
                if at.abs() > squared {
                    return false;
                }
                continue;
            }
            let (one, other) = ((-squared - at) / rate, (squared - at) / rate);
            enter = enter.max(one.min(other));
            leave = leave.min(one.max(other));
        }
        enter <= leave * (1.0 + RAY_SLACK) + RAY_SLACK
    }

    /// About the origin along the axes.
    pub fn upright(half_extents_m: &Vector3<f64>) -> Self {
        let half = [0, 1, 2].map(|i| Vector3::ith(i, half_extents_m[i]));
        Self::from_half(Vector3::zeros(), half)
    }

    /// Around points, with its longest half axis.
    pub fn around<'p>(
        points: &(impl Iterator<Item = &'p Vector3<f64>> + Clone),
    ) -> (Self, Vector3<f64>) {
        let (node, longest) = fitted(points);
        let axis = node.half[longest];
        (node, axis)
    }

    fn from_half(centre: Vector3<f64>, half: [Vector3<f64>; 3]) -> Self {
        let inverse_squared = half.map(|half| {
            let squared = half.norm_squared();
            if squared > 0.0 { squared.recip() } else { 0.0 }
        });
        Self {
            centre,
            half,
            inverse_squared,
            next: 0,
            count: 0,
        }
    }

    pub fn placed(&self, placement: &Placement) -> Self {
        Self {
            centre: placement.point(&self.centre),
            half: self.half.map(|half| placement.rotation * half),
            ..*self
        }
    }

    pub fn corners(&self) -> [Vector3<f64>; 8] {
        std::array::from_fn(|i| {
            (0..3).fold(self.centre, |corner, axis| {
                let sign = if i >> axis & 1 == 0 { -1.0 } else { 1.0 };
                corner + self.half[axis] * sign
            })
        })
    }

    /// A leaf of `count` things from `first` on.
    pub fn leaf(self, first: u32, count: u32) -> Self {
        Self {
            next: first,
            count,
            ..self
        }
    }

    /// Two children, of which the second one is at `second`.
    pub fn open_at(&mut self, second: u32) {
        self.next = second;
        self.count = 0;
    }

    /// The children of the box at `index`, or the first thing in a leaf.
    #[inline]
    pub fn children(&self, index: u32) -> Result<[u32; 2], u32> {
        if self.count == 0 {
            Ok([index + 1, self.next])
        } else {
            Err(self.next)
        }
    }

    /// Half of the diagonal, m.
    pub fn radius_m(&self) -> f64 {
        self.half
            .iter()
            .map(Vector3::norm_squared)
            .sum::<f64>()
            .sqrt()
    }
}

/// By how much a ray may miss a box by rounding and still count, relative and in m.
const RAY_SLACK: f64 = 1e-9;

/// The parts of a box.
pub(crate) enum Parts<'t> {
    Boxes([u32; 2]),
    Triangles(&'t [[Vector3<f64>; 3]]),
}

/// A closed surface, ready for distance queries.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct MeshTree {
    /// Depth first; the root comes first.
    nodes: Vec<Node>,
    /// In the order of the leaves.
    triangles: Vec<[Vector3<f64>; 3]>,
    /// One vertex of each connected part of the surface.
    pub anchors: Vec<Vector3<f64>>,
}

impl MeshTree {
    /// Triangles that name a vertex which is not there are left out: an error of the loader's.
    /// Without any triangle the surface is the origin, which keeps every query defined.
    pub fn new(mesh: &TriangleMesh) -> Self {
        let corner = |&i: &u32| mesh.vertices_m.get(i as usize).map(|vertex| vertex.coords);
        let mut triangles: Vec<[Vector3<f64>; 3]> = mesh
            .triangles
            .iter()
            .filter_map(|[a, b, c]| Some([corner(a)?, corner(b)?, corner(c)?]))
            .collect();
        let anchors = if triangles.is_empty() {
            triangles.push([Vector3::zeros(); 3]);
            vec![Vector3::zeros()]
        } else {
            anchors(mesh)
        };
        let mut nodes = Vec::with_capacity(triangles.len());
        split(&mut nodes, &mut triangles, 0);
        Self {
            nodes,
            triangles,
            anchors,
        }
    }

    pub fn root(&self) -> &Node {
        &self.nodes[0]
    }

    #[inline]
    pub fn node(&self, index: u32) -> &Node {
        &self.nodes[index as usize]
    }

    #[inline]
    pub fn parts(&self, index: u32) -> Parts<'_> {
        let node = self.node(index);
        if node.count == 0 {
            Parts::Boxes([index + 1, node.next])
        } else {
            let first = node.next as usize;
            Parts::Triangles(&self.triangles[first..first + node.count as usize])
        }
    }

    pub fn vertices_m(&self) -> impl Iterator<Item = &Vector3<f64>> + Clone {
        self.triangles.iter().flatten()
    }

    /// Vertex farthest along `direction`; `hint` is the one found last, and only saves time.
    pub fn support(&self, direction: &Vector3<f64>, hint: &mut usize) -> Vector3<f64> {
        let at = |corner: usize| &self.triangles[corner / 3][corner % 3];
        if *hint >= 3 * self.triangles.len() {
            *hint = 0;
        }
        let mut best = direction.dot(at(*hint));
        let mut stack = vec![(self.root().high(direction), 0)];
        while let Some((high, index)) = stack.pop() {
            if high <= best {
                continue;
            }
            match self.parts(index) {
                Parts::Boxes(boxes) => {
                    let [one, other] = boxes.map(|i| (self.node(i).high(direction), i));
                    // The farther one is on top.
                    let (under, top) = if one.0 >= other.0 {
                        (other, one)
                    } else {
                        (one, other)
                    };
                    stack.extend([under, top].into_iter().filter(|entry| entry.0 > best));
                }
                Parts::Triangles(triangles) => {
                    let first = 3 * self.node(index).next as usize;
                    for (i, vertex) in triangles.iter().flatten().enumerate() {
                        let value = direction.dot(vertex);
                        if value > best {
                            best = value;
                            *hint = first + i;
                        }
                    }
                }
            }
        }
        *at(*hint)
    }
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "a mesh numbers its vertices in u32, so its triangles and boxes fit too"
)]
fn split(nodes: &mut Vec<Node>, triangles: &mut [[Vector3<f64>; 3]], first: usize) {
    let (node, longest) = fitted(&triangles.iter().flatten());
    if triangles.len() <= LEAF_TRIANGLES {
        nodes.push(node.leaf(first as u32, triangles.len() as u32));
        return;
    }
    let axis = node.half[longest];
    let key = |triangle: &[Vector3<f64>; 3]| axis.dot(&(triangle[0] + triangle[1] + triangle[2]));
    let middle = triangles.len() / 2;
    triangles.select_nth_unstable_by(middle, |one, other| key(one).total_cmp(&key(other)));
    let index = nodes.len();
    nodes.push(node);
    let (left, right) = triangles.split_at_mut(middle);
    split(nodes, left, first);
    let second = nodes.len() as u32;
    nodes[index].open_at(second);
    split(nodes, right, first + middle);
}

/// The box along the principal axes of some points, and its longest axis.
fn fitted<'p>(points: &(impl Iterator<Item = &'p Vector3<f64>> + Clone)) -> (Node, usize) {
    let vertices = || points.clone();
    let count = vertices().count() as f64;
    let mean = vertices().sum::<Vector3<f64>>() / count;
    let covariance = vertices().fold(Matrix3::zeros(), |sum, vertex| {
        let offset = vertex - mean;
        sum + offset * offset.transpose()
    });
    let eigen = covariance.symmetric_eigen();
    let turned: [Vector3<f64>; 3] = [0, 1, 2].map(|i| eigen.eigenvectors.column(i).into());
    let upright = [Vector3::x(), Vector3::y(), Vector3::z()];
    // Corners that spread alike have principal axes by chance; then those of the mesh may fit
    // better, as for a box.
    let [one, other] = [turned, upright].map(|axes| {
        let mut centre = Vector3::zeros();
        let mut half = [Vector3::zeros(); 3];
        for (axis, half) in axes.iter().zip(&mut half) {
            let (low, high) = vertices().fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), v| {
                let t = axis.dot(v);
                (lo.min(t), hi.max(t))
            });
            centre += axis * (0.5 * (low + high));
            *half = axis * (0.5 * (high - low));
        }
        (centre, half)
    });
    let area = |half: &[Vector3<f64>; 3]| {
        let [a, b, c] = half.each_ref().map(Vector3::norm);
        a * b + b * c + c * a
    };
    let (centre, half) = if area(&other.1) < area(&one.1) {
        other
    } else {
        one
    };
    let squared = half.map(|half| half.norm_squared());
    let longest = (0..3).fold(
        0,
        |best, i| if squared[i] > squared[best] { i } else { best },
    );
    let node = Node::from_half(centre, half);
    (node, longest)
}

/// An order in which equal points are neighbours.
pub(crate) fn by_coordinates(one: &Vector3<f64>, other: &Vector3<f64>) -> Ordering {
    one.x
        .total_cmp(&other.x)
        .then(one.y.total_cmp(&other.y))
        .then(one.z.total_cmp(&other.z))
}

/// One vertex of each connected part; vertices at the same place are one.
fn anchors(mesh: &TriangleMesh) -> Vec<Vector3<f64>> {
    let count = mesh.vertices_m.len();
    let mut parent: Vec<usize> = (0..count).collect();
    let join = |parent: &mut Vec<usize>, a: usize, b: usize| {
        let (a, b) = (top(parent, a), top(parent, b));
        parent[a.max(b)] = a.min(b);
    };
    let mut order: Vec<usize> = (0..count).collect();
    let key = |i: usize| mesh.vertices_m[i].coords;
    order.sort_unstable_by(|&i, &j| by_coordinates(&key(i), &key(j)).then(i.cmp(&j)));
    for pair in order.windows(2) {
        if key(pair[0]) == key(pair[1]) {
            join(&mut parent, pair[0], pair[1]);
        }
    }
    let mut used = vec![false; count];
    for triangle in &mesh.triangles {
        let [a, b, c] = triangle.map(|i| i as usize);
        if a.max(b).max(c) < count {
            join(&mut parent, a, b);
            join(&mut parent, b, c);
            used[a] = true;
        }
    }
    let mut tops: Vec<usize> = (0..count)
        .filter(|&i| used[i])
        .map(|i| top(&mut parent, i))
        .collect();
    tops.sort_unstable();
    tops.dedup();
    tops.into_iter()
        .map(|i| mesh.vertices_m[i].coords)
        .collect()
}

fn top(parent: &mut [usize], mut i: usize) -> usize {
    while parent[i] != i {
        parent[i] = parent[parent[i]];
        i = parent[i];
    }
    i
}
