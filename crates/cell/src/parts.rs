//! The resolved cell: robot, tool and everything that can be hit.

use std::collections::BTreeMap;
use std::f64::consts::{PI, TAU};
use std::sync::Arc;

use nalgebra::{Point3, Vector3};
use needlebench_geometry::{ConvexMesh, Shape, Solid, TriangleMesh, Visual};
use needlebench_kinematics::{
    Body, Chain, Dynamics, JOINT_COUNT, JointLimits, Joints, Pose, base_from_base_link,
};
use serde::{Deserialize, Serialize};

use crate::bodies::{BodyKind, ClearanceClass, CollisionBody, Frame};
use crate::pairs::{PairRule, pair_rule};

/// A link of the arm: geometry in the link's own frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Link {
    /// Short name as reports print it: `base`, `shoulder`, `upper_arm`, `forearm`, `wrist_1` ...
    pub name: String,
    /// Collision geometry.
    pub solids: Vec<Solid>,
    /// Surfaces for pictures.
    pub visuals: Vec<Visual>,
}

/// A part of arm or tool without collision shape: its clearance is not evaluated.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct UnseenPart {
    /// A link's label, or the name of a link in a URDF.
    pub name: String,
    /// The body that it belongs to: 0 for the base, 1 to 6 for the moving links; none for the tool.
    pub owner: Option<usize>,
}

/// The arm, placed in the world.
#[derive(Debug, Clone, PartialEq)]
pub struct Robot {
    /// Name from the URDF.
    pub name: String,
    /// Pose of ROS's `base_link` in the world.
    pub world_from_base_link: Pose,
    /// Joints from `base_link` to the flange (`tool0`).
    pub chain: Chain,
    /// The fixed link (geometry in `base_link`).
    pub base: Link,
    /// The six moving links.
    pub links: [Link; JOINT_COUNT],
    /// Parts without a collision shape that the scenario does not exempt.
    pub unseen: Vec<UnseenPart>,
    /// Mass properties of the moving links, without the tool.
    pub bodies: [Body; JOINT_COUNT],
    /// Limits of the joints.
    pub limits: JointLimits,
}

impl Robot {
    /// Base and moving links.
    pub fn all_links(&self) -> impl Iterator<Item = &Link> {
        std::iter::once(&self.base).chain(&self.links)
    }

    /// Controller's base frame in `base_link`: turned by 180 degrees about z.
    pub fn base_link_from_base() -> Pose {
        // Half a turn is its own inverse.
        base_from_base_link()
    }

    /// Controller's base frame in the world.
    pub fn world_from_base(&self) -> Pose {
        self.world_from_base_link * Self::base_link_from_base()
    }

    /// Poses of the six moving links in the world.
    pub fn world_from_links(&self, q: &Joints) -> [Pose; JOINT_COUNT] {
        self.chain
            .link_poses(q)
            .map(|pose| self.world_from_base_link * pose)
    }

    /// Pose of the flange in the world.
    pub fn world_from_flange(&self, q: &Joints) -> Pose {
        self.world_from_base_link * self.chain.base_link_from_flange(q)
    }
}

/// The needle that the guide is made for.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Needle {
    /// Gauge number.
    pub gauge: u32,
    /// Outer diameter, m.
    pub outer_diameter_m: f64,
    /// Length of the cannula from hub to tip, m.
    pub length_m: f64,
}

/// A needle guide, in the frame of the flange.
///
/// The z axes of `guide_entry`, `guide_exit` and `needle_tip` point along the insertion.
#[derive(Debug, Clone, PartialEq)]
pub struct Tool {
    /// Name of the tool, e.g. `offset`.
    pub name: String,
    /// Collision geometry of everything but the guide tube.
    pub solids: Vec<Solid>,
    /// Collision geometry of the guide tube, whose gap to the skin is intended.
    pub guide_solids: Vec<Solid>,
    /// Links that are drawn or have mass, and no collision shape.
    pub unseen: Vec<UnseenPart>,
    /// Surfaces for pictures.
    pub visuals: Vec<Visual>,
    /// Mass properties of the whole tool.
    pub body: Body,
    /// Where the needle enters the guide.
    pub flange_from_guide_entry: Pose,
    /// Where the needle leaves the guide.
    pub flange_from_guide_exit: Pose,
    /// Diameter of the bore, m.
    pub bore_m: f64,
    /// The needle.
    pub needle: Needle,
}

