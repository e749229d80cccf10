//! Clearances of a whole cell.

use std::borrow::Cow;
use std::sync::Arc;

use needlebench_cell::{
    BodyKind, BodyPair, Cell, ClearanceClass, CollisionBody, Frame, part_in_words,
};
use needlebench_geometry::{PRUNING_MARGIN_M, Placement, Separation, Solid, separation_within};
use needlebench_kinematics::{Chain, JOINT_COUNT, Joints, Pose};

use crate::body::{LinkPlacements, PlacedBody, placed_body};
use crate::posture::Posture;

/// Number of classes.
pub(crate) const CLASS_COUNT: usize = ClearanceClass::ALL.len();

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

    /// What people call the two closest solids, `a` first.
    pub fn in_words<'c>(&self, cell: &'c Cell) -> [Cow<'c, str>; 2] {
        let (a, b) = self.solid_names(cell);
        [a, b].map(part_in_words)
    }
}

/// What the patient may be nearer by than at a cut of its scan, m: breath and registration move a patient so far.
pub const CUT_MARGIN_M: f64 = 5e-3;

/// Whether a clearance is known, although the patient may go on behind the cuts of its scan: what it may be is farther, by
/// [`CUT_MARGIN_M`] at least. `behind_cuts_m` is a lower bound of the distance from it, none where nothing is cut.
pub fn is_known(clearance_m: f64, behind_cuts_m: Option<f64>) -> bool {
    behind_cuts_m.is_none_or(|from_m| from_m >= clearance_m.max(0.0) + CUT_MARGIN_M)
}

/// The least clearance of each class.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClassMinima {
    pub(crate) classes: [Option<PairClearance>; CLASS_COUNT],
    pub(crate) behind_cuts_m: [Option<f64>; CLASS_COUNT],
}

impl ClassMinima {
    /// Least clearance of a class, or `None` if the cell has no pair of that class.
    pub fn get(&self, class: ClearanceClass) -> Option<&PairClearance> {
        self.classes[class as usize].as_ref()
    }

    /// Distance from where the patient's body may go on behind the cuts of its scan, m; none where nothing is cut, or for
    /// a class that is not from the patient.
    pub fn behind_cuts_m(&self, class: ClearanceClass) -> Option<f64> {
        self.behind_cuts_m[class as usize]
    }

    /// All classes that the cell has, in the order of [`ClearanceClass`].
    pub fn iter(&self) -> impl Iterator<Item = &PairClearance> {
        self.classes.iter().flatten()
    }
}

#[derive(Debug, Clone, Copy)]
pub(crate) struct PlacedPair {
    pub a: usize,
    pub b: usize,
    pub class: ClearanceClass,
    /// No solid of the two bodies is a mesh.
    pub is_convex: bool,
}

/// Two solids of a pair; indices into their bodies' solids.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct SolidPair {
    a: usize,
    b: usize,
}

/// What clearances of a cell are computed from.
#[derive(Debug, Clone, Copy)]
pub struct ClearanceParts<'c> {
    /// Joints from `base_link` to the flange.
    pub chain: &'c Chain,
    /// Pose of `base_link` in the world.
    pub world_from_base_link: &'c Pose,
    /// All bodies.
    pub bodies: &'c [CollisionBody],
    /// Pairs of them, the moving body first if there is one.
    pub pairs: &'c [BodyPair],
    /// Where the patient's body may go on behind the cuts of its scan, world.
    pub behind_cuts: &'c [Solid],
}

impl<'c> ClearanceParts<'c> {
    /// Those of a cell.
    pub fn of(cell: &'c Cell) -> Self {
        Self {
            chain: &cell.robot.chain,
            world_from_base_link: &cell.robot.world_from_base_link,
            bodies: &cell.bodies,
            pairs: &cell.pairs,
            behind_cuts: &cell.behind_cuts,
        }
    }

    /// Those of arm and tool with what may be behind the cuts in the patient's place; none where nothing is cut.
    fn behind_cuts(&self) -> Option<(Vec<CollisionBody>, Vec<BodyPair>)> {
        if self.behind_cuts.is_empty() {
            return None;
        }
        let is_patient = |body: &CollisionBody| body.kind == BodyKind::Phantom;
        let bodies = self.bodies.iter().map(|body| {
            let mut body = body.clone();
            if is_patient(&body) {
                body.solids = self.behind_cuts.to_vec();
            }
            body
        });
        let pairs = self.pairs.iter().copied();
        let pairs = pairs.filter(|pair| is_patient(&self.bodies[pair.b]));
        Some((bodies.collect(), pairs.collect()))
    }
}

