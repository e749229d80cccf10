//! What clearances and configurations are computed from, as a value and as bytes.

use nalgebra::Unit;
use needlebench_cell::scenario::{
    AttachedTo, MountKind, MountSection, PlanningSection, TableSection,
};
use needlebench_cell::{
    BodyKind, BodyPair, ClearanceClass, CollisionBody, Frame, ResolvedScenario, Roll,
};
use needlebench_geometry::encoding::{Encode, Reader};
use needlebench_kinematics::{
    Chain, ChainJoint, JOINT_COUNT, JointLimit, JointLimits, Joints, Pose,
};

/// Number of classes.
pub(crate) const CLASS_COUNT: usize = ClearanceClass::ALL.len();

/// What of a cell a page's arm meets. Names stay outside: bodies, solids and pairs go by their indices in
/// the cell.
#[derive(Debug, Clone, PartialEq)]
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
    /// What carries the robot, made anew where the base goes.
    pub mount: Option<MountSection>,
    /// The table, to which a mount may be clamped.
    pub table: Option<TableSection>,
    /// Where the guide is to be, by goal.
    pub goals: Vec<GoalPose>,
    /// What postures have to keep.
    pub limits: Limits,
}

/// A body, and how it goes where the base goes.
#[derive(Debug, Clone, PartialEq)]
pub struct SceneBody {
    /// The body.
    pub body: CollisionBody,
    /// How it goes along.
    pub tie: Tie,
}

/// How a body goes where the robot's base goes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Tie {
    /// It stands in the room, or moves with a link.
    None,
    /// It is bolted to the base.
    Base,
    /// It is made anew: `[mount]`.
    Mount,
}

/// Where the guide is to be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GoalPose {
    /// The guide's exit at roll 0.
    pub world_from_guide_exit: Pose,
    /// Roll about the needle.
    pub roll: Roll,
}

