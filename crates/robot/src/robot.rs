//! The arm, from any URDF with the UR joint names.

mod arm_checks;
mod calibration;
mod enclosure;
mod envelope;
mod link_shape;
mod missing_inertia;
mod nominal;
mod parametric;
mod srdf;
mod tool;
mod urdf;

use std::ops::Range;
use std::sync::Arc;

use nalgebra::Vector3;
use needlebench_cell::{Link, Robot};
use needlebench_geometry::{Shape, Solid, TriangleMesh, Visual};
use needlebench_input::{Finding, Location, ModelSource, PackagePaths, nearest_name, source_of};
use needlebench_kinematics::{
    Body, Chain, ChainJoint, JOINT_COUNT, JOINT_NAMES, JointLimits, Pose, UrGeometry,
};

use crate::arm::{Arm, Recognition, choose_arm, note_on_no_arm};
use crate::loaded::arm_name;
use crate::mesh_file::{MeshFormat, read_mesh as read_mesh_file};
use crate::{ArmInUse, LinkMember, LoadedRobot, RobotDescription};
use arm_checks::{check_body, check_origin, joint_limit};
pub use calibration::{Calibration, OriginDeviation};
pub use enclosure::{LinkEnclosure, enclosures};
pub use envelope::StatedShape;
use link_shape::shape_of_link;
pub use missing_inertia::MissingInertia;
use nominal::{body_in_frame_of, nominal_robot, notes_on_limits};
pub use parametric::GuidePlace;
pub use srdf::{DisabledPair, Srdf};
pub use tool::{ToolOverrides, read_tool};
use urdf::{Element, Geometry, JointKind, Urdf, UrdfJoint, UrdfLink};

/// Short names of the moving links of every UR arm, from the base on.
pub const MOVING_LINK_LABELS: [&str; JOINT_COUNT] = [
    "shoulder",
    "upper_arm",
    "forearm",
    "wrist_1",
    "wrist_2",
    "wrist_3",
];

/// Grey of surfaces without a colour.
const DEFAULT_COLOR: [f32; 4] = [0.7, 0.72, 0.75, 1.0];

