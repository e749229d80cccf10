//! Cells with exact probabilities.

use std::sync::OnceLock;

use nalgebra::{Matrix6, Point3, Vector2, Vector3, Vector6};
use needlebench_numerics::random::SplitMix64;
use needlebench_probability::{Bend, BendDirection, Event, HalfPlane, Law, Structure};

use crate::common::{correlated, failing, linear};
use crate::quadrature::{density, either_above, in_ball, in_disc, integral};
use crate::shapes::{DEPTH_M, NEEDLE, Shape, Shapes, structure};

/// One question with its answer.
pub struct Cell {
    pub law: Law,
    pub shapes: Shapes,
    pub structures: Vec<Structure>,
    pub event: Event,
    pub exact: f64,
}

/// Standard normal limits of both ends of the needle for a plane, and their correlation, with a boundary error.
struct Ends {
    mean_m: [f64; 2],
    sd_m: [f64; 2],
    correlation: f64,
}

impl Ends {
    fn new(law: &Law, normal: &Vector3<f64>, boundary_sd_m: f64) -> Self {
        let mut weights = [Vector6::zeros(); 2];
        for axis in 0..3 {
            weights[0][axis] = normal[axis];
            weights[1][axis + 3] = normal[axis];
        }
        let covariance = |a: usize, b: usize| {
            weights[a].dot(&(law.covariance_m2() * weights[b])) + boundary_sd_m * boundary_sd_m
        };
        let sd_m = [0, 1].map(|end| covariance(end, end).sqrt());
        Self {
            mean_m: [0, 1].map(|end| {
                weights[end].dot(law.mean_m()) + f64::from(u8::from(end == 1)) * normal.x * DEPTH_M
            }),
            sd_m,
            correlation: covariance(0, 1) / (sd_m[0] * sd_m[1]),
        }
    }

    fn either_above(&self, limit_m: f64, shifts_m: [f64; 2]) -> f64 {
        let limits =
            [0, 1].map(|end| (limit_m - self.mean_m[end] - shifts_m[end]) / self.sd_m[end]);
        either_above(limits[0], limits[1], self.correlation)
    }
}

fn random_law(random: &mut SplitMix64) -> Law {
    let mut sds = || -> [f64; 3] { std::array::from_fn(|_| random.uniform(0.4e-3, 1.4e-3)) };
    let (entry, tip) = (sds(), sds());
    let correlation = random.uniform(-0.5, 0.99);
    // Axes that are none of the needle's.
    let turn = nalgebra::Rotation3::from_euler_angles(
        random.uniform(-1.0, 1.0),
        random.uniform(-1.0, 1.0),
        random.uniform(-1.0, 1.0),
    );
    let mut both = Matrix6::zeros();
    both.fixed_view_mut::<3, 3>(0, 0).copy_from(turn.matrix());
    both.fixed_view_mut::<3, 3>(3, 3).copy_from(turn.matrix());
    let covariance = both * correlated(entry, tip, correlation) * both.transpose();
    let mean = Vector6::from_fn(|_, _| random.uniform(-0.5e-3, 0.5e-3));
    linear(mean, &(0.5 * (covariance + covariance.transpose())))
}

fn across(random: &mut SplitMix64) -> Vector3<f64> {
    let (sine, cosine) = libm::sincos(random.uniform(-3.0, 3.0));
    Vector3::new(0.0, cosine, sine)
}

fn plane_of(normal: &Vector3<f64>, offset_m: f64) -> HalfPlane {
    HalfPlane {
        normal: normal.yz(),
        offset_m,
        stretch_m: [f64::NEG_INFINITY, f64::INFINITY],
    }
}

pub fn closer() -> Event {
    Event::Closer {
        structure: 0,
        margin_m: 0.5e-3,
    }
}

pub const NEEDED_M: f64 = NEEDLE.radius_m + 0.5e-3;

/// Both ends, correlation, mean, boundary error.
fn half_spaces() -> Vec<Cell> {
    let mut random = SplitMix64::new(1);
    first(
        40,
        (0..).map(|number| {
            let law = random_law(&mut random);
            let normal = across(&mut random);
            let boundary_sd_m = if number % 2 == 0 {
                0.0
            } else {
                random.uniform(0.2e-3, 1e-3)
            };
            let ends = Ends::new(&law, &normal, boundary_sd_m);
            let deviations = random.uniform(0.8, 4.6);
            let limits_m = [0, 1].map(|end| ends.mean_m[end] + deviations * ends.sd_m[end]);
            let offset_m = NEEDED_M + limits_m[0].max(limits_m[1]);
            Cell {
                exact: ends.either_above(offset_m - NEEDED_M, [0.0; 2]),
                law,
                shapes: Shapes(vec![Shape::HalfSpace { normal, offset_m }]),
                structures: vec![structure(
                    boundary_sd_m,
                    vec![vec![plane_of(&normal, offset_m)]],
                )],
                event: closer(),
            }
        }),
    )
}

/// The same for entry and tip, whose axes have unequal standard deviations.
pub fn rigid(random: &mut SplitMix64) -> (Law, [f64; 3], [f64; 3]) {
    let sds: [f64; 3] = std::array::from_fn(|_| random.uniform(0.4e-3, 1.5e-3));
    let mean: [f64; 3] = std::array::from_fn(|_| random.uniform(-0.4e-3, 0.4e-3));
    let both = Vector6::from_fn(|row, _| mean[row % 3]);
    (linear(both, &correlated(sds, sds, 1.0)), mean, sds)
}

