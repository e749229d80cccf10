//! Importance sampling: draws that are moved to where a needle comes too close, and their weights.
//!
//! The proposal is a mixture: a fifth of the draws as they are, the others moved to the nearest points of failure in
//! the space of standard normal variables. No weight is above 5.

use needlebench_numerics::normal;
use needlebench_numerics::random::NormalPairs;

use crate::bend::BendDirection;
use crate::case::{Anatomy, Case};
use crate::draw::{Shifts, Streams, Values, any_direction, chosen, cosine_and_sine, nth, path};
use crate::event::Asked;
use crate::law::Law;

/// Standard normal variables that draws are moved in: six of entry and tip, level, drift, phase of a failed hold, size
/// of the bend, its turn, and the boundary of one structure.
pub(crate) const VARIABLES: usize = 12;
const LEVEL: usize = 6;
const DRIFT: usize = 7;
const PHASE: usize = 8;
const SIZE: usize = 9;
const TURN: usize = 10;
const BOUNDARY: usize = 11;

/// Share of draws that are not moved.
const AS_IS: f64 = 0.2;

/// Points that draws are moved to.
const MOST_POINTS: usize = 4;

/// Points whose density is lower than that of the best by more, in the logarithm, add nothing.
const NEGLIGIBLE: f64 = 5.0;

/// Widened draws that failures are looked for in, and how much wider they are.
const SEARCHED: u64 = 900;
const WIDENED: [f64; 3] = [1.3, 2.2, 3.3];

/// A draw in the space of standard normal variables.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Latent {
    normals: [f64; VARIABLES],
    hold: usize,
    /// Cosine and sine of where an unknown direction is turned.
    direction: [f64; 2],
}

impl Latent {
    fn values(&self, law: &Law) -> Values {
        let normals = &self.normals;
        let (curve, turn) = law.bend().map_or((0, [1.0, 0.0]), |bend| {
            let curve = nth(bend.count(), normal::probability_below(normals[SIZE]));
            let turn = match bend.direction() {
                BendDirection::Known { spread_rad } => cosine_and_sine(spread_rad * normals[TURN]),
                BendDirection::Unknown => self.direction,
            };
            (curve, turn)
        });
        Values {
            linear: std::array::from_fn(|index| normals[index]),
            level: normals[LEVEL],
            drift: normals[DRIFT],
            hold: self.hold,
            phase: normal::probability_below(normals[PHASE]),
            curve,
            turn,
        }
    }
}

/// A point of failure that draws are moved to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Point {
    pub latent: Latent,
    /// Structure whose boundary is moved.
    pub structure: usize,
}

/// Where draws are moved to.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Proposal {
    pub points: Vec<Point>,
    /// Of the points' states of the breath.
    weights: Vec<f64>,
    turns_any_way: bool,
}

/// One draw: values, its weight, and which boundary is moved by how much.
pub(crate) struct Drawn {
    pub values: Values,
    pub weight: f64,
    pub moved: Option<(usize, f64)>,
}

impl Proposal {
    /// Draw `index`; `starts` are those of the boundaries.
    pub fn draw(&self, law: &Law, random: &mut NormalPairs, starts: &[u64], index: u64) -> Drawn {
        let picked = random.uniform(0.0, 1.0);
        let hold = chosen(law, random.uniform(0.0, 1.0));
        let mut latent = Latent {
            normals: std::array::from_fn(|_| random.next_normal()),
            hold,
            direction: any_direction(random),
        };
        // Standard normal of the boundaries comes from their own sequences.
        latent.normals[BOUNDARY] = 0.0;
        let mut moved = None;
        if picked >= AS_IS {
            let share = (picked - AS_IS) / (1.0 - AS_IS);
            let point = &self.points[nth(self.points.len(), share)];
            latent.hold = point.latent.hold;
            for (value, by) in latent.normals.iter_mut().zip(&point.latent.normals) {
                *value += by;
            }
            moved = Some((point.structure, point.latent.normals[BOUNDARY]));
            if self.turns_any_way {
                latent.direction = about(point.latent.direction, random);
            }
        }
        let shifts = Shifts {
            starts,
            index,
            moved,
        };
        Drawn {
            values: latent.values(law),
            weight: self.weight(&latent, &shifts),
            moved,
        }
    }

