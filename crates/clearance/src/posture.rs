//! Where the solids of a cell are at one posture, and lower bounds of their distances.
//!
//! What encloses a solid is placed once per posture, not once per pair. A lower bound is the
//! largest of three: by balls, by capsules, and by the plane across the way from the one solid's
//! axis to the other's turned box, which for a box of a table or a wedge of a ring is mostly the
//! distance itself.

use std::sync::Arc;

use needlebench_cell::Frame;
use needlebench_geometry::{BoundingCapsule, Placement};

use crate::body::{LinkPlacements, Part, PlacedBody, Seen, SolidTree};

/// All solids at one posture, in the world.
pub(crate) struct Posture {
    /// Of the bodies that move, one body after the other.
    moving: Vec<Seen>,
    /// Balls around the bodies.
    balls: Vec<BoundingCapsule>,
    /// Capsules around the bodies.
    wholes: Vec<BoundingCapsule>,
}

impl Posture {
    pub fn new(bodies: &[Arc<PlacedBody>], links: &LinkPlacements) -> Self {
        let mut moving = Vec::with_capacity(32);
        let mut balls = Vec::with_capacity(bodies.len());
        let mut wholes = Vec::with_capacity(bodies.len());
        for body in bodies {
            match body.frame {
                Frame::World => {
                    balls.push(body.bound);
                    wholes.push(body.whole);
                }
                Frame::Link(i) => {
                    balls.push(body.bound.placed(&links[i]));
                    wholes.push(body.whole.placed(&links[i]));
                    moving.extend(body.solids.iter().map(|solid| solid.seen.placed(&links[i])));
                }
            }
        }
        Self {
            moving,
            balls,
            wholes,
        }
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

    /// Lower bound of the distance of two bodies by what encloses them whole, m; the balls alone where
    /// these suffice for the limit.
    pub fn whole_gap_m(&self, a: usize, b: usize, limit_m: f64) -> f64 {
        let (ball_a, ball_b) = (&self.balls[a], &self.balls[b]);
        let ball_m =
            (ball_a.centre - ball_b.centre).norm() - ball_a.ball_radius_m - ball_b.ball_radius_m;
        if ball_m >= limit_m || ball_m.is_nan() {
            return ball_m;
        }
        let (one, other) = (&self.wholes[a], &self.wholes[b]);
        ball_m.max(one.gap_m(other))
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
                Frame::World => Placement::IDENTITY,
                Frame::Link(_) => {
                    let solid = &b.solids[0].seen.placement;
                    self.seen(b, 0)
                        .placement
                        .after(&solid.inverse_after(&Placement::IDENTITY))
                }
            };
            stack.clear();
            let gap_m = |node: u32| {
                let node = &nodes[node as usize].block;
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
                match nodes[index as usize].part {
                    Part::Halves { second } => {
                        let first = index + 1;
                        let (one, other) = ((gap_m(first), first), (gap_m(second), second));
                        // The nearer one is on top.
                        if one.0 <= other.0 {
                            stack.extend([other, one]);
                        } else {
                            stack.extend([one, other]);
                        }
                    }
                    Part::Solid(solid) => match try_one(solid as usize, limit_m) {
                        Some(next_m) => limit_m = next_m,
                        None => return,
                    },
                }
            }
        }
    }
}
