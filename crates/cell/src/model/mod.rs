//! The resolved cell: robot, tool and everything that can be hit.

use std::collections::BTreeMap;
use std::f64::consts::{PI, TAU};
use std::sync::Arc;

use nalgebra::{Point3, Vector3};
use needlebench_geometry::{ConvexMesh, Shape, Solid, TriangleMesh, Visual};
use needlebench_kinematics::{
    Body, Chain, Dynamics, JOINT_COUNT, JointLimits, Joints, Pose, UrGeometry, UrModel,
    base_from_base_link,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

mod arm_in_use;
mod pairs;

use crate::arm::SAME_ARM_M;
use crate::files::ModelSource;
pub use arm_in_use::{ArmInUse, ArmReport};
pub use pairs::{LeftOut, PairRule, pair_rule, place_in_chain};

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

/// A link of the URDF that a body of the arm was made of.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LinkMember {
    /// Name in the URDF, e.g. `forearm_link`.
    pub name: String,
    /// The body: 0 for the base, 1 to 6 for the moving links.
    pub owner: usize,
    /// Whether it has collision geometry.
    pub has_geometry: bool,
    /// Whether it has surfaces for pictures.
    pub is_drawn: bool,
    /// Whether it is the base or a moving link itself, and not bolted to one.
    pub is_links_own: bool,
}

/// Beginning of the note on parts that have no shape because the scenario says so.
pub const WITHOUT_SHAPE: &str = "without a shape, as the scenario says: ";

/// A part of arm or tool that has no collision shape though it is there: nothing is known of its clearance.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct UnseenPart {
    /// A link's label, or the name of a link in a URDF.
    pub name: String,
    /// The body that it belongs to: 0 for the base, 1 to 6 for the moving links; none for the tool.
    pub owner: Option<usize>,
}

/// A calibration that a robot's chain was made from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct AppliedCalibration {
    /// Its hash, if the file has one.
    pub hash: Option<String>,
    /// The file.
    pub source: ModelSource,
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
    /// Links of the URDF and what they became part of, in the file's order.
    pub members: Vec<LinkMember>,
    /// Parts that have no collision shape, and of which nobody says that they need none.
    pub unseen: Vec<UnseenPart>,
    /// Mass properties of the moving links, without the tool.
    pub bodies: [Body; JOINT_COUNT],
    /// Limits of the joints.
    pub limits: JointLimits,
    /// The arm whose data the robot has, if its lengths are known or somebody named it.
    pub arm: Option<ArmInUse>,
    /// The URDF.
    pub source: ModelSource,
    /// The factory calibration whose joint origins replaced the URDF's, if one was given.
    pub calibration: Option<AppliedCalibration>,
    /// The URDF's collision meshes, each once.
    pub meshes: Vec<ModelSource>,
    /// What was assumed or replaced while the URDF was read; belongs in every report.
    pub notes: Vec<String>,
}

impl Robot {
    /// What the arm is called: the maker's name where its lengths are those of a known arm, else
    /// the URDF's.
    pub fn arm_name(&self) -> String {
        if let Some(used) = self.arm.as_ref().filter(|used| used.has_its_lengths()) {
            return used.arm.data.name.clone();
        }
        let known = UrGeometry::of_chain(&self.chain)
            .map(|geometry| UrModel::nearest(&geometry))
            .ok()
            .filter(|(_, deviation_m)| *deviation_m <= SAME_ARM_M);
        known.map_or_else(|| self.name.clone(), |(model, _)| model.name().to_owned())
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
    /// The URDF.
    pub source: ModelSource,
}

impl Tool {
    /// Length of the guide tube, m.
    pub fn guide_length_m(&self) -> f64 {
        (self.flange_from_guide_exit.translation.vector
            - self.flange_from_guide_entry.translation.vector)
            .norm()
    }
}

/// What a collision body is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum BodyKind {
    /// The arm's fixed link.
    Base,
    /// A moving link of the arm.
    Link,
    /// The tool, but for its guide tube.
    Tool,
    /// The guide tube.
    GuideTube,
    /// Volume behind the guide that needle and hand need; not a physical body.
    NeedleCorridor,
    /// The patient: the phantom's skin, head and arms.
    Phantom,
    /// CT table.
    Table,
    /// CT gantry.
    Gantry,
    /// The robot's mount.
    Mount,
    /// One of the scenario's obstacles.
    Obstacle,
    /// Somebody who stands in the room.
    Person,
}

