//! Bodies prepared for many postures: shapes, what encloses them, and a tree over many solids.

use std::sync::Arc;

use nalgebra::Vector3;
use needlebench_cell::{CollisionBody, Frame};
use needlebench_geometry::{BoundingCapsule, OrientedBox, Placement, PreparedShape, Shape};
use needlebench_kinematics::{JOINT_COUNT, Pose};

/// From this number on the solids of a body are searched by a tree of boxes.
const TREE_SOLIDS: usize = 6;

/// A solid's place and what encloses it.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Seen {
    pub placement: Placement,
    pub bound: BoundingCapsule,
    pub block: OrientedBox,
}

impl Seen {
    pub fn new(shape: &PreparedShape, placement: Placement) -> Self {
        Self {
            bound: shape.bounding_capsule().placed(&placement),
            block: shape.bounding_box().placed(&placement),
            placement,
        }
    }

    pub fn placed(&self, placement: &Placement) -> Self {
        Self {
            placement: placement.after(&self.placement),
            bound: self.bound.placed(placement),
            block: self.block.placed(placement),
        }
    }

    /// How far the plane across the way from A's axis to a box keeps A from the box.
    #[inline]
    pub fn gap_to_box_m(&self, shape: &PreparedShape, other: &OrientedBox) -> f64 {
        let mut from = self.bound.centre;
        let axis = &self.bound.half_axis;
        let length_squared = axis.norm_squared();
        if length_squared > 0.0 {
            let along = (other.centre - from).dot(axis) / length_squared;
            from += axis * along.clamp(-1.0, 1.0);
        }
        let way = other.nearest(&from) - from;
        let length = way.norm();
        if length > 0.0 {
            let across = way / length;
            let in_shape = self.placement.rotation.tr_mul(&across);
            let mut hint = usize::MAX;
            let reach = in_shape.dot(&shape.core_support(&in_shape, &mut hint))
                + across.dot(&self.placement.translation)
                + shape.radius_m();
            other.low(&across) - reach
        } else {
            f64::NEG_INFINITY
        }
    }
}

/// The solids of a body in a tree of boxes, for bodies of many.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct SolidTree(pub Vec<Node>);

/// A box around some solids.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Node {
    pub block: OrientedBox,
    pub part: Part,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Part {
    /// The second of two halves; the first one follows its parent.
    Halves {
        second: u32,
    },
    Solid(u32),
}

impl SolidTree {
    pub fn new(solids: &[&OrientedBox]) -> Option<Self> {
        if solids.len() < TREE_SOLIDS {
            return None;
        }
        let mut nodes = Vec::with_capacity(2 * solids.len());
        let mut order: Vec<usize> = (0..solids.len()).collect();
        split(&mut nodes, solids, &mut order);
        Some(Self(nodes))
    }
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "a body has fewer than 2^32 solids"
)]
fn split(nodes: &mut Vec<Node>, solids: &[&OrientedBox], order: &mut [usize]) {
    if let [only] = order {
        nodes.push(Node {
            block: solids[*only].clone(),
            part: Part::Solid(*only as u32),
        });
        return;
    }
    let corners: Vec<Vector3<f64>> = order.iter().flat_map(|&i| solids[i].corners()).collect();
    let (block, axis) = OrientedBox::around(&corners.iter());
    let middle = order.len() / 2;
    let key = |i: usize| axis.dot(&solids[i].centre);
    order.sort_unstable_by(|&i, &j| key(i).total_cmp(&key(j)).then(i.cmp(&j)));
    let index = nodes.len();
    nodes.push(Node {
        block,
        part: Part::Halves { second: 0 },
    });
    let (left, right) = order.split_at_mut(middle);
    split(nodes, solids, left);
    let second = nodes.len() as u32;
    nodes[index].part = Part::Halves { second };
    split(nodes, solids, right);
}

/// Poses of the moving links, as the bodies need them.
pub(crate) type LinkPlacements = [Placement; JOINT_COUNT];

