//! Least clearances of a posture by what can still be nearest.
//!
//! All couples of solids are bounded from below once, at a posture of reference: those that are near
//! are listed, and for the rest of each pair of bodies one bound is kept. At a posture close by, a bound
//! is less by no more than the two bodies have travelled, so that most couples need not be looked at
//! again, and the couple that was nearest of its class is tried first. Where the bounds do not suffice
//! any more, the posture becomes the new reference.
//!
//! # Why nothing is missed
//!
//! A body travels by no more than its ball does ([`Placement::travel_m`]). The signed distance of convex solids changes by no more than the
//! two bodies' travel together, in penetration too: it is the largest gap along any direction. So does
//! that of a mesh while the bound stays above zero; below, it is given up.

use std::cmp::Ordering;

use needlebench_cell::{ClearanceClass, Frame};
use needlebench_geometry::{
    Between, BoundingCapsule, PRUNING_MARGIN_M, Placement, Separation, is_nearer,
    separation_between,
};

use needlebench_kinematics::{JOINT_COUNT, Joints, Pose};

use crate::body::{LinkPlacements, PlacedBody, Seen};
use crate::model::{CLASS_COUNT, ClassMinima, ClearanceModel, PairClearance};
use crate::posture::Posture;

impl ClearanceModel {
    /// [`ClearanceModel::minimum_per_class`] with the poses of the moving links given.
    pub fn minimum_per_class_at(&self, world_from_links: &[Pose; JOINT_COUNT]) -> ClassMinima {
        let links = world_from_links.each_ref().map(Placement::new);
        let look = Look {
            model: self,
            links: &links,
        };
        let mut least = Least::default();
        look.search(&mut Nearby::default(), &mut least);
        self.with_behind_cuts(least.minima(&look), world_from_links)
    }

    /// The same with the distances from what may be behind the cuts of the patient's scan.
    fn with_behind_cuts(
        &self,
        mut minima: ClassMinima,
        world_from_links: &[Pose; JOINT_COUNT],
    ) -> ClassMinima {
        if let Some(model) = &self.behind_cuts {
            let behind = model.minimum_per_class_at(world_from_links);
            for pair in behind.iter() {
                minima.behind_cuts_m[pair.class as usize] = Some(pair.separation.distance_m);
            }
        }
        minima
    }

    /// [`ClearanceModel::minimum_per_class`] of postures that follow each other: what is known from the
    /// one before says of most solids that they are not the nearest.
    pub fn minimum_per_class_near(&self, q: &Joints, nearby: &mut Nearby) -> ClassMinima {
        let world_from_links = self.world_from_links(q);
        let links = world_from_links.each_ref().map(Placement::new);
        let look = Look {
            model: self,
            links: &links,
        };
        let mut least = Least::default();
        look.search(nearby, &mut least);
        self.with_behind_cuts(least.minima(&look), &world_from_links)
    }

    /// Where a posture holds the arm's links.
    pub fn held(&self, q: &Joints) -> Held {
        Held(self.world_from_links(q).each_ref().map(Placement::new))
    }

    /// Least clearances as far as they count, and no farther; of postures that follow each other, as
    /// [`ClearanceModel::minimum_per_class_near`].
    pub fn what_counts_near(&self, held: &Held, nearby: &mut Nearby, counts: &Counts) -> Counted {
        let look = Look {
            model: self,
            links: &held.0,
        };
        let mut counting = Counting {
            counts,
            found: Counted {
                by_class_m: [f64::INFINITY; CLASS_COUNT],
                couple_of_class: [None; CLASS_COUNT],
                aim_m: counts.aim_cap_m,
                excess_m: counts.excess_cap_m,
                excess_of: None,
            },
        };
        if counts.excess_cap_m >= counts.ends_below_m {
            look.search(nearby, &mut counting);
        }
        counting.found
    }

    /// The pair whose clearance exceeds the floor of its class, m, by least, or is farthest below it.
    ///
    /// Classes that do not matter have the floor negative infinity; `None` if none does.
    pub fn least_excess(
        &self,
        q: &Joints,
        floor_m: impl Fn(ClearanceClass) -> f64,
    ) -> Option<PairClearance> {
        let links = self.world_from_links(q).each_ref().map(Placement::new);
        let look = Look {
            model: self,
            links: &links,
        };
        let mut least = LeastExcess {
            floor_m: ClearanceClass::ALL.map(floor_m),
            excess_m: f64::INFINITY,
            found: None,
        };
        look.search_afresh(&mut Nearby::default(), &mut least);
        let (couple, separation) = least.found?;
        Some(look.clearance(couple, &separation))
    }

