//! What is decided about contacts inside a rapier step.

use needlebench_kinematics::JOINT_COUNT;
use rapier3d_f64::dynamics::{RigidBodyHandle, RigidBodySet};
use rapier3d_f64::math::Vector;
use rapier3d_f64::pipeline::{ContactModificationContext, PhysicsHooks};

use crate::convert::UNITS_PER_M;

/// Contacts with a shorter lever about every joint are not solved, m.
///
/// 1 kN there is 1 N m at the joint, and the recovery speed turns the joint at no more than
/// 100 rad/s.
const SHORTEST_LEVER_M: f64 = 1e-3;

/// Leaves contacts that no joint can answer out of the solver.
///
/// An example is a contact on the shoulder's barrel, whose normals all meet its axis.
/// rapier solves a contact with the inverse of its mobility `J M^-1 J'`. Where the force line meets
/// every joint's axis that is the inverse of rounding errors, and one step throws the arm away
/// (impulses of 1e20 N s were seen). Such contacts are still reported, without a force.
pub(super) struct Hooks {
    /// The moving links in order.
    pub links: [RigidBodyHandle; JOINT_COUNT],
    /// Axis of each link's joint in the link's frame; the joint is at the frame's origin.
    pub axes: [Vector; JOINT_COUNT],
}

impl Hooks {
    fn link_index(&self, body: Option<RigidBodyHandle>) -> Option<usize> {
        self.links.iter().position(|&link| Some(link) == body)
    }

    /// Longest lever, about any joint that carries `body`, of a force along `normal` at `point`.
    fn lever_m(
        &self,
        bodies: &RigidBodySet,
        body: Option<RigidBodyHandle>,
        point: Vector,
        normal: Vector,
    ) -> f64 {
        let Some(last) = self.link_index(body) else {
            return 0.0;
        };
        (0..=last)
            .map(|i| {
                let pose = bodies[self.links[i]].position();
                let axis = pose.rotation * self.axes[i];
                axis.dot((point - pose.translation).cross(normal)).abs()
            })
            .fold(0.0, f64::max)
            / UNITS_PER_M
    }
}

impl PhysicsHooks for Hooks {
    fn modify_solver_contacts(&self, context: &mut ContactModificationContext<'_>) {
        let (bodies, body1, body2) = (context.bodies, context.rigid_body1, context.rigid_body2);
        let Some(manifold) = context.rigid_mut() else {
            return;
        };
        let normal = *manifold.normal;
        // In this hook the anchor is a point in the world.
        manifold.solver_contacts.retain(|contact| {
            let point = contact.anchor1;
            let lever_m = self
                .lever_m(bodies, body1, point, normal)
                .max(self.lever_m(bodies, body2, point, normal));
            lever_m >= SHORTEST_LEVER_M
        });
    }
}
