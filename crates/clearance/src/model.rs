//! Clearances of a whole cell.

use nalgebra::{Matrix3, Vector3};
use needlebench_cell::{Cell, ClearanceClass, CollisionBody, Frame};
use needlebench_kinematics::{Chain, JOINT_COUNT, Joints, Pose};

use crate::bounds::Capsule;
use crate::core::{Placement, PreparedShape};
use crate::separation::{Separation, closer_than};

/// Number of classes; `NeedleRoute` is the last.
pub(crate) const CLASS_COUNT: usize = ClearanceClass::NeedleRoute as usize + 1;

/// What a lower bound by enclosing volumes has to exceed a distance by before the pair is left
/// out, m. More than the distances' own error, so that leaving out never changes a result.
const PRUNING_MARGIN_M: f64 = 3e-7;

/// All classes, each at the index that it is cast to.
const CLASSES: [ClearanceClass; CLASS_COUNT] = [
    ClearanceClass::RobotPhantom,
    ClearanceClass::RobotTable,
    ClearanceClass::RobotGantry,
    ClearanceClass::RobotMount,
    ClearanceClass::SelfCollision,
    ClearanceClass::ToolPhantom,
    ClearanceClass::GuideStandoff,
    ClearanceClass::NeedleCorridor,
    ClearanceClass::NeedleRoute,
];

/// Clearance of one pair of bodies.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PairClearance {
    /// Index into [`Cell::pairs`].
    pub pair: usize,
    /// Class that the pair counts for.
    pub class: ClearanceClass,
    /// Closest solid of the pair's body `a`, an index into its solids.
    pub solid_a: usize,
    /// Closest solid of the pair's body `b`, an index into its solids.
    pub solid_b: usize,
    /// Signed distance and witness points, in the world.
    pub separation: Separation,
}

impl PairClearance {
    /// Names of the two closest solids, `a` first. `cell` is the one that the model was made of.
    pub fn solid_names<'c>(&self, cell: &'c Cell) -> (&'c str, &'c str) {
        let pair = cell.pairs[self.pair];
        (
            &cell.bodies[pair.a].solids[self.solid_a].name,
            &cell.bodies[pair.b].solids[self.solid_b].name,
        )
    }
}

/// The least clearance of each class.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClassMinima([Option<PairClearance>; CLASS_COUNT]);

impl ClassMinima {
    /// Least clearance of a class, or `None` if the cell has no pair of that class.
    pub fn get(&self, class: ClearanceClass) -> Option<&PairClearance> {
        self.0[class as usize].as_ref()
    }

    /// All classes that the cell has, in the order of [`ClearanceClass`].
    pub fn iter(&self) -> impl Iterator<Item = &PairClearance> {
        self.0.iter().flatten()
    }
}

/// Poses of the moving links, as the bodies need them.
pub(crate) type LinkPlacements = [Placement; JOINT_COUNT];

#[derive(Debug, Clone)]
pub(crate) struct PlacedShape {
    pub shape: PreparedShape,
    pub body_from_shape: Placement,
    /// Encloses the shape, in the body's frame.
    pub bound: Capsule,
}

#[derive(Debug, Clone)]
pub(crate) struct PlacedBody {
    pub frame: Frame,
    pub solids: Vec<PlacedShape>,
    /// Ball around all solids, in the body's frame.
    bound: Capsule,
}

#[derive(Debug, Clone, Copy)]
pub(crate) struct PlacedPair {
    pub a: usize,
    pub b: usize,
    pub class: ClearanceClass,
}

/// Two solids of a pair; indices into their bodies' solids.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct SolidPair {
    a: usize,
    b: usize,
}

/// Clearance queries of one cell, prepared once.
///
/// Distances are as accurate as [`separation`](crate::separation). Nothing is allocated per
/// query but the list that [`ClearanceModel::all_pairs`] returns, and what the depth of
/// penetrating shapes needs.
#[derive(Debug, Clone)]
pub struct ClearanceModel {
    pub(crate) chain: Chain,
    world_from_base_link: Pose,
    pub(crate) bodies: Vec<PlacedBody>,
    pub(crate) pairs: Vec<PlacedPair>,
}

impl ClearanceModel {
    /// Prepares the geometry of a cell.
    pub fn new(cell: &Cell) -> Self {
        Self {
            chain: cell.robot.chain,
            world_from_base_link: cell.robot.world_from_base_link,
            bodies: cell.bodies.iter().map(placed_body).collect(),
            pairs: cell
                .pairs
                .iter()
                .map(|pair| PlacedPair {
                    a: pair.a,
                    b: pair.b,
                    class: pair.class,
                })
                .collect(),
        }
    }

    /// Clearance of every pair of [`Cell::pairs`], in that order, at joint positions `q`.
    pub fn all_pairs(&self, q: &Joints) -> Vec<PairClearance> {
        self.all_pairs_at(&self.world_from_links(q))
    }