    /// Most that the distance of two solids differs between two postures, m: how far the one of the arm moves beside the
    /// other from one to the other.
    pub fn travel_m(&self, couple: Couple, from: &Held, to: &Held) -> f64 {
        let pair = &self.pairs[couple.pair];
        let bound = &self.bodies[pair.a].solids[couple.a].bound;
        let [from, to] = [from, to].map(|held| self.b_from_a(pair, &held.0));
        // Of the ball and of a capsule's axis the ends move farthest, and what is around them turns with them.
        let ends = [1.0, -1.0].map(|side| {
            let end = bound.centre + bound.half_axis * side;
            from.travel_m(&to, &end, bound.radius_m)
        });
        ends[0].max(ends[1])
    }

    /// A pair that is closer than the limit of its class, m, if there is any; of postures that follow
    /// each other, as [`ClearanceModel::minimum_per_class_near`].
    ///
    /// Classes that do not matter have the limit negative infinity.
    pub fn below_near(
        &self,
        q: &Joints,
        nearby: &mut Nearby,
        limit_m: impl Fn(ClearanceClass) -> f64,
    ) -> Option<PairClearance> {
        let links = self.world_from_links(q).each_ref().map(Placement::new);
        let look = Look {
            model: self,
            links: &links,
        };
        let limits_m = ClearanceClass::ALL.map(limit_m);
        let mut below = Below {
            limits_m: &limits_m,
            found: None,
        };
        look.search(nearby, &mut below);
        let (couple, separation) = below.found?;
        Some(look.clearance(couple, &separation))
    }

    /// Whether any pair is closer than the limit of its class, m: whether [`ClearanceModel::below_near`] finds one, without
    /// how deep it is.
    pub fn is_below_near(
        &self,
        q: &Joints,
        nearby: &mut Nearby,
        limit_m: impl Fn(ClearanceClass) -> f64,
    ) -> bool {
        let links = self.world_from_links(q).each_ref().map(Placement::new);
        let look = Look {
            model: self,
            links: &links,
        };
        let mut any = AnyBelow {
            limits_m: ClearanceClass::ALL.map(limit_m),
            found: false,
        };
        look.search(nearby, &mut any);
        any.found
    }
}

/// The arm's links where a posture holds them, for a model that is asked several things about it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Held(LinkPlacements);

/// Two solids of a pair of bodies.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Couple {
    /// The pair, an index into [`Cell::pairs`](needlebench_cell::Cell::pairs).
    pub pair: usize,
    /// Solid of its first body.
    pub a: usize,
    /// Solid of its second body.
    pub b: usize,
}

/// What is known from the posture that a model was asked for last. It only saves time: answers do
/// not depend on it, but for which of two couples at the very same distance is named.
///
/// It belongs to one model; of postures that follow each other closely, it saves most.
#[derive(Debug, Clone, Default)]
pub struct Nearby {
    /// Nearest couple of each class.
    nearest: [Option<Couple>; CLASS_COUNT],
    /// Where the links were.
    last: Option<LinkPlacements>,
    reference: Option<Reference>,
    /// Travel of each body since the reference, m.
    travel_m: Vec<f64>,
}

/// Bounds at one posture.
#[derive(Debug, Clone)]
struct Reference {
    links: LinkPlacements,
    /// By pair: couples that are not listed are no nearer, m.
    rest_m: Vec<f64>,
    /// Couples that are near, the least bound first.
    near: Vec<Near>,
}

#[derive(Debug, Clone, Copy)]
struct Near {
    bound_m: f64,
    couple: Couple,
}

impl Near {
    fn least_first(&self, other: &Self) -> Ordering {
        let by_bound = self.bound_m.total_cmp(&other.bound_m);
        by_bound.then(self.couple.cmp(&other.couple))
    }
}

