//! The motions of the ISO 9283 protocol: poses to postures, postures to one cycle.

use nalgebra::{UnitVector3, Vector3};
use needlebench_cell::{Cell, Robot};
use needlebench_clearance::ClearanceModel;
use needlebench_kinematics::ik::{Kinematics, SolutionKind, nearest_within_limits};
use needlebench_kinematics::trajectory::{
    JointPath, JointTrajectory, LineError, MotionLimits, Phase, ProfileLimits,
};
use needlebench_kinematics::{JOINT_LABELS, Joints, NotUrGeometry, Pose};
use needlebench_scenario::ResolvedScenario;
use needlebench_scenario::iso9283::{DIRECTIONAL_POSES, Iso9283Protocol, POSE_COUNT, Stop};
use std::borrow::Cow;

use crate::limits::ClassLimits;
use crate::motion::MotionChecker;
use crate::rejection::distance_in_words;

/// The order of the standard: from P1 to P5, P4, P3, P2 and back to P1; indices from 0.
const ORDER: [usize; POSE_COUNT] = [4, 3, 2, 1, 0];

/// One cycle, as it is repeated.
#[derive(Debug, Clone, PartialEq)]
pub struct Cycle {
    /// The motion, from P1 at rest to rest.
    pub trajectory: JointTrajectory,
    /// Where it stops, in the order of time.
    pub stops: Vec<Stop>,
}

/// The protocol as motions.
#[derive(Debug, Clone, PartialEq)]
pub struct ProtocolPlan {
    /// Joint positions at P1 to P5, rad.
    pub joints: [Joints; POSE_COUNT],
    /// The sequence of poses: P5, P4, P3, P2, P1.
    pub cycle: Cycle,
    /// P1, P2 and P4, each from three directions; none if the test is left out.
    pub directional: Option<Cycle>,
}

/// Why a protocol cannot be carried out.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ProtocolError {
    /// The robot is no UR arm.
    #[error(transparent)]
    NotUr(#[from] NotUrGeometry),
    /// A pose that the configuration does not reach.
    #[error("P{pose} is out of reach in configuration {configuration}{others}")]
    Unreachable {
        /// Number of the pose, from 1.
        pose: usize,
        /// The configuration's label.
        configuration: &'static str,
        /// Which configurations reach it, in words.
        others: String,
    },
    /// A pose at which a joint has no place in its range.
    #[error("at P{pose} {joint} would be at {position_deg:.1} deg, outside its range")]
    JointLimit {
        /// Number of the pose, from 1.
        pose: usize,
        /// Label of the joint.
        joint: &'static str,
        /// Its position, deg.
        position_deg: f64,
    },
    /// A straight approach that does not exist.
    #[error("P{pose} cannot be approached along {axis}: {error}")]
    Approach {
        /// Number of the pose, from 1.
        pose: usize,
        /// `x`, `y` or `z`.
        axis: char,
        /// What is in the way.
        error: LineError,
    },
    /// A motion that collides.
    #[error(
        "on the way to P{pose}, {}, clearance {limit_mm:.1} mm required",
        distance_in_words(.a, .b, *.distance_mm)
    )]
    Collision {
        /// Number of the pose, from 1.
        pose: usize,
        /// One solid.
        a: String,
        /// The other one.
        b: String,
        /// Their distance, mm; negative inside.
        distance_mm: f64,
        /// Least distance that is allowed, mm.
        limit_mm: f64,
    },
}

impl ProtocolError {
    /// How the scenario can be mended.
    pub fn hint(&self) -> &'static str {
        match self {
            Self::NotUr(_) => "the protocol needs the closed-form inverse kinematics of a UR arm",
            Self::Unreachable { .. } => {
                "move the cube (`cube_centre_mm`), make it smaller (`cube_edge_mm`), or choose \
                 another `configuration` or `guide_axis`"
            }
            Self::JointLimit { .. } => "try another `roll_deg` or `configuration`",
            Self::Approach { .. } => "use a shorter `approach_mm`, or 0 to omit the test",
            Self::Collision { .. } => {
                "move the cube (`cube_centre_mm`), choose another `configuration`, or omit phantom \
                 and table from the scenario"
            }
        }
    }
}

/// Plans the protocol of a scenario, which has to have one.
///
/// # Errors
/// Why it cannot be carried out.
pub fn plan_protocol(
    resolved: &ResolvedScenario,
    protocol: &Iso9283Protocol,
    model: &ClearanceModel,
) -> Result<ProtocolPlan, ProtocolError> {
    let robot = &resolved.cell.robot;
    let kinematics = Kinematics::new(robot.chain)?.within(robot.limits);
    let joints = postures(protocol, &kinematics, robot, &resolved.start)?;
    let limits = motion_limits(protocol, resolved);
    let plan = ProtocolPlan {
        cycle: plain_cycle(protocol, &joints, &limits),
        directional: (protocol.approach_m > 0.0)
            .then(|| directional_cycle(protocol, robot, &joints, &limits))
            .transpose()?,
        joints,
    };
    let planning = &resolved.scenario.planning;
    let checker = MotionChecker::new(
        &resolved.cell,
        model,
        ClassLimits::of(&resolved.scenario),
        planning,
    );
    for cycle in [Some(&plan.cycle), plan.directional.as_ref()]
        .into_iter()
        .flatten()
    {
        check_collisions(&checker, &resolved.cell, cycle)?;
    }
    Ok(plan)
}

