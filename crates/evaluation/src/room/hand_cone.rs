//! The free cone behind the guide in which a hand can hold the needle.

use std::cmp::Ordering;
use std::collections::BinaryHeap;
use std::f64::consts::{FRAC_PI_2, TAU};

use nalgebra::{Point3, Vector3};

use super::obstacles::{Near, PlacedObstacles};

/// Angle to which the cone is computed, rad.
pub const CONE_TOLERANCE_RAD: f64 = 0.25 * std::f64::consts::PI / 180.0;
/// The hand comes no nearer to the guide's entry than this, m.
pub(crate) const CONE_START_M: f64 = 0.01;
/// Cells that are looked at before the bound reached until then is taken.
const MOST_CELLS: usize = 20_000;
/// Cells smaller than this are not cut further, m: what is so near ends the search from below.
const SMALLEST_M: f64 = 2.5e-4;

/// The largest free cone.
#[derive(Debug, Clone, PartialEq)]
pub struct HandCone {
    /// Proven lower bound of its half-angle, rad; at most a right angle.
    pub half_angle_rad: f64,
    /// How much larger the true angle may be, rad: to a point that is known to be in a solid.
    pub accuracy_rad: f64,
    /// What blocks a larger one; `None` if the whole half space is free.
    pub blocker: Option<String>,
}

/// Part of the hemisphere: ranges of distance, angle from the axis and angle about it.
#[derive(Debug, Clone)]
struct Cell {
    distance_m: [f64; 2],
    angle_rad: [f64; 2],
    turn_rad: [f64; 2],
    near: Near,
}

impl PartialEq for Cell {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}
impl Eq for Cell {}
impl PartialOrd for Cell {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
impl Ord for Cell {
    /// Smallest angle first out of the heap; among equals an order of their own, so that results
    /// never depend on how they came in.
    fn cmp(&self, other: &Self) -> Ordering {
        other.angle_rad[0]
            .total_cmp(&self.angle_rad[0])
            .then(other.turn_rad[0].total_cmp(&self.turn_rad[0]))
            .then(other.distance_m[0].total_cmp(&self.distance_m[0]))
    }
}

fn middle([low, high]: [f64; 2]) -> f64 {
    0.5 * (low + high)
}

impl Cell {
    /// Lengths of the ways from the middle to the rim: outwards, away from the axis, about it. No
    /// point of the cell is farther from its middle than their sum.
    fn reach_m(&self) -> [f64; 3] {
        let half = |[low, high]: [f64; 2]| 0.5 * (high - low);
        let far_m = self.distance_m[1];
        [
            half(self.distance_m),
            far_m * half(self.angle_rad),
            far_m * libm::sin(self.angle_rad[1]) * half(self.turn_rad),
        ]
    }