    /// Density of a draw as it is over that of the proposal.
    fn weight(&self, latent: &Latent, shifts: &Shifts<'_>) -> f64 {
        let each = (1.0 - AS_IS) / self.points.len() as f64;
        let density: f64 = self
            .points
            .iter()
            .zip(&self.weights)
            .filter(|(point, _)| point.latent.hold == latent.hold)
            .map(|(point, weight)| {
                let mean = &point.latent.normals;
                let inner = mean[..BOUNDARY].iter().zip(&latent.normals);
                let mut exponent: f64 =
                    inner.map(|(mean, value)| mean * (value - 0.5 * mean)).sum();
                let by = mean[BOUNDARY];
                if by != 0.0 {
                    exponent += by * (shifts.of(point.structure) - 0.5 * by);
                }
                let turn = if self.turns_any_way {
                    turn_density(point.latent.direction, latent.direction)
                } else {
                    1.0
                };
                each * turn * libm::exp(exponent) / weight
            })
            .sum();
        (AS_IS + density).recip()
    }
}

/// Half of them any directions, the others about a centre with the density cos^8 of half the angle: the half angle's
/// tangent is a normal variable over the root of a chi-square one with 9 degrees of freedom.
fn about([cosine, sine]: [f64; 2], random: &mut NormalPairs) -> [f64; 2] {
    if random.uniform(0.0, 1.0) < 0.5 {
        return any_direction(random);
    }
    let across = random.next_normal();
    let along: f64 = (0..9).map(|_| random.next_normal().powi(2)).sum();
    let square = across * across + along;
    let (c, s) = (
        (along - across * across) / square,
        2.0 * across * along.sqrt() / square,
    );
    [c * cosine - s * sine, s * cosine + c * sine]
}

/// Its density relative to that of any direction.
fn turn_density(centre: [f64; 2], direction: [f64; 2]) -> f64 {
    /// One over the mean of cos^8 over a circle, 35/128.
    const NORM: f64 = 128.0 / 35.0;
    let cosine = centre[0] * direction[0] + centre[1] * direction[1];
    let half = 0.5 * (1.0 + cosine).max(0.0);
    0.5 + 0.5 * NORM * (half * half) * (half * half)
}

/// Searches points of failure of structures that come closer than a margin.
pub(crate) struct Search<'s, 'c, A> {
    pub case: &'s Case<'c, A>,
    pub structures: &'s [usize],
    pub margin_m: f64,
}

/// A failure that was found, and its distance from the mean: half its square, less the logarithm of the state's weight.
struct Candidate {
    point: Point,
    cost: f64,
}

impl<A: Anatomy> Search<'_, '_, A> {
    /// None if no failure was found.
    pub fn proposal(&self, streams: &Streams) -> Option<Proposal> {
        let mut open = self.candidates(streams);
        open.sort_by(|a, b| a.cost.total_cmp(&b.cost));
        let mut found: Vec<Candidate> = Vec::new();
        while !open.is_empty() && found.len() < MOST_POINTS {
            let mut random = streams.search(u64::MAX - found.len() as u64);
            let nearest = self.walked(self.refined(&open.remove(0)), &mut random);
            open.retain(|other| !covers(&nearest.point, &other.point));
            found.push(nearest);
        }
        let best = found
            .iter()
            .map(|each| each.cost)
            .fold(f64::INFINITY, f64::min);
        found.retain(|each| each.cost <= best + NEGLIGIBLE);
        let points: Vec<Point> = found.iter().map(|each| each.point).collect();
        let law = self.case.law;
        let is_finite = |point: &Point| point.latent.normals.iter().all(|each| each.is_finite());
        let turns_any_way = law
            .bend()
            .is_some_and(|bend| bend.direction() == BendDirection::Unknown);
        (!points.is_empty() && points.iter().all(is_finite)).then(|| Proposal {
            weights: points
                .iter()
                .map(|point| law.holds()[point.latent.hold].weight)
                .collect(),
            points,
            turns_any_way,
        })
    }

