//! Adaptive halving of a motion until every class is known to the tolerance.

use std::collections::BTreeMap;

use nalgebra::Vector3;
use needlebench_cell::{ClearanceClass, Frame};
use needlebench_geometry::{
    BoundingCapsule, MovingSolids, Placement, Separation, separation_within,
};
use needlebench_kinematics::trajectory::Phase;

use super::motion::{Motion, Span};
use super::planes::{Gaps, Plane, capsule_gap_m};
use super::sweep::{ChainBounds, MovingSolid, PointBounds, Posture, Sweep, inner_from_outer};
use super::{
    CertificateOptions, ClassCertificate, Effort, LEAST_INTERVAL_S, MOST_INTERVALS, MotionBound,
    MotionCertificate, ROUNDING_M,
};
use crate::body::PlacedShape;
use crate::model::{CLASS_COUNT, ClearanceModel, PairClearance};

/// A solid as it moves relative to a body nearer to the base: the same for all that this body is made of.
#[derive(Debug)]
struct Mover<'m> {
    solid: &'m PlacedShape,
    link: usize,
    /// Of the body that it is seen from; `None`: fixed in the world.
    seen_from: Option<usize>,
    moving: MovingSolid,
}

impl Mover<'_> {
    /// First joint that moves it.
    fn first_joint(&self) -> usize {
        self.seen_from.map_or(0, |link| link + 1)
    }

    fn inner_from_outer(&self, posture: &Posture) -> Placement {
        inner_from_outer(&posture.links, self.seen_from, self.link)
    }

    fn at(&self, posture: &Posture) -> Stand {
        let inner_from_outer = self.inner_from_outer(posture);
        Stand {
            bound: self.solid.bound.placed(&inner_from_outer),
            inner_from_outer,
        }
    }

    fn bounds(&self, sweep: &Sweep<'_>) -> PointBounds {
        sweep.point_bounds(&self.moving, self.solid, self.first_joint())
    }

    fn way_m(&self, sweep: &Sweep<'_>, points: &PointBounds) -> f64 {
        sweep.way_m(&self.moving, self.solid, self.first_joint(), points)
    }
}

/// Where a [`Mover`] stands in a posture, in the frame of the inner body.
#[derive(Debug, Clone, Copy)]
struct Stand {
    inner_from_outer: Placement,
    bound: BoundingCapsule,
}

/// A [`Mover`] over an interval.
#[derive(Debug, Clone, Copy)]
struct Course {
    points: PointBounds,
    /// At both ends.
    ends: [Stand; 2],
}

/// Two solids of a pair, by who moves relative to whom.
#[derive(Debug)]
struct Couple<'m> {
    pair: usize,
    class: ClearanceClass,
    outer: &'m PlacedShape,
    inner: &'m PlacedShape,
    outer_solid: usize,
    inner_solid: usize,
    /// `None`: fixed in the world.
    inner_link: Option<usize>,
    /// The outer solid, seen from the inner body.
    mover: usize,
    /// The pair's body `a` is the inner one.
    swapped: bool,
}

