//! Clearance along planned motions.

use std::sync::OnceLock;

use nalgebra::Point3;
use needlebench_cell::{BodyKind, Cell, ClearanceClass, Frame};
use needlebench_clearance::{ClassMinima, ClearanceModel, Nearby, PairClearance};
use needlebench_kinematics::trajectory::{JointTrajectory, Phase};
use needlebench_kinematics::{JOINT_COUNT, Joints};
use needlebench_scenario::scenario::PlanningSection;

use crate::limits::{ByClass, ClassLimits};

/// Checks motions of one cell.
#[derive(Debug)]
pub struct MotionChecker<'a> {
    pub(crate) model: &'a ClearanceModel,
    cell: &'a Cell,
    /// Radius about each joint's axis within which everything beyond the joint stays, m; found when a
    /// motion is checked.
    sweep_radius_m: OnceLock<Joints>,
    /// What clearances may be and ought to be.
    pub(crate) limits: ClassLimits,
    /// Motion of any point that may go unchecked, m.
    spacing_m: f64,
    /// Width of certificates that is aimed at, m.
    pub(crate) tolerance_m: f64,
}

/// A pair that comes too near during a motion.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Violation {
    pub phase: Phase,
    pub time_s: f64,
    pub pair: PairClearance,
    pub limit_m: f64,
}

/// Resolution of the times at which postures are looked at, s.
const GRID_S: f64 = 2e-3;

impl<'a> MotionChecker<'a> {
    /// Prepares the checker.
    pub fn new(
        cell: &'a Cell,
        model: &'a ClearanceModel,
        limits: ClassLimits,
        planning: &PlanningSection,
    ) -> Self {
        Self {
            model,
            cell,
            sweep_radius_m: OnceLock::new(),
            limits,
            spacing_m: planning.sample_spacing_mm * 1e-3,
            tolerance_m: planning.certificate_tolerance_mm * 1e-3,
        }
    }

    /// Least clearance that a class may have, m.
    pub(crate) fn limit_m(&self, class: ClearanceClass) -> f64 {
        self.limits.get(class).floor_m
    }

    /// Least clearances of a posture, and the pair that is deepest in collision, if any collides.
    pub(crate) fn posture(
        &self,
        q: &Joints,
        nearby: &mut Nearby,
    ) -> (ClassMinima, Option<PairClearance>) {
        let minima = self.model.minimum_per_class_near(q, nearby);
        let collision = self.worst(&minima);
        (minima, collision)
    }

    /// Whether no pair is closer than the limit of its class.
    pub(crate) fn is_free(
        &self,
        q: &Joints,
        nearby: &mut Nearby,
        limit_m: impl Fn(ClearanceClass) -> f64,
    ) -> bool {
        !self.model.is_below_near(q, nearby, limit_m)
    }

    /// Limits of a motion, m: of what is no body nothing is asked.
    fn motion_limit_m(&self, class: ClearanceClass) -> f64 {
        if class.is_physical() {
            self.limit_m(class)
        } else {
            f64::NEG_INFINITY
        }
    }

    /// The pair that is farthest below its limit, if any is.
    fn worst(&self, minima: &ClassMinima) -> Option<PairClearance> {
        minima
            .iter()
            .filter(|pair| pair.class.is_physical())
            .map(|pair| (pair, pair.separation.distance_m - self.limit_m(pair.class)))
            .filter(|(_, excess_m)| *excess_m < 0.0)
            .min_by(|a, b| a.1.total_cmp(&b.1))
            .map(|(pair, _)| *pair)
    }

