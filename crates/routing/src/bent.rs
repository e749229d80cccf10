//! The needle as it bends in tissue, beside its straight axis.

use nalgebra::{UnitVector3, Vector3};
use needlebench_insertion::Point;
use needlebench_scenario::imperfections::{Aim, TissueNeedle};
use needlebench_scenario::{BevelFacing, NeedlePath, bevel_clock};

use crate::anatomy::{Anatomy, Nearest, Obstacle, Ray};

/// Directions of a bevel that are tried where nobody knows it.
const DIRECTIONS: u32 = 12;

/// Points of a bent needle that distances are measured between, at least so far apart, m.
const STEP_M: f64 = 5e-3;

/// A needle whose bending is known.
#[derive(Debug, Clone, PartialEq)]
pub struct RouteNeedle {
    /// The needle, and what holds it.
    pub needle: TissueNeedle,
    /// Where its bevel looks.
    pub facing: BevelFacing,
    /// From the guide's exit to the skin, m.
    pub standoff_m: f64,
    /// From the guide's exit to the tip, m; none for one that ends at the target.
    pub insertion_length_m: Option<f64>,
}

/// A median needle of a route as tissue bends it.
#[derive(Debug, Clone, PartialEq)]
pub struct Bend {
    /// Where the needle is, from the skin to its tip and on as far as it is thrown: along the ray from the target, and
    /// off it, m.
    pub path_m: Vec<[f64; 2]>,
    /// Ends of the straight needle where that is aimed beside the target, of the same; it keeps the same distances.
    aimed_m: Option<[[f64; 2]; 2]>,
    /// How far the tip is off the guide's axis, m.
    pub tip_m: f64,
    /// Unit vector towards which it bends, frame `phantom`; none where that is not known, and distances are the least
    /// of twelve directions.
    pub towards: Option<Vector3<f64>>,
    /// Lower bounds of the distances of the bent needle's surface, m, in the order of [`Obstacle::ALL`]; infinite where
    /// there is nothing.
    pub distances_m: [f64; 3],
    /// Towards which it bends where it comes nearest, of each.
    nearest_towards: [Vector3<f64>; 3],
}

impl RouteNeedle {
    /// Whether it is known to which side it bends. If not, the bend is part of the error that the margins are for.
    pub fn has_side(&self) -> bool {
        self.needle.tip == Point::Bevel && self.facing != BevelFacing::Unknown
    }

    /// The bend on a ray that leaves the body so far from the target, m, of a needle that is thrown so far behind it.
    /// None where nothing is known of it: there is bone in the way, or it is no needle that can be inserted.
    pub fn bend(
        &self,
        anatomy: &dyn Anatomy,
        ray: &Ray,
        depth_m: f64,
        throw_m: f64,
    ) -> Option<Bend> {
        let way_m = self
            .insertion_length_m
            .map(|length_m| length_m - self.standoff_m);
        let tip_m = way_m.map_or(0.0, |way_m| depth_m - way_m);
        let layers = anatomy.layers(ray, [tip_m, depth_m]).ok()?;
        let [entry, tip] = [depth_m, tip_m].map(|along_m| ray.at(along_m));
        let [twelve, three] = bevel_clock(&entry, &tip);
        let needle = &self.needle;
        // Nobody knows where a tip without a bevel bends to, nor one that runs along what it is to face.
        let known = self.facing.pushed_towards(&entry, &tip).ok().flatten();
        let towards = known.filter(|_| needle.tip == Point::Bevel);
        let way_of = |layers| {
            let way = NeedlePath::new(layers, None, [[1.0, 0.0], [0.0, 1.0]]);
            needle.turned(way, self.standoff_m)
        };
        let mut way = way_of(layers);
        let aim = match towards.filter(|_| needle.is_aimed) {
            Some(towards) => {
                let bend_m = needle.mean_bend_m(&way, self.standoff_m).ok()?;
                let aim = Aim::new(depth_m - tip_m, bend_m)?;
                let (sine, cosine) = libm::sincos(aim.tilt_rad);
                let inwards = towards * -sine - ray.outwards.into_inner() * cosine;
                let aimed = Ray {
                    target: entry + inwards * aim.tip_m,
                    outwards: UnitVector3::new_normalize(-inwards),
                };
                way = way_of(anatomy.layers(&aimed, [0.0, aim.tip_m]).ok()?);
                Some(aim)
            }
            None => None,
        };
        let inserted = needle.insert_median(&way, self.standoff_m).ok()?;
        // From along the axis and off it to along the ray and off that.
        let (sine, cosine) = libm::sincos(aim.map_or(0.0, |aim| aim.tilt_rad));
        let on_ray = |at_m: f64, off_m: f64| {
            let inwards_m = at_m * cosine + off_m * sine;
            [depth_m - inwards_m, off_m * cosine - at_m * sine]
        };
        let bent = inserted.depths_m.iter().zip(&inserted.path_m);
        let mut path_m: Vec<[f64; 2]> = Vec::new();
        for (at_m, [off_m, _]) in bent {
            let place_m = on_ray(*at_m, *off_m);
            let is_end = inserted.depths_m.last() == Some(at_m);
            match path_m.last() {
                Some([before_m, _]) if before_m - place_m[0] < STEP_M && !is_end => {}
                _ => path_m.push(place_m),
            }
        }
        let [.., [before_m, off_before_m], [end_m, off_m]] = path_m[..] else {
            return None;
        };
        if path_m.iter().any(|[_, off_m]| !off_m.is_finite()) {
            return None;
        }
        // Thrown, it goes on as it points.
        if end_m + throw_m > 1e-9 {
            let slope = (off_m - off_before_m) / (before_m - end_m);
            path_m.push([-throw_m, off_m + slope * (end_m + throw_m)]);
        }
        let aimed_m = aim.map(|aim| [on_ray(0.0, 0.0), on_ray(aim.tip_m + throw_m, 0.0)]);
        let all: Vec<Vector3<f64>> = towards.map_or_else(
            || {
                let hours = (0..DIRECTIONS).map(f64::from);
                let angles = hours.map(|hour| hour * std::f64::consts::TAU / f64::from(DIRECTIONS));
                let each = angles.map(libm::sincos);
                each.map(|(sine, cosine)| twelve * cosine + three * sine)
                    .collect()
            },
            |towards| vec![towards],
        );
        let stretches = || {
            path_m
                .windows(2)
                .chain(aimed_m.iter().map(|ends| &ends[..]))
        };
        let nearest =
            Obstacle::ALL.map(|obstacle| least(anatomy, ray, stretches(), &all, obstacle));
        Some(Bend {
            tip_m: inserted.tip_m()[0],
            path_m,
            aimed_m,
            towards,
            distances_m: nearest.map(|(distance_m, _)| distance_m - 0.5 * needle.needle.outer_m),
            nearest_towards: nearest.map(|(_, towards)| towards),
        })
    }
}

