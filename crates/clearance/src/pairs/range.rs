//! Least and largest distance of two bodies over all joint positions between them, proven.
//!
//! *Bound.* Let a box of joint positions have the centre `c` and the half widths `w_j`, `j` from
//! the joint next to body B to the one next to body A, and let B stand still. Go from `c` to any
//! `q` of the box joint by joint, the one next to A first. Turning joint `j` moves a point of A by
//! no more than its distance from that joint's axis times `|q_j - c_j|`. That distance is at most
//! `R_j(c)`, the largest of A's geometry at `c`, plus what the joints turned before have moved the
//! point: `rho_j = R_j(c) + sum_{m > j} rho_m w_m`. The axis itself has not moved, because only
//! joints behind it have. So no point of A moves by more than `D = sum_j rho_j w_j`.
//!
//! A signed distance is the largest gap along any direction, of penetrating convex bodies as well,
//! and a gap changes by no more than the points that bound it move. Hence
//! `d(c) - D <= d(q) <= d(c) + D`.
//!
//! *Search.* The box with the lowest bound is halved along its joint with the largest `rho_j w_j`
//! until the lowest bound of all and the least distance at a centre are within the tolerance.

use std::cmp::Ordering;
use std::collections::BinaryHeap;
use std::f64::consts::{PI, TAU};
use std::ops::Range;

use nalgebra::{Point3, Vector3};
use needlebench_cell::{BodyPair, Cell};
use needlebench_geometry::{Shape, Solid, TriangleMesh};
use needlebench_kinematics::{Chain, JOINT_COUNT, JointLimit, Joints};

use super::PairSettings;
use crate::ClearanceModel;

/// Taken off every bound for the error of distances, 2e-7 m at worst, and the rounding here.
const ROUNDING_M: f64 = 1e-6;

/// Bounds of an extreme of the distance over all joint positions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RangeBound {
    /// The extreme is no less than this, m.
    pub lower_m: f64,
    /// The extreme is no more than this, m.
    pub upper_m: f64,
    /// Boxes of joint positions that it took.
    pub boxes: usize,
}

impl RangeBound {
    /// Of a distance that no joint changes.
    pub(super) fn of_constant(distance_m: f64) -> Self {
        Self {
            lower_m: distance_m - ROUNDING_M,
            upper_m: distance_m + ROUNDING_M,
            boxes: 1,
        }
    }
}

/// Which extreme.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Extreme {
    Nearest,
    Farthest,
}

/// The joint's range, or one turn of it: an arm is the same a turn further.
pub(super) fn one_turn(limit: &JointLimit) -> [f64; 2] {
    let [lower, upper] = [limit.lower_rad, limit.upper_rad];
    if lower <= -PI && upper >= PI {
        [-PI, PI]
    } else if upper - lower >= TAU && lower.is_finite() {
        [lower, lower + TAU]
    } else if upper - lower >= TAU {
        [upper - TAU, upper]
    } else {
        [lower, upper]
    }
}

/// A ball; the balls of a list hold, with what lies between them, a shape.
struct Ball {
    centre: Point3<f64>,
    radius_m: f64,
}

/// Two bodies and the joints between them.
pub(super) struct PairRange {
    model: ClearanceModel,
    chain: Chain,
    ranges: [[f64; 2]; JOINT_COUNT],
    joints: Range<usize>,
    /// Around body A, in its link's frame.
    balls: Vec<Ball>,
}

/// Joint positions about a centre.
#[derive(Clone, Copy)]
struct JointBox {
    centre: Joints,
    half: Joints,
    /// No position of the box has less.
    bound_m: f64,
    /// Joint along which the bound gains most.
    widest: usize,
    order: usize,
}

impl PartialEq for JointBox {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for JointBox {}

impl PartialOrd for JointBox {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for JointBox {
    /// The greatest is the one to halve next: the lowest bound, and the oldest of equals.
    fn cmp(&self, other: &Self) -> Ordering {
        let by_bound = other.bound_m.total_cmp(&self.bound_m);
        by_bound.then(other.order.cmp(&self.order))
    }
}

impl PairRange {
    /// `pair.a` is the body behind the `joints`, `pair.b` the one before them.
    pub(super) fn new(cell: &Cell, pair: BodyPair, joints: Range<usize>) -> Self {
        let alone = Cell {
            bodies: vec![cell.bodies[pair.a].clone(), cell.bodies[pair.b].clone()],
            pairs: vec![BodyPair { a: 0, b: 1, ..pair }],
            ..cell.clone()
        };
        Self {
            model: ClearanceModel::new(&alone),
            chain: cell.robot.chain,
            ranges: cell.robot.limits.0.each_ref().map(one_turn),
            joints,
            balls: alone.bodies[0].solids.iter().flat_map(balls).collect(),
        }
    }