/// Reads the arm from a URDF; `named` is the arm whose data it has, if it is named.
pub fn read_robot(
    location: &Location,
    packages: &PackagePaths,
    missing_inertia: &MissingInertia,
    world_from_base_link: Pose,
    named: Option<&Arc<Arm>>,
    prefix: Option<&str>,
) -> Result<LoadedRobot, Finding> {
    let mut urdf = read_urdf(location)?;
    let mut notes = urdf.notes.clone();
    notes.extend(location.note().map(str::to_owned));
    match prefix {
        Some(prefix) => {
            notes.push(take_prefix(&mut urdf, prefix)?);
            notes.extend(hold_others(&mut urdf));
        }
        None => notes.extend(without_prefix(&mut urdf)?),
    }
    let (joints, tip) = arm_joints(&urdf)?;

    // Fixed joints between two revolute ones are folded into the next joint's origin.
    let mut chain_joints = Vec::with_capacity(JOINT_COUNT);
    let mut limits = Vec::with_capacity(JOINT_COUNT);
    let mut parent = "base_link";
    for joint in urdf.joints_between("base_link", &tip).into_iter().flatten() {
        check_origin(&urdf, joint)?;
    }
    for joint in &joints {
        let between = urdf
            .joints_between(parent, &joint.child)
            .expect("the joints were found along this path");
        let parent_from_joint = between
            .iter()
            .fold(Pose::identity(), |pose, each| pose * each.parent_from_joint);
        chain_joints.push(ChainJoint {
            parent_from_joint,
            axis: joint.axis,
        });
        limits.push(joint_limit(&urdf, joint)?);
        parent = &joint.child;
    }
    let chain = Chain {
        joints: chain_joints.try_into().expect("six joints"),
        wrist_3_from_flange: fixed_pose(&urdf, parent, &tip),
    };
    let geometry = UrGeometry::of_chain(&chain).map_err(|error| {
        Finding::new(&urdf.file, error.to_string())
            .hint("needlebench supports six-joint UR arms and their factory calibrations")
    })?;

    let limits = JointLimits(limits.try_into().expect("six limits"));
    notes.extend(note_on_soft_limits(&joints));
    let arm = arm_in_use(named, location, packages, &geometry, &limits)?;
    match &arm {
        Some(used) => {
            notes.push(used.note());
            if used.has_its_lengths() {
                let whose = used.arm.possessive();
                notes.extend(notes_on_limits(&limits, &whose, &used.limits));
            }
        }
        None => notes.push(note_on_no_arm(&geometry)),
    }
    notes.extend(note_on_place(&urdf));

    // Every URDF link belongs to the nearest moving link above it.
    let mut owned: Vec<Vec<(&UrdfLink, Pose)>> = vec![Vec::new(); JOINT_COUNT + 1];
    for link in &urdf.links {
        let (owner, owner_from_link) = owner_of(&urdf, &joints, &link.name);
        owned[owner].push((link, owner_from_link));
    }
    let members = urdf
        .links
        .iter()
        .map(|link| LinkMember {
            name: link.name.clone(),
            owner: owner_of(&urdf, &joints, &link.name).0,
            has_geometry: !link.collisions.is_empty(),
            is_drawn: !link.visuals.is_empty(),
            is_links_own: link.name.starts_with("base")
                || joints.iter().any(|joint| joint.child == link.name),
        })
        .collect();
    let mut links = Vec::with_capacity(JOINT_COUNT + 1);
    let mut bodies = Vec::with_capacity(JOINT_COUNT);
    for (index, members) in owned.iter().enumerate() {
        let label = match index.checked_sub(1) {
            None => "base",
            Some(moving) => MOVING_LINK_LABELS[moving],
        };
        links.push(read_link(
            &urdf, location, packages, label, members, &mut notes,
        )?);
        let Some(joint) = index.checked_sub(1) else {
            continue;
        };
        bodies.push(match body_of(members) {
            Ok(body) => {
                let links: Vec<&UrdfLink> = members.iter().map(|(link, _)| *link).collect();
                check_body(&urdf, label, &links, &body)?;
                body
            }
            Err(what) => {
                let link = &joints[joint].child;
                let (arm, nominal) = missing_inertia
                    .stand_in(arm.as_ref())
                    .ok_or_else(|| no_inertia(&urdf, link, what, missing_inertia, arm.as_ref()))?;
                notes.push(format!(
                    "link '{link}' has {what}: {} {label} is used",
                    arm.possessive()
                ));
                body_in_frame_of(&chain, nominal, joint)
            }
        });
    }
    let base = links.remove(0);
    let robot = Robot {
        name: urdf.name.clone(),
        world_from_base_link,
        chain,
        base,
        links: links.try_into().expect("six links"),
        unseen: Vec::new(),
        bodies: bodies.try_into().expect("six bodies"),
        limits,
    };
    let description = RobotDescription {
        members,
        arm_name: arm_name(&robot, arm.as_ref()),
        arm,
        source: source_of(location.display(), urdf.text.as_bytes()),
        calibration: None,
        meshes: collision_meshes(&urdf, location, packages),
        notes,
    };
    Ok(LoadedRobot { robot, description })
}

/// The arm whose data the robot has, by its own URDF too if this is another.
fn arm_in_use(
    named: Option<&Arc<Arm>>,
    location: &Location,
    packages: &PackagePaths,
    geometry: &UrGeometry,
    limits: &JointLimits,
) -> Result<Option<ArmInUse>, Finding> {
    let Some((arm, recognition)) = choose_arm(named, location, geometry)? else {
        return Ok(None);
    };
    let nominal = match recognition {
        Recognition::Own => None,
        Recognition::Named | Recognition::Lengths => {
            Some(Arc::new(nominal_robot(&arm, packages)?.robot))
        }
    };
    Ok(Some(ArmInUse {
        deviation_m: arm.deviation_m(geometry),
        limits: nominal.as_ref().map_or(*limits, |robot| robot.limits),
        nominal,
        recognition,
        arm,
    }))
}

/// Reads and parses a URDF; says which shipped ones there are if it does not exist.
pub(crate) fn read_urdf(location: &Location) -> Result<Urdf, Finding> {
    let file = location.display();
    let bytes = location.read().map_err(|error| {
        Finding::new(&file, format!("cannot read the URDF: {error}"))
            .hint("the path is relative to the working directory")
    })?;
    Urdf::parse(&file, &bytes)
}