impl Tool {
    /// Length of the guide tube, m.
    pub fn guide_length_m(&self) -> f64 {
        (self.flange_from_guide_exit.translation.vector
            - self.flange_from_guide_entry.translation.vector)
            .norm()
    }
}

/// Two bodies of which the distance matters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct BodyPair {
    /// Index into [`Cell::bodies`]; always a moving body.
    pub a: usize,
    /// Index into [`Cell::bodies`].
    pub b: usize,
    /// Class that the pair counts for.
    pub class: ClearanceClass,
}

/// Everything around the arm.
#[derive(Debug, Clone, PartialEq)]
pub struct Cell {
    /// The arm.
    pub robot: Robot,
    /// Its tool.
    pub tool: Tool,
    /// Acceleration of gravity in the world, m/s^2.
    pub gravity_m_s2: Vector3<f64>,
    /// Reflected rotor inertia per joint, kg m^2.
    pub armature_kgm2: Joints,
    /// All collision bodies: base, links, tool, guide tube, corridor, then the surroundings.
    pub bodies: Vec<CollisionBody>,
    /// The pairs that are checked; adjacent links and what is bolted together are left out.
    pub pairs: Vec<BodyPair>,
    /// Classes of which not all bodies have a shape, and the parts that have none: nothing is known of the least
    /// clearance there.
    pub unseen: BTreeMap<ClearanceClass, Vec<String>>,
    /// Where the patient's body may go on behind the cuts of its scan, world; empty where nothing is cut. No body:
    /// clearances from the patient are evaluated only where it is farther.
    pub behind_cuts: Vec<Solid>,
}

/// Volume behind the guide entry that has to stay free: a cylinder about the guide axis, and a cone
/// about it that widens from the guide entry.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NeedleCorridor {
    /// Radius, m.
    pub radius_m: f64,
    /// Length behind the guide entry, m.
    pub length_m: f64,
    /// Half-angle of the cone that the hand needs, rad; 0 for no cone. Its apex is the guide entry
    /// and it is as long as the cylinder.
    pub hand_cone_half_angle_rad: f64,
}

/// Sides of the pyramid that stands for the hand cone. It is circumscribed, so wider than the cone
/// by `1 / cos(pi / 32)` at its corners, which is 0.5 %: a clearance from it is never optimistic.
const HAND_CONE_SIDES: u32 = 32;

impl NeedleCorridor {
    /// The solids in the frame of the guide entry, whose z points along the insertion.
    fn solids(&self) -> Vec<Solid> {
        let mut solids = vec![Solid {
            name: "needle_corridor".into(),
            shape: Shape::Cylinder {
                radius_m: self.radius_m,
                half_length_m: 0.5 * self.length_m,
            },
            parent_from_shape: Pose::translation(0.0, 0.0, -0.5 * self.length_m),
        }];
        if self.hand_cone_half_angle_rad > 0.0 {
            solids.push(Solid {
                name: "hand_cone".into(),
                shape: Shape::Convex(Arc::new(self.hand_cone())),
                parent_from_shape: Pose::identity(),
            });
        }
        solids
    }