/// What a collision body moves with.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Frame {
    /// Fixed; solids are given in the world.
    World,
    /// Moves with moving link 0..6; solids are given in that link's frame.
    Link(usize),
}

/// A rigid group of solids.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CollisionBody {
    /// Unique name: `upper_arm`, `tool`, `guide_tube`, `phantom`, `table` ...
    pub name: String,
    /// What it is.
    pub kind: BodyKind,
    /// What it moves with.
    pub frame: Frame,
    /// Its geometry in that frame.
    pub solids: Vec<Solid>,
}

/// Classes of clearance, as reports name them.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema,
)]
#[serde(rename_all = "snake_case")]
pub enum ClearanceClass {
    /// Moving links against the patient's skin, head and arms included.
    RobotPhantom,
    /// Links and tool against the table.
    RobotTable,
    /// Links and tool against the gantry.
    RobotGantry,
    /// Links and tool against the mount.
    RobotMount,
    /// Links and tool against the scenario's obstacles.
    RobotObstacle,
    /// Links and tool against the people in the room.
    RobotPerson,
    /// The arm and its tool against themselves.
    #[serde(rename = "self")]
    SelfCollision,
    /// The tool, without its guide tube, against the skin.
    ToolPhantom,
    /// The guide tube against the skin: the intended stand-off.
    GuideStandoff,
    /// The needle's and hand's volume behind the guide against everything it does not belong to.
    NeedleCorridor,
    /// The planned needle line against bone, vessel and organ.
    NeedleRoute,
}

impl ClearanceClass {
    /// All of them, in the order of reports; each at the index that it is cast to.
    pub const ALL: [Self; 11] = [
        Self::RobotPhantom,
        Self::RobotTable,
        Self::RobotGantry,
        Self::RobotMount,
        Self::RobotObstacle,
        Self::RobotPerson,
        Self::SelfCollision,
        Self::ToolPhantom,
        Self::GuideStandoff,
        Self::NeedleCorridor,
        Self::NeedleRoute,
    ];

    /// The class of a name.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|class| class.name() == name)
    }

    /// Name as in reports and scenario files.
    pub fn name(self) -> &'static str {
        match self {
            Self::RobotPhantom => "robot_phantom",
            Self::RobotTable => "robot_table",
            Self::RobotGantry => "robot_gantry",
            Self::RobotMount => "robot_mount",
            Self::RobotObstacle => "robot_obstacle",
            Self::RobotPerson => "robot_person",
            Self::SelfCollision => "self",
            Self::ToolPhantom => "tool_phantom",
            Self::GuideStandoff => "guide_standoff",
            Self::NeedleCorridor => "needle_corridor",
            Self::NeedleRoute => "needle_route",
        }
    }

    /// Whether touching in this class is a collision of physical bodies.
    pub fn is_physical(self) -> bool {
        !matches!(self, Self::NeedleCorridor | Self::NeedleRoute)
    }

    /// Whether nobody wants these bodies to come near each other: physical ones, but for the guide's
    /// intended stand-off from the skin.
    pub fn is_unwanted(self) -> bool {
        self.is_physical() && self != Self::GuideStandoff
    }

    /// Whether it is of arm and tool against what stands around them: what is called the clearance.
    pub fn is_surroundings(self) -> bool {
        self.is_unwanted() && self != Self::SelfCollision
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

/// Everything that the arm works among.
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
                    let names = unseen.entry(class).or_default();
                    if names.last() != Some(&part.name) {
                        names.push(part.name.clone());
                    }
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
        }
    }

    /// The arm with its tool as rigid bodies, for inverse dynamics.
    pub fn dynamics(&self) -> Dynamics {
        self.dynamics_under(&self.gravity_m_s2)
    }

    /// The same under another gravity, world axes, m/s^2: one that a controller believes in.
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
pub(crate) fn placed(solids: &[Solid], new_from_old: &Pose) -> Vec<Solid> {
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
    fn every_class_is_at_its_index_and_goes_by_its_name() {
        for (index, class) in ClearanceClass::ALL.into_iter().enumerate() {
            assert_eq!(class as usize, index);
            assert_eq!(ClearanceClass::named(class.name()), Some(class));
        }
    }

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
