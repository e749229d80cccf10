//! From a scenario file to a resolved cell with goals.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use nalgebra::{Point3, Translation3, UnitQuaternion, Vector3};
use needlebench_kinematics::trajectory::{MotionLimits, ProfileLimits};
use needlebench_kinematics::{JOINT_LABELS, Joints, Pose};

use crate::files::{Location, source_of};
use crate::fixtures::Fixture;
use crate::goal::{PlacedPhantom, Surroundings, resolve_goal, solid_contains};
use crate::imperfections::{Imperfections, resolve_imperfections};
use crate::iso9283::{Iso9283Protocol, resolve_iso9283};
use crate::model::{BodyKind, Cell, CollisionBody, Frame, ModelSource, NeedleCorridor};
use crate::parts::Library;
use crate::people::{People, Room, resolve_people};
use crate::phantom_place::place_phantom;
use crate::robot::{MissingInertia, read_robot};
use crate::scenario::Scenario;
use crate::toml_text::TomlText;
use crate::values::check_values;
use crate::{Calibration, Finding, Goal, PackagePaths, Robot};

/// Standard gravity, m/s^2.
const GRAVITY_M_S2: f64 = 9.80665;

/// What the command line may replace in a scenario.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Overrides {
    /// URDF of another robot, relative to the working directory.
    pub robot_urdf: Option<PathBuf>,
    /// Search paths for `package://`.
    pub packages: PackagePaths,
    /// Factory calibration whose joint origins replace the URDF's, relative to the working
    /// directory.
    pub calibration: Option<PathBuf>,
    /// What to do when a moving link has no mass.
    pub missing_inertia: Option<MissingInertia>,
}

/// A scenario with everything that it names read, checked and placed.
#[derive(Debug, Clone, PartialEq)]
pub struct ResolvedScenario {
    /// The file as it was read.
    pub scenario: Scenario,
    /// The file.
    pub source: ModelSource,
    /// Robot, tool and all that can be hit.
    pub cell: Cell,
    /// The phantom, if there is one.
    pub phantom: Option<PlacedPhantom>,
    /// Table, gantry and mount, for pictures.
    pub fixtures: Vec<Fixture>,
    /// Where needles are to go.
    pub goals: Vec<Goal>,
    /// The test by ISO 9283, in place of goals.
    pub iso9283: Option<Iso9283Protocol>,
    /// Where every motion starts.
    pub start: Joints,
    /// Limits of the motion: the scenario's and the URDF's, whichever are lower.
    pub motion: MotionLimits,
    /// Parameter file of the phantom.
    pub phantom_source: Option<ModelSource>,
    /// Files of the parts that the user gave the phantom.
    pub phantom_parts: Vec<ModelSource>,
    /// What was assumed or adjusted; belongs in every report.
    pub notes: Vec<String>,
    /// The people in the room, by goal.
    pub people: People,
    /// How the real arm and phantom differ; none if they do not.
    pub imperfections: Option<Imperfections>,
}

/// Reads a robot without a scenario: the one of the overrides, or the shipped UR3, with its
/// `base_link` at the world's origin.
///
/// # Errors
/// What is wrong with the URDF or the calibration.
pub fn load_robot(overrides: &Overrides) -> Result<Robot, Finding> {
    let location = match &overrides.robot_urdf {
        Some(path) => Location::Disk(path.clone()),
        None => Location::of_model("ur3", "ur3", "urdf", Path::new("")),
    };
    let missing_inertia = overrides.missing_inertia.unwrap_or_default();
    let mut robot = read_robot(
        &location,
        &overrides.packages,
        missing_inertia,
        Pose::identity(),
    )?;
    calibrate(&mut robot, overrides)?;
    Ok(robot)
}

/// Gives a robot its true joint origins, if the command line names a calibration.
pub(crate) fn calibrate(robot: &mut Robot, overrides: &Overrides) -> Result<(), Finding> {
    match &overrides.calibration {
        Some(path) => Calibration::load(path)?.apply_to(robot),
        None => Ok(()),
    }
}

/// Reads, resolves and validates a scenario file.
///
/// # Errors
/// Every [`Finding`] of the first stage that has any: text, values, models, goals.
pub fn load_scenario(path: &Path, overrides: &Overrides) -> Result<ResolvedScenario, Vec<Finding>> {
    let file = path.display().to_string();
    let text = std::fs::read_to_string(path).map_err(|error| {
        let finding = Finding::new(&file, format!("cannot read the scenario: {error}"));
        vec![
            finding.hint(if error.kind() == std::io::ErrorKind::InvalidData {
                "save the file as UTF-8 text"
            } else {
                "scenarios are TOML files, such as scenarios/table3.toml"
            }),
        ]
    })?;
    resolve_scenario(
        &file,
        &text,
        path.parent().unwrap_or(Path::new("")),
        overrides,
    )
}

