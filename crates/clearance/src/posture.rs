//! Where the solids of a cell are at one posture, and lower bounds of their distances.
//!
//! What encloses a solid is placed once per posture, not once per pair. A lower bound is the
//! largest of three: by balls, by capsules, and by the plane across the way from the one solid's
//! axis to the other's turned box, which for a box of a table or a wedge of a ring is mostly the
//! distance itself.

use std::cell::OnceCell;
use std::sync::Arc;

use needlebench_cell::Frame;
use needlebench_geometry::{BoundingCapsule, Placement};

use crate::body::{LinkPlacements, Part, PlacedBody, Seen, SolidTree};

/// All solids at one posture, in the world; each is placed when it is first asked for.
pub(crate) struct Posture<'l> {
    links: &'l LinkPlacements,
    /// Of the bodies that move, one body after the other.
    moving: Vec<OnceCell<Seen>>,
    /// Balls around the bodies.
    balls: Vec<BoundingCapsule>,
    /// Capsules around the bodies.
    wholes: Vec<BoundingCapsule>,
}

impl<'l> Posture<'l> {
    pub fn new(bodies: &[Arc<PlacedBody>], links: &'l LinkPlacements) -> Self {
        let placed = |bound: &BoundingCapsule, frame: Frame| match frame {
            Frame::World => *bound,
            Frame::Link(link) => bound.placed(&links[link]),
        };
        let moving = bodies.iter().filter(|body| body.frame != Frame::World);
        let count = moving.map(|body| body.solids.len()).sum();
        let all = bodies.iter();
        Self {
            links,
            moving: vec![OnceCell::new(); count],
            balls: all
                .clone()
                .map(|body| placed(&body.bound, body.frame))
                .collect(),
            wholes: all.map(|body| placed(&body.whole, body.frame)).collect(),
        }
    }

    #[inline]
    fn seen<'s>(&'s self, body: &'s PlacedBody, solid: usize) -> &'s Seen {
        let seen = &body.solids[solid].seen;
        match body.frame {
            Frame::World => seen,
            Frame::Link(link) => {
                let place = &self.moving[body.first_moving + solid];
                place.get_or_init(|| seen.placed(&self.links[link]))
            }
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