#[derive(Debug, Clone)]
pub(crate) struct PlacedShape {
    /// What it was made of.
    solid: (Shape, Pose),
    pub shape: Arc<PreparedShape>,
    pub body_from_shape: Placement,
    /// Encloses the shape, in the body's frame.
    pub bound: BoundingCapsule,
    /// Place and what encloses the shape, in the body's frame.
    pub seen: Seen,
}

impl PlacedShape {
    /// Whether it was made of this shape.
    pub fn has_shape(&self, shape: &Shape) -> bool {
        same_shape(&self.solid.0, shape)
    }
}

#[derive(Debug, Clone)]
pub(crate) struct PlacedBody {
    pub frame: Frame,
    pub solids: Vec<PlacedShape>,
    /// Ball around all solids, in the body's frame.
    pub bound: BoundingCapsule,
    /// Capsule around all solids, in the body's frame.
    pub whole: BoundingCapsule,
    /// In the body's frame.
    pub tree: Option<SolidTree>,
    /// Solids of the moving bodies before this one.
    pub first_moving: usize,
}

/// Prepares a body; `known` is one that may be the same or have the same shapes.
pub(crate) fn placed_body(
    body: &CollisionBody,
    first_moving: usize,
    known: Option<&Arc<PlacedBody>>,
) -> Arc<PlacedBody> {
    if let Some(known) = known
        && known.is_of(body, first_moving)
    {
        return Arc::clone(known);
    }
    let known = known.map_or(&[][..], |known| &known.solids);
    let solids: Vec<_> = body
        .solids
        .iter()
        .enumerate()
        .map(|(index, solid)| {
            let twin = known
                .get(index)
                .filter(|known| known.has_shape(&solid.shape));
            let shape = match twin {
                Some(known) => Arc::clone(&known.shape),
                None => Arc::new(PreparedShape::new(&solid.shape)),
            };
            let body_from_shape = Placement::new(&solid.parent_from_shape);
            PlacedShape {
                solid: (solid.shape.clone(), solid.parent_from_shape),
                bound: shape.bounding_capsule().placed(&body_from_shape),
                seen: Seen::new(&shape, body_from_shape),
                body_from_shape,
                shape,
            }
        })
        .collect();
    Arc::new(PlacedBody {
        frame: body.frame,
        bound: BoundingCapsule::around_balls(solids.iter().map(|solid| &solid.bound)),
        whole: around_boxes(&solids),
        tree: SolidTree::new(&solids.iter().map(|s| &s.seen.block).collect::<Vec<_>>()),
        first_moving,
        solids,
    })
}

/// A capsule around the boxes of solids.
fn around_boxes(solids: &[PlacedShape]) -> BoundingCapsule {
    let boxes = solids.iter().map(|solid| &solid.seen.block);
    let corners: Vec<Vector3<f64>> = boxes.flat_map(OrientedBox::corners).collect();
    if corners.is_empty() {
        return BoundingCapsule::on_z(0.0, 0.0);
    }
    BoundingCapsule::around_points(corners.iter())
}

impl PlacedBody {
    /// Whether preparing a body would give this one again.
    pub fn is_of(&self, body: &CollisionBody, first_moving: usize) -> bool {
        self.frame == body.frame
            && self.first_moving == first_moving
            && self.solids.len() == body.solids.len()
            && self.solids.iter().zip(&body.solids).all(|(placed, solid)| {
                placed.solid.1 == solid.parent_from_shape && placed.has_shape(&solid.shape)
            })
    }
}

/// Whether two shapes are equal, without looking into meshes that are one and the same.
fn same_shape(a: &Shape, b: &Shape) -> bool {
    match (a, b) {
        (Shape::Convex(a), Shape::Convex(b)) => Arc::ptr_eq(a, b) || a == b,
        (Shape::Mesh(a), Shape::Mesh(b)) => Arc::ptr_eq(a, b) || a == b,
        _ => a == b,
    }
}