    /// Failures among draws that are wider than the law.
    fn candidates(&self, streams: &Streams) -> Vec<Candidate> {
        let law = self.case.law;
        let holds: Vec<usize> = (0..law.holds().len())
            .filter(|hold| law.holds()[*hold].weight > 0.0)
            .collect();
        let each = SEARCHED.div_ceil(holds.len() as u64);
        let mut found = Vec::new();
        for (nth_hold, hold) in holds.iter().enumerate() {
            for count in 0..each {
                let index = nth_hold as u64 * each + count;
                let mut random = streams.search(index);
                let wider = WIDENED[usize::try_from(count % 3).unwrap_or(0)];
                let latent = Latent {
                    normals: std::array::from_fn(|variable| {
                        // Most of a wider phase would be that of no breath at all.
                        let wider = if variable == PHASE { 1.0 } else { wider };
                        wider * random.next_normal()
                    }),
                    hold: *hold,
                    direction: any_direction(&mut random),
                };
                let hit = self
                    .structures
                    .iter()
                    .find(|structure| self.spare_m(&latent, **structure) <= 0.0);
                if let Some(structure) = hit {
                    found.push(self.candidate(Point {
                        latent,
                        structure: *structure,
                    }));
                }
            }
        }
        found
    }

    fn candidate(&self, mut point: Point) -> Candidate {
        // Variables that the law does not have cost nothing.
        for variable in 0..VARIABLES {
            if !self.has(variable, &point) {
                point.latent.normals[variable] = 0.0;
            }
        }
        let weight = self.case.law.holds()[point.latent.hold].weight;
        Candidate {
            cost: 0.5 * square(&point.latent.normals) - libm::log(weight),
            point,
        }
    }

    fn has(&self, variable: usize, point: &Point) -> bool {
        let law = self.case.law;
        let hold = &law.holds()[point.latent.hold];
        let moves =
            |vectors: &[nalgebra::Vector3<f64>; 2]| vectors.iter().any(|each| each.norm() > 0.0);
        match variable {
            LEVEL => moves(&hold.level_sd_m),
            DRIFT => moves(&hold.drift_sd_m),
            PHASE => hold.failed_m.is_some(),
            SIZE => law.bend().is_some_and(|bend| bend.count() > 1),
            TURN => law.bend().is_some_and(
                |bend| matches!(bend.direction(), BendDirection::Known { spread_rad } if spread_rad > 0.0),
            ),
            BOUNDARY => self.case.structures[point.structure].boundary_sd_m > 0.0,
            _ => true,
        }
    }

    /// How far a structure is from failure, m: negative beyond it.
    fn spare_m(&self, latent: &Latent, structure: usize) -> f64 {
        let law = self.case.law;
        let path = path(law, &latent.values(law));
        let shifts = Shifts {
            starts: &[],
            index: 0,
            moved: None,
        };
        let spare_m = Asked::new(self.case, path, shifts, true).spare_m(structure, self.margin_m);
        spare_m - self.case.structures[structure].boundary_sd_m * latent.normals[BOUNDARY]
    }

    /// Nearer to the mean: the iteration of Hasofer, Lind, Rackwitz and Fiessler with steps that a merit function
    /// shortens (Zhang and Der Kiureghian 1995), and the first failure on the line from the mean where it ends.
    fn refined(&self, from: &Candidate) -> Candidate {
        const ITERATIONS: usize = 20;
        const SHORTER: usize = 5;
        const SETTLED: f64 = 0.02;
        let mut best = self.on_boundary(&from.point);
        let mut point = best.point;
        let mut penalty = 0.0;
        for _ in 0..ITERATIONS {
            self.turn(&mut point);
            let spare_m = self.spare_m(&point.latent, point.structure);
            let slope = self.slope(&point, spare_m);
            let steepness = square(&slope);
            if steepness <= 0.0 || !steepness.is_finite() {
                break;
            }
            let normals = point.latent.normals;
            let product: f64 = slope.iter().zip(&normals).map(|(a, b)| a * b).sum();
            let scale = (product - spare_m) / steepness;
            let step: [f64; VARIABLES] =
                std::array::from_fn(|index| slope[index] * scale - normals[index]);
            // Above |z| / |slope| a step along the line to the nearest point makes the merit less.
            let needed = 2.0 * (1.0 + square(&normals).sqrt()) / steepness.sqrt();
            penalty = needed.max(penalty);
            let merit = |normals: &[f64; VARIABLES], spare_m: f64| {
                0.5 * square(normals) + penalty * spare_m.abs()
            };
            let now = merit(&normals, spare_m);
            let mut share = 1.0;
            let mut moved = point;
            for _ in 0..SHORTER {
                moved.latent.normals =
                    std::array::from_fn(|index| normals[index] + share * step[index]);
                let spare_m = self.spare_m(&moved.latent, point.structure);
                if merit(&moved.latent.normals, spare_m) < now {
                    break;
                }
                share *= 0.5;
            }
            point = moved;
            let found = self.on_boundary(&point);
            if found.cost < best.cost && self.fails(&found.point) {
                best = found;
            }
            if share * share * square(&step) < SETTLED * SETTLED {
                break;
            }
        }
        best
    }