/// Takes the prefix off the names of links and joints where the six joints have one in common, as ROS's description
/// gives it (`tf_prefix`), and says so.
///
/// # Errors
/// Several arms: the prefix has to be given.
fn without_prefix(urdf: &mut Urdf) -> Result<Option<String>, Finding> {
    let prefixes = prefixes_of(urdf);
    match prefixes.as_slice() {
        [prefix] if !prefix.is_empty() => Ok(take_prefix(urdf, prefix).ok()),
        [_, _, ..] => {
            let quoted: Vec<String> = prefixes.iter().map(|it| format!("`{it}`")).collect();
            let message = format!(
                "it has {} UR arms, {}",
                prefixes.len(),
                quoted.join(" and ")
            );
            Err(Finding::new(&urdf.file, message).hint(
                "select the robot by --prefix, or `prefix` under [robot]; the other arms are fixed",
            ))
        }
        _ => Ok(None),
    }
}

/// What stands before the names of each UR arm's joints in the file; empty for one whose names are bare.
fn prefixes_of(urdf: &Urdf) -> Vec<String> {
    let has = |name: &str| urdf.joints.iter().any(|joint| joint.name == name);
    let prefixes = urdf.joints.iter().filter_map(|joint| {
        let prefix = joint.name.strip_suffix(JOINT_NAMES[0])?;
        let whole = JOINT_NAMES
            .iter()
            .all(|name| has(&format!("{prefix}{name}")));
        whole.then(|| prefix.to_owned())
    });
    prefixes.collect()
}

/// Takes a prefix off the names that have it.
///
/// # Errors
/// A prefix of no arm, or names that are there without it too.
fn take_prefix(urdf: &mut Urdf, prefix: &str) -> Result<String, Finding> {
    let known = prefixes_of(urdf);
    if !known.iter().any(|each| each == prefix) {
        let known: Vec<String> = known.iter().map(|each| format!("`{each}`")).collect();
        let message = format!("no UR arm in it has the prefix `{prefix}`");
        let hint = if known.is_empty() {
            format!("the joints of an arm are {}", JOINT_NAMES.join(", "))
        } else {
            format!("prefixes: {}", known.join(" and "))
        };
        return Err(Finding::new(&urdf.file, message).key("prefix").hint(hint));
    }
    let of_joints = urdf
        .joints
        .iter()
        .flat_map(|joint| [&joint.parent, &joint.child]);
    let taken = |bare: &str| {
        urdf.links.iter().any(|link| link.name == bare)
            || urdf.joints.iter().any(|joint| joint.name == bare)
    };
    let names = urdf.links.iter().map(|link| &link.name).chain(of_joints);
    let bare = |name: &'_ &String| name.strip_prefix(prefix).is_some_and(&taken);
    if let Some(twice) = names.filter(|_| !prefix.is_empty()).find(bare) {
        let message = format!("it has '{twice}' with and without the prefix `{prefix}`");
        return Err(Finding::new(&urdf.file, message).key("prefix"));
    }
    for name in urdf.links.iter_mut().map(|link| &mut link.name).chain(
        urdf.joints
            .iter_mut()
            .flat_map(|joint| [&mut joint.name, &mut joint.parent, &mut joint.child]),
    ) {
        if let Some(bare) = name.strip_prefix(prefix) {
            *name = bare.to_owned();
        }
    }
    Ok(format!("prefix `{prefix}` removed from all names"))
}

/// Makes the moving joints of others than the arm stand still at zero, and says so.
fn hold_others(urdf: &mut Urdf) -> Option<String> {
    let is_other = |joint: &&mut UrdfJoint| {
        joint.kind != JointKind::Fixed && !JOINT_NAMES.contains(&joint.name.as_str())
    };
    let mut held = Vec::new();
    for joint in urdf.joints.iter_mut().filter(is_other) {
        joint.kind = JointKind::Fixed;
        held.push(joint.name.clone());
    }
    (!held.is_empty()).then(|| format!("joints outside the arm, fixed at 0: {}", held.join(", ")))
}