    /// First collision along a trajectory.
    ///
    /// Postures are looked at so often that no point of the arm moves by more than the spacing
    /// from one to the next. Contact shallower than that may go unnoticed between two of them.
    pub(crate) fn first_collision(&self, trajectory: &JointTrajectory) -> Option<Violation> {
        let duration_s = trajectory.duration_s();
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "small, positive"
        )]
        let steps = (duration_s / GRID_S).ceil() as u32;
        let mut nearby = Nearby::default();
        let mut checked: Option<Joints> = None;
        let mut next = trajectory.sample(0.0).position;
        for k in 0..=steps {
            let time_s = (GRID_S * f64::from(k)).min(duration_s);
            let q = next;
            next = trajectory.sample(time_s + GRID_S).position;
            // Left out as long as the next posture is near enough to the last one looked at.
            let near =
                checked.is_some_and(|at| self.largest_displacement_m(&at, &next) < self.spacing_m);
            if near && k < steps {
                continue;
            }
            let below = self
                .model
                .below_near(&q, &mut nearby, |class| self.motion_limit_m(class));
            if let Some(found) = below {
                let pair = self
                    .worst(&self.model.minimum_per_class(&q))
                    .unwrap_or(found);
                return Some(Violation {
                    phase: trajectory.phase_at(time_s),
                    time_s,
                    pair,
                    limit_m: self.limit_m(pair.class),
                });
            }
            checked = Some(q);
        }
        None
    }

    /// Whether the joint-space line between two postures has the required clearances `least_m`, its first end not
    /// checked; and the number of postures that were checked. No point of the arm moves by more than the spacing from
    /// one of them to the next.
    pub(crate) fn keeps_straight(
        &self,
        from: &Joints,
        to: &Joints,
        least_m: &ByClass,
    ) -> (bool, u64) {
        let way_m = self.largest_displacement_m(from, to);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "small, positive"
        )]
        let steps = ((way_m / self.spacing_m).ceil() as u64).max(1);
        let mut checks = 0;
        let mut nearby = Nearby::default();
        // The end, the middle, the quarters ...: a blocked way shows early.
        let bits = u64::BITS - steps.leading_zeros();
        for k in 0..1_u64 << bits {
            let step = steps - (k.reverse_bits() >> (u64::BITS - bits)).min(steps);
            if step == 0 || (k.reverse_bits() >> (u64::BITS - bits)) >= steps {
                continue;
            }
            let q = from + (to - from) * (step as f64 / steps as f64);
            checks += 1;
            let least = |class: ClearanceClass| {
                if class.is_physical() {
                    least_m.get(class)
                } else {
                    f64::NEG_INFINITY
                }
            };
            if !self.is_free(&q, &mut nearby, least) {
                return (false, checks);
            }
        }
        (true, checks)
    }

    /// By how much a posture is below some clearances at most, m, not above 0 where it keeps all of them, and
    /// how much less that gets with each joint, m/rad. `None` where nothing is asked for.
    pub(crate) fn lack(&self, q: &Joints, least_m: &ByClass) -> Option<(f64, Joints)> {
        let nearest = self
            .model
            .least_excess(q, |class| match least_m.get(class) {
                least_m if class.is_physical() && least_m.is_finite() => least_m,
                _ => f64::NEG_INFINITY,
            })?;
        let separation = &nearest.separation;
        let robot = &self.cell.robot;
        let base_link_from_world = robot.world_from_base_link.inverse();
        // B gets away from A along the normal as its own joints move it, less as A's do.
        let normal = base_link_from_world.rotation * separation.normal.into_inner();
        let pair = &self.cell.pairs[nearest.pair];
        let response = |body: usize, point: &Point3<f64>| match self.cell.bodies[body].frame {
            Frame::World => Joints::zeros(),
            Frame::Link(link) => {
                let point = (base_link_from_world * point).coords;
                robot.chain.point_response(q, link, &point, &normal)
            }
        };
        let rate =
            response(pair.b, &separation.point_on_b) - response(pair.a, &separation.point_on_a);
        Some((least_m.get(nearest.class) - separation.distance_m, rate))
    }

    /// For each joint, a radius about its axis within which everything beyond the joint stays, m.
    pub(crate) fn sweep_radii_m(&self) -> &Joints {
        self.sweep_radius_m.get_or_init(|| sweep_radii(self.cell))
    }

    /// Bound on the way of any point of arm and tool between two postures, m.
    pub(crate) fn largest_displacement_m(&self, from: &Joints, to: &Joints) -> f64 {
        self.sweep_radii_m().dot(&(to - from).abs())
    }
}

/// For each joint, a radius about its origin that holds all geometry beyond it, whatever the
/// joints beyond it do: the distances from origin to origin, and each body's own radius.
fn sweep_radii(cell: &Cell) -> Joints {
    let mut own_radius_m = [0.0_f64; JOINT_COUNT];
    for body in &cell.bodies {
        // The needle corridor is no body that could hit anything.
        if let (Frame::Link(link), true) = (body.frame, body.kind != BodyKind::NeedleCorridor) {
            for solid in &body.solids {
                let radius_m = solid.parent_from_shape.translation.vector.norm()
                    + solid.shape.bounding_radius_m();
                own_radius_m[link] = own_radius_m[link].max(radius_m);
            }
        }
    }
    Joints::from_fn(|joint, _| {
        let mut travelled_m = 0.0;
        let mut radius_m = own_radius_m[joint];
        for (link, own_m) in own_radius_m.iter().enumerate().skip(joint + 1) {
            travelled_m += cell.robot.chain.joints[link]
                .parent_from_joint
                .translation
                .vector
                .norm();
            radius_m = radius_m.max(travelled_m + own_m);
        }
        radius_m
    })
}