/// Resolves a scenario's text; `base` is the folder that its paths are relative to.
///
/// # Errors
/// As [`load_scenario`].
pub fn resolve_scenario(
    file: &str,
    text: &str,
    base: &Path,
    overrides: &Overrides,
) -> Result<ResolvedScenario, Vec<Finding>> {
    let toml = TomlText::parse(file, text).map_err(|finding| vec![finding])?;
    let scenario: Scenario = toml.deserialize().map_err(|finding| vec![finding])?;
    let source = source_of(file.to_owned(), text.as_bytes());
    resolve(
        &toml,
        scenario,
        source,
        base,
        overrides,
        &Library::default(),
    )
}

/// Resolves a scenario's struct; `toml` says where its values stand, and `library` keeps what is read.
pub(crate) fn resolve(
    toml: &TomlText<'_>,
    scenario: Scenario,
    source: ModelSource,
    base: &Path,
    overrides: &Overrides,
    library: &Library,
) -> Result<ResolvedScenario, Vec<Finding>> {
    let one = |finding: Finding| vec![finding];
    let findings = check_values(toml, &scenario);
    if !findings.is_empty() {
        return Err(findings);
    }
    let mut notes = Vec::new();
    let world_from_base_link =
        pose_of(scenario.robot.base_position_mm, scenario.robot.base_rpy_deg);
    let robot = library.robot(toml, &scenario.robot, base, overrides);
    let robot = Robot {
        world_from_base_link,
        ..Robot::clone(&*robot.map_err(one)?)
    };
    notes.extend(robot.notes.iter().cloned());
    let tool = library
        .tool(toml, &scenario, base, overrides)
        .map_err(one)?;
    notes.extend(tool.notes.iter().cloned());
    let mut tool = tool.tool.clone();
    let iso9283 = scenario
        .iso9283
        .as_ref()
        .map(|section| resolve_iso9283(toml, section, &robot, &mut tool, &mut notes))
        .transpose()
        .map_err(one)?;
    let [table, gantry, mount] = library
        .fixtures(toml, &scenario, &world_from_base_link)
        .map_err(one)?;
    let (mut phantom, mut phantom_source, mut phantom_parts) = (None, None, Vec::new());
    if let Some(section) = &scenario.phantom {
        let part = library.phantom(toml, section, base).map_err(one)?;
        notes.extend(part.notes.iter().cloned());
        phantom = Some(PlacedPhantom {
            world_from_phantom: place_phantom(toml, section, scenario.table.as_ref(), &part)
                .map_err(one)?,
            phantom: Arc::clone(&part.phantom),
        });
        phantom_source.clone_from(&part.model);
        phantom_parts.clone_from(&part.parts);
    }

    let mut fixtures = Vec::new();
    let mut surroundings = Vec::new();
    if let Some(placed) = &phantom {
        let mut skin = placed.phantom.skin().clone();
        skin.parent_from_shape = placed.world_from_phantom * skin.parent_from_shape;
        surroundings.push(static_body("phantom", BodyKind::Phantom, vec![skin]));
    }
    for (name, kind, fixture) in [
        ("table", BodyKind::Table, table),
        ("gantry", BodyKind::Gantry, gantry),
        ("mount", BodyKind::Mount, mount),
    ] {
        if let Some(fixture) = fixture {
            surroundings.push(static_body(name, kind, fixture.solids.clone()));
            fixtures.push(Fixture::clone(&fixture));
        }
    }

    check_base(toml, &world_from_base_link, &surroundings).map_err(one)?;
    let goals = {
        let context = Surroundings {
            robot: &robot,
            tool: &tool,
            phantom: phantom.as_ref(),
            fixtures: &surroundings
                .iter()
                .filter(|body| body.kind != BodyKind::Phantom)
                .cloned()
                .collect::<Vec<_>>(),
        };
        let (mut goals, mut findings) = (Vec::new(), Vec::new());
        for (index, section) in scenario.goals.iter().enumerate() {
            match resolve_goal(toml, index, section, &context, &mut notes) {
                Ok(goal) => goals.push(goal),
                Err(finding) => findings.push(finding),
            }
        }
        if !findings.is_empty() {
            return Err(findings);
        }
        goals
    };

    let people = {
        let base = robot.base.solids.iter().map(|solid| crate::shape::Solid {
            parent_from_shape: world_from_base_link * solid.parent_from_shape,
            ..solid.clone()
        });
        let base: Vec<_> = base.collect();
        let standing = surroundings
            .iter()
            .flat_map(|body| body.solids.iter().map(|solid| (body.name.as_str(), solid)));
        let solids: Vec<_> = standing
            .chain(base.iter().map(|solid| ("robot's base", solid)))
            .collect();
        let room = Room {
            phantom: phantom.as_ref(),
            solids: &solids,
            robot_base_m: Point3::from(world_from_base_link.translation.vector),
        };
        resolve_people(toml, &scenario.people, &goals, &room).map_err(one)?
    };
    let start = Joints::from_column_slice(&scenario.start.joints_deg.map(f64::to_radians));
    if let Some(joint) = robot.limits.first_violation(&start) {
        let limit = robot.limits.0[joint];
        return Err(one(toml.finding(
            &format!("start.joints_deg[{joint}]"),
            format!(
                "{} starts at {:.1} deg, outside {:.1} to {:.1} deg",
                JOINT_LABELS[joint],
                start[joint].to_degrees(),
                limit.lower_rad.to_degrees(),
                limit.upper_rad.to_degrees()
            ),
        )));
    }
    let motion = motion_limits(&scenario, &robot.limits.velocities_rad_s());
    let corridor = NeedleCorridor {
        radius_m: scenario.tool.corridor_radius_mm * 1e-3,
        length_m: scenario
            .tool
            .corridor_length_mm
            .map_or(tool.needle.length_m, |mm| mm * 1e-3),
        hand_cone_half_angle_rad: scenario.tool.hand_cone_half_angle_deg.to_radians(),
    };
    let imperfections = scenario
        .imperfections
        .as_ref()
        .map(|section| {
            let bore_clearance_m = tool.bore_m - tool.needle.outer_diameter_m;
            resolve_imperfections(toml, section, base, library, bore_clearance_m)
        })
        .transpose()
        .map_err(one)?;
    let cell = Cell::assemble(
        robot,
        tool,
        corridor,
        surroundings,
        Joints::from_column_slice(&scenario.controller.armature_kgm2),
        Vector3::new(0.0, 0.0, -GRAVITY_M_S2),
    );
    Ok(ResolvedScenario {
        scenario,
        source,
        cell,
        phantom,
        fixtures,
        goals,
        iso9283,
        start,
        motion,
        phantom_source,
        phantom_parts,
        notes,
        people,
        imperfections,
    })
}