impl Couple<'_> {
    fn are_convex(&self) -> bool {
        self.outer.shape.is_convex() && self.inner.shape.is_convex()
    }

    /// Lower bound of the distance in a posture by the solids' capsules, m.
    ///
    /// Without their balls, which [`capsule_gap_m`] does not know: bounds over shorter and shorter
    /// intervals tend to this one.
    fn capsules_m(&self, outer: &Stand) -> f64 {
        outer.bound.gap_m(&self.inner.bound)
    }

    fn inner_solid_from_outer_solid(&self, inner_from_outer: &Placement) -> Placement {
        let outer = inner_from_outer.after(&self.outer.body_from_shape);
        self.inner.body_from_shape.inverse_after(&outer)
    }

    /// Signed distance in the frame of the inner body, the normal from the outer solid; `None` if it is
    /// certainly larger than the cutoff.
    fn separation_within(&self, inner_from_outer: &Placement, cutoff_m: f64) -> Option<Separation> {
        let inner_solid_from_outer_solid = self.inner_solid_from_outer_solid(inner_from_outer);
        let (outer, inner) = (&self.outer.shape, &self.inner.shape);
        separation_within(outer, inner, &inner_solid_from_outer_solid, cutoff_m)
            .map(|separation| separation.placed(&self.inner.body_from_shape))
    }

    /// That separation as the model reports it.
    fn clearance(&self, separation: &Separation, posture: &Posture) -> PairClearance {
        let mut separation = match self.inner_link {
            None => *separation,
            Some(link) => separation.placed(&posture.links[link]),
        };
        let (mut solid_a, mut solid_b) = (self.outer_solid, self.inner_solid);
        if self.swapped {
            (solid_a, solid_b) = (solid_b, solid_a);
            separation.normal = -separation.normal;
            std::mem::swap(&mut separation.point_on_a, &mut separation.point_on_b);
        }
        PairClearance {
            pair: self.pair,
            class: self.class,
            solid_a,
            solid_b,
            separation,
        }
    }
}

fn couples(model: &ClearanceModel) -> (Vec<Couple<'_>>, Vec<Mover<'_>>) {
    let link = |body: usize| match model.bodies[body].frame {
        Frame::World => None,
        Frame::Link(link) => Some(link),
    };
    let (mut couples, mut movers) = (Vec::new(), Vec::new());
    // Movers of a body seen from another: the first of them.
    let mut known = BTreeMap::new();
    for (pair, placed) in model.pairs.iter().enumerate() {
        // `None` is less than any link.
        let swapped = link(placed.a) < link(placed.b);
        let (outer, inner) = if swapped {
            (placed.b, placed.a)
        } else {
            (placed.a, placed.b)
        };
        // One body of every pair moves.
        let Some(outer_link) = link(outer) else {
            continue;
        };
        let inner_link = link(inner);
        let first = *known.entry((outer, inner_link)).or_insert_with(|| {
            let solids = model.bodies[outer].solids.iter();
            movers.extend(solids.map(|solid| Mover {
                solid,
                link: outer_link,
                seen_from: inner_link,
                moving: MovingSolid::new(&model.chain, outer_link, solid),
            }));
            movers.len() - model.bodies[outer].solids.len()
        });
        for (outer_solid, moving) in model.bodies[outer].solids.iter().enumerate() {
            for (inner_solid, still) in model.bodies[inner].solids.iter().enumerate() {
                couples.push(Couple {
                    pair,
                    class: placed.class,
                    outer: moving,
                    inner: still,
                    outer_solid,
                    inner_solid,
                    inner_link,
                    mover: first + outer_solid,
                    swapped,
                });
            }
        }
    }
    (couples, movers)
}

/// What is known of a couple in an interval.
#[derive(Debug, Clone, Copy)]
enum Known {
    /// Nothing but its capsules.
    Capsules,
    /// Gaps along one or two directions.
    Planes([(Plane, Gaps); 2]),
    /// Lower bounds of the distance at both ends.
    Ends(Gaps),
}

#[derive(Debug, Clone, Copy)]
struct Open {
    couple: usize,
    known: Known,
}

#[derive(Debug)]
struct Interval {
    left: usize,
    right: usize,
    phase: Phase,
    open: Vec<Open>,
}

/// A couple that was closed in an interval although it may come nearer there than what had been
/// attained until then.
#[derive(Debug, Clone, Copy)]
struct Closed {
    couple: usize,
    bound_m: f64,
    start_s: f64,
    end_s: f64,
    phase: Phase,
}

struct Search<'m, M> {
    model: &'m ClearanceModel,
    motion: &'m M,
    options: CertificateOptions,
    length_scale: f64,
    chain: ChainBounds,
    couples: Vec<Couple<'m>>,
    movers: Vec<Mover<'m>>,
    postures: Vec<Posture>,
    classes: [Option<ClassCertificate>; CLASS_COUNT],
    /// Clearances beyond this are not resolved, m.
    enough_m: [f64; CLASS_COUNT],
    will_sample: bool,
    closed: Vec<Closed>,
    effort: Effort,
}