/// What is asked of a posture.
pub(crate) trait Wanted {
    /// What lies beyond does not matter, m; negative infinity for a class that is not asked for.
    fn cutoff_m(&self, class: ClearanceClass) -> f64;

    /// A couple within the cutoff; false ends the search.
    fn take(&mut self, class: ClearanceClass, couple: Couple, found: &Separation) -> bool;

    /// What a couple has to be nearer than for the search to end, where nothing else is asked of it, m.
    fn ends_below_m(&self, _class: ClearanceClass) -> Option<f64> {
        None
    }

    /// A couple nearer than this ends the search, however much nearer it is, m.
    fn ends_anyway_below_m(&self, _class: ClearanceClass) -> f64 {
        f64::NEG_INFINITY
    }

    /// There is a couple that ends the search.
    fn end(&mut self, _couple: Couple) {}
}

/// Travel that the bounds of a reference are to last for, of the way to it: a bisection's further
/// steps sum up to the last one, for either body.
const STEPS_AHEAD: f64 = 2.0;
/// Where the way was so long that this would be exceeded, m, the next one is taken to be as long: no
/// bounds are kept for it, and what was nearest before says nothing.
const MOST_AHEAD_M: f64 = 0.06;

/// Most that a point of a body moves between two places of its link, m.
fn travel_m(body: &PlacedBody, from: &LinkPlacements, to: &LinkPlacements) -> f64 {
    let Frame::Link(link) = body.frame else {
        return 0.0;
    };
    let BoundingCapsule {
        centre,
        ball_radius_m,
        ..
    } = &body.bound;
    from[link].travel_m(&to[link], centre, *ball_radius_m)
}

/// A bound after some travel. NaN stays NaN, which proves nothing.
pub(crate) fn after_travel(bound_m: f64, travel_m: f64, is_convex: bool) -> f64 {
    let left_m = bound_m - travel_m;
    if is_convex || left_m >= 0.0 || left_m.is_nan() {
        left_m
    } else {
        f64::NEG_INFINITY
    }
}

/// What is looked at: a posture of a model.
pub(crate) struct Look<'m> {
    pub model: &'m ClearanceModel,
    pub links: &'m LinkPlacements,
}