    /// [`ClearanceModel::all_pairs`] with the poses of the moving links given, for states that
    /// an engine has recorded.
    pub fn all_pairs_at(&self, world_from_links: &[Pose; JOINT_COUNT]) -> Vec<PairClearance> {
        let links = world_from_links.each_ref().map(Placement::new);
        (0..self.pairs.len())
            .filter_map(|pair| {
                let query = self.query(pair, &links);
                let mut best = None;
                query.improve(&mut best, None);
                best
            })
            .collect()
    }

    /// The least clearance of each class at joint positions `q`.
    ///
    /// The same numbers as the minimum over [`ClearanceModel::all_pairs`], but pairs that
    /// bounding volumes or a separating plane show to be farther apart are left out.
    pub fn minimum_per_class(&self, q: &Joints) -> ClassMinima {
        self.minimum_per_class_at(&self.world_from_links(q))
    }

    /// [`ClearanceModel::minimum_per_class`] with the poses of the moving links given.
    pub fn minimum_per_class_at(&self, world_from_links: &[Pose; JOINT_COUNT]) -> ClassMinima {
        let links = world_from_links.each_ref().map(Placement::new);
        // The most promising solids of each class first: their distance prunes most of the rest.
        let mut promising: [Option<(f64, usize, SolidPair)>; CLASS_COUNT] = [None; CLASS_COUNT];
        for (pair, placed) in self.pairs.iter().enumerate() {
            let slot = &mut promising[placed.class as usize];
            let least_m = slot.map_or(f64::INFINITY, |(bound_m, ..)| bound_m);
            if let Some((bound_m, solids)) = self.query(pair, &links).most_promising(least_m) {
                *slot = Some((bound_m, pair, solids));
            }
        }
        let mut best = [None; CLASS_COUNT];
        for (slot, promising) in best.iter_mut().zip(promising) {
            if let Some((_, pair, solids)) = promising {
                self.query(pair, &links).try_solids(solids, slot);
            }
        }
        // Backwards: what moves most, the tool, tends to be closest and comes late in the list.
        for (pair, placed) in self.pairs.iter().enumerate().rev() {
            let class = placed.class as usize;
            let done = promising[class]
                .filter(|&(_, promising_pair, _)| promising_pair == pair)
                .map(|(_, _, solids)| solids);
            self.query(pair, &links).improve(&mut best[class], done);
        }
        ClassMinima(best)
    }

    /// The first pair of physical bodies, in the order of [`Cell::pairs`], that is closer than
    /// the limit of its class, m; with the clearance of the first such solids, not the least.
    ///
    /// Classes that do not matter have the limit negative infinity.
    pub fn first_below(
        &self,
        q: &Joints,
        limit_m: impl Fn(ClearanceClass) -> f64,
    ) -> Option<PairClearance> {
        self.first_below_at(&self.world_from_links(q), limit_m)
    }

    /// [`ClearanceModel::first_below`] with the poses of the moving links given.
    pub fn first_below_at(
        &self,
        world_from_links: &[Pose; JOINT_COUNT],
        limit_m: impl Fn(ClearanceClass) -> f64,
    ) -> Option<PairClearance> {
        let links = world_from_links.each_ref().map(Placement::new);
        let limits_m = CLASSES.map(|class| {
            if class.is_physical() {
                limit_m(class)
            } else {
                f64::NEG_INFINITY
            }
        });
        self.pairs.iter().enumerate().find_map(|(pair, placed)| {
            let limit_m = limits_m[placed.class as usize];
            if limit_m == f64::NEG_INFINITY {
                return None;
            }
            self.query(pair, &links).first_below(limit_m)
        })
    }

    pub(crate) fn world_from_links(&self, q: &Joints) -> [Pose; JOINT_COUNT] {
        self.chain
            .link_poses(q)
            .map(|pose| self.world_from_base_link * pose)
    }

    fn query<'m>(&'m self, pair: usize, links: &'m LinkPlacements) -> PairQuery<'m> {
        let PlacedPair { a, b, class } = self.pairs[pair];
        let (a, b) = (&self.bodies[a], &self.bodies[b]);
        let b_from_a = match (a.frame, b.frame) {
            (Frame::World, Frame::World) => IDENTITY,
            (Frame::Link(i), Frame::World) => links[i],
            (Frame::World, Frame::Link(j)) => links[j].inverse_after(&IDENTITY),
            (Frame::Link(i), Frame::Link(j)) => links[j].inverse_after(&links[i]),
        };
        PairQuery {
            pair,
            class,
            a,
            b,
            b_from_a,
            links,
        }
    }
}

pub(crate) const IDENTITY: Placement = Placement {
    rotation: Matrix3::new(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0),
    translation: Vector3::new(0.0, 0.0, 0.0),
};

fn placed_body(body: &CollisionBody) -> PlacedBody {
    let solids: Vec<_> = body
        .solids
        .iter()
        .map(|solid| {
            let shape = PreparedShape::new(&solid.shape);
            let body_from_shape = Placement::new(&solid.parent_from_shape);
            PlacedShape {
                bound: shape.bound.placed(&body_from_shape),
                body_from_shape,
                shape,
            }
        })
        .collect();
    PlacedBody {
        frame: body.frame,
        bound: Capsule::around_balls(solids.iter().map(|solid| &solid.bound)),
        solids,
    }
}