impl Bend {
    /// What the bent needle on a ray comes nearest to, with the distance of its axis; none if nothing of it is near.
    pub fn nearest(&self, anatomy: &dyn Anatomy, ray: &Ray, obstacle: Obstacle) -> Option<Nearest> {
        let towards = &self.nearest_towards[obstacle as usize];
        let aimed = self.aimed_m.iter().map(|ends| &ends[..]);
        let stretches = self.path_m.windows(2).chain(aimed);
        let stretches = stretches.map(|ends| stretch(ray, ends, towards));
        let nearest = stretches.min_by(|(a, a_m), (b, b_m)| {
            let [a_m, b_m] =
                [(a, a_m), (b, b_m)].map(|(ray, m)| anatomy.distance_m(ray, *m, obstacle));
            a_m.total_cmp(&b_m)
        });
        let (ray, from_to_m) = nearest?;
        anatomy.nearest(&ray, from_to_m, obstacle)
    }
}

/// A straight stretch of a bent needle as a ray, and from where to where on it, m.
fn stretch(ray: &Ray, ends: &[[f64; 2]], towards: &Vector3<f64>) -> (Ray, [f64; 2]) {
    let at = |[along_m, off_m]: [f64; 2]| ray.at(along_m) + towards * off_m;
    let [from, to] = [at(ends[1]), at(ends[0])];
    let (outwards, length_m) = UnitVector3::new_and_get(to - from);
    let stretch = Ray {
        target: from,
        outwards,
    };
    (stretch, [0.0, length_m])
}

/// Least distance of a bent needle's axis from an obstacle, m, of some directions that it may bend to, and which it is.
fn least<'s>(
    anatomy: &dyn Anatomy,
    ray: &Ray,
    stretches: impl Iterator<Item = &'s [[f64; 2]]>,
    directions: &[Vector3<f64>],
    obstacle: Obstacle,
) -> (f64, Vector3<f64>) {
    // Nothing comes nearer than the axis by more than it is bent; what may come nearest is first.
    let stretches = stretches.map(|ends| {
        let [[to_m, off_to_m], [from_m, off_from_m]] = [ends[0], ends[1]];
        let straight_m = anatomy.distance_m(ray, [from_m, to_m], obstacle);
        (straight_m - off_to_m.abs().max(off_from_m.abs()), ends)
    });
    let mut stretches: Vec<(f64, &[[f64; 2]])> = stretches.collect();
    stretches.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut least = (f64::INFINITY, directions[0]);
    for (bound_m, ends) in stretches {
        for towards in directions {
            if bound_m >= least.0 {
                return least;
            }
            let (bent, from_to_m) = stretch(ray, ends, towards);
            let bent_m = anatomy.distance_m(&bent, from_to_m, obstacle);
            if bent_m < least.0 {
                least = (bent_m, *towards);
            }
        }
    }
    least
}