/// Clearance queries of one cell, prepared once.
///
/// Distances are as accurate as [`separation`](needlebench_geometry::separation).
#[derive(Debug, Clone)]
pub struct ClearanceModel {
    pub(crate) chain: Chain,
    world_from_base_link: Pose,
    pub(crate) bodies: Vec<Arc<PlacedBody>>,
    pub(crate) pairs: Vec<PlacedPair>,
    /// By class: whether there is a pair of it.
    has_class: [bool; CLASS_COUNT],
    /// That of what may be behind the cuts of the patient's scan; none where nothing is cut.
    pub(crate) behind_cuts: Option<Arc<ClearanceModel>>,
}

impl ClearanceModel {
    /// Prepares the geometry of a cell.
    pub fn new(cell: &Cell) -> Self {
        Self::of_parts(&ClearanceParts::of(cell))
    }

    /// Prepares the geometry of what is known of a cell.
    pub fn of_parts(parts: &ClearanceParts<'_>) -> Self {
        Self::made_of(parts, None)
    }

    /// The model of another cell: what [`ClearanceModel::new`] gives for it, bit for bit, but the
    /// bodies and shapes that this model has too are not prepared again. Cheap where little differs,
    /// as between the layouts of a study.
    pub fn for_cell(&self, cell: &Cell) -> Self {
        self.for_parts(&ClearanceParts::of(cell))
    }

    /// [`ClearanceModel::for_cell`] of what is known of a cell.
    pub fn for_parts(&self, parts: &ClearanceParts<'_>) -> Self {
        Self::made_of(parts, Some(self))
    }

    /// Number of bodies that the model of a cell would share with this one.
    pub fn bodies_in_common(&self, cell: &Cell) -> usize {
        let pairs = self.bodies.iter().zip(&cell.bodies);
        pairs
            .filter(|(placed, body)| placed.is_of(body, placed.first_moving))
            .count()
    }

    /// Whether the model of a cell would need no shape that this one lacks.
    pub fn has_shapes_of(&self, cell: &Cell) -> bool {
        self.bodies.len() == cell.bodies.len()
            && self.bodies.iter().zip(&cell.bodies).all(|(placed, body)| {
                placed.solids.len() == body.solids.len()
                    && placed
                        .solids
                        .iter()
                        .zip(&body.solids)
                        .all(|(placed, solid)| placed.has_shape(&solid.shape))
            })
    }

    fn made_of(parts: &ClearanceParts<'_>, like: Option<&Self>) -> Self {
        let known = like.map_or(&[][..], |like| &like.bodies);
        let mut moving = 0;
        let bodies = parts.bodies.iter().enumerate().map(|(index, body)| {
            let placed = placed_body(body, moving, known.get(index));
            if placed.frame != Frame::World {
                moving += placed.solids.len();
            }
            placed
        });
        let bodies: Vec<Arc<PlacedBody>> = bodies.collect();
        let is_convex = |body: usize| {
            let mut solids = bodies[body].solids.iter();
            solids.all(|solid| solid.shape.is_convex())
        };
        let mut has_class = [false; CLASS_COUNT];
        for pair in parts.pairs {
            has_class[pair.class as usize] = true;
        }
        let pairs = parts
            .pairs
            .iter()
            .map(|pair| PlacedPair {
                a: pair.a,
                b: pair.b,
                class: pair.class,
                is_convex: is_convex(pair.a) && is_convex(pair.b),
            })
            .collect();
        let behind_cuts = parts.behind_cuts().map(|(bodies, pairs)| {
            let parts = ClearanceParts {
                bodies: &bodies,
                pairs: &pairs,
                behind_cuts: &[],
                ..*parts
            };
            let like = like.and_then(|like| like.behind_cuts.as_deref());
            Arc::new(Self::made_of(&parts, like))
        });
        Self {
            chain: *parts.chain,
            world_from_base_link: *parts.world_from_base_link,
            bodies,
            pairs,
            has_class,
            behind_cuts,
        }
    }

    /// Whether there is a pair of a class.
    pub fn has(&self, class: ClearanceClass) -> bool {
        self.has_class[class as usize]
    }

    /// Clearance of every pair of [`Cell::pairs`], in that order, at joint positions `q`.
    pub fn all_pairs(&self, q: &Joints) -> Vec<PairClearance> {
        self.all_pairs_at(&self.world_from_links(q))
    }

    /// [`ClearanceModel::all_pairs`] with the poses of the moving links given, for states that
    /// an engine has recorded.
    pub fn all_pairs_at(&self, world_from_links: &[Pose; JOINT_COUNT]) -> Vec<PairClearance> {
        let links = world_from_links.each_ref().map(Placement::new);
        let posture = Posture::new(&self.bodies, &links);
        (0..self.pairs.len())
            .filter_map(|pair| self.pair_at(pair, &links, &posture))
            .collect()
    }

    /// Clearance of one pair of [`Cell::pairs`].
    pub(crate) fn pair_at(
        &self,
        pair: usize,
        links: &LinkPlacements,
        posture: &Posture,
    ) -> Option<PairClearance> {
        let mut best = None;
        self.query(pair, links, posture).improve(&mut best);
        best
    }

