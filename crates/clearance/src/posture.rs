//! Where the solids of a cell are at one posture, and lower bounds of their distances.
//!
//! What encloses a solid is placed once per posture, not once per pair. A lower bound is the
//! largest of three: by balls, by capsules, and by the plane across the way from the one solid's
//! axis to the other's turned box, which for a box of a table or a wedge of a ring is mostly the
//! distance itself.

use std::sync::Arc;

use nalgebra::Vector3;
use needlebench_cell::Frame;

use crate::bounds::Capsule;
use crate::core::{Placement, PreparedShape};
use crate::mesh::Node;
use crate::model::{IDENTITY, LinkPlacements, PlacedBody};

/// From this number on the solids of a body are searched by a tree of boxes.
const TREE_SOLIDS: usize = 6;

/// A solid's place and what encloses it.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Seen {
    pub placement: Placement,
    pub bound: Capsule,
    pub block: Node,
}

impl Seen {
    pub fn new(shape: &PreparedShape, placement: Placement) -> Self {
        Self {
            bound: shape.bound.placed(&placement),
            block: shape.block.placed(&placement),
            placement,
        }
    }

    fn placed(&self, placement: &Placement) -> Self {
        Self {
            placement: placement.after(&self.placement),
            bound: self.bound.placed(placement),
            block: self.block.placed(placement),
        }
    }

    /// How far the plane across the way from A's axis to a box keeps A from the box.
    #[inline]
    fn gap_to_box_m(&self, shape: &PreparedShape, other: &Node) -> f64 {
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
            let reach = in_shape.dot(&shape.core.support(&in_shape, &mut hint))
                + across.dot(&self.placement.translation)
                + shape.radius_m;
            other.low(&across) - reach
        } else {
            f64::NEG_INFINITY
        }
    }
}

/// The solids of a body in a tree of boxes, for bodies of many.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct SolidTree(Vec<Node>);

impl SolidTree {
    pub fn new(solids: &[&Node]) -> Option<Self> {
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
fn split(nodes: &mut Vec<Node>, solids: &[&Node], order: &mut [usize]) {
    if let [only] = order {
        nodes.push(solids[*only].clone().leaf(*only as u32, 1));
        return;
    }
    let corners: Vec<Vector3<f64>> = order.iter().flat_map(|&i| solids[i].corners()).collect();
    let (node, axis) = Node::around(&corners.iter());
    let middle = order.len() / 2;
    let key = |i: usize| axis.dot(&solids[i].centre);
    order.sort_unstable_by(|&i, &j| key(i).total_cmp(&key(j)).then(i.cmp(&j)));
    let index = nodes.len();
    nodes.push(node);
    let (left, right) = order.split_at_mut(middle);
    split(nodes, solids, left);
    let second = nodes.len() as u32;
    nodes[index].open_at(second);
    split(nodes, solids, right);
}

/// All solids at one posture, in the world.
pub(crate) struct Posture {
    /// Of the bodies that move, one body after the other.
    moving: Vec<Seen>,
    /// Balls around the bodies.
    balls: Vec<Capsule>,
}

impl Posture {
    pub fn new(bodies: &[Arc<PlacedBody>], links: &LinkPlacements) -> Self {
        let mut moving = Vec::with_capacity(32);
        let mut balls = Vec::with_capacity(bodies.len());
        for body in bodies {
            match body.frame {
                Frame::World => balls.push(body.bound),
                Frame::Link(i) => {
                    balls.push(body.bound.placed(&links[i]));
                    moving.extend(body.solids.iter().map(|solid| solid.seen.placed(&links[i])));
                }
            }
        }
        Self { moving, balls }
    }

    #[inline]
    fn seen<'s>(&'s self, body: &'s PlacedBody, solid: usize) -> &'s Seen {
        match body.frame {
            Frame::World => &body.solids[solid].seen,
            Frame::Link(_) => &self.moving[body.first_moving + solid],
        }
    }

    /// Where a solid is in the world.
    pub fn place<'s>(&'s self, body: &'s PlacedBody, solid: usize) -> &'s Placement {
        &self.seen(body, solid).placement
    }

    /// Calls `visit` with all solids of A and B whose lower bound, which is passed on, is below a
    /// limit. `visit` returns the limit from there on, or `None` to end.
    pub fn for_each_near(
        &self,
        (index_a, a): (usize, &PlacedBody),
        (index_b, b): (usize, &PlacedBody),
        mut limit_m: f64,
        mut visit: impl FnMut(usize, usize, f64) -> Option<f64>,
    ) {
        let (ball_a, ball_b) = (&self.balls[index_a], &self.balls[index_b]);
        if ball_a.balls_part(ball_b, limit_m) {
            return;
        }
        let mut stack = Vec::new();
        for i in 0..a.solids.len() {
            let seen = self.seen(a, i);
            if seen.bound.balls_part(ball_b, limit_m) {
                continue;
            }
            let shape = &a.solids[i].shape;
            let mut try_one = |j: usize, limit_m: f64| {
                let other = self.seen(b, j);
                if seen.bound.balls_part(&other.bound, limit_m) {
                    return Some(limit_m);
                }
                let mut gap_m = seen.bound.gap_m(&other.bound);
                if gap_m < limit_m || gap_m.is_nan() {
                    gap_m = gap_m.max(seen.gap_to_box_m(shape, &other.block));
                }
                if gap_m >= limit_m {
                    return Some(limit_m);
                }
                visit(i, j, gap_m)
            };
            let Some(SolidTree(nodes)) = &b.tree else {
                for j in 0..b.solids.len() {
                    match try_one(j, limit_m) {
                        Some(next_m) => limit_m = next_m,
                        None => return,
                    }
                }
                continue;
            };
            let to_world = match b.frame {
                Frame::World => IDENTITY,
                Frame::Link(_) => {
                    let solid = &b.solids[0].seen.placement;
                    self.seen(b, 0)
                        .placement
                        .after(&solid.inverse_after(&IDENTITY))
                }
            };
            stack.clear();
            let gap_m = |node: u32| {
                let node = &nodes[node as usize];
                match b.frame {
                    Frame::World => seen.gap_to_box_m(shape, node),
                    Frame::Link(_) => seen.gap_to_box_m(shape, &node.placed(&to_world)),
                }
            };
            stack.push((gap_m(0), 0_u32));
            while let Some((lower_m, index)) = stack.pop() {
                if lower_m >= limit_m {
                    continue;
                }
                match nodes[index as usize].children(index) {
                    Ok([one, other]) => {
                        let (one, other) = ((gap_m(one), one), (gap_m(other), other));
                        // The nearer one is on top.
                        if one.0 <= other.0 {
                            stack.extend([other, one]);
                        } else {
                            stack.extend([one, other]);
                        }
                    }
                    Err(solid) => match try_one(solid as usize, limit_m) {
                        Some(next_m) => limit_m = next_m,
                        None => return,
                    },
                }
            }
        }
    }
}