/// The six joints in order, and the link that is the flange.
fn arm_joints(urdf: &Urdf) -> Result<(Vec<&UrdfJoint>, String), Finding> {
    let names: Vec<&str> = urdf
        .joints
        .iter()
        .map(|joint| joint.name.as_str())
        .collect();
    let mut joints = Vec::with_capacity(JOINT_COUNT);
    for expected in JOINT_NAMES {
        let Some(joint) = urdf.joints.iter().find(|joint| joint.name == expected) else {
            let finding = Finding::new(&urdf.file, format!("it has no joint '{expected}'"))
                .key(format!("joint '{expected}'"));
            let is_ur = |name: &&str| JOINT_NAMES.iter().any(|joint| name.ends_with(joint));
            if !names.iter().any(is_ur) {
                let moving = urdf
                    .joints
                    .iter()
                    .filter(|joint| joint.kind != JointKind::Fixed);
                let moving: Vec<&str> = moving.map(|joint| joint.name.as_str()).collect();
                let message = match moving.as_slice() {
                    [] => "not a UR arm: it has no moving joints".to_owned(),
                    all => format!("not a UR arm: its moving joints are {}", all.join(", ")),
                };
                return Err(Finding::new(&urdf.file, message).hint(format!(
                    "supported are the six-joint arms of Universal Robots, with ROS's joint names: {}",
                    JOINT_NAMES.join(", ")
                )));
            }
            let prefixed = names.iter().copied().find(|name| name.ends_with(expected));
            let near = prefixed.or_else(|| nearest_name(expected, names.iter().copied()));
            return Err(match near {
                Some(near) => finding.hint(format!(
                    "joints need ROS's UR names; did you mean to rename '{near}'?"
                )),
                None => finding.hint("joints need ROS's UR names, without a prefix"),
            });
        };
        if !matches!(joint.kind, JointKind::Revolute | JointKind::Continuous) {
            return Err(urdf
                .finding(&joint.span, format!("joint '{expected}' is not revolute"))
                .key(format!("joint '{expected}'"))
                .hint("all six joints of a UR arm are revolute: type=\"revolute\""));
        }
        joints.push(joint);
    }
    for link in ["base_link", "tool0"] {
        if urdf.link(link).is_none() {
            return Err(Finding::new(&urdf.file, format!("it has no link '{link}'"))
                .key(format!("link '{link}'"))
                .hint(if link == "tool0" {
                    "`tool0` is the flange frame: z out of the flange, joined to wrist 3 by a \
                     fixed joint"
                } else {
                    "`base_link` is ROS's base frame of the arm"
                }));
        }
    }
    let path = urdf
        .joints_between("base_link", "tool0")
        .ok_or_else(|| Finding::new(&urdf.file, "`tool0` is not below `base_link`"))?;
    let moving: Vec<&str> = path
        .iter()
        .filter(|joint| joint.kind != JointKind::Fixed)
        .map(|joint| joint.name.as_str())
        .collect();
    if moving != JOINT_NAMES {
        return Err(Finding::new(
            &urdf.file,
            format!(
                "the moving joints from base_link to tool0 are {}",
                moving.join(", ")
            ),
        )
        .hint(format!("expected {}", JOINT_NAMES.join(", "))));
    }
    if let Some(other) = urdf
        .joints
        .iter()
        .find(|joint| joint.kind != JointKind::Fixed && !moving.contains(&joint.name.as_str()))
    {
        return Err(urdf
            .finding(
                &other.span,
                format!(
                    "joint '{}' moves but is not one of the arm's six",
                    other.name
                ),
            )
            .hint("make it fixed: only the arm's joints are driven"));
    }
    Ok((joints, "tool0".to_owned()))
}

fn fixed_pose(urdf: &Urdf, ancestor: &str, link: &str) -> Pose {
    urdf.joints_between(ancestor, link)
        .into_iter()
        .flatten()
        .fold(Pose::identity(), |pose, joint| {
            pose * joint.parent_from_joint
        })
}

/// Index of the moving link (0 for the base) that a URDF link is fixed to, and its pose there.
fn owner_of(urdf: &Urdf, joints: &[&UrdfJoint], link: &str) -> (usize, Pose) {
    let mut owner_from_link = Pose::identity();
    let mut at = link;
    loop {
        if let Some(index) = joints.iter().position(|joint| joint.child == at) {
            return (index + 1, owner_from_link);
        }
        if at == "base_link" {
            return (0, owner_from_link);
        }
        let Some(joint) = urdf.joint_above(at) else {
            // Above base_link: the robot is placed by its base_link, so that is where it belongs.
            let root_from_base_link = fixed_pose(urdf, at, "base_link");
            return (0, root_from_base_link.inverse() * owner_from_link);
        };
        owner_from_link = joint.parent_from_joint * owner_from_link;
        at = &joint.parent;
    }
}

/// Mass properties of a moving link and all that is fixed to it; says what it lacks.
fn body_of(members: &[(&UrdfLink, Pose)]) -> Result<Body, &'static str> {
    let body = members
        .iter()
        .fold(Body::massless(), |sum, (link, owner_from_link)| {
            let body = link.inertial.unwrap_or(Body::massless());
            sum.combined_with(&body.transformed(owner_from_link))
        });
    if body.mass_kg <= 0.0 {
        Err("no mass")
    } else if body.inertia_kgm2.symmetric_eigenvalues().min() <= 0.0 {
        Err("no moment of inertia")
    } else {
        Ok(body)
    }
}