    fn halves(self, axis: usize) -> [Self; 2] {
        let (mut first, mut second) = (self.clone(), self);
        let range = |cell: &mut Self| match axis {
            0 => cell.distance_m,
            1 => cell.angle_rad,
            _ => cell.turn_rad,
        };
        let cut = middle(range(&mut first));
        match axis {
            0 => (first.distance_m[1], second.distance_m[0]) = (cut, cut),
            1 => (first.angle_rad[1], second.angle_rad[0]) = (cut, cut),
            _ => (first.turn_rad[1], second.turn_rad[0]) = (cut, cut),
        }
        [first, second]
    }
}

/// Largest half-angle of a cone about `axis` in which nothing stands between `CONE_START_M` and
/// `reach_m` from `apex`.
///
/// Branch and bound over distance, angle and turn: a cell in whose middle the nearest solid is
/// farther than the cell's own radius is free. Cells are taken by their smallest angle, so all
/// directions within that of the cell in hand are proven free at any time; that is the result, and
/// it is never too large but for the distances' own error (below 1e-8 m). The smallest angle at
/// which a point was found inside a solid bounds it from the other side, as proven; the search ends
/// when both are within [`CONE_TOLERANCE_RAD`], or when what is left is nearer than 0.5 mm to
/// touching. Then a point of what is so near is the bound (`touched_rad`): being near is not being
/// inside, and 0.25 mm beside the guide's entry are more than a degree.
pub fn hand_cone(
    obstacles: &PlacedObstacles<'_>,
    apex: &Point3<f64>,
    axis: &Vector3<f64>,
    reach_m: f64,
) -> HandCone {
    let [across, beside] = frame_about(axis);
    let mut heap = BinaryHeap::from([Cell {
        distance_m: [CONE_START_M, reach_m.max(CONE_START_M)],
        angle_rad: [0.0, FRAC_PI_2],
        turn_rad: [0.0, TAU],
        near: obstacles.everything(),
    }]);
    let mut met = (FRAC_PI_2, None);
    for looked_at in 0.. {
        let Some(cell) = heap.pop() else { break };
        let least_rad = cell.angle_rad[0];
        let close_enough = met.0 - least_rad <= CONE_TOLERANCE_RAD;
        if close_enough {
            return result(obstacles, least_rad.min(met.0), met);
        }
        let point_at = |angle_rad: f64| {
            let turn_rad = middle(cell.turn_rad);
            let direction = axis * libm::cos(angle_rad)
                + (across * libm::cos(turn_rad) + beside * libm::sin(turn_rad))
                    * libm::sin(angle_rad);
            apex + direction * middle(cell.distance_m)
        };
        if looked_at >= MOST_CELLS {
            return result(obstacles, least_rad.min(met.0), met);
        }
        let angle_rad = middle(cell.angle_rad);
        let point = point_at(angle_rad);
        let reach = cell.reach_m();
        let radius_m: f64 = reach.iter().sum();
        let (nearest, near) = obstacles.within(&cell.near, &point, radius_m);
        let Some((distance_m, index)) = nearest else {
            continue;
        };
        if distance_m <= 0.0 && angle_rad < met.0 {
            met = (angle_rad, Some(index));
        }
        if radius_m <= SMALLEST_M {
            let near = (least_rad, point_at(least_rad));
            let touched_rad = touched_rad(obstacles, index, (apex, axis), reach_m, near);
            if touched_rad < met.0 || met.1.is_none() {
                met = (touched_rad.min(met.0), Some(index));
            }
            return result(obstacles, least_rad.min(met.0), met);
        }
        let widest = (0..3)
            .max_by(|a, b| reach[*a].total_cmp(&reach[*b]))
            .unwrap_or(0);
        heap.extend(Cell { near, ..cell }.halves(widest));
    }
    result(obstacles, met.0, met)
}

/// Smallest angle from the axis that is found of a point of one solid, near a point of the cone of
/// `from_rad` that nearly touches it.
///
/// Nearest points of the solid and of the cone are taken in turn, which leads to where the two are
/// nearest. Every point that is looked at is on the solid or in it, so the angle is a bound whatever the
/// turns lead to.
fn touched_rad(
    obstacles: &PlacedObstacles<'_>,
    index: usize,
    (apex, axis): (&Point3<f64>, &Vector3<f64>),
    reach_m: f64,
    (from_rad, start): (f64, Point3<f64>),
) -> f64 {
    const TURNS: usize = 30;
    let on_cone = |point: &Point3<f64>| {
        let offset = point - apex;
        let across = offset - axis * offset.dot(axis);
        let level = across.try_normalize(f64::MIN_POSITIVE).unwrap_or_default();
        apex + (axis * libm::cos(from_rad) + level * libm::sin(from_rad)) * offset.norm()
    };
    let is_in_reach =
        |point: &Point3<f64>| (CONE_START_M..=reach_m).contains(&(point - apex).norm());
    let mut least_rad = FRAC_PI_2;
    let mut at = start;
    for _ in 0..TURNS {
        if is_in_reach(&at) && obstacles.is_inside(index, &at) {
            return from_rad.min(least_rad);
        }
        let touched = obstacles.point_of(index, &at);
        if is_in_reach(&touched) {
            least_rad = least_rad.min((touched - apex).angle(axis));
        }
        // As far again into the solid: where cone and solid cross, that is inside both.
        at = on_cone(&(touched + (touched - at)));
    }
    least_rad
}

fn result(
    obstacles: &PlacedObstacles<'_>,
    half_angle_rad: f64,
    (met_rad, blocker): (f64, Option<usize>),
) -> HandCone {
    HandCone {
        half_angle_rad,
        accuracy_rad: met_rad - half_angle_rad,
        blocker: blocker.map(|index| obstacles.name(index).to_owned()),
    }
}

/// Two unit vectors at right angles to a unit vector and to each other.
pub(super) fn frame_about(axis: &Vector3<f64>) -> [Vector3<f64>; 2] {
    let mut other = Vector3::zeros();
    other[axis.iamin()] = 1.0;
    let across = axis.cross(&other);
    // At least sqrt(2/3): the smallest component of a unit vector is at most sqrt(1/3).
    let across = across / across.norm();
    [across, axis.cross(&across)]
}
