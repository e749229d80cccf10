//! Input of clearances and configurations, as a value and as bytes.

use needlebench_cell::{BodyKind, BodyPair, ClearanceClass, CollisionBody};
use needlebench_geometry::Solid;
use needlebench_geometry::encoding::{decode, encode};
use needlebench_kinematics::{Chain, JointLimits, Joints, Pose};
use needlebench_scenario::scenario::{AttachedTo, MountSection, PlanningSection, TableSection};
use needlebench_scenario::{ResolvedScenario, Roll};
use serde::{Deserialize, Serialize};

/// Number of classes.
pub(crate) const CLASS_COUNT: usize = ClearanceClass::ALL.len();

/// The parts of a cell that clearances depend on. Names stay outside: bodies, solids and pairs go by their indices in
/// the cell.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Scene {
    /// Joints from `base_link` to the flange.
    pub chain: Chain,
    /// Pose of `base_link` in the world.
    pub world_from_base_link: Pose,
    /// Limits of the joints.
    pub joint_limits: JointLimits,
    /// Joint positions that the motion starts from, rad.
    pub start: Joints,
    /// Where the needle leaves the guide.
    pub flange_from_guide_exit: Pose,
    /// All bodies.
    pub bodies: Vec<SceneBody>,
    /// Pairs whose distance is measured.
    pub pairs: Vec<BodyPair>,
    /// What carries the robot, generated for each base placement.
    pub mount: Option<MountSection>,
    /// The table, to which a mount may be clamped.
    pub table: Option<TableSection>,
    /// Required pose of the guide, by goal.
    pub goals: Vec<GoalPose>,
    /// Limits of postures.
    pub limits: Limits,
}

/// A body, and how it moves with the base.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SceneBody {
    /// The body.
    pub body: CollisionBody,
    /// How it moves.
    pub tie: Tie,
}

/// How a body moves with the robot's base.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Tie {
    /// It is fixed in the room, or moves with a link.
    None,
    /// It is bolted to the base.
    Base,
    /// It is generated for the base placement: `[mount]`.
    Mount,
}

/// Required pose of the guide.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct GoalPose {
    /// The guide's exit at roll 0.
    pub world_from_guide_exit: Pose,
    /// Roll about the needle.
    pub roll: Roll,
}

/// Limits below which a posture is rejected, and below which a criterion fails. By class, m; negative infinity
/// for none.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Limits {
    /// Clearances below are rejected.
    pub floor_m: [f64; CLASS_COUNT],
    /// Clearances below fail the criterion.
    pub judged_m: [f64; CLASS_COUNT],
    /// Least `|sin q5|` and `|sin q3|`.
    pub singularity_sine: f64,
    /// Least distance from the shoulder's singularity, m.
    pub shoulder_m: f64,
}

impl Limits {
    /// Those of a scenario; clearances by class.
    pub fn new(
        planning: &PlanningSection,
        floor_m: [f64; CLASS_COUNT],
        judged_m: [f64; CLASS_COUNT],
    ) -> Self {
        Self {
            floor_m,
            judged_m,
            singularity_sine: planning.min_singularity_sine,
            shoulder_m: planning.min_shoulder_distance_mm * 1e-3,
        }
    }
}

impl Scene {
    /// That of a scenario.
    pub fn of(resolved: &ResolvedScenario, limits: Limits) -> Self {
        let cell = &resolved.cell;
        let scenario = &resolved.scenario;
        let tie = |body: &CollisionBody| {
            let obstacle = scenario.obstacles.iter().find(|it| it.name == body.name);
            match (body.kind, obstacle) {
                (BodyKind::Base, _) => Tie::Base,
                (_, Some(it)) if it.attached_to == AttachedTo::RobotBase => Tie::Base,
                (BodyKind::Mount, None) => Tie::Mount,
                _ => Tie::None,
            }
        };
        let bodies = cell.bodies.iter().map(|body| {
            let solids = body.solids.iter().map(|solid| Solid {
                name: String::new(),
                ..solid.clone()
            });
            SceneBody {
                tie: tie(body),
                body: CollisionBody {
                    name: String::new(),
                    solids: solids.collect(),
                    ..*body
                },
            }
        });
        let goals = resolved.goals.iter().map(|goal| GoalPose {
            world_from_guide_exit: goal.world_from_guide_exit,
            roll: goal.roll,
        });
        Self {
            chain: cell.robot.chain,
            world_from_base_link: cell.robot.world_from_base_link,
            joint_limits: cell.robot.limits,
            start: resolved.start,
            flange_from_guide_exit: cell.tool.flange_from_guide_exit,
            bodies: bodies.collect(),
            pairs: cell.pairs.clone(),
            mount: scenario.mount.clone(),
            table: scenario.table.clone(),
            goals: goals.collect(),
            limits,
        }
    }

    /// As bytes.
    pub fn encode(&self) -> Vec<u8> {
        encode(self)
    }

    /// From the bytes of [`Scene::encode`]; `None` for others.
    pub fn decode(bytes: &[u8]) -> Option<Self> {
        decode(bytes)
    }
}