fn static_body(name: &str, kind: BodyKind, solids: Vec<crate::shape::Solid>) -> CollisionBody {
    CollisionBody {
        name: name.to_owned(),
        kind,
        frame: Frame::World,
        solids,
    }
}

fn pose_of(position_mm: [f64; 3], rpy_deg: [f64; 3]) -> Pose {
    let [roll, pitch, yaw] = rpy_deg.map(f64::to_radians);
    Pose::from_parts(
        Translation3::from(Vector3::from(position_mm) * 1e-3),
        UnitQuaternion::from_euler_angles(roll, pitch, yaw),
    )
}

/// Refuses a base that stands inside something: the fixed link is in no pair that is checked later.
fn check_base(
    toml: &TomlText<'_>,
    world_from_base_link: &Pose,
    surroundings: &[CollisionBody],
) -> Result<(), Finding> {
    /// Height of a UR3's base with the shoulder on it, m.
    const BASE_HEIGHT_M: f64 = 0.15;
    let inside = |body: &&CollisionBody| {
        body.kind != BodyKind::Mount
            && (0..=5).any(|k| {
                let height_m = BASE_HEIGHT_M * (f64::from(k) + 0.1) / 5.1;
                let point = world_from_base_link * Point3::new(0.0, 0.0, height_m);
                body.solids
                    .iter()
                    .any(|solid| solid_contains(solid, &point))
            })
    };
    match surroundings.iter().find(inside) {
        None => Ok(()),
        Some(body) => Err(toml
            .finding(
                "robot.base_position_mm",
                format!("the robot's base stands inside the {}", body.name),
            )
            .hint("the position is in the world: z up, floor at 0, in millimetres")),
    }
}

fn motion_limits(scenario: &Scenario, urdf_velocity: &Joints) -> MotionLimits {
    let motion = &scenario.motion;
    let wanted = Joints::repeat(motion.joint_velocity_deg_s.to_radians());
    MotionLimits {
        velocity: wanted.zip_map(urdf_velocity, f64::min),
        acceleration: Joints::repeat(motion.joint_acceleration_deg_s2.to_radians()),
        jerk: Joints::repeat(motion.joint_jerk_deg_s3.to_radians()),
        line: ProfileLimits {
            velocity: motion.line_velocity_mm_s * 1e-3,
            acceleration: motion.line_acceleration_mm_s2 * 1e-3,
            jerk: motion.line_jerk_mm_s3 * 1e-3,
        },
    }
}