/// What a posture has to keep not to be rejected, and not to fail. By class, m; negative infinity where
/// nothing is asked.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// What is nearer is rejected.
    pub floor_m: [f64; CLASS_COUNT],
    /// What is nearer misses its criterion.
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
        let bodies = cell.bodies.iter().map(|body| SceneBody {
            tie: tie(body),
            body: body.clone(),
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

    /// As bytes, without names.
    pub fn encode(&self) -> Vec<u8> {
        let mut bytes = Vec::new();
        let out = &mut bytes;
        for joint in &self.chain.joints {
            joint.parent_from_joint.encode(out);
            joint.axis.into_inner().encode(out);
        }
        self.chain.wrist_3_from_flange.encode(out);
        self.world_from_base_link.encode(out);
        for limit in &self.joint_limits.0 {
            let JointLimit {
                lower_rad,
                upper_rad,
                velocity_rad_s,
                effort_nm,
            } = limit;
            put(out, &[*lower_rad, *upper_rad, *velocity_rad_s, *effort_nm]);
        }
        put(out, self.start.as_slice());
        self.flange_from_guide_exit.encode(out);
        self.bodies.len().encode(out);
        for SceneBody { body, tie } in &self.bodies {
            out.push(code(&KINDS, &body.kind));
            out.push(code(&TIES, tie));
            out.push(code(&frames(), &body.frame));
            body.solids.len().encode(out);
            for solid in &body.solids {
                solid.encode(out);
            }
        }
        self.pairs.len().encode(out);
        for pair in &self.pairs {
            pair.a.encode(out);
            pair.b.encode(out);
            out.push(code(&ClearanceClass::ALL, &pair.class));
        }
        encode_mount(self.mount.as_ref(), out);
        encode_table(self.table.as_ref(), out);
        self.goals.len().encode(out);
        for goal in &self.goals {
            goal.world_from_guide_exit.encode(out);
            // No angle is infinite.
            let roll_rad = match goal.roll {
                Roll::Free => f64::INFINITY,
                Roll::Fixed(roll_rad) => roll_rad,
            };
            roll_rad.encode(out);
        }
        put(out, &self.limits.floor_m);
        put(out, &self.limits.judged_m);
        put(out, &[self.limits.singularity_sine, self.limits.shoulder_m]);
        bytes
    }

    /// From the bytes of [`Scene::encode`]; names are empty. `None` for others.
    pub fn decode(bytes: &[u8]) -> Option<Self> {
        let mut reader = Reader(bytes);
        let from = &mut reader;
        let mut joints = Vec::with_capacity(JOINT_COUNT);
        for _ in 0..JOINT_COUNT {
            joints.push(ChainJoint {
                parent_from_joint: from.pose()?,
                axis: Unit::new_unchecked(from.vector()?),
            });
        }
        let chain = Chain {
            joints: joints.try_into().ok()?,
            wrist_3_from_flange: from.pose()?,
        };
        let world_from_base_link = from.pose()?;
        let mut limits = Vec::with_capacity(JOINT_COUNT);
        for _ in 0..JOINT_COUNT {
            let [lower_rad, upper_rad, velocity_rad_s, effort_nm] = take(from)?;
            limits.push(JointLimit {
                lower_rad,
                upper_rad,
                velocity_rad_s,
                effort_nm,
            });
        }
        let scene = Self {
            chain,
            world_from_base_link,
            joint_limits: JointLimits(limits.try_into().ok()?),
            start: Joints::from(take::<JOINT_COUNT>(from)?),
            flange_from_guide_exit: from.pose()?,
            bodies: list(from, body)?,
            pairs: list(from, |from| {
                Some(BodyPair {
                    a: from.count()?,
                    b: from.count()?,
                    class: of_code(&ClearanceClass::ALL, from.byte()?)?,
                })
            })?,
            mount: mount(from)?,
            table: table(from)?,
            goals: list(from, |from| {
                let world_from_guide_exit = from.pose()?;
                let roll_rad = from.number()?;
                let roll = if roll_rad.is_finite() {
                    Roll::Fixed(roll_rad)
                } else {
                    Roll::Free
                };
                Some(GoalPose {
                    world_from_guide_exit,
                    roll,
                })
            })?,
            limits: Limits {
                floor_m: take(from)?,
                judged_m: take(from)?,
                singularity_sine: from.number()?,
                shoulder_m: from.number()?,
            },
        };
        reader.0.is_empty().then_some(scene)
    }
}

const KINDS: [BodyKind; 10] = [
    BodyKind::Base,
    BodyKind::Link,
    BodyKind::Tool,
    BodyKind::GuideTube,
    BodyKind::NeedleCorridor,
    BodyKind::Phantom,
    BodyKind::Table,
    BodyKind::Gantry,
    BodyKind::Mount,
    BodyKind::Obstacle,
];
const TIES: [Tie; 3] = [Tie::None, Tie::Base, Tie::Mount];
const MOUNTS: [MountKind; 5] = [
    MountKind::Column,
    MountKind::Wedge,
    MountKind::TableRail,
    MountKind::Wall,
    MountKind::Ceiling,
];

/// The world, and the links.
fn frames() -> [Frame; JOINT_COUNT + 1] {
    std::array::from_fn(|place| match place {
        0 => Frame::World,
        link => Frame::Link(link - 1),
    })
}

fn code<T: PartialEq>(all: &[T], one: &T) -> u8 {
    let place = all.iter().position(|each| each == one);
    let place = place.expect("the lists above are complete");
    u8::try_from(place).expect("they are short")
}

fn of_code<T: Copy>(all: &[T], code: u8) -> Option<T> {
    all.get(usize::from(code)).copied()
}

fn put(bytes: &mut Vec<u8>, numbers: &[f64]) {
    for number in numbers {
        number.encode(bytes);
    }
}

fn take<const N: usize>(from: &mut Reader<'_>) -> Option<[f64; N]> {
    let mut numbers = [0.0; N];
    for number in &mut numbers {
        *number = from.number()?;
    }
    Some(numbers)
}

/// A count, and so many things.
fn list<'a, T>(
    from: &mut Reader<'a>,
    read: impl FnMut(&mut Reader<'a>) -> Option<T>,
) -> Option<Vec<T>> {
    let count = from.count()?;
    from.list(count, 1, read)
}

fn body(from: &mut Reader<'_>) -> Option<SceneBody> {
    let kind = of_code(&KINDS, from.byte()?)?;
    let tie = of_code(&TIES, from.byte()?)?;
    let frame = of_code(&frames(), from.byte()?)?;
    let solids = list(from, Reader::solid)?;
    Some(SceneBody {
        tie,
        body: CollisionBody {
            name: String::new(),
            kind,
            frame,
            solids,
        },
    })
}

fn encode_mount(section: Option<&MountSection>, bytes: &mut Vec<u8>) {
    bytes.push(u8::from(section.is_some()));
    let Some(section) = section else { return };
    let MountSection {
        kind,
        width_mm,
        depth_mm,
        plate_width_mm,
        plate_thickness_mm,
        column_offset_mm: [x_mm, y_mm],
        arm_thickness_mm,
        wedge_height_mm,
        bracket_mm,
        ceiling_height_mm,
        surface_mm,
        rail_length_mm,
    } = section;
    bytes.push(code(&MOUNTS, kind));
    let numbers = [
        width_mm,
        depth_mm,
        plate_width_mm,
        plate_thickness_mm,
        x_mm,
        y_mm,
        arm_thickness_mm,
        wedge_height_mm,
        bracket_mm,
        ceiling_height_mm,
        surface_mm,
        rail_length_mm,
    ];
    put(bytes, &numbers.map(|number| *number));
}

/// The outer `None` for bytes that are none of these.
#[expect(clippy::option_option, reason = "bytes that end, and no mount")]
fn mount(from: &mut Reader<'_>) -> Option<Option<MountSection>> {
    if from.byte()? == 0 {
        return Some(None);
    }
    let kind = of_code(&MOUNTS, from.byte()?)?;
    let numbers: [f64; 12] = take(from)?;
    let [
        width_mm,
        depth_mm,
        plate_width_mm,
        plate_thickness_mm,
        x_mm,
        y_mm,
        arm_thickness_mm,
        wedge_height_mm,
        bracket_mm,
        ceiling_height_mm,
        surface_mm,
        rail_length_mm,
    ] = numbers;
    Some(Some(MountSection {
        kind,
        width_mm,
        depth_mm,
        plate_width_mm,
        plate_thickness_mm,
        column_offset_mm: [x_mm, y_mm],
        arm_thickness_mm,
        wedge_height_mm,
        bracket_mm,
        ceiling_height_mm,
        surface_mm,
        rail_length_mm,
    }))
}

fn encode_table(section: Option<&TableSection>, bytes: &mut Vec<u8>) {
    bytes.push(u8::from(section.is_some()));
    let Some(section) = section else { return };
    let TableSection {
        width_mm,
        length_mm,
        thickness_mm,
        top_height_mm,
        center_mm: [x_mm, y_mm],
        yaw_deg,
    } = section;
    let numbers = [
        width_mm,
        length_mm,
        thickness_mm,
        top_height_mm,
        x_mm,
        y_mm,
        yaw_deg,
    ];
    put(bytes, &numbers.map(|number| *number));
}

#[expect(clippy::option_option, reason = "bytes that end, and no table")]
fn table(from: &mut Reader<'_>) -> Option<Option<TableSection>> {
    if from.byte()? == 0 {
        return Some(None);
    }
    let numbers: [f64; 7] = take(from)?;
    let [
        width_mm,
        length_mm,
        thickness_mm,
        top_height_mm,
        x_mm,
        y_mm,
        yaw_deg,
    ] = numbers;
    Some(Some(TableSection {
        width_mm,
        length_mm,
        thickness_mm,
        top_height_mm,
        center_mm: [x_mm, y_mm],
        yaw_deg,
    }))
}
