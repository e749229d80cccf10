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

use needlebench_cell::{ClearanceClass, Frame};
use needlebench_geometry::{
    BoundingCapsule, PRUNING_MARGIN_M, Placement, Separation, separation_within,
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
        let mut least = Least::of_each_class();
        look.search(&mut Nearby::default(), &mut least);
        least.minima(&look)
    }

    /// [`ClearanceModel::minimum_per_class`] of postures that follow each other: what is known from the
    /// one before says of most solids that they are not the nearest.
    pub fn minimum_per_class_near(&self, q: &Joints, nearby: &mut Nearby) -> ClassMinima {
        self.least_near(q, nearby, Least::of_each_class())
    }

    /// Of each group of classes the one with the least clearance over its offset; all others are `None`,
    /// and what cannot be the least of its group costs nothing. `share` says how a class counts, `None`
    /// that it does not.
    pub fn minimum_per_group_near(
        &self,
        q: &Joints,
        nearby: &mut Nearby,
        share: impl Fn(ClearanceClass) -> Option<Share>,
    ) -> ClassMinima {
        self.least_near(q, nearby, Least::of(ClearanceClass::ALL.map(share)))
    }

    fn least_near(&self, q: &Joints, nearby: &mut Nearby, mut least: Least) -> ClassMinima {
        let links = self.world_from_links(q).each_ref().map(Placement::new);
        let look = Look {
            model: self,
            links: &links,
        };
        look.search(nearby, &mut least);
        least.minima(&look)
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
}

/// Two solids of a pair: indices of the pair and of the solids of its bodies.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Couple {
    pub pair: usize,
    pub a: usize,
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

/// What is asked of a posture.
pub(crate) trait Wanted {
    /// What lies beyond does not matter, m; negative infinity for a class that is not asked for.
    fn cutoff_m(&self, class: ClearanceClass) -> f64;

    /// How a class counts, if the least of some classes is asked for.
    fn share(&self, _class: ClearanceClass) -> Option<Share> {
        None
    }

