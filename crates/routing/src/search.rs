//! Directions evaluated by all rules that need no robot.

use std::cmp::Ordering;

use nalgebra::UnitVector3;
use needlebench_cell::part_in_words;
use needlebench_parallel::in_parallel;

use crate::anatomy::{Anatomy, Exit, LungPassage, Obstacle, Ray, angle_rad};
use crate::bent::Bend;
use crate::directions::{around, evenly};
use crate::risk::Risk;
use crate::rules::{Refusal, RouteRule, RouteRules};

/// Neighbouring directions that one thread evaluates before it takes others.
const TOGETHER: usize = 64;

/// An admissible direction, before the robot is checked.
#[derive(Debug, Clone, PartialEq)]
pub struct Route {
    /// From the target to the entry, frame `phantom`.
    pub outwards: UnitVector3<f64>,
    /// From the skin to the target, m.
    pub depth_m: f64,
    /// Lower bounds of the needle's distances from the skin to the target and behind it, as far as it is thrown, m, in
    /// the order of [`Obstacle::ALL`]; infinite where there is nothing.
    pub distances_m: [f64; 3],
    /// Least distance beyond the margins of [`RouteRules::margins_m`], m, of the straight needle and of the bent one.
    pub spare_m: f64,
    /// Angle between the needle and the skin's normal, rad.
    pub skin_angle_rad: f64,
    /// Lungs along the path.
    pub lungs: LungPassage,
    /// How it compares.
    pub risk: Risk,
    /// The needle as tissue bends it; none where it is not known to which side.
    pub bend: Option<Bend>,
}

impl Route {
    /// Of two needle paths the one of less risk first; of equals the one with more margin.
    pub fn better_first(&self, other: &Self) -> Ordering {
        let risk = self.risk.log_odds.total_cmp(&other.risk.log_odds);
        risk.then(other.spare_m.total_cmp(&self.spare_m))
    }
}

/// A direction and its evaluation.
#[derive(Debug, Clone, PartialEq)]
pub struct Candidate {
    /// From the target, frame `phantom`.
    pub outwards: UnitVector3<f64>,
    /// The skin in that direction, m from the target, if there is any.
    pub depth_m: Option<f64>,
    /// A needle path, or the rule that rejects it.
    pub outcome: Result<Route, Refusal>,
    /// What it would be for the straight needle, where only the bent one breaks a rule.
    pub straight: Option<Box<Route>>,
}

/// What was found of all directions.
#[derive(Debug, Clone, PartialEq)]
pub struct Searched {
    /// In the order of [`evenly`].
    pub candidates: Vec<Candidate>,
}

impl Searched {
    /// The admissible ones, the best first.
    pub fn free(&self) -> Vec<&Route> {
        let mut free: Vec<&Route> = self
            .candidates
            .iter()
            .filter_map(|candidate| candidate.outcome.as_ref().ok())
            .collect();
        free.sort_by(|a, b| a.better_first(b));
        free
    }

    /// How many directions each rule rejects, in the order of the rules; those that reject none are left out.
    pub fn refused(&self) -> Vec<(RouteRule, usize)> {
        let refusals = self.candidates.iter();
        let rules: Vec<RouteRule> = refusals
            .filter_map(|candidate| Some(candidate.outcome.as_ref().err()?.rule))
            .collect();
        RouteRule::ALL
            .into_iter()
            .map(|rule| (rule, rules.iter().filter(|each| **each == rule).count()))
            .filter(|(_, count)| *count > 0)
            .collect()
    }
}

/// Evaluates so many directions, evenly over the sphere; the same on any number of threads. Checks between directions
/// whether to stop, and then leaves the rest out.
pub fn search(
    anatomy: &dyn Anatomy,
    rules: &RouteRules,
    count: usize,
    threads: usize,
    stop: &(dyn Fn() -> bool + Sync),
) -> Searched {
    let directions: Vec<UnitVector3<f64>> = evenly(count).collect();
    let order = neighbours_together(&directions);
    let parts: Vec<&[usize]> = order.chunks(TOGETHER).collect();
    let judged = in_parallel(threads, &parts, |part| {
        let go_on = part.iter().take_while(|_| !stop());
        go_on
            .map(|&index| (index, judge(anatomy, rules, &directions[index])))
            .collect::<Vec<_>>()
    });
    let mut judged: Vec<(usize, Candidate)> = judged.into_iter().flatten().collect();
    judged.sort_by_key(|(index, _)| *index);
    tracing::info!(
        asked = count,
        judged = judged.len(),
        "directions of the needle"
    );
    Searched {
        candidates: judged.into_iter().map(|(_, candidate)| candidate).collect(),
    }
}