    fn hand_cone(&self) -> ConvexMesh {
        let corner_radius_m = self.length_m * libm::tan(self.hand_cone_half_angle_rad)
            / libm::cos(PI / f64::from(HAND_CONE_SIDES));
        let mut vertices_m = vec![Point3::origin()];
        vertices_m.extend((0..HAND_CONE_SIDES).map(|side| {
            let (sine, cosine) = libm::sincos(TAU * f64::from(side) / f64::from(HAND_CONE_SIDES));
            Point3::new(
                corner_radius_m * cosine,
                corner_radius_m * sine,
                -self.length_m,
            )
        }));
        // Vertex 0 is the apex; the base is a fan about vertex 1.
        let mut triangles: Vec<[u32; 3]> = (0..HAND_CONE_SIDES)
            .map(|side| [0, 1 + side, 1 + (side + 1) % HAND_CONE_SIDES])
            .collect();
        triangles.extend((2..HAND_CONE_SIDES).map(|side| [1, 1 + side, side]));
        ConvexMesh(TriangleMesh {
            vertices_m,
            triangles,
        })
    }
}

impl Cell {
    /// Puts robot, tool and surroundings together and derives the pairs to check.
    pub fn assemble(
        robot: Robot,
        tool: Tool,
        corridor: NeedleCorridor,
        surroundings: Vec<CollisionBody>,
        armature_kgm2: Joints,
        gravity_m_s2: Vector3<f64>,
    ) -> Self {
        let mut bodies = vec![CollisionBody {
            name: robot.base.name.clone(),
            kind: BodyKind::Base,
            frame: Frame::World,
            solids: placed(&robot.base.solids, &robot.world_from_base_link),
        }];
        for (i, link) in robot.links.iter().enumerate() {
            bodies.push(CollisionBody {
                name: link.name.clone(),
                kind: BodyKind::Link,
                frame: Frame::Link(i),
                solids: link.solids.clone(),
            });
        }
        let wrist_3 = Frame::Link(JOINT_COUNT - 1);
        let flange = &robot.chain.wrist_3_from_flange;
        bodies.push(CollisionBody {
            name: "tool".into(),
            kind: BodyKind::Tool,
            frame: wrist_3,
            solids: placed(&tool.solids, flange),
        });
        bodies.push(CollisionBody {
            name: "guide_tube".into(),
            kind: BodyKind::GuideTube,
            frame: wrist_3,
            solids: placed(&tool.guide_solids, flange),
        });
        bodies.push(CollisionBody {
            name: "needle_corridor".into(),
            kind: BodyKind::NeedleCorridor,
            frame: wrist_3,
            solids: placed(&corridor.solids(), &(flange * tool.flange_from_guide_entry)),
        });
        bodies.extend(surroundings);
        bodies.retain(|body| !body.solids.is_empty());

        let mut unseen: BTreeMap<ClearanceClass, Vec<String>> = BTreeMap::new();
        for part in robot.unseen.iter().chain(&tool.unseen) {
            let (kind, frame) = match part.owner {
                Some(0) => (BodyKind::Base, Frame::World),
                Some(link) => (BodyKind::Link, Frame::Link(link - 1)),
                None => (BodyKind::Tool, wrist_3),
            };
            let body = CollisionBody {
                name: part.name.clone(),
                kind,
                frame,
                solids: Vec::new(),
            };
            for other in &bodies {
                if let PairRule::Measured(class) = pair_rule(&body, other) {
                    unseen.entry(class).or_default().push(part.name.clone());
                }
            }
        }
        for names in unseen.values_mut() {
            names.dedup();
        }

        let mut pairs = Vec::new();
        for a in 0..bodies.len() {
            for b in a + 1..bodies.len() {
                if let PairRule::Measured(class) = pair_rule(&bodies[a], &bodies[b]) {
                    // The moving body first; both move for `self` pairs and the corridor's.
                    let (a, b) = if bodies[a].frame == Frame::World {
                        (b, a)
                    } else {
                        (a, b)
                    };
                    pairs.push(BodyPair { a, b, class });
                }
            }
        }
        Self {
            robot,
            tool,
            gravity_m_s2,
            armature_kgm2,
            bodies,
            pairs,
            unseen,
            behind_cuts: Vec::new(),
        }
    }