    /// The least clearance of each class at joint positions `q`.
    ///
    /// The same numbers as the minimum over [`ClearanceModel::all_pairs`], but pairs that
    /// bounding volumes or a separating plane show to be farther apart are left out.
    pub fn minimum_per_class(&self, q: &Joints) -> ClassMinima {
        self.minimum_per_class_at(&self.world_from_links(q))
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
        let posture = Posture::new(&self.bodies, &links);
        let limits_m = ClearanceClass::ALL.map(|class| {
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
            self.query(pair, &links, &posture).first_below(limit_m)
        })
    }

    /// Place of a pair's body A beside its body B.
    pub(crate) fn b_from_a(&self, pair: &PlacedPair, links: &LinkPlacements) -> Placement {
        let place = |body: usize| match self.bodies[body].frame {
            Frame::World => None,
            Frame::Link(link) => Some(&links[link]),
        };
        match (place(pair.a), place(pair.b)) {
            (Some(a), Some(b)) => b.inverse_after(a),
            (Some(a), None) => *a,
            (None, Some(b)) => b.inverse_after(&Placement::IDENTITY),
            (None, None) => Placement::IDENTITY,
        }
    }

    pub(crate) fn world_from_links(&self, q: &Joints) -> [Pose; JOINT_COUNT] {
        self.chain
            .link_poses(q)
            .map(|pose| self.world_from_base_link * pose)
    }

    fn query<'m>(
        &'m self,
        pair: usize,
        links: &'m LinkPlacements,
        posture: &'m Posture<'m>,
    ) -> PairQuery<'m> {
        let PlacedPair { a, b, class, .. } = self.pairs[pair];
        PairQuery {
            pair,
            class,
            a: (a, &self.bodies[a]),
            b: (b, &self.bodies[b]),
            links,
            posture,
        }
    }
}

/// What a lower bound has to reach for a pair to be left out.
fn beyond_m(best: Option<&PairClearance>) -> f64 {
    best.map_or(f64::INFINITY, |best| best.separation.distance_m) + PRUNING_MARGIN_M
}

/// Whether the distance is below the limit, or is not a number: joint positions that are not
/// finite must not pass for free.
fn is_closer(separation: &Separation, limit_m: f64) -> bool {
    separation.distance_m < limit_m || separation.distance_m.is_nan()
}

/// One pair of bodies at one state of the arm.
struct PairQuery<'m> {
    pair: usize,
    class: ClearanceClass,
    /// The bodies, after their indices.
    a: (usize, &'m PlacedBody),
    b: (usize, &'m PlacedBody),
    links: &'m LinkPlacements,
    posture: &'m Posture<'m>,
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

    /// Replaces `best` by the closest solids of this pair if they are closer.
    fn improve(&self, best: &mut Option<PairClearance>) {
        let first = self.most_promising(beyond_m(best.as_ref()));
        let first = first.map(|(_, solids)| solids);
        // A good start halves the number of full distances.
        if let Some(first) = first {
            self.try_solids(first, best);
        }
        self.for_each_near(beyond_m(best.as_ref()), |solids, _| {
            if Some(solids) != first {
                self.try_solids(solids, best);
            }
            Some(beyond_m(best.as_ref()))
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
    fn for_each_near(&self, limit_m: f64, mut visit: impl FnMut(SolidPair, f64) -> Option<f64>) {
        let visit = |a, b, bound_m| visit(SolidPair { a, b }, bound_m);
        self.posture.for_each_near(self.a, self.b, limit_m, visit);
    }

    /// Signed distance in the frame of solid B, or `None` if it is beyond the cutoff.
    fn separation(&self, solids: SolidPair, cutoff_m: f64) -> Option<Separation> {
        let ((_, body_a), (_, body_b)) = (self.a, self.b);
        let (a, b) = (&body_a.solids[solids.a], &body_b.solids[solids.b]);
        let [world_from_a, world_from_b] =
            [(body_a, solids.a), (body_b, solids.b)].map(|(body, i)| self.posture.place(body, i));
        let solid_b_from_solid_a = world_from_b.inverse_after(world_from_a);
        separation_within(&a.shape, &b.shape, &solid_b_from_solid_a, cutoff_m)
    }

    fn clearance(&self, solids: SolidPair, in_solid_b: &Separation) -> PairClearance {
        let (_, body_b) = self.b;
        let in_body_b = in_solid_b.placed(&body_b.solids[solids.b].body_from_shape);
        PairClearance {
            pair: self.pair,
            class: self.class,
            solid_a: solids.a,
            solid_b: solids.b,
            separation: match body_b.frame {
                Frame::World => in_body_b,
                Frame::Link(i) => in_body_b.placed(&self.links[i]),
            },
        }
    }
}