/// `samples_s` are in ascending order. `length_scale` is 1 for a proof; tests take less, to see that they notice.
pub(super) fn certify<M: Motion>(
    model: &ClearanceModel,
    motion: &M,
    options: &CertificateOptions,
    samples_s: &[f64],
    enough_m: [f64; CLASS_COUNT],
    length_scale: f64,
) -> MotionCertificate {
    let (couples, movers) = couples(model);
    let mut search = Search {
        model,
        motion,
        options: *options,
        length_scale,
        chain: ChainBounds::new(&model.chain),
        couples,
        movers,
        postures: Vec::new(),
        classes: [None; CLASS_COUNT],
        enough_m,
        will_sample: !samples_s.is_empty(),
        closed: Vec::new(),
        effort: Effort::default(),
    };
    let spans = motion.spans();
    let mut level: Vec<Interval> = spans.iter().map(|span| search.whole(span)).collect();
    while !level.is_empty() {
        level = level
            .into_iter()
            .filter_map(|interval| search.work_on(&interval))
            .flatten()
            .collect();
    }
    search.look_at_samples(samples_s);
    MotionCertificate {
        classes: search.classes,
        effort: search.effort,
    }
}

impl<M: Motion> Search<'_, M> {
    /// A span as one interval; its ends start the list of attained clearances.
    fn whole(&mut self, span: &Span) -> Interval {
        let left = self.start(span, span.start_s);
        let right = self.start(span, span.end_s);
        let open = (0..self.couples.len())
            .filter(|&couple| counts(self.couples[couple].class, span.phase))
            .map(|couple| Open {
                couple,
                known: self.known_at_ends(couple, left, right),
            })
            .collect();
        Interval {
            left,
            right,
            phase: span.phase,
            open,
        }
    }

    fn known_at_ends(&self, couple: usize, left: usize, right: usize) -> Known {
        let couple = &self.couples[couple];
        if self.uses_planes(couple) {
            return Known::Capsules;
        }
        let [left_m, right_m] = [left, right].map(|posture| {
            let outer = self.movers[couple.mover].at(&self.postures[posture]);
            let capsules_m = couple.capsules_m(&outer);
            // A bound that is beyond what is attained will do however short the interval.
            let attained_m = self.attained_m(couple.class);
            if capsules_m >= attained_m {
                capsules_m
            } else {
                let found =
                    couple.separation_within(&outer.inner_from_outer, self.cutoff_m(attained_m));
                found.map_or(attained_m, |separation| separation.distance_m)
            }
        });
        Known::Ends(Gaps { left_m, right_m })
    }

    fn uses_planes(&self, couple: &Couple<'_>) -> bool {
        self.options.bound == MotionBound::Planes && couple.are_convex()
    }

    /// Beyond what a distance from a surface need not be known: bounds of first order live by it.
    fn cutoff_m(&self, attained_m: f64) -> f64 {
        match self.options.bound {
            MotionBound::Planes => attained_m,
            MotionBound::Lipschitz => f64::INFINITY,
        }
    }

    fn posture(&mut self, time_s: f64) -> usize {
        self.effort.postures += 1;
        let position = self.motion.position(time_s);
        let links = self.model.world_from_links(&position);
        let links = links.each_ref().map(Placement::new);
        self.postures
            .push(Posture::new(&self.model.chain, time_s, position, &links));
        self.postures.len() - 1
    }

    /// The posture at an end of a span, with the least clearances there.
    fn start(&mut self, span: &Span, time_s: f64) -> usize {
        let index = self.posture(time_s);
        let minima = self.model.minimum_per_class(&self.postures[index].position);
        for found in minima.iter() {
            if counts(found.class, span.phase) {
                self.attain(found, time_s, span.phase);
            }
        }
        index
    }

    fn attain(&mut self, found: &PairClearance, time_s: f64, phase: Phase) {
        let class = &mut self.classes[found.class as usize];
        let lower_bound_m = class.map_or(f64::INFINITY, |known| known.lower_bound_m);
        let nearer = class
            .is_none_or(|known| found.separation.distance_m < known.attained.separation.distance_m);
        if nearer {
            *class = Some(ClassCertificate {
                lower_bound_m,
                attained: *found,
                time_s,
                phase,
                behind_cuts_m: None,
            });
        }
    }

    /// What matters of a class is less than this: what has been attained, or what is enough.
    fn attained_m(&self, class: ClearanceClass) -> f64 {
        let enough_m = self.enough_m[class as usize];
        self.classes[class as usize]
            .as_ref()
            .map_or(enough_m, |known| {
                known.attained.separation.distance_m.min(enough_m)
            })
    }

    /// Counts a bound that holds over an interval.
    fn count(&mut self, class: ClearanceClass, bound_m: f64) {
        if let Some(known) = &mut self.classes[class as usize] {
            // A bound that is no number proves nothing.
            let bound_m = if bound_m.is_nan() {
                f64::NEG_INFINITY
            } else {
                bound_m
            };
            known.lower_bound_m = known.lower_bound_m.min(bound_m);
        }
    }

    /// Closes what can be closed in an interval, and halves it for the rest.
    fn work_on(&mut self, interval: &Interval) -> Option<[Interval; 2]> {
        self.effort.intervals += 1;
        let (left_s, right_s) = (
            self.postures[interval.left].time_s,
            self.postures[interval.right].time_s,
        );
        let is_finite = [interval.left, interval.right].iter().all(|&posture| {
            self.postures[posture]
                .position
                .iter()
                .all(|q| q.is_finite())
        });
        let may_halve = is_finite
            && right_s - left_s > LEAST_INTERVAL_S
            && self.effort.intervals < MOST_INTERVALS;
        let deviation_rad = self.motion.chord_deviation(left_s, right_s);
        let mut open = Vec::new();
        let mut courses: Vec<Option<Course>> = vec![None; self.movers.len()];
        for each in &interval.open {
            let Couple { class, mover, .. } = self.couples[each.couple];
            let enough_m = self.attained_m(class) - self.options.tolerance_m;
            let (bound_m, way_m) = {
                let ends = [interval.left, interval.right].map(|end| &self.postures[end]);
                let sweep = Sweep::new(ends, deviation_rad, &self.chain, self.length_scale);
                let course = courses[mover].get_or_insert_with(|| {
                    let mover = &self.movers[mover];
                    Course {
                        points: mover.bounds(&sweep),
                        ends: ends.map(|posture| mover.at(posture)),
                    }
                });
                self.bound(&sweep, course, each, enough_m)
            };
            let is_closed = bound_m >= enough_m
                // Two surfaces that cross: their depth need not follow the motion smoothly.
                || (way_m <= self.options.tolerance_m
                    && !self.couples[each.couple].are_convex()
                    && bound_m < 0.0);
            if is_closed || !may_halve {
                self.count(class, bound_m);
                let may_be_nearest = bound_m < self.attained_m(class) || bound_m.is_nan();
                if self.will_sample && may_be_nearest {
                    self.closed.push(Closed {
                        couple: each.couple,
                        bound_m,
                        start_s: left_s,
                        end_s: right_s,
                        phase: interval.phase,
                    });
                }
            } else {
                open.push(Open {
                    couple: each.couple,
                    known: each.known,
                });
            }
        }
        if open.is_empty() {
            return None;
        }
        Some(self.halved(interval, &open))
    }

    /// Looks at the couples at the sampled times at which they may be the nearest of their class: in
    /// all other intervals their bounds say that they are not.
    fn look_at_samples(&mut self, samples_s: &[f64]) {
        let mut postures: Vec<Option<usize>> = vec![None; samples_s.len()];
        for closed in std::mem::take(&mut self.closed) {
            let class = self.couples[closed.couple].class;
            let first = samples_s.partition_point(|&each| each < closed.start_s);
            let end = samples_s.partition_point(|&each| each <= closed.end_s);
            for sample in first..end {
                if closed.bound_m >= self.attained_m(class) {
                    break;
                }
                let posture = match postures[sample] {
                    Some(known) => known,
                    None => self.posture(samples_s[sample]),
                };
                postures[sample] = Some(posture);
                let couple = &self.couples[closed.couple];
                let outer = self.movers[couple.mover].at(&self.postures[posture]);
                let attained_m = self.attained_m(class);
                if couple.capsules_m(&outer) < attained_m {
                    self.distance_within(
                        closed.couple,
                        posture,
                        &outer.inner_from_outer,
                        closed.phase,
                        attained_m,
                    );
                }
            }
        }
    }

    /// Lower bound of a couple's clearance over an interval, and its way in it, m. The bound need not be the
    /// best where it is enough.
    fn bound(&self, sweep: &Sweep<'_>, course: &Course, open: &Open, enough_m: f64) -> (f64, f64) {
        let couple = &self.couples[open.couple];
        let points = &course.points;
        let lost_m = points.deviation_m + ROUNDING_M;
        match &open.known {
            Known::Capsules => {
                let attained = self.classes[couple.class as usize].as_ref();
                let attained_m =
                    attained.map_or(f64::INFINITY, |known| known.attained.separation.distance_m);
                let far_m = far_m(couple, course) - lost_m;
                // No class is nearer than what it has attained: a bound beyond that is not its least.
                let bound_m = if far_m > attained_m + ROUNDING_M {
                    far_m
                } else {
                    by_capsules_m(couple, course) - lost_m
                };
                (bound_m, f64::INFINITY)
            }
            Known::Planes([(_, one), (_, two)]) => (
                one.least_of_larger_m(two, points.curvature_m) - lost_m,
                f64::INFINITY,
            ),
            Known::Ends(ends) => {
                let way_m = self.movers[couple.mover].way_m(sweep, points);
                let mut bound_m = 0.5 * (ends.left_m + ends.right_m - way_m) - lost_m;
                if couple.are_convex() || bound_m > 0.0 && bound_m >= enough_m {
                    return (bound_m, way_m);
                }
                let around_m = by_capsules_m(couple, course) - lost_m;
                if bound_m <= 0.0 || around_m >= enough_m {
                    bound_m = around_m;
                }
                // One that is inside the other is not told by its surface.
                let is_apart = ends.left_m > 0.0 || ends.right_m > 0.0;
                if bound_m < enough_m && is_apart && self.options.bound == MotionBound::Planes {
                    let least_m = enough_m.max(0.0) + lost_m;
                    let attained_m = self.attained_m(couple.class).max(0.0) + lost_m;
                    let aim_m = attained_m.max(least_m);
                    let found = by_surfaces_m(couple, course, aim_m, least_m);
                    bound_m = found.map_or(bound_m, |found_m| bound_m.max(found_m - lost_m));
                }
                (bound_m, way_m + points.deviation_m)
            }
        }
    }

    /// Looks at the posture in the middle and hands the open couples to both halves.
    fn halved(&mut self, interval: &Interval, open: &[Open]) -> [Interval; 2] {
        let time_s =
            0.5 * (self.postures[interval.left].time_s + self.postures[interval.right].time_s);
        let middle = self.posture(time_s);
        let mut halves =
            [(interval.left, middle), (middle, interval.right)].map(|(left, right)| Interval {
                left,
                right,
                phase: interval.phase,
                open: Vec::with_capacity(open.len()),
            });
        let mut stands: Vec<Option<Stand>> = vec![None; self.movers.len()];
        for each in open {
            let mover = self.couples[each.couple].mover;
            let outer =
                stands[mover].get_or_insert_with(|| self.movers[mover].at(&self.postures[middle]));
            let known = self.look(interval, middle, each, outer);
            for (half, known) in halves.iter_mut().zip(known) {
                half.open.push(Open {
                    couple: each.couple,
                    known,
                });
            }
        }
        halves
    }

    /// What is known of a couple in both halves once its middle has been looked at.
    fn look(
        &mut self,
        interval: &Interval,
        middle: usize,
        open: &Open,
        outer: &Stand,
    ) -> [Known; 2] {
        let couple = &self.couples[open.couple];
        let placement = &outer.inner_from_outer;
        let attained_m = self.attained_m(couple.class);
        match open.known {
            Known::Capsules => {
                // Farther than the nearest: shorter intervals do, without a distance.
                if couple.capsules_m(outer) >= attained_m {
                    return [Known::Capsules; 2];
                }
                let separation = self.distance(open.couple, middle, placement, interval.phase);
                match self.plane(open.couple, interval, placement, &separation) {
                    None => [Known::Capsules; 2],
                    Some((plane, middle_m, ends)) => [
                        Known::Planes([(plane, ends.left_half(middle_m)); 2]),
                        Known::Planes([(plane, ends.right_half(middle_m)); 2]),
                    ],
                }
            }
            Known::Planes(mut planes) => {
                self.effort.planes += 2;
                let middles_m = planes
                    .each_mut()
                    .map(|(plane, _)| plane.gap_m(couple.outer, placement));
                let halves = [0, 1].map(|i| {
                    let (plane, gaps) = planes[i];
                    [
                        (plane, gaps.left_half(middles_m[i])),
                        (plane, gaps.right_half(middles_m[i])),
                    ]
                });
                // These directions do where the couple is not the nearest of its class.
                let kept = [
                    Known::Planes([halves[0][0], halves[1][0]]),
                    Known::Planes([halves[0][1], halves[1][1]]),
                ];
                if middles_m[0].max(middles_m[1]) >= attained_m {
                    return kept;
                }
                let separation = self.distance(open.couple, middle, placement, interval.phase);
                let Some((plane, middle_m, ends)) =
                    self.plane(open.couple, interval, placement, &separation)
                else {
                    return kept;
                };
                let better = |measure: &dyn Fn(&Gaps) -> f64| {
                    usize::from(measure(&planes[1].1) > measure(&planes[0].1))
                };
                let (at_left, at_right) =
                    (better(&|gaps| gaps.left_m), better(&|gaps| gaps.right_m));
                [
                    Known::Planes([halves[at_left][0], (plane, ends.left_half(middle_m))]),
                    Known::Planes([(plane, ends.right_half(middle_m)), halves[at_right][1]]),
                ]
            }
            Known::Ends(ends) => {
                let mut middle_m = couple.capsules_m(outer);
                let may_do = match self.options.bound {
                    MotionBound::Planes => middle_m >= attained_m,
                    MotionBound::Lipschitz => {
                        let reach_m = ends.left_m.max(ends.right_m) - middle_m;
                        middle_m >= attained_m + reach_m.max(0.0) && middle_m >= 2.0 * attained_m
                    }
                };
                if !may_do {
                    let cutoff_m = self.cutoff_m(attained_m);
                    let phase = interval.phase;
                    let found =
                        self.distance_within(open.couple, middle, placement, phase, cutoff_m);
                    middle_m = found.map_or(attained_m, |separation| separation.distance_m);
                }
                [
                    Known::Ends(ends.left_half(middle_m)),
                    Known::Ends(ends.right_half(middle_m)),
                ]
            }
        }
    }

    fn distance(
        &mut self,
        couple: usize,
        posture: usize,
        inner_from_outer: &Placement,
        phase: Phase,
    ) -> Separation {
        self.distance_within(couple, posture, inner_from_outer, phase, f64::INFINITY)
            .expect("no distance is beyond an infinite cutoff")
    }

    /// The distance in a posture, which is attained if it is the nearest of its class; `None` if it is
    /// certainly larger than the cutoff.
    fn distance_within(
        &mut self,
        couple: usize,
        posture: usize,
        inner_from_outer: &Placement,
        phase: Phase,
        cutoff_m: f64,
    ) -> Option<Separation> {
        self.effort.distances += 1;
        let couple = &self.couples[couple];
        let separation = couple.separation_within(inner_from_outer, cutoff_m)?;
        let posture = &self.postures[posture];
        let time_s = posture.time_s;
        if separation.distance_m < self.attained_m(couple.class) {
            let found = couple.clearance(&separation, posture);
            self.attain(&found, time_s, phase);
        }
        Some(separation)
    }

    /// The plane of a separation with its gaps in the middle and at both ends; none if the
    /// separation has no direction.
    fn plane(
        &mut self,
        couple: usize,
        interval: &Interval,
        inner_from_outer: &Placement,
        separation: &Separation,
    ) -> Option<(Plane, f64, Gaps)> {
        self.effort.planes += 3;
        let couple = &self.couples[couple];
        let normal = (-separation.normal.into_inner()).try_normalize(0.5)?;
        let mut plane = Plane::across(normal, couple.inner);
        let middle_m = plane.gap_m(couple.outer, inner_from_outer);
        let mover = &self.movers[couple.mover];
        let [left_m, right_m] = [interval.left, interval.right].map(|posture| {
            let placement = mover.inner_from_outer(&self.postures[posture]);
            plane.gap_m(couple.outer, &placement)
        });
        Some((plane, middle_m, Gaps { left_m, right_m }))
    }
}