/// Indices of directions so that each stands beside its neighbours: rays that are close by look at the same voxels,
/// which are in the cache then.
fn neighbours_together(directions: &[UnitVector3<f64>]) -> Vec<usize> {
    /// Bands from pole to pole: some 3 deg wide.
    const BANDS: f64 = 60.0;
    let mut keyed: Vec<(i64, f64, usize)> = directions
        .iter()
        .enumerate()
        .map(|(index, direction)| {
            let [azimuth, elevation] = crate::angles_rad(direction);
            #[expect(clippy::cast_possible_truncation, reason = "a few dozen")]
            let band = (elevation / std::f64::consts::PI * BANDS).floor() as i64;
            // To and fro, so that a band begins where the last one ended.
            let along = if band % 2 == 0 { azimuth } else { -azimuth };
            (band, along, index)
        })
        .collect();
    keyed.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)).then(a.2.cmp(&b.2)));
    keyed.into_iter().map(|(.., index)| index).collect()
}

/// Evaluates one direction.
pub fn judge(anatomy: &dyn Anatomy, rules: &RouteRules, outwards: &UnitVector3<f64>) -> Candidate {
    let ray = Ray {
        target: anatomy.target(),
        outwards: *outwards,
    };
    let exit = anatomy.exit(&ray);
    let (outcome, straight) = match route(anatomy, rules, &ray, exit) {
        Ok(straight) => bent(anatomy, rules, &ray, straight),
        refused @ Err(_) => (refused, None),
    };
    Candidate {
        outwards: *outwards,
        depth_m: match exit {
            Exit::Skin(depth_m) => Some(depth_m),
            Exit::End(_) | Exit::Nowhere => None,
        },
        outcome,
        straight,
    }
}

/// A path of the straight needle with the bend of the one that is known, or what that breaks.
fn bent(
    anatomy: &dyn Anatomy,
    rules: &RouteRules,
    ray: &Ray,
    mut straight: Route,
) -> (Result<Route, Refusal>, Option<Box<Route>>) {
    let Some(needle) = rules.needle.as_ref().filter(|needle| needle.has_side()) else {
        return (Ok(straight), None);
    };
    straight.bend = needle.bend(anatomy, ray, straight.depth_m, rules.throw_m);
    let broken = match &straight.bend {
        // Nothing is known of it, so it keeps no margin.
        None => Some((f64::NEG_INFINITY, 0.0)),
        Some(bend) if bend.towards.is_none() => None,
        Some(bend) => {
            let bent_m = spare_m(rules, &bend.distances_m);
            straight.spare_m = straight.spare_m.min(bent_m);
            worst(rules, &bend.distances_m).map(|(_, distance_m, margin_m)| (distance_m, margin_m))
        }
    };
    match broken {
        None => (Ok(straight), None),
        Some((value, limit)) => {
            let rule = RouteRule::Bent;
            (
                Err(Refusal { rule, value, limit }),
                Some(Box::new(straight)),
            )
        }
    }
}

/// Why only the bent needle breaks a rule on a path, for people; none where it breaks none.
pub fn bent_reason(anatomy: &dyn Anatomy, rules: &RouteRules, route: &Route) -> Option<String> {
    rules.needle.as_ref()?;
    let Some(bend) = &route.bend else {
        return Some("nobody knows how the needle bends there".to_owned());
    };
    let (obstacle, distance_m, margin_m) = worst(rules, &bend.distances_m)?;
    let ray = Ray {
        target: anatomy.target(),
        outwards: route.outwards,
    };
    let name = bend
        .nearest(anatomy, &ray, obstacle)
        .map(|nearest| nearest.name);
    let [bend, distance, margin] =
        [bend.tip_m.abs(), distance_m, margin_m].map(|m| format!("{:.1} mm", m * 1e3));
    let name = name.unwrap_or_else(|| obstacle.name().to_owned());
    let name = part_in_words(&name);
    Some(if distance_m > 0.0 {
        format!("bent by {bend} it comes within {distance} of {name}; {margin} asked for")
    } else {
        format!("bent by {bend} it meets {name}; {margin} asked for")
    })
}