impl Look<'_> {
    /// Hands all couples to `wanted` that are within its cutoffs.
    pub fn search(&self, nearby: &mut Nearby, wanted: &mut impl Wanted) {
        let last = nearby.last.replace(*self.links);
        let Some(ahead_m) = last.and_then(|last| self.ahead_m(&last)) else {
            nearby.reference = None;
            nearby.nearest = [None; CLASS_COUNT];
            return self.search_afresh(nearby, wanted);
        };
        let bodies = &self.model.bodies;
        let tried = nearby.nearest;
        for couple in tried.into_iter().flatten() {
            if !self.try_couple(couple, nearby, wanted) {
                return;
            }
        }
        let mut classes = ClearanceClass::ALL.into_iter();
        if classes.any(|class| self.model.has(class) && wanted.cutoff_m(class) == f64::INFINITY) {
            // Of that class nothing is known.
            return self.search_afresh(nearby, wanted);
        }
        let known = nearby.reference.take();
        let known = known.filter(|reference| {
            nearby.travel_m.clear();
            let travelled = bodies
                .iter()
                .map(|body| travel_m(body, &reference.links, self.links));
            nearby.travel_m.extend(travelled);
            self.reaches(reference, &nearby.travel_m, wanted)
        });
        let reference = known.unwrap_or_else(|| {
            nearby.travel_m.clear();
            nearby.travel_m.resize(bodies.len(), 0.0);
            self.reference(&Posture::new(bodies, self.links), wanted, ahead_m)
        });
        for near in &reference.near {
            let (pair, couple) = (&self.model.pairs[near.couple.pair], near.couple);
            let travel_m = nearby.travel_m[pair.a] + nearby.travel_m[pair.b];
            let bound_m = after_travel(near.bound_m, travel_m, pair.is_convex);
            if bound_m >= wanted.cutoff_m(pair.class) {
                continue;
            }
            // Those that were expected to be nearest are done.
            if tried[pair.class as usize] == Some(couple) {
                continue;
            }
            if !self.try_couple(couple, nearby, wanted) {
                break;
            }
        }
        nearby.reference = Some(reference);
    }

    /// How far the arm is expected to move on, m; `None` if it came from far.
    fn ahead_m(&self, last: &LinkPlacements) -> Option<f64> {
        let bodies = self.model.bodies.iter();
        let step_m = bodies
            .map(|body| travel_m(body, last, self.links))
            .fold(0.0, f64::max);
        Some(STEPS_AHEAD * step_m).filter(|ahead_m| *ahead_m <= MOST_AHEAD_M)
    }

    /// The same of a posture of which nothing is known: the pairs whose bounds are least are looked at
    /// first, and leave out most of the rest.
    fn search_afresh(&self, nearby: &mut Nearby, wanted: &mut impl Wanted) {
        let (bodies, pairs) = (&self.model.bodies, &self.model.pairs);
        let posture = Posture::new(bodies, self.links);
        let mut order: Vec<(f64, usize)> = Vec::with_capacity(pairs.len());
        for (index, pair) in pairs.iter().enumerate() {
            let cutoff_m = wanted.cutoff_m(pair.class);
            if cutoff_m == f64::NEG_INFINITY {
                continue;
            }
            let whole_m = posture.whole_gap_m(pair.a, pair.b, cutoff_m);
            if whole_m < cutoff_m || whole_m.is_nan() {
                order.push((whole_m, index));
            }
        }
        // Of equal ones what moves most, the tool, tends to be closest and comes late in the list.
        order.sort_unstable_by(|one, other| one.0.total_cmp(&other.0).then(other.1.cmp(&one.1)));
        // Of each class without a cutoff the couple with the least bound: its distance leaves out most of the
        // others.
        let mut first = [None; CLASS_COUNT];
        let mut least_m = ClearanceClass::ALL.map(|class| match wanted.cutoff_m(class) {
            f64::INFINITY => f64::INFINITY,
            _ => f64::NEG_INFINITY,
        });
        for &(whole_m, index) in &order {
            let pair = &pairs[index];
            let class = pair.class as usize;
            if whole_m >= least_m[class] {
                continue;
            }
            let (a, b) = ((pair.a, &*bodies[pair.a]), (pair.b, &*bodies[pair.b]));
            posture.for_each_near(a, b, least_m[class], |a, b, bound_m| {
                least_m[class] = bound_m;
                first[class] = Some(Couple { pair: index, a, b });
                Some(bound_m)
            });
        }
        for couple in first.into_iter().flatten() {
            if !self.try_couple(couple, nearby, wanted) {
                return;
            }
        }
        let mut near: Vec<Near> = Vec::with_capacity(16);
        for (whole_m, index) in order {
            let pair = &pairs[index];
            let cutoff_m = wanted.cutoff_m(pair.class);
            if whole_m >= cutoff_m {
                continue;
            }
            near.clear();
            let (a, b) = ((pair.a, &*bodies[pair.a]), (pair.b, &*bodies[pair.b]));
            posture.for_each_near(a, b, cutoff_m, |a, b, bound_m| {
                let couple = Couple { pair: index, a, b };
                if first[pair.class as usize] != Some(couple) {
                    near.push(Near { bound_m, couple });
                }
                Some(cutoff_m)
            });
            near.sort_unstable_by(Near::least_first);
            for near in &near {
                if near.bound_m >= wanted.cutoff_m(pair.class) {
                    continue;
                }
                if !self.try_couple(near.couple, nearby, wanted) {
                    return;
                }
            }
        }
    }

    /// Whether no couple outside the list can be within the cutoffs.
    fn reaches(&self, reference: &Reference, travel_m: &[f64], wanted: &impl Wanted) -> bool {
        let pairs = self.model.pairs.iter().zip(&reference.rest_m);
        pairs.into_iter().all(|(pair, rest_m)| {
            let cutoff_m = wanted.cutoff_m(pair.class);
            cutoff_m == f64::NEG_INFINITY
                || after_travel(*rest_m, travel_m[pair.a] + travel_m[pair.b], pair.is_convex)
                    >= cutoff_m
        })
    }

    /// Bounds of all couples that matter here, or would after moving on by `ahead_m`.
    fn reference(&self, posture: &Posture, wanted: &impl Wanted, ahead_m: f64) -> Reference {
        let (bodies, pairs) = (&self.model.bodies, &self.model.pairs);
        let mut limits_m = [f64::NEG_INFINITY; CLASS_COUNT];
        for pair in pairs {
            let cutoff_m = wanted.cutoff_m(pair.class);
            limits_m[pair.class as usize] = cutoff_m + ahead_m;
        }
        let mut near: Vec<Near> = Vec::with_capacity(64);
        let mut rest_m = vec![f64::NEG_INFINITY; pairs.len()];
        // Backwards: what moves most, the tool, tends to be closest and comes late in the list.
        for (index, pair) in pairs.iter().enumerate().rev() {
            let limit_m = limits_m[pair.class as usize];
            if limit_m == f64::NEG_INFINITY {
                continue;
            }
            let whole_m = posture.whole_gap_m(pair.a, pair.b, limit_m);
            if whole_m >= limit_m {
                rest_m[index] = whole_m;
                continue;
            }
            let (a, b) = ((pair.a, &*bodies[pair.a]), (pair.b, &*bodies[pair.b]));
            posture.for_each_near(a, b, limit_m, |a, b, bound_m| {
                near.push(Near {
                    bound_m,
                    couple: Couple { pair: index, a, b },
                });
                Some(limit_m)
            });
        }
        for (rest_m, pair) in rest_m.iter_mut().zip(pairs) {
            *rest_m = rest_m.max(limits_m[pair.class as usize]);
        }
        near.sort_unstable_by(Near::least_first);
        Reference {
            links: *self.links,
            rest_m,
            near,
        }
    }

    /// Hands a couple over if it is within its cutoff; whether to go on.
    fn try_couple(&self, couple: Couple, nearby: &mut Nearby, wanted: &mut impl Wanted) -> bool {
        let pair = &self.model.pairs[couple.pair];
        let cutoff_m = wanted.cutoff_m(pair.class);
        if cutoff_m == f64::NEG_INFINITY {
            return true;
        }
        let (body_a, body_b) = (&self.model.bodies[pair.a], &self.model.bodies[pair.b]);
        let (a, b) = (&body_a.solids[couple.a], &body_b.solids[couple.b]);
        let [bound_a, bound_b] = [(body_a, a), (body_b, b)].map(|(body, solid)| match body.frame {
            Frame::World => solid.seen.bound,
            Frame::Link(link) => solid.seen.bound.placed(&self.links[link]),
        });
        if bound_a.balls_part(&bound_b, cutoff_m) || bound_a.gap_m(&bound_b) >= cutoff_m {
            return true;
        }
        let [place_a, place_b] =
            [(body_a, a), (body_b, b)].map(|(body, solid)| self.place(body, &solid.seen));
        let solid_b_from_solid_a = place_b.inverse_after(&place_a);
        if let Some(limit_m) = wanted.ends_below_m(pair.class) {
            let ends = is_nearer(&a.shape, &b.shape, &solid_b_from_solid_a, limit_m);
            if ends {
                nearby.nearest[pair.class as usize] = Some(couple);
                wanted.end(couple);
            }
            return !ends;
        }
        let limit_m = wanted.ends_anyway_below_m(pair.class);
        match separation_between(&a.shape, &b.shape, &solid_b_from_solid_a, limit_m, cutoff_m) {
            Between::BeyondCutoff => true,
            Between::Below => {
                nearby.nearest[pair.class as usize] = Some(couple);
                wanted.end(couple);
                false
            }
            Between::Found(found) if found.distance_m > cutoff_m => true,
            Between::Found(found) => {
                nearby.nearest[pair.class as usize] = Some(couple);
                wanted.take(pair.class, couple, &found)
            }
        }
    }

    fn place(&self, body: &PlacedBody, seen: &Seen) -> Placement {
        match body.frame {
            Frame::World => seen.placement,
            Frame::Link(link) => self.links[link].after(&seen.placement),
        }
    }

    /// A couple's separation in the frame of its second solid, as it is reported.
    pub fn clearance(&self, couple: Couple, in_solid_b: &Separation) -> PairClearance {
        let pair = &self.model.pairs[couple.pair];
        let body_b = &self.model.bodies[pair.b];
        let in_body_b = in_solid_b.placed(&body_b.solids[couple.b].body_from_shape);
        PairClearance {
            pair: couple.pair,
            class: pair.class,
            solid_a: couple.a,
            solid_b: couple.b,
            separation: match body_b.frame {
                Frame::World => in_body_b,
                Frame::Link(link) => in_body_b.placed(&self.links[link]),
            },
        }
    }
}