    /// A couple within the cutoff; false ends the search.
    fn take(&mut self, class: ClearanceClass, couple: Couple, found: &Separation) -> bool;
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
        let ahead_m = last.and_then(|last| self.ahead_m(&last));
        if ahead_m.is_none() {
            nearby.nearest = [None; CLASS_COUNT];
        }
        let bodies = &self.model.bodies;
        let mut posture = None;
        let tried = self.promising(&mut posture, nearby, wanted);
        for couple in tried.into_iter().flatten() {
            if !self.try_couple(couple, nearby, wanted) {
                return;
            }
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
            let posture = posture.get_or_insert_with(|| Posture::new(bodies, self.links));
            self.reference(posture, wanted, ahead_m.unwrap_or(0.0))
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

    /// What was nearest of each class in the posture before, and of groups of which nothing was the couple
    /// with the least bound: their distances leave out most of the rest.
    fn promising(
        &self,
        posture: &mut Option<Posture>,
        nearby: &Nearby,
        wanted: &impl Wanted,
    ) -> [Option<Couple>; CLASS_COUNT] {
        let (bodies, pairs) = (&self.model.bodies, &self.model.pairs);
        let mut tried = nearby.nearest;
        let mut best: [(f64, Option<(ClearanceClass, Couple)>); CLASS_COUNT] =
            [(f64::INFINITY, None); CLASS_COUNT];
        for couple in tried.iter().flatten() {
            if let Some(share) = wanted.share(pairs[couple.pair].class) {
                best[share.group].0 = f64::NEG_INFINITY;
            }
        }
        // Backwards: what moves most, the tool, tends to be closest and comes late in the list.
        for (index, pair) in pairs.iter().enumerate().rev() {
            let Some(share) = wanted.share(pair.class) else {
                continue;
            };
            let (least_m, found) = &mut best[share.group];
            if *least_m == f64::NEG_INFINITY {
                continue;
            }
            let posture = posture.get_or_insert_with(|| Posture::new(bodies, self.links));
            let limit_m = *least_m + share.offset_m;
            if posture.whole_gap_m(pair.a, pair.b, limit_m) >= limit_m {
                continue;
            }
            let (a, b) = ((pair.a, &*bodies[pair.a]), (pair.b, &*bodies[pair.b]));
            posture.for_each_near(a, b, limit_m, |a, b, bound_m| {
                *least_m = bound_m - share.offset_m;
                *found = Some((pair.class, Couple { pair: index, a, b }));
                Some(bound_m)
            });
        }
        for (class, couple) in best.iter().filter_map(|(_, found)| *found) {
            tried[class as usize] = Some(couple);
        }
        tried
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
        near.sort_unstable_by(|one, other| {
            let by_bound = one.bound_m.total_cmp(&other.bound_m);
            by_bound.then(one.couple.cmp(&other.couple))
        });
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
        let Some(found) = separation_within(&a.shape, &b.shape, &solid_b_from_solid_a, cutoff_m)
        else {
            return true;
        };
        if found.distance_m > cutoff_m {
            return true;
        }
        nearby.nearest[pair.class as usize] = Some(couple);
        wanted.take(pair.class, couple, &found)
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

/// How a class counts where the least of several is asked for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Share {
    /// Classes with the same number are asked for together: the least of them all.
    pub group: usize,
    /// Taken off the clearances of the class before they are compared, m.
    pub offset_m: f64,
}

/// The nearest couple of each group of classes; classes without a share are not asked for.
pub(crate) struct Least {
    shares: [Option<Share>; CLASS_COUNT],
    /// By group.
    best: [Option<(ClearanceClass, Couple, Separation)>; CLASS_COUNT],
}

impl Least {
    /// Each class alone.
    pub fn of_each_class() -> Self {
        Self::of(std::array::from_fn(|group| {
            Some(Share {
                group,
                offset_m: 0.0,
            })
        }))
    }

    /// Numbers of groups are below that of classes.
    pub fn of(shares: [Option<Share>; CLASS_COUNT]) -> Self {
        Self {
            shares,
            best: [None; CLASS_COUNT],
        }
    }

    /// What a couple counts.
    fn counted_m(&self, class: ClearanceClass, separation: &Separation) -> f64 {
        let offset_m = self.shares[class as usize].map_or(0.0, |share| share.offset_m);
        separation.distance_m - offset_m
    }

    /// What was found, as it is reported.
    pub fn minima(&self, look: &Look<'_>) -> ClassMinima {
        let mut minima = [None; CLASS_COUNT];
        for (class, couple, separation) in self.best.iter().flatten() {
            minima[*class as usize] = Some(look.clearance(*couple, separation));
        }
        ClassMinima(minima)
    }
}

impl Wanted for Least {
    fn share(&self, class: ClearanceClass) -> Option<Share> {
        self.shares[class as usize]
    }

    #[inline]
    fn cutoff_m(&self, class: ClearanceClass) -> f64 {
        let Some(share) = &self.shares[class as usize] else {
            return f64::NEG_INFINITY;
        };
        match &self.best[share.group] {
            None => f64::INFINITY,
            Some((other, _, best)) => {
                self.counted_m(*other, best) + share.offset_m + PRUNING_MARGIN_M
            }
        }
    }

    fn take(&mut self, class: ClearanceClass, couple: Couple, found: &Separation) -> bool {
        let Some(share) = self.shares[class as usize] else {
            return true;
        };
        let here_m = self.counted_m(class, found);
        let is_better = self.best[share.group]
            .as_ref()
            .is_none_or(|(class, known, best)| {
                let best_m = self.counted_m(*class, best);
                here_m < best_m
                // Joint positions that are not finite must not pass for free.
                || here_m.is_nan() && !best_m.is_nan()
                || here_m == best_m && couple < *known
            });
        if is_better {
            self.best[share.group] = Some((class, couple, *found));
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