fn route(
    anatomy: &dyn Anatomy,
    rules: &RouteRules,
    ray: &Ray,
    exit: Exit,
) -> Result<Route, Refusal> {
    let refuse = |rule, value, limit| Refusal { rule, value, limit };
    let longest_m = rules.longest_m;
    let too_short = |depth_m| refuse(RouteRule::NeedleTooShort, depth_m, longest_m);
    let depth_m = match exit {
        Exit::Skin(depth_m) => depth_m,
        // What the needle does not reach is not looked at any farther.
        Exit::End(beyond_m) if beyond_m > longest_m => return Err(too_short(beyond_m)),
        Exit::End(beyond_m) => return Err(refuse(RouteRule::End, beyond_m, 0.0)),
        Exit::Nowhere => return Err(refuse(RouteRule::NoSkin, 0.0, 0.0)),
    };
    if depth_m > longest_m {
        return Err(too_short(depth_m));
    }
    if anatomy.is_body_between(ray, [depth_m, depth_m + rules.outside_m]) {
        return Err(refuse(RouteRule::Outside, 0.0, rules.outside_m));
    }
    let surface =
        |from_to_m, obstacle| anatomy.distance_m(ray, from_to_m, obstacle) - rules.needle_radius_m;
    let on_the_way_m = Obstacle::ALL.map(|obstacle| surface([0.0, depth_m], obstacle));
    if let Some((obstacle, distance_m, margin_m)) = worst(rules, &on_the_way_m) {
        return Err(refuse(RouteRule::of(obstacle), distance_m, margin_m));
    }
    let lungs = anatomy.lungs(ray, [0.0, depth_m]);
    if lungs.entries > rules.max_pleural_crossings {
        let (value, limit) = (lungs.entries, rules.max_pleural_crossings);
        return Err(refuse(RouteRule::Pleura, value.into(), limit.into()));
    }
    for (rule, crossed, allowed) in [
        (RouteRule::Fissure, &lungs.fissures, rules.cross_fissures),
        (RouteRule::Bulla, &lungs.bullae, rules.cross_bullae),
    ] {
        if !allowed && !crossed.is_empty() {
            return Err(refuse(rule, crossed.len() as f64, 0.0));
        }
    }
    let behind_m = throw(anatomy, rules, ray)?;
    let distances_m = [0, 1, 2].map(|index| f64::min(on_the_way_m[index], behind_m[index]));
    let normal = anatomy.skin_normal(ray, depth_m);
    let skin_angle_rad = angle_rad(&ray.outwards, &normal);
    if skin_angle_rad > rules.max_skin_angle_rad {
        let limit = rules.max_skin_angle_rad;
        return Err(refuse(RouteRule::Oblique, skin_angle_rad, limit));
    }
    let diameter_m = 2.0 * rules.needle_radius_m;
    let touches = anatomy.touches_pleura();
    Ok(Route {
        outwards: ray.outwards,
        depth_m,
        spare_m: spare_m(rules, &distances_m),
        distances_m,
        skin_angle_rad,
        risk: Risk::new(&rules.odds, &ray.outwards, &lungs, touches, diameter_m),
        lungs,
        bend: None,
    })
}

/// Distances behind the target, as far as the needle is thrown, where that is free.
fn throw(anatomy: &dyn Anatomy, rules: &RouteRules, ray: &Ray) -> Result<[f64; 3], Refusal> {
    let from_to_m = [-rules.throw_m, 0.0];
    let refuse = |value, limit| Refusal {
        rule: RouteRule::Throw,
        value,
        limit,
    };
    let distances_m = Obstacle::ALL
        .map(|obstacle| anatomy.distance_m(ray, from_to_m, obstacle) - rules.needle_radius_m);
    if let Some((_, distance_m, margin_m)) = worst(rules, &distances_m) {
        return Err(refuse(distance_m, margin_m));
    }
    if !rules.cross_bullae && !anatomy.lungs(ray, from_to_m).bullae.is_empty() {
        return Err(Refusal {
            rule: RouteRule::Bulla,
            value: 1.0,
            limit: 0.0,
        });
    }
    match anatomy.leaves_lung_m(ray, rules.throw_m) {
        Some(behind_m) => Err(refuse(behind_m, rules.throw_m)),
        None => Ok(distances_m),
    }
}

/// The margin with the largest shortfall.
fn worst(rules: &RouteRules, distances_m: &[f64; 3]) -> Option<(Obstacle, f64, f64)> {
    Obstacle::ALL
        .into_iter()
        .map(|obstacle| {
            let index = obstacle as usize;
            (obstacle, distances_m[index], rules.margins_m[index])
        })
        .filter(|(_, distance_m, margin_m)| distance_m < margin_m)
        .min_by(|a, b| (a.1 - a.2).total_cmp(&(b.1 - b.2)))
}

fn spare_m(rules: &RouteRules, distances_m: &[f64; 3]) -> f64 {
    let pairs = distances_m.iter().zip(&rules.margins_m);
    pairs
        .map(|(distance_m, margin_m)| distance_m - margin_m)
        .fold(f64::INFINITY, f64::min)
}

/// The best needle path near one: in decreasing steps, from ring to ring, to the first better one.
pub fn refined(
    anatomy: &dyn Anatomy,
    rules: &RouteRules,
    route: &Route,
    [from_rad, to_rad]: [f64; 2],
    better_first: impl Fn(&Route, &Route) -> Ordering,
) -> Route {
    const ON_A_RING: usize = 6;
    /// Rings that are asked at most: the best one near by is sought, not one elsewhere.
    const RINGS: usize = 12;
    let mut best = route.clone();
    let mut step_rad = from_rad;
    for _ in 0..RINGS {
        if step_rad < to_rad {
            break;
        }
        let better = around(&best.outwards, step_rad, ON_A_RING)
            .filter_map(|outwards| judge(anatomy, rules, &outwards).outcome.ok())
            .filter(|found| better_first(found, &best).is_lt())
            .min_by(&better_first);
        match better {
            Some(found) => best = found,
            None => step_rad *= 0.5,
        }
    }
    best
}