/// Joint positions at all poses: the configuration's, with the 2π equivalents that are nearest to the start posture at
/// P1 and nearest to P1 at the others.
fn postures(
    protocol: &Iso9283Protocol,
    kinematics: &Kinematics,
    robot: &Robot,
    start: &Joints,
) -> Result<[Joints; POSE_COUNT], ProtocolError> {
    let base_link_from_base = Robot::base_link_from_base();
    let point_from_flange = protocol.flange_from_point.inverse();
    let mut joints = [*start; POSE_COUNT];
    for (index, base_from_point) in protocol.base_from_point.iter().enumerate() {
        let seed = joints[0];
        let base_link_from_flange: Pose = base_link_from_base * base_from_point * point_from_flange;
        let found = kinematics
            .branches(&base_link_from_flange, Some(&seed))
            .solutions;
        let pose = index + 1;
        let exact = || found.iter().filter(|each| each.kind == SolutionKind::Exact);
        let Some(solution) = exact().find(|each| each.configuration == protocol.configuration)
        else {
            let others: Vec<&str> = exact().map(|each| each.configuration.label()).collect();
            return Err(ProtocolError::Unreachable {
                pose,
                configuration: protocol.configuration.label(),
                others: if others.is_empty() {
                    " and in all others".to_owned()
                } else {
                    format!("; within reach of {}", others.join(", "))
                },
            });
        };
        let Some(wrap) = nearest_within_limits(&solution.joints, &robot.limits, &seed) else {
            let joint = robot.limits.first_violation(&solution.joints).unwrap_or(0);
            return Err(ProtocolError::JointLimit {
                pose,
                joint: JOINT_LABELS[joint],
                position_deg: solution.joints[joint].to_degrees(),
            });
        };
        joints[index] = wrap.joints;
    }
    Ok(joints)
}

/// The rated speeds times the share; accelerations and jerks are the scenario's.
fn motion_limits(protocol: &Iso9283Protocol, resolved: &ResolvedScenario) -> MotionLimits {
    MotionLimits {
        velocity: resolved.cell.robot.limits.velocities_rad_s() * protocol.speed_share,
        line: ProfileLimits {
            velocity: protocol.line_velocity_m_s,
            ..resolved.motion.line
        },
        ..resolved.motion
    }
}

fn plain_cycle(
    protocol: &Iso9283Protocol,
    joints: &[Joints; POSE_COUNT],
    limits: &MotionLimits,
) -> Cycle {
    let mut trajectory = JointTrajectory::starting_at(joints[0]);
    let mut stops = Vec::with_capacity(ORDER.len());
    for pose in ORDER {
        let departure_s = trajectory.duration_s();
        trajectory = trajectory.then_straight_to(Phase::Transfer, joints[pose], limits);
        let arrival_s = trajectory.duration_s();
        trajectory = trajectory.then_hold(Phase::Hold, protocol.dwell_s);
        stops.push(Stop {
            pose,
            axis: None,
            departure_s,
            arrival_s,
            end_s: trajectory.duration_s(),
        });
    }
    Cycle { trajectory, stops }
}

/// Each pose from three perpendicular directions: straight out along an axis of the base frame,
/// and straight back in. The approaches come from the side of the cube's middle, so that they stay
/// in the cube; those of P1 run against the axes, the one along z from above.
fn directional_cycle(
    protocol: &Iso9283Protocol,
    robot: &Robot,
    joints: &[Joints; POSE_COUNT],
    limits: &MotionLimits,
) -> Result<Cycle, ProtocolError> {
    let base_link_from_base = Robot::base_link_from_base();
    let mut trajectory = JointTrajectory::starting_at(joints[0]);
    let mut stops = Vec::with_capacity(3 * DIRECTIONAL_POSES.len());
    for pose in DIRECTIONAL_POSES {
        let at = protocol.base_from_point[pose].translation.vector;
        let outwards = at - protocol.cube_centre_m.coords;
        for axis in 0..3 {
            let sign = if outwards[axis] > 0.0 { 1.0 } else { -1.0 };
            let mut direction = Vector3::zeros();
            direction[axis] = sign;
            let direction = UnitVector3::new_unchecked(base_link_from_base * direction);
            let line = JointPath::line_ending_at(
                &robot.chain,
                &joints[pose],
                &direction,
                protocol.approach_m,
            )
            .map_err(|error| ProtocolError::Approach {
                pose: pose + 1,
                axis: ['x', 'y', 'z'][axis],
                error,
            })?;
            trajectory = trajectory
                .then_straight_to(Phase::Transfer, joints[pose], limits)
                .then_along(Phase::Retract, line.reversed(), limits);
            let departure_s = trajectory.duration_s();
            trajectory = trajectory.then_along(Phase::Approach, line, limits);
            let arrival_s = trajectory.duration_s();
            trajectory = trajectory.then_hold(Phase::Hold, protocol.dwell_s);
            stops.push(Stop {
                pose,
                axis: Some(axis),
                departure_s,
                arrival_s,
                end_s: trajectory.duration_s(),
            });
        }
    }
    Ok(Cycle { trajectory, stops })
}

fn check_collisions(
    checker: &MotionChecker<'_>,
    cell: &Cell,
    cycle: &Cycle,
) -> Result<(), ProtocolError> {
    let Some(found) = checker.first_collision(&cycle.trajectory) else {
        return Ok(());
    };
    let towards = cycle.stops.iter().find(|stop| stop.end_s >= found.time_s);
    let [a, b] = found.pair.in_words(cell).map(Cow::into_owned);
    Err(ProtocolError::Collision {
        pose: towards.map_or(1, |stop| stop.pose + 1),
        a,
        b,
        distance_mm: found.pair.separation.distance_m * 1e3,
        limit_mm: found.limit_m * 1e3,
    })
}