/// The nearest couple of each class.
#[derive(Default)]
pub(crate) struct Least([Option<(Couple, Separation)>; CLASS_COUNT]);

impl Least {
    /// What was found, as it is reported.
    pub fn minima(&self, look: &Look<'_>) -> ClassMinima {
        let found = self.0.each_ref();
        ClassMinima {
            classes: found.map(|best| {
                let (couple, separation) = best.as_ref()?;
                Some(look.clearance(*couple, separation))
            }),
            behind_cuts_m: [None; CLASS_COUNT],
        }
    }
}

impl Wanted for Least {
    #[inline]
    fn cutoff_m(&self, class: ClearanceClass) -> f64 {
        match &self.0[class as usize] {
            None => f64::INFINITY,
            Some((_, best)) => best.distance_m + PRUNING_MARGIN_M,
        }
    }

    fn take(&mut self, class: ClearanceClass, couple: Couple, found: &Separation) -> bool {
        let best = &mut self.0[class as usize];
        let here_m = found.distance_m;
        let is_better = best.as_ref().is_none_or(|(known, best)| {
            here_m < best.distance_m
                // Joint positions that are not finite must not pass for free.
                || here_m.is_nan() && !best.distance_m.is_nan()
                || here_m == best.distance_m && couple < *known
        });
        if is_better {
            *best = Some((couple, *found));
        }
        true
    }
}