/// Lower bound of a couple's clearance part by part of their surfaces, as far as it is at least `least_m`, without
/// what is off the chord; parts that keep `aim_m` are not looked into.
fn by_surfaces_m(couple: &Couple<'_>, course: &Course, aim_m: f64, least_m: f64) -> Option<f64> {
    let solids = MovingSolids {
        a: &couple.outer.shape,
        b: &couple.inner.shape,
        b_from_a: course
            .ends
            .map(|end| couple.inner_solid_from_outer_solid(&end.inner_from_outer)),
    };
    solids.least_gap_m(aim_m, least_m, |one, two| {
        let [one, two] = [one, two].map(|[left_m, right_m]| Gaps { left_m, right_m });
        one.least_of_larger_m(&two, course.points.curvature_m)
    })
}

/// The same by the capsules around both solids, in the directions in which they see each other at the ends.
fn by_capsules_m(couple: &Couple<'_>, course: &Course) -> f64 {
    let inner = &couple.inner.bound;
    let [left, right] = &course.ends;
    let [one, two] = [left, right].map(|seen| {
        let normal = inner
            .towards(&seen.bound)
            .try_normalize(0.0)
            .unwrap_or_else(Vector3::z);
        Gaps {
            left_m: capsule_gap_m(&normal, &left.bound, inner),
            right_m: capsule_gap_m(&normal, &right.bound, inner),
        }
    });
    one.least_of_larger_m(&two, course.points.curvature_m)
}

/// What [`by_capsules_m`] is at least, by the balls around the capsules and the way of the outer one: seen along the
/// direction at one end, a gap falls by no more than that way.
fn far_m(couple: &Couple<'_>, course: &Course) -> f64 {
    let inner = &couple.inner.bound;
    let [left, right] = course.ends.each_ref().map(|end| &end.bound);
    let apart_m = (left.centre - inner.centre)
        .norm()
        .min((right.centre - inner.centre).norm());
    let radii_m = [left, inner].map(|each| each.half_axis.norm() + each.radius_m);
    let way_m = (right.centre - left.centre).norm() + (right.half_axis - left.half_axis).norm();
    apart_m - radii_m[0] - radii_m[1] - 0.5 * way_m - 0.125 * course.points.curvature_m
}

/// Whether a class counts in a phase: needle and hand come only when the guide stands in its
/// place.
fn counts(class: ClearanceClass, phase: Phase) -> bool {
    class != ClearanceClass::NeedleCorridor || phase == Phase::Hold
}