fn no_inertia(
    urdf: &Urdf,
    link: &str,
    what: &str,
    policy: &MissingInertia,
    arm: Option<&ArmInUse>,
) -> Finding {
    let message = format!("link '{link}' has {what}");
    let finding = match urdf.link(link) {
        Some(link) => urdf.finding(&link.span, message),
        None => Finding::new(&urdf.file, message),
    };
    finding
        .key(format!("link '{link}'"))
        .hint(format!("give it an <inertial>{}", policy.way_out(arm)))
}

/// Says of which joints the ranges are those of their safety controllers.
fn note_on_soft_limits(joints: &[&UrdfJoint]) -> Option<String> {
    let soft = joints.iter().filter(|joint| {
        let limit = joint.limit.filter(|_| joint.kind == JointKind::Revolute);
        let own = limit.map_or([f64::NEG_INFINITY, f64::INFINITY], |own| {
            [own.lower, own.upper]
        });
        joint
            .soft
            .is_some_and(|soft| soft[0] > own[0] || soft[1] < own[1])
    });
    let names: Vec<&str> = soft.map(|joint| joint.name.as_str()).collect();
    (!names.is_empty()).then(|| {
        format!(
            "soft limits of <safety_controller> narrow the range of {}",
            names.join(", ")
        )
    })
}

/// Says that what stands above `base_link` in the file does not place the robot.
fn note_on_place(urdf: &Urdf) -> Option<String> {
    let root = urdf
        .links
        .iter()
        .find(|link| urdf.joint_above(&link.name).is_none())?;
    let root_from_base_link = fixed_pose(urdf, &root.name, "base_link");
    (root_from_base_link != Pose::identity()).then(|| {
        format!(
            "base_link is placed by the scenario; its pose relative to '{}' in the URDF is ignored",
            root.name
        )
    })
}

fn read_link(
    urdf: &Urdf,
    location: &Location,
    packages: &PackagePaths,
    label: &str,
    members: &[(&UrdfLink, Pose)],
    notes: &mut Vec<String>,
) -> Result<Link, Finding> {
    let mut solids = Vec::new();
    let mut visuals = Vec::new();
    for (link, owner_from_link) in members {
        solids.extend(read_solids(
            urdf,
            location,
            packages,
            link,
            owner_from_link,
            notes,
        )?);
        visuals.extend(read_visuals(
            urdf,
            location,
            packages,
            link,
            owner_from_link,
            notes,
        ));
    }
    rename_unique(&mut solids, label);
    if solids.is_empty() {
        notes.push(format!(
            "{label} has no collision geometry: its clearance is not evaluated"
        ));
    }
    if visuals.is_empty() {
        visuals = solids
            .iter()
            .map(|solid| visual_of(solid, DEFAULT_COLOR))
            .collect();
    }
    Ok(Link {
        name: label.to_owned(),
        solids,
        visuals,
    })
}

/// Collision geometry of one URDF link, in the frame of its owner.
pub(crate) fn read_solids(
    urdf: &Urdf,
    location: &Location,
    packages: &PackagePaths,
    link: &UrdfLink,
    owner_from_link: &Pose,
    notes: &mut Vec<String>,
) -> Result<Vec<Solid>, Finding> {
    let mut solids = Vec::new();
    for element in &link.collisions {
        let shape = if let Some(shape) = shape_of(&element.geometry) {
            shape
        } else {
            let mesh = read_mesh(urdf, location, packages, element)?;
            let (shape, said) = shape_of_link(&mesh, &link.name).map_err(|why| {
                urdf.finding(
                    &element.span,
                    format!("collision mesh of '{}': {why}", link.name),
                )
            })?;
            notes.extend(said);
            shape
        };
        solids.push(Solid {
            name: element.name.clone().unwrap_or_default(),
            shape,
            parent_from_shape: owner_from_link * element.link_from_geometry,
        });
    }
    Ok(solids)
}