    /// The same, of a patient whose body may go on there; world.
    #[must_use]
    pub fn with_behind_cuts(self, behind_cuts: Vec<Solid>) -> Self {
        Self {
            behind_cuts,
            ..self
        }
    }

    /// The arm with its tool as rigid bodies, for inverse dynamics.
    pub fn dynamics(&self) -> Dynamics {
        self.dynamics_under(&self.gravity_m_s2)
    }

    /// The same under another gravity, world axes, m/s^2, such as the controller's.
    pub fn dynamics_under(&self, gravity_m_s2: &Vector3<f64>) -> Dynamics {
        let mut bodies = self.robot.bodies;
        let tool_in_link = self
            .tool
            .body
            .transformed(&self.robot.chain.wrist_3_from_flange);
        bodies[JOINT_COUNT - 1] = bodies[JOINT_COUNT - 1].combined_with(&tool_in_link);
        Dynamics {
            chain: self.robot.chain,
            bodies,
            armature_kgm2: self.armature_kgm2,
            gravity_m_s2: self.robot.world_from_base_link.rotation.inverse() * gravity_m_s2,
        }
    }

    /// Pose of the guide's exit in the world; z along the insertion.
    pub fn world_from_guide_exit(&self, q: &Joints) -> Pose {
        self.robot.world_from_flange(q) * self.tool.flange_from_guide_exit
    }

    /// World poses of all [`Cell::bodies`] at joint positions `q`.
    pub fn world_from_bodies(&self, q: &Joints) -> Vec<Pose> {
        let links = self.robot.world_from_links(q);
        self.bodies
            .iter()
            .map(|body| match body.frame {
                Frame::World => Pose::identity(),
                Frame::Link(i) => links[i],
            })
            .collect()
    }
}

/// Solids in another frame.
pub fn placed(solids: &[Solid], new_from_old: &Pose) -> Vec<Solid> {
    solids
        .iter()
        .map(|solid| Solid {
            parent_from_shape: new_from_old * solid.parent_from_shape,
            ..solid.clone()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_hand_cone_is_closed_convex_and_contains_the_cone() {
        let corridor = NeedleCorridor {
            radius_m: 0.02,
            length_m: 0.15,
            hand_cone_half_angle_rad: 0.3,
        };
        let ConvexMesh(mesh) = corridor.hand_cone();
        let radius_m = 0.15 * libm::tan(0.3_f64);
        // The circumscribed polygon's area over the circle's.
        let turn = PI / f64::from(HAND_CONE_SIDES);
        let volume_m3 = PI * radius_m.powi(2) * 0.15 / 3.0 * libm::tan(turn) / turn;
        let measured_m3: f64 = mesh
            .triangles
            .iter()
            .map(|triangle| {
                let [a, b, c] = triangle.map(|i| mesh.vertices_m[i as usize].coords);
                a.dot(&b.cross(&c)) / 6.0
            })
            .sum();
        assert!((measured_m3 - volume_m3).abs() < 1e-12);
        for triangle in &mesh.triangles {
            let [a, b, c] = triangle.map(|i| mesh.vertices_m[i as usize]);
            let outwards = (b - a).cross(&(c - a));
            for vertex in &mesh.vertices_m {
                assert!(outwards.dot(&(vertex - a)) < 1e-12);
            }
        }
        for k in 0..1000 {
            let angle = TAU * f64::from(k) / 1000.0;
            let rim = Point3::new(
                radius_m * libm::cos(angle),
                radius_m * libm::sin(angle),
                -0.15,
            );
            for triangle in &mesh.triangles {
                let [a, b, c] = triangle.map(|i| mesh.vertices_m[i as usize]);
                assert!((b - a).cross(&(c - a)).dot(&(rim - a)) < 1e-12);
            }
        }
    }
}