/// Twenty beside the needle, and twenty lesions about the tip.
fn balls() -> Vec<Cell> {
    let mut random = SplitMix64::new(2);
    first(
        40,
        (0..).map(|number| {
            let (law, mean_m, sd_m) = rigid(&mut random);
            let normal = across(&mut random);
            let radius_m = random.uniform(1.5e-3, 5e-3);
            if number % 4 < 2 {
                let variances_m2 = [1, 2].map(|axis| (sd_m[axis] * normal[axis]).powi(2));
                let deviations = random.uniform(1.0, 4.6);
                let spread_m = deviations * (variances_m2[0] + variances_m2[1]).sqrt();
                let away_m = radius_m + NEEDED_M + 0.5e-3 + spread_m;
                let centre_m = Point3::new(0.5 * DEPTH_M, away_m * normal.y, away_m * normal.z);
                let covers = HalfPlane::covers(&[centre_m], 1, radius_m);
                let mean_m = [mean_m[1] - centre_m.y, mean_m[2] - centre_m.z];
                return Cell {
                    exact: in_disc(mean_m, [sd_m[1], sd_m[2]], radius_m + NEEDED_M),
                    law,
                    shapes: Shapes(vec![Shape::Ball { centre_m, radius_m }]),
                    structures: vec![structure(0.0, covers)],
                    event: closer(),
                };
            }
            let boundary_sd_m = if number % 2 == 0 { 0.0 } else { 0.5e-3 };
            let off_m = normal * random.uniform(0.0, 2e-3);
            let mean_m: [f64; 3] = std::array::from_fn(|axis| mean_m[axis] - off_m[axis]);
            let exact = if boundary_sd_m > 0.0 {
                integral(-8.0, 8.0, 4, |z| {
                    density(z) * in_ball(mean_m, sd_m, radius_m + boundary_sd_m * z)
                })
            } else {
                in_ball(mean_m, sd_m, radius_m)
            };
            Cell {
                exact,
                law,
                shapes: Shapes(vec![Shape::Ball {
                    centre_m: Point3::new(DEPTH_M, 0.0, 0.0) + off_m,
                    radius_m,
                }]),
                structures: vec![structure(boundary_sd_m, Vec::new())],
                event: Event::TipInside { structure: 0 },
            }
        }),
    )
}

/// Failed holds, and bends in a known and an unknown direction, towards half-spaces.
fn mixtures() -> Vec<Cell> {
    let mut random = SplitMix64::new(3);
    first(
        10,
        (0..).map(|number| {
            let linear = random_law(&mut random);
            let normal = across(&mut random);
            let full_m = normal * -random.uniform(4e-3, 9e-3) + Vector3::x() * 1e-3;
            let level_m = normal * random.uniform(0.2e-3, 0.8e-3);
            // A straight bend from the entry: whatever is farthest off is an end.
            let sizes_m = [0.4e-3, 0.8e-3, 1.1e-3, 2.0e-3];
            let spread_rad = 0.3;
            let (direction, bent) = match number % 3 {
                0 => (BendDirection::Unknown, true),
                1 => (BendDirection::Known { spread_rad }, true),
                _ => (BendDirection::Unknown, false),
            };
            let curves = sizes_m.map(|size_m| vec![Vector2::zeros(), Vector2::new(size_m, 0.0)]);
            let bend = bent.then(|| Bend::new(vec![0.0, 1.0], curves.to_vec(), direction).unwrap());
            let law = Law::new(
                *linear.mean_m(),
                linear.parts().to_vec(),
                bend,
                failing(level_m, full_m),
            )
            .unwrap();
            let offset_m = NEEDED_M + random.uniform(3e-3, 6e-3);
            // The level is a shift of both ends, as the boundary is.
            let ends = Ends::new(&law, &normal, level_m.norm());
            let beyond = |tip_m: f64| {
                let held = ends.either_above(offset_m - NEEDED_M, [0.0, tip_m]);
                let failed = integral(0.0, 0.5, 3, |u| {
                    let sine = libm::sin(std::f64::consts::PI * u);
                    let by_m = -normal.dot(&full_m) * (sine * sine) * (sine * sine);
                    2.0 * ends.either_above(offset_m - NEEDED_M, [by_m, by_m + tip_m])
                });
                0.95 * held + 0.05 * failed
            };
            let angle_of_normal = libm::atan2(normal.z, normal.y);
            let towards = |angle: f64| {
                let product = libm::cos(angle - angle_of_normal);
                let each = sizes_m.map(|size_m| beyond(size_m * product));
                each.iter().sum::<f64>() / each.len() as f64
            };
            let exact = match (bent, direction) {
                (false, _) => beyond(0.0),
                (true, BendDirection::Unknown) => {
                    let pi = std::f64::consts::PI;
                    integral(-pi, pi, 1, towards) / (2.0 * pi)
                }
                (true, BendDirection::Known { spread_rad }) => {
                    integral(-8.0, 8.0, 2, |z| density(z) * towards(spread_rad * z))
                }
            };
            Cell {
                exact,
                law,
                shapes: Shapes(vec![Shape::HalfSpace { normal, offset_m }]),
                structures: vec![structure(0.0, vec![vec![plane_of(&normal, offset_m)]])],
                event: closer(),
            }
        }),
    )
}

pub fn all() -> &'static [Cell] {
    static CELLS: OnceLock<Vec<Cell>> = OnceLock::new();
    CELLS.get_or_init(|| {
        [half_spaces(), balls(), mixtures()]
            .into_iter()
            .flatten()
            .collect()
    })
}

/// The first so many that are neither certain nor rarer than what is printed.
fn first(count: usize, cells: impl Iterator<Item = Cell>) -> Vec<Cell> {
    cells
        .filter(|cell| (3e-7..0.999).contains(&cell.exact))
        .take(count)
        .collect()
}