/// Groups of classes of which the least clearance counts as one.
pub const AIMS: usize = 3;

/// Up to where clearances count.
///
/// A class counts for itself up to a limit, and beside others for the least of one of some groups and for
/// the least *excess* over floors, each up to a cap. What counts for nothing any more costs nothing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Counts {
    /// By class: up to where its own clearance counts, m.
    pub class_cap_m: [f64; CLASS_COUNT],
    /// By class: the group that it counts in, if any.
    pub aim_of: [Option<usize>; CLASS_COUNT],
    /// By group: up to where its least clearance counts, m.
    pub aim_cap_m: [f64; AIMS],
    /// By class: what its clearance has to keep, m; negative infinity where nothing.
    pub floor_m: [f64; CLASS_COUNT],
    /// Up to where the least excess over the floors counts, m. Where it is negative nothing else does.
    pub excess_cap_m: f64,
    /// An excess below this is enough to know, m: nothing else is looked at then. Negative infinity where all is asked.
    pub ends_below_m: f64,
}

/// Clearances as far as they count.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Counted {
    /// By class: the least clearance where it is below the class's cap, else something not below it, m.
    pub by_class_m: [f64; CLASS_COUNT],
    /// The solids whose distances these are.
    pub couple_of_class: [Option<Couple>; CLASS_COUNT],
    /// By group: the least clearance, or the cap where that is less, m.
    pub aim_m: [f64; AIMS],
    /// The least excess over a floor, or the cap where that is less, m. Where it is negative it alone is right; where it is
    /// below [`Counts::ends_below_m`] it is only known that the least one is, and the value may be any such.
    pub excess_m: f64,
    /// The solids whose excess it is, unless it is the cap.
    pub excess_of: Option<Couple>,
}

impl Counts {
    /// Up to where the clearance of a class counts for itself or for its group, m.
    pub fn farthest_m(&self, class: ClearanceClass) -> f64 {
        let own_m = self.class_cap_m[class as usize];
        let aim = self.aim_of[class as usize];
        aim.map_or(own_m, |aim| own_m.max(self.aim_cap_m[aim]))
    }
}

struct Counting<'c> {
    counts: &'c Counts,
    found: Counted,
}