    /// Nearer still by steps at random, where distances are not smooth or the phase of a failed hold bends everything.
    fn walked(&self, from: Candidate, random: &mut NormalPairs) -> Candidate {
        const STEPS: usize = 240;
        const SIZES: [f64; 3] = [0.3, 0.1, 0.03];
        let mut best = from;
        for step in 0..STEPS {
            let size = SIZES[step % SIZES.len()];
            let mut point = best.point;
            point.latent.normals = point
                .latent
                .normals
                .map(|each| each * (1.0 - 0.5 * size) + size * random.next_normal());
            point.latent.direction = any_direction(random);
            let same_direction = Point {
                latent: Latent {
                    direction: best.point.latent.direction,
                    ..point.latent
                },
                ..point
            };
            for point in [same_direction, point] {
                let found = self.candidate(point);
                if found.cost < best.cost && self.fails(&found.point) {
                    best = found;
                }
            }
        }
        best
    }

    fn fails(&self, point: &Point) -> bool {
        self.spare_m(&point.latent, point.structure) <= 0.0
    }

    /// The direction of an unknown bend that comes nearest.
    fn turn(&self, point: &mut Point) {
        const TRIED: u32 = 12;
        let bend = self.case.law.bend();
        if bend.is_none_or(|bend| bend.direction() != BendDirection::Unknown) {
            return;
        }
        let mut least_m = self.spare_m(&point.latent, point.structure);
        for tried in 0..TRIED {
            let angle_rad = std::f64::consts::TAU * f64::from(tried) / f64::from(TRIED);
            let mut other = point.latent;
            other.direction = cosine_and_sine(angle_rad);
            let spare_m = self.spare_m(&other, point.structure);
            if spare_m < least_m {
                (least_m, point.latent) = (spare_m, other);
            }
        }
    }

    fn slope(&self, point: &Point, spare_m: f64) -> [f64; VARIABLES] {
        /// Steps: of variables that act linearly, and of curves, of which there are few, and phases.
        const STEPS: (f64, f64) = (0.05, 0.25);
        std::array::from_fn(|variable| {
            if !self.has(variable, point) {
                return 0.0;
            }
            let moved = |by: f64| {
                let mut latent = point.latent;
                latent.normals[variable] += by;
                self.spare_m(&latent, point.structure)
            };
            if variable == SIZE || variable == PHASE {
                (moved(STEPS.1) - moved(-STEPS.1)) / (2.0 * STEPS.1)
            } else {
                (moved(STEPS.0) - spare_m) / STEPS.0
            }
        })
    }

    /// The first failure on the line from the mean through a point, a little beyond it at most.
    fn on_boundary(&self, point: &Point) -> Candidate {
        const BEYOND: f64 = 1.15;
        const STEPS: u32 = 12;
        let at = |share: f64| {
            let mut other = *point;
            other.latent.normals = other.latent.normals.map(|each| share * each);
            other
        };
        let fails = |share: f64| self.spare_m(&at(share).latent, point.structure) <= 0.0;
        let mut high = if fails(1.0) { 1.0 } else { BEYOND };
        let mut low = 0.0;
        if fails(0.0) {
            high = 0.0;
        }
        for _ in 0..STEPS {
            let middle = f64::midpoint(low, high);
            if fails(middle) {
                high = middle;
            } else {
                low = middle;
            }
        }
        self.candidate(at(high))
    }
}

/// Whether draws that are moved to a point find another failure too: it lies beyond the plane through the point.
fn covers(point: &Point, other: &Point) -> bool {
    /// Of the distance of the plane.
    const NEARLY: f64 = 0.7;
    let (mean, value) = (&point.latent.normals, &other.latent.normals);
    let product: f64 = mean.iter().zip(value).map(|(a, b)| a * b).sum();
    point.latent.hold == other.latent.hold && product >= NEARLY * square(mean)
}

fn square(values: &[f64; VARIABLES]) -> f64 {
    values.iter().map(|each| each * each).sum()
}
