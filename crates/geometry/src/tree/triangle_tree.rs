//! A flat tree of boxes around the triangles of a closed surface, each turned to fit its patch.
//!
//! A patch of a smooth surface is a thin slab. Boxes along the axes cannot be thin there, turned
//! ones are: their slack falls with the square of the patch's size, and a search for the nearest
//! triangle visits a number of boxes that grows with the logarithm of the triangles.

use std::cmp::Ordering;

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::bounds::OrientedBox;
use crate::encoding::{decode, encode};
use crate::topology::{connected_parts, weld};
use crate::triangle_mesh::TriangleMesh;

/// Triangles in a leaf: their own plane tests cost about as much as a further box.
const LEAF_TRIANGLES: usize = 4;

/// A box around some triangles.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Node {
    block: OrientedBox,
    /// Leaf: its first triangle. Else: the second child; the first one follows its parent.
    next: u32,
    /// Triangles of a leaf; zero for all others.
    count: u32,
}

/// The parts of a box.
pub(crate) enum Parts<'t> {
    Boxes([u32; 2]),
    Triangles(&'t [[Vector3<f64>; 3]]),
}

/// The triangles of a closed surface in nested boxes.
///
/// The one tree for distances, rays and inside tests.
#[derive(Debug, Clone, PartialEq)]
pub struct TriangleTree {
    /// Depth first; the root comes first.
    nodes: Vec<Node>,
    /// In the order of the leaves.
    triangles: Vec<[Vector3<f64>; 3]>,
    /// Their numbers in the mesh.
    numbers: Vec<u32>,
    /// One vertex of each connected part of the surface.
    pub(crate) anchors: Vec<Vector3<f64>>,
}

impl TriangleTree {
    /// Triangles that name a vertex which is not there are left out: an error of the loader's.
    /// Without any triangle the surface is the origin, which keeps every query defined.
    pub fn new(mesh: &TriangleMesh) -> Self {
        let mut items: Vec<Item> = (0..)
            .zip(&mesh.triangles)
            .filter_map(|(number, triangle)| {
                let corners = corners_of(mesh, triangle)?;
                Some(Item { corners, number })
            })
            .collect();
        let anchors = if items.is_empty() {
            items.push(NOTHING);
            vec![Vector3::zeros()]
        } else {
            let corners: Vec<_> = items.iter().map(|item| item.corners).collect();
            anchors(&corners)
        };
        let mut nodes = Vec::with_capacity(items.len());
        split(&mut nodes, &mut items, 0);
        Self {
            nodes,
            triangles: items.iter().map(|item| item.corners).collect(),
            numbers: items.iter().map(|item| item.number).collect(),
            anchors,
        }
    }

    /// Its bytes: with those of the mesh all of it.
    pub(crate) fn encoded(&self) -> Vec<u8> {
        encode(&(&self.nodes, &self.numbers, &self.anchors))
    }

    /// The tree of a mesh from what [`TriangleTree::encoded`] made of it.
    pub(crate) fn decoded(bytes: &[u8], mesh: &TriangleMesh) -> Option<Self> {
        let (nodes, numbers, anchors): (_, Vec<u32>, _) = decode(bytes)?;
        let corners = numbers.iter().map(|&number| match number {
            number if number == NOTHING.number => Some(NOTHING.corners),
            number => corners_of(mesh, mesh.triangles.get(number as usize)?),
        });
        Some(Self {
            nodes,
            triangles: corners.collect::<Option<_>>()?,
            numbers,
            anchors,
        })
    }

    pub(crate) fn root(&self) -> &OrientedBox {
        &self.nodes[0].block
    }

    #[inline]
    pub(crate) fn block(&self, index: u32) -> &OrientedBox {
        &self.nodes[index as usize].block
    }

    #[inline]
    pub(crate) fn parts(&self, index: u32) -> Parts<'_> {
        let node = &self.nodes[index as usize];
        if node.count == 0 {
            Parts::Boxes([index + 1, node.next])
        } else {
            let first = node.next as usize;
            Parts::Triangles(&self.triangles[first..first + node.count as usize])
        }
    }

    pub(crate) fn vertices_m(&self) -> impl Iterator<Item = &Vector3<f64>> + Clone {
        self.triangles.iter().flatten()
    }

    /// Vertex farthest along `direction`; `hint` is the one found last, and only saves time.
    pub(crate) fn support(&self, direction: &Vector3<f64>, hint: &mut usize) -> Vector3<f64> {
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
                    let [one, other] = boxes.map(|i| (self.block(i).high(direction), i));
                    // The farther one is on top.
                    let (under, top) = if one.0 >= other.0 {
                        (other, one)
                    } else {
                        (one, other)
                    };
                    stack.extend([under, top].into_iter().filter(|entry| entry.0 > best));
                }
                Parts::Triangles(triangles) => {
                    let first = 3 * self.nodes[index as usize].next as usize;
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

/// A triangle and its number in the mesh.
struct Item {
    corners: [Vector3<f64>; 3],
    number: u32,
}

/// What stands for a mesh without triangles.
const NOTHING: Item = Item {
    corners: [Vector3::new(0.0, 0.0, 0.0); 3],
    number: u32::MAX,
};

/// None if a vertex is not there.
fn corners_of(mesh: &TriangleMesh, triangle: &[u32; 3]) -> Option<[Vector3<f64>; 3]> {
    let [a, b, c] = triangle.map(|i| mesh.vertices_m.get(i as usize).map(|vertex| vertex.coords));
    Some([a?, b?, c?])
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "a mesh numbers its vertices in u32, so its triangles and boxes fit too"
)]
fn split(nodes: &mut Vec<Node>, triangles: &mut [Item], first: usize) {
    let corners = triangles.iter().flat_map(|item| &item.corners);
    let (block, axis) = OrientedBox::around(&corners);
    if triangles.len() <= LEAF_TRIANGLES {
        nodes.push(Node {
            block,
            next: first as u32,
            count: triangles.len() as u32,
        });
        return;
    }
    let key = |item: &Item| {
        let [a, b, c] = &item.corners;
        axis.dot(&(a + b + c))
    };
    let middle = triangles.len() / 2;
    triangles.select_nth_unstable_by(middle, |one, other| key(one).total_cmp(&key(other)));
    let index = nodes.len();
    nodes.push(Node {
        block,
        next: 0,
        count: 0,
    });
    let (left, right) = triangles.split_at_mut(middle);
    split(nodes, left, first);
    let second = nodes.len() as u32;
    nodes[index].next = second;
    split(nodes, right, first + middle);
}

/// An order in which equal points are neighbours.
pub(crate) fn by_coordinates(one: &Vector3<f64>, other: &Vector3<f64>) -> Ordering {
    one.x
        .total_cmp(&other.x)
        .then(one.y.total_cmp(&other.y))
        .then(one.z.total_cmp(&other.z))
}

/// One vertex of each connected part; vertices at the same place are one.
fn anchors(triangles: &[[Vector3<f64>; 3]]) -> Vec<Vector3<f64>> {
    let corners = triangles.as_flattened();
    let mut welded = TriangleMesh {
        vertices_m: corners.iter().map(|&corner| corner.into()).collect(),
        triangles: (0..corners.len())
            .step_by(3)
            .filter_map(|i| u32::try_from(i).ok())
            .map(|i| [i, i + 1, i + 2])
            .collect(),
    };
    weld(&mut welded);
    connected_parts(&welded)
        .iter()
        .map(|part| triangles[part[0]][0])
        .collect()
}