/// Whether the distance is below the limit, or is not a number: joint positions that are not
/// finite must not pass for free.
fn is_closer(separation: &Separation, limit_m: f64) -> bool {
    separation.distance_m < limit_m || separation.distance_m.is_nan()
}

/// One pair of bodies at one state of the arm. Works in the frame of body B.
struct PairQuery<'m> {
    pair: usize,
    class: ClearanceClass,
    a: &'m PlacedBody,
    b: &'m PlacedBody,
    b_from_a: Placement,
    links: &'m LinkPlacements,
}

impl PairQuery<'_> {
    /// The solids with the least lower bound of their distance, if it is below `least_m`.
    fn most_promising(&self, mut least_m: f64) -> Option<(f64, SolidPair)> {
        let mut found = None;
        self.for_each_near(least_m, |solids, bound_m| {
            least_m = bound_m;
            found = Some((bound_m, solids));
            Some(least_m)
        });
        found
    }

    /// Replaces `best` by the closest solids of this pair if they are closer. `done` have been
    /// tried before.
    fn improve(&self, best: &mut Option<PairClearance>, done: Option<SolidPair>) {
        let beyond_m = |best: &Option<PairClearance>| {
            best.map_or(f64::INFINITY, |best| best.separation.distance_m) + PRUNING_MARGIN_M
        };
        // Nothing within reach, or a good start: it halves the number of full distances.
        let Some((_, first)) = self.most_promising(beyond_m(best)) else {
            return;
        };
        if done != Some(first) {
            self.try_solids(first, best);
        }
        self.for_each_near(beyond_m(best), |solids, _| {
            if solids != first && done != Some(solids) {
                self.try_solids(solids, best);
            }
            Some(beyond_m(best))
        });
    }

    /// Clearance of the first solids that are closer than `limit_m`.
    fn first_below(&self, limit_m: f64) -> Option<PairClearance> {
        let mut found = None;
        self.for_each_near(limit_m + PRUNING_MARGIN_M, |solids, _| {
            found = self
                .separation(solids, limit_m)
                .filter(|separation| is_closer(separation, limit_m))
                .map(|separation| self.clearance(solids, &separation));
            if found.is_some() {
                None
            } else {
                Some(limit_m + PRUNING_MARGIN_M)
            }
        });
        found
    }

    fn try_solids(&self, solids: SolidPair, best: &mut Option<PairClearance>) {
        let best_m = best.map_or(f64::INFINITY, |best| best.separation.distance_m);
        if let Some(separation) = self.separation(solids, best_m)
            && is_closer(&separation, best_m)
        {
            *best = Some(self.clearance(solids, &separation));
        }
    }

    /// Calls `visit` with all solids whose lower bound, which is passed on, is below a limit.
    /// `visit` returns the limit from there on, or `None` to end.
    fn for_each_near(
        &self,
        mut limit_m: f64,
        mut visit: impl FnMut(SolidPair, f64) -> Option<f64>,
    ) {
        if self
            .a
            .bound
            .placed(&self.b_from_a)
            .ball_gap_m(&self.b.bound)
            >= limit_m
        {
            return;
        }
        for (i, a) in self.a.solids.iter().enumerate() {
            let bound_a = a.bound.placed(&self.b_from_a);
            if bound_a.ball_gap_m(&self.b.bound) >= limit_m {
                continue;
            }
            for (j, b) in self.b.solids.iter().enumerate() {
                let ball_gap_m = bound_a.ball_gap_m(&b.bound);
                if ball_gap_m >= limit_m {
                    continue;
                }
                let gap_m = bound_a.gap_m(&b.bound).max(ball_gap_m);
                if gap_m >= limit_m {
                    continue;
                }
                match visit(SolidPair { a: i, b: j }, gap_m) {
                    Some(next_m) => limit_m = next_m,
                    None => return,
                }
            }
        }
    }

    /// Signed distance in the frame of solid B, or `None` if it is beyond the cutoff.
    fn separation(&self, solids: SolidPair, cutoff_m: f64) -> Option<Separation> {
        let (a, b) = (&self.a.solids[solids.a], &self.b.solids[solids.b]);
        let solid_b_from_solid_a = b
            .body_from_shape
            .inverse_after(&self.b_from_a.after(&a.body_from_shape));
        closer_than(&a.shape, &b.shape, &solid_b_from_solid_a, cutoff_m)
    }

    fn clearance(&self, solids: SolidPair, in_solid_b: &Separation) -> PairClearance {
        let in_body_b = in_solid_b.placed(&self.b.solids[solids.b].body_from_shape);
        PairClearance {
            pair: self.pair,
            class: self.class,
            solid_a: solids.a,
            solid_b: solids.b,
            separation: match self.b.frame {
                Frame::World => in_body_b,
                Frame::Link(i) => in_body_b.placed(&self.links[i]),
            },
        }
    }
}