    /// Bounds of an extreme over the joints' ranges, to the tolerance or as good as the allowed
    /// number of boxes makes them.
    pub(super) fn bound(&self, extreme: Extreme, settings: &PairSettings) -> RangeBound {
        let sign = match extreme {
            Extreme::Nearest => 1.0,
            Extreme::Farthest => -1.0,
        };
        let mut centre = Joints::zeros();
        let mut half = Joints::zeros();
        for joint in self.joints.clone() {
            let [lower, upper] = self.ranges[joint];
            centre[joint] = 0.5 * (lower + upper);
            half[joint] = 0.5 * (upper - lower);
        }
        let (whole, mut least_m) = self.visit(sign, centre, half, f64::NEG_INFINITY, 1);
        let mut bound_m = whole.bound_m;
        let mut boxes = 1;
        let mut open = BinaryHeap::from([whole]);
        while let Some(lowest) = open.pop() {
            bound_m = lowest.bound_m;
            if least_m - bound_m <= settings.tolerance_m || boxes + 2 > settings.boxes {
                break;
            }
            let mut half = lowest.half;
            half[lowest.widest] *= 0.5;
            for side in [-1.0, 1.0] {
                let mut centre = lowest.centre;
                centre[lowest.widest] += side * half[lowest.widest];
                boxes += 1;
                let (part, value_m) = self.visit(sign, centre, half, lowest.bound_m, boxes);
                least_m = least_m.min(value_m);
                open.push(part);
            }
        }
        let (inner_m, outer_m) = (least_m + ROUNDING_M, bound_m - ROUNDING_M);
        match extreme {
            Extreme::Nearest => RangeBound {
                lower_m: outer_m,
                upper_m: inner_m,
                boxes,
            },
            Extreme::Farthest => RangeBound {
                lower_m: -inner_m,
                upper_m: -outer_m,
                boxes,
            },
        }
    }

    /// The box about a centre, of which no position has less than `floor_m`, and the value there.
    fn visit(
        &self,
        sign: f64,
        centre: Joints,
        half: Joints,
        floor_m: f64,
        order: usize,
    ) -> (JointBox, f64) {
        let value_m = sign * self.distance_m(&centre);
        let (travel_m, widest) = self.travel(&centre, &half);
        let found = JointBox {
            centre,
            half,
            bound_m: (value_m - travel_m).max(floor_m),
            widest,
            order,
        };
        (found, value_m)
    }

    fn distance_m(&self, q: &Joints) -> f64 {
        self.model
            .all_pairs(q)
            .first()
            .map_or(f64::INFINITY, |pair| pair.separation.distance_m)
    }

    /// The most that a point of body A moves within a box, m, and the joint that does most of it.
    fn travel(&self, centre: &Joints, half: &Joints) -> (f64, usize) {
        let links = self.chain.link_poses(centre);
        let body = &links[self.joints.end - 1];
        let points: Vec<Point3<f64>> = self.balls.iter().map(|ball| body * ball.centre).collect();
        let mut travel_m = 0.0;
        let mut most = (f64::NEG_INFINITY, self.joints.start);
        for joint in self.joints.clone().rev() {
            let origin = links[joint].translation.vector;
            let axis = links[joint].rotation * self.chain.joints[joint].axis.into_inner();
            let radius_m = points
                .iter()
                .zip(&self.balls)
                .map(|(point, ball)| (point.coords - origin).cross(&axis).norm() + ball.radius_m)
                .fold(0.0, f64::max);
            let part_m = (radius_m + travel_m) * half[joint];
            if part_m > most.0 {
                most = (part_m, joint);
            }
            travel_m += part_m;
        }
        (travel_m, most.1)
    }
}

/// Balls whose convex hull holds a solid, in the frame of its body.
fn balls(solid: &Solid) -> Vec<Ball> {
    let place = |centre: Point3<f64>, radius_m: f64| Ball {
        centre: solid.parent_from_shape * centre,
        radius_m,
    };
    match &solid.shape {
        Shape::Sphere { radius_m } => vec![place(Point3::origin(), *radius_m)],
        Shape::Cylinder {
            radius_m,
            half_length_m,
        }
        | Shape::Capsule {
            radius_m,
            half_length_m,
        } => [-1.0, 1.0]
            .map(|end| place(Point3::new(0.0, 0.0, end * half_length_m), *radius_m))
            .into(),
        Shape::Cuboid { half_extents_m } => corners(&-half_extents_m, half_extents_m)
            .map(|corner| place(corner, 0.0))
            .into(),
        Shape::Convex(mesh) => box_of(&mesh.0).map(|corner| place(corner, 0.0)).into(),
        Shape::Mesh(mesh) => box_of(mesh.surface())
            .map(|corner| place(corner, 0.0))
            .into(),
    }
}

fn box_of(mesh: &TriangleMesh) -> [Point3<f64>; 8] {
    let mut low = Vector3::repeat(f64::INFINITY);
    let mut high = Vector3::repeat(f64::NEG_INFINITY);
    for vertex in &mesh.vertices_m {
        low = low.inf(&vertex.coords);
        high = high.sup(&vertex.coords);
    }
    corners(&low, &high)
}

fn corners(low: &Vector3<f64>, high: &Vector3<f64>) -> [Point3<f64>; 8] {
    std::array::from_fn(|k| {
        Point3::from(Vector3::from_fn(|axis, _| {
            if (k >> axis) & 1 == 0 {
                low[axis]
            } else {
                high[axis]
            }
        }))
    })
}