/// Surfaces of one URDF link, in the frame of its owner. What cannot be read is left out and noted;
/// a link of which nothing can be read is drawn as the collision geometry that it has.
pub(crate) fn read_visuals(
    urdf: &Urdf,
    location: &Location,
    packages: &PackagePaths,
    link: &UrdfLink,
    owner_from_link: &Pose,
    notes: &mut Vec<String>,
) -> Vec<Visual> {
    let visual = |element: &Element| -> Result<Visual, Finding> {
        let mesh = match shape_of(&element.geometry) {
            Some(shape) => shape.surface(PICTURE_CHORD_ERROR_M),
            None => read_mesh(urdf, location, packages, element)?,
        };
        Ok(Visual {
            mesh: Arc::new(mesh),
            parent_from_visual: owner_from_link * element.link_from_geometry,
            color_rgba: element.color_rgba.unwrap_or(DEFAULT_COLOR),
        })
    };
    let (mut visuals, mut unread) = (Vec::new(), Vec::new());
    for element in &link.visuals {
        match visual(element) {
            Ok(visual) => visuals.push(visual),
            Err(finding) => unread.push(finding.message),
        }
    }
    let instead = if visuals.is_empty() && !unread.is_empty() {
        visuals.extend(link.collisions.iter().flat_map(visual));
        ", which show its collision geometry instead"
    } else {
        ""
    };
    notes.extend(unread.into_iter().map(|why| {
        format!(
            "the visual mesh of '{}' is omitted from images{instead}: {why}",
            link.name
        )
    }));
    visuals
}

/// Fineness of curved surfaces in pictures.
const PICTURE_CHORD_ERROR_M: f64 = 2e-4;

/// A solid as a coloured surface.
pub(crate) fn visual_of(solid: &Solid, color_rgba: [f32; 4]) -> Visual {
    Visual {
        mesh: Arc::new(solid.shape.surface(PICTURE_CHORD_ERROR_M)),
        parent_from_visual: solid.parent_from_shape,
        color_rgba,
    }
}

/// Gives solids names that are unique in the cell: `label.index` unless the file names them so.
pub(crate) fn rename_unique(solids: &mut [Solid], label: &str) {
    for (index, solid) in solids.iter_mut().enumerate() {
        if !solid.name.starts_with(&format!("{label}.")) {
            solid.name = format!("{label}.{index}");
        }
    }
}

fn shape_of(geometry: &Geometry) -> Option<Shape> {
    Some(match geometry {
        Geometry::Box { size_m: [x, y, z] } => Shape::Cuboid {
            half_extents_m: Vector3::new(*x, *y, *z) * 0.5,
        },
        Geometry::Cylinder { radius_m, length_m } => Shape::Cylinder {
            radius_m: *radius_m,
            half_length_m: 0.5 * length_m,
        },
        Geometry::Sphere { radius_m } => Shape::Sphere {
            radius_m: *radius_m,
        },
        Geometry::Mesh { .. } => return None,
    })
}

/// Files of the collision meshes with their hashes; those that cannot be read were refused before.
fn collision_meshes(urdf: &Urdf, location: &Location, packages: &PackagePaths) -> Vec<ModelSource> {
    let mut sources: Vec<ModelSource> = Vec::new();
    for element in urdf.links.iter().flat_map(|link| &link.collisions) {
        let Geometry::Mesh { filename, .. } = &element.geometry else {
            continue;
        };
        let Ok(mesh) = location.mesh(filename, packages) else {
            continue;
        };
        let Ok(bytes) = mesh.read() else { continue };
        let source = source_of(mesh.display(), &bytes);
        if !sources.contains(&source) {
            sources.push(source);
        }
    }
    sources
}

fn read_mesh(
    urdf: &Urdf,
    location: &Location,
    packages: &PackagePaths,
    element: &Element,
) -> Result<TriangleMesh, Finding> {
    let Geometry::Mesh { filename, scale } = &element.geometry else {
        unreachable!("only called for meshes")
    };
    let span: &Range<usize> = &element.span;
    let mesh_location = location.mesh(filename, packages).map_err(|why| {
        urdf.finding(span, format!("mesh `{filename}`: {why}"))
            .key("filename")
    })?;
    let refused = |why: String| {
        let message = format!("mesh `{}`: {why}", mesh_location.display());
        urdf.finding(span, message).key("filename")
    };
    let format = MeshFormat::of_name(filename).ok_or_else(|| {
        let what = MeshFormat::other(filename).unwrap_or("not a mesh file by its name");
        refused(format!("it is {what}")).hint("STL, OBJ and COLLADA (.dae) are read: convert it")
    })?;
    let bytes = mesh_location.read().map_err(|error| {
        refused(error).hint(
            "mesh paths are relative to the URDF; package:// and model:// need --package-path",
        )
    })?;
    read_mesh_file(&bytes, format, *scale).map_err(|why| refused(why.to_string()))
}