impl Wanted for Counting<'_> {
    #[inline]
    fn cutoff_m(&self, class: ClearanceClass) -> f64 {
        let (counts, found, class) = (self.counts, &self.found, class as usize);
        let mut cutoff_m = match counts.floor_m[class] {
            f64::NEG_INFINITY => f64::NEG_INFINITY,
            floor_m => floor_m + found.excess_m,
        };
        if found.excess_m >= 0.0 {
            let own_m = counts.class_cap_m[class].min(found.by_class_m[class]);
            cutoff_m = cutoff_m.max(own_m);
            if let Some(aim) = counts.aim_of[class] {
                cutoff_m = cutoff_m.max(found.aim_m[aim]);
            }
            // No farther than what is known of the class already.
            cutoff_m = cutoff_m.min(found.by_class_m[class]);
        }
        cutoff_m + PRUNING_MARGIN_M
    }

    fn take(&mut self, class: ClearanceClass, couple: Couple, found: &Separation) -> bool {
        let (counts, class) = (self.counts, class as usize);
        // Joint positions that are not finite must not pass for free.
        let distance_m = if found.distance_m.is_nan() {
            f64::NEG_INFINITY
        } else {
            found.distance_m
        };
        if distance_m < self.found.by_class_m[class] {
            self.found.by_class_m[class] = distance_m;
            self.found.couple_of_class[class] = Some(couple);
        }
        if let Some(aim) = counts.aim_of[class] {
            let known_m = &mut self.found.aim_m[aim];
            *known_m = known_m.min(distance_m);
        }
        let excess_m = distance_m - counts.floor_m[class];
        if counts.floor_m[class] > f64::NEG_INFINITY && excess_m < self.found.excess_m {
            self.found.excess_m = excess_m;
            self.found.excess_of = Some(couple);
        }
        self.found.excess_m >= counts.ends_below_m
    }

    #[inline]
    fn ends_anyway_below_m(&self, class: ClearanceClass) -> f64 {
        self.counts.floor_m[class as usize] + self.counts.ends_below_m
    }

    fn end(&mut self, couple: Couple) {
        self.found.excess_m = f64::NEG_INFINITY;
        self.found.excess_of = Some(couple);
    }
}

/// The couple whose clearance exceeds the floor of its class by least.
struct LeastExcess {
    floor_m: [f64; CLASS_COUNT],
    excess_m: f64,
    found: Option<(Couple, Separation)>,
}

impl Wanted for LeastExcess {
    #[inline]
    fn cutoff_m(&self, class: ClearanceClass) -> f64 {
        match self.floor_m[class as usize] {
            f64::NEG_INFINITY => f64::NEG_INFINITY,
            floor_m => floor_m + self.excess_m + PRUNING_MARGIN_M,
        }
    }

    fn take(&mut self, class: ClearanceClass, couple: Couple, found: &Separation) -> bool {
        let excess_m = found.distance_m - self.floor_m[class as usize];
        if excess_m < self.excess_m || self.found.is_none() {
            (self.excess_m, self.found) = (excess_m, Some((couple, *found)));
        }
        true
    }
}

/// Any couple nearer than the limit of its class, m.
pub(crate) struct Below<'l> {
    pub limits_m: &'l [f64; CLASS_COUNT],
    pub found: Option<(Couple, Separation)>,
}

impl Wanted for Below<'_> {
    #[inline]
    fn cutoff_m(&self, class: ClearanceClass) -> f64 {
        self.limits_m[class as usize] + PRUNING_MARGIN_M
    }

    fn take(&mut self, class: ClearanceClass, couple: Couple, found: &Separation) -> bool {
        let limit_m = self.limits_m[class as usize];
        if found.distance_m < limit_m || found.distance_m.is_nan() {
            self.found = Some((couple, *found));
            return false;
        }
        true
    }
}

/// Whether any couple is nearer than the limit of its class, m.
struct AnyBelow {
    limits_m: [f64; CLASS_COUNT],
    found: bool,
}

impl Wanted for AnyBelow {
    #[inline]
    fn cutoff_m(&self, class: ClearanceClass) -> f64 {
        self.limits_m[class as usize] + PRUNING_MARGIN_M
    }

    fn take(&mut self, _: ClearanceClass, _: Couple, _: &Separation) -> bool {
        unreachable!("nothing is handed over")
    }

    #[inline]
    fn ends_below_m(&self, class: ClearanceClass) -> Option<f64> {
        Some(self.limits_m[class as usize])
    }

    fn end(&mut self, _: Couple) {
        self.found = true;
    }
}
