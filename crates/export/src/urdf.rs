//! The cell as a robot description for ROS: URDF, and an SRDF of what may touch.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use nalgebra::{Rotation3, Vector3};
use needlebench_cell::{BodyKind, CollisionBody, Frame, LeftOut, PairRule, pair_rule};
use needlebench_geometry::{Shape, Solid, TriangleMesh, Visual};
use needlebench_kinematics::{Body, JOINT_COUNT, JOINT_NAMES, JointLimit, LINK_NAMES, Pose};
use needlebench_scenario::ResolvedScenario;
use quick_xml::escape::escape;

use crate::head::{head, xml_comment};
use crate::marks::marks;
use crate::postures::named_postures;
use crate::stl::stl;
use crate::surfaces::surfaces_of_cell;
use crate::{ExportError, ExportedFile, MovesWith};

/// What the description is, for who opens it.
const REMARKS: [&str; 6] = [
    "Collision geometry is that of clearances and engines. A capsule is written as a cylinder and \
     two spheres, the same set. Meshes are the surfaces themselves, with coordinates rounded to \
     single precision (less than 6e-8 of their size).",
    "Meshes of the package beside this file: package://STEM_meshes/... It is a ROS package for \
     colcon; other tools use this file's folder as the package folder.",
    "Rotor inertia, gravity, friction between bodies and acceleration limits cannot be expressed \
     in URDF and are omitted. Speed limits are those of the arm, not of the scenario's motions.",
    "Inertias are those of the moving links and of the tool. Static bodies have none.",
    "needle_corridor is not a body but the access zone behind the guide, which needle and hand \
     require. A planner that checks it keeps it free, as needlebench does; remove its link for the \
     bodies alone.",
    "Frames GOAL/target, GOAL/PERSON/eyes_1.75 and the like have no geometry.",
];

/// The cell as `STEM.urdf` and `STEM.srdf`, with the surfaces that they name as a package beside them.
///
/// # Errors
/// [`ExportError::NotUr`] for an arm without configurations.
pub fn urdf(resolved: &ResolvedScenario, stem: &str) -> Result<Vec<ExportedFile>, ExportError> {
    let mut writer = Writer {
        package: format!("{}_meshes", package_name(stem)),
        meshes: BTreeMap::new(),
        xml: String::new(),
    };
    writer.cell(resolved);
    let name = escape(&*resolved.scenario.name);
    let mut lines = head(resolved, "The whole cell as a robot description");
    lines.extend(REMARKS.map(|line| line.replace("STEM_meshes", &writer.package)));
    let description = format!(
        "<?xml version=\"1.0\"?>\n{}<robot name=\"{name}\">\n{}</robot>\n",
        xml_comment(&lines),
        writer.xml
    );
    let mut files = vec![
        ExportedFile::text(format!("{stem}.urdf"), description),
        ExportedFile::text(format!("{stem}.srdf"), srdf(resolved)?),
    ];
    files.extend(writer.package_files());
    Ok(files)
}

/// Names of ROS packages are of small letters, digits and underscores, and begin with a letter.
fn package_name(stem: &str) -> String {
    let name: String = stem
        .chars()
        .map(|letter| match letter.to_ascii_lowercase() {
            letter if letter.is_ascii_alphanumeric() => letter,
            _ => '_',
        })
        .collect();
    if name.starts_with(|letter: char| letter.is_ascii_alphabetic()) {
        name
    } else {
        format!("cell_{name}")
    }
}

/// Names of links that bodies of the scenario's own may not have.
const RESERVED: [&str; 9] = [
    "world",
    "base_link",
    "base",
    "tool0",
    "tool",
    "guide_tube",
    "needle_corridor",
    "guide_entry",
    "guide_exit",
];

/// Groups of surfaces that a patient has.
const TISSUES: [&str; 8] = [
    "skin", "beside", "assumed", "organ", "bone", "vessel", "lesion", "marker",
];

/// The link of a collision body.
fn link_of(body: &CollisionBody) -> String {
    match (body.kind, body.frame) {
        (BodyKind::Base, _) => "base_link".to_owned(),
        (BodyKind::Link, Frame::Link(link)) => LINK_NAMES[link].to_owned(),
        (BodyKind::Tool, _) => "tool".to_owned(),
        (BodyKind::GuideTube, _) => "guide_tube".to_owned(),
        (BodyKind::NeedleCorridor, _) => "needle_corridor".to_owned(),
        _ => {
            let name = body.name.as_str();
            if RESERVED.contains(&name) || LINK_NAMES.contains(&name) {
                format!("{name}_body")
            } else {
                name.to_owned()
            }
        }
    }
}

struct Writer {
    package: String,
    /// Surfaces by the name of their file.
    meshes: BTreeMap<String, Vec<u8>>,
    xml: String,
}

impl Writer {
    fn cell(&mut self, resolved: &ResolvedScenario) {
        let cell = &resolved.cell;
        let robot = &cell.robot;
        self.line("  <link name=\"world\"/>");
        self.link("base_link", None, &robot.base.visuals, &robot.base.solids);
        self.fixed("world", "base_link", &robot.world_from_base_link);
        self.link("base", None, &[], &[]);
        self.fixed(
            "base_link",
            "base",
            &needlebench_cell::Robot::base_link_from_base(),
        );
        let mut parent = "base_link";
        for (i, name) in LINK_NAMES.into_iter().enumerate() {
            let (link, body) = (&robot.links[i], &robot.bodies[i]);
            self.link(name, Some(body), &link.visuals, &link.solids);
            let joint = &robot.chain.joints[i];
            let limit = &robot.limits.0[i];
            self.turning(i, parent, &joint.parent_from_joint, &joint.axis, limit);
            parent = name;
        }
        let tool = &cell.tool;
        self.link("tool0", None, &[], &[]);
        self.fixed(parent, "tool0", &robot.chain.wrist_3_from_flange);
        self.link("tool", Some(&tool.body), &tool.visuals, &tool.solids);
        self.fixed("tool0", "tool", &Pose::identity());
        let here = Pose::identity();
        for body in &cell.bodies {
            let (parent, solids) = match body.kind {
                BodyKind::Base | BodyKind::Link | BodyKind::Tool => continue,
                BodyKind::GuideTube => ("tool0", &tool.guide_solids),
                BodyKind::NeedleCorridor => (LINK_NAMES[JOINT_COUNT - 1], &body.solids),
                _ => ("world", &body.solids),
            };
            let name = link_of(body);
            // The guide tube is on the tool's pictures; the patient's are of all that is inside.
            match body.kind {
                BodyKind::GuideTube => self.link(&name, None, &[], solids),
                BodyKind::Phantom => self.phantom(&name, resolved, solids),
                kind => self.plain_link(&name, color(kind), solids),
            }
            self.fixed(parent, &name, &here);
        }
        for mark in marks(resolved) {
            let parent = match mark.frame {
                MovesWith::Base | MovesWith::World => "world",
                MovesWith::Link(link) => LINK_NAMES[link],
                MovesWith::Flange => "tool0",
            };
            self.link(&mark.name, None, &[], &[]);
            self.fixed(parent, &mark.name, &mark.place);
        }
    }

    fn line(&mut self, text: &str) {
        self.xml.push_str(text);
        self.xml.push('\n');
    }

    fn open_link(&mut self, name: &str) {
        self.line(&format!("  <link name=\"{}\">", escape(name)));
    }

    fn link(&mut self, name: &str, body: Option<&Body>, visuals: &[Visual], solids: &[Solid]) {
        self.open_link(name);
        self.inertial(&body.copied().unwrap_or(Body::massless()));
        for (number, visual) in (1..).zip(visuals) {
            let file = self.mesh(&format!("{name}_visual_{number}"), &visual.mesh);
            self.visual(&[(visual.parent_from_visual, file)], &visual.color_rgba);
        }
        self.collisions(solids);
        self.line("  </link>");
    }

    /// What has no mass says so: of a link that says nothing `PyBullet` takes 1 kg, and `MuJoCo` what its collision shapes
    /// weigh in water.
    fn inertial(&mut self, body: &Body) {
        let inertia = &body.inertia_kgm2;
        self.line("    <inertial>");
        self.line(&format!(
            "      <origin xyz=\"{}\" rpy=\"0 0 0\"/>",
            vector(&body.com_m)
        ));
        self.line(&format!("      <mass value=\"{}\"/>", body.mass_kg));
        self.line(&format!(
            "      <inertia ixx=\"{}\" ixy=\"{}\" ixz=\"{}\" iyy=\"{}\" iyz=\"{}\" izz=\"{}\"/>",
            inertia[(0, 0)],
            inertia[(0, 1)],
            inertia[(0, 2)],
            inertia[(1, 1)],
            inertia[(1, 2)],
            inertia[(2, 2)]
        ));
        self.line("    </inertial>");
    }

    /// A link that looks as it collides.
    fn plain_link(&mut self, name: &str, color_rgba: [f32; 4], solids: &[Solid]) {
        self.open_link(name);
        self.inertial(&Body::massless());
        for solid in solids {
            let geometry = self.geometry(solid);
            self.visual(&geometry, &color_rgba);
        }
        self.collisions(solids);
        self.line("  </link>");
    }

    /// The patient: all that is seen, as on pages, and the outside to collide with.
    fn phantom(&mut self, name: &str, resolved: &ResolvedScenario, solids: &[Solid]) {
        self.open_link(name);
        self.inertial(&Body::massless());
        for surface in surfaces_of_cell(resolved).0 {
            if TISSUES.contains(&surface.group) {
                let file = self.mesh(&format!("{name}_{}", surface.group), &surface.mesh);
                self.visual(&[(Pose::identity(), file)], &surface.color_rgba);
            }
        }
        self.collisions(solids);
        self.line("  </link>");
    }

    fn visual(&mut self, geometry: &[(Pose, String)], color_rgba: &[f32; 4]) {
        for (pose, text) in geometry {
            let [red, green, blue, opacity] = color_rgba;
            let color = format!("{red} {green} {blue} {opacity}");
            let material = color.replace(' ', "_");
            self.line(&format!(
                "    <visual>{}<geometry>{text}</geometry><material name=\"{material}\"><color rgba=\"{color}\"/></material></visual>",
                origin(pose)
            ));
        }
    }

    fn collisions(&mut self, solids: &[Solid]) {
        for solid in solids {
            for (pose, text) in self.geometry(solid) {
                self.line(&format!(
                    "    <collision name=\"{}\">{}<geometry>{text}</geometry></collision>",
                    escape(&*solid.name),
                    origin(&pose)
                ));
            }
        }
    }

    /// A solid as elements that together are the same set, each at its place.
    fn geometry(&mut self, solid: &Solid) -> Vec<(Pose, String)> {
        let here = solid.parent_from_shape;
        let cylinder = |radius_m: f64, half_length_m: f64| {
            format!(
                "<cylinder radius=\"{radius_m}\" length=\"{}\"/>",
                2.0 * half_length_m
            )
        };
        let sphere = |radius_m: f64| format!("<sphere radius=\"{radius_m}\"/>");
        match &solid.shape {
            Shape::Sphere { radius_m } => vec![(here, sphere(*radius_m))],
            Shape::Cylinder {
                radius_m,
                half_length_m,
            } => vec![(here, cylinder(*radius_m, *half_length_m))],
            Shape::Capsule {
                radius_m,
                half_length_m,
            } => {
                let end = |z: f64| here * Pose::translation(0.0, 0.0, z);
                vec![
                    (here, cylinder(*radius_m, *half_length_m)),
                    (end(*half_length_m), sphere(*radius_m)),
                    (end(-half_length_m), sphere(*radius_m)),
                ]
            }
            Shape::Cuboid { half_extents_m } => {
                let size = half_extents_m * 2.0;
                vec![(here, format!("<box size=\"{}\"/>", vector(&size)))]
            }
            Shape::Convex(mesh) => vec![(here, self.mesh(&solid.name, &mesh.0))],
            Shape::Mesh(mesh) => vec![(here, self.mesh(&solid.name, mesh.surface()))],
        }
    }

    /// The element of a surface, which becomes a file of the package.
    fn mesh(&mut self, name: &str, mesh: &TriangleMesh) -> String {
        let bytes = stl(mesh);
        let safe: String = name
            .chars()
            .map(|letter| {
                if letter.is_ascii_alphanumeric() || "._-".contains(letter) {
                    letter
                } else {
                    '_'
                }
            })
            .collect();
        // Another surface of the same name has another number.
        let file = (1..=u32::MAX)
            .map(|number| match number {
                1 => format!("{safe}.stl"),
                _ => format!("{safe}_{number}.stl"),
            })
            .find(|file| self.meshes.get(file).is_none_or(|known| *known == bytes))
            .expect("some number is free");
        self.meshes.insert(file.clone(), bytes);
        format!("<mesh filename=\"package://{}/{file}\"/>", self.package)
    }

    fn fixed(&mut self, parent: &str, child: &str, parent_from_child: &Pose) {
        self.line(&format!(
            "  <joint name=\"{child}_fixed\" type=\"fixed\"><parent link=\"{}\"/><child link=\"{child}\"/>{}</joint>",
            escape(parent),
            origin(parent_from_child),
            child = escape(child),
        ));
    }

    fn turning(
        &mut self,
        index: usize,
        parent: &str,
        parent_from_joint: &Pose,
        axis: &Vector3<f64>,
        limit: &JointLimit,
    ) {
        let ends = [limit.lower_rad, limit.upper_rad];
        let (kind, range) = if ends.iter().all(|end| end.is_finite()) {
            (
                "revolute",
                format!("lower=\"{}\" upper=\"{}\" ", ends[0], ends[1]),
            )
        } else {
            ("continuous", String::new())
        };
        self.line(&format!(
            "  <joint name=\"{}\" type=\"{kind}\">",
            JOINT_NAMES[index]
        ));
        self.line(&format!(
            "    <parent link=\"{parent}\"/><child link=\"{}\"/>{}<axis xyz=\"{}\"/>",
            LINK_NAMES[index],
            origin(parent_from_joint),
            vector(axis)
        ));
        self.line(&format!(
            "    <limit {range}effort=\"{}\" velocity=\"{}\"/>",
            limit.effort_nm, limit.velocity_rad_s
        ));
        self.line("  </joint>");
    }

    /// The package of the surfaces.
    fn package_files(self) -> Vec<ExportedFile> {
        let Self {
            package, meshes, ..
        } = self;
        if meshes.is_empty() {
            return Vec::new();
        }
        let manifest = format!(
            "<?xml version=\"1.0\"?>\n<package format=\"3\">\n  <name>{package}</name>\n  <version>0.0.0</version>\n  \
             <description>Surfaces of a cell, exported by needlebench</description>\n  \
             <maintainer email=\"nobody@example.com\">nobody</maintainer>\n  <license>as of the scenario</license>\n  \
             <buildtool_depend>ament_cmake</buildtool_depend>\n  <export><build_type>ament_cmake</build_type></export>\n\
             </package>\n"
        );
        let build = format!(
            "cmake_minimum_required(VERSION 3.16)\nproject({package} NONE)\nfind_package(ament_cmake REQUIRED)\n\
             file(GLOB meshes *.stl)\ninstall(FILES ${{meshes}} DESTINATION share/${{PROJECT_NAME}})\nament_package()\n"
        );
        let mut files = vec![
            ExportedFile::text(format!("{package}/package.xml"), manifest),
            ExportedFile::text(format!("{package}/CMakeLists.txt"), build),
        ];
        files.extend(meshes.into_iter().map(|(file, bytes)| ExportedFile {
            name: format!("{package}/{file}"),
            bytes,
        }));
        files
    }
}

/// Colours of what has one for all of it: red, green, blue, opacity.
fn color(kind: BodyKind) -> [f32; 4] {
    match kind {
        BodyKind::NeedleCorridor => [0.34, 0.71, 0.91, 0.35],
        BodyKind::Table => [0.62, 0.68, 0.74, 1.0],
        BodyKind::Gantry => [0.9, 0.9, 0.88, 1.0],
        BodyKind::Mount => [0.55, 0.55, 0.58, 1.0],
        BodyKind::Person => [0.35, 0.45, 0.65, 0.35],
        _ => [0.6, 0.55, 0.45, 1.0],
    }
}

/// Pairs of links that need no check, with the reason; the group of the arm; postures.
fn srdf(resolved: &ResolvedScenario) -> Result<String, ExportError> {
    let cell = &resolved.cell;
    let mut lines = head(resolved, "Collision pairs of the cell, and postures");
    lines.push(
        "Disabled pairs are those that needlebench does not measure: they share a joint (Adjacent) \
         or never move relative to each other (Never). All others are measured, including those \
         certified never to touch: see needlebench pairs."
            .to_owned(),
    );
    let mut text = format!(
        "<?xml version=\"1.0\"?>\n{}<robot name=\"{}\">\n",
        xml_comment(&lines),
        escape(&*resolved.scenario.name)
    );
    text.push_str(
        "  <group name=\"manipulator\"><chain base_link=\"base_link\" tip_link=\"tool0\"/></group>\n  \
         <group name=\"needle_guide\"><chain base_link=\"base_link\" tip_link=\"guide_exit\"/></group>\n",
    );
    for posture in named_postures(resolved)? {
        let _ = writeln!(
            text,
            "  <group_state name=\"{}\" group=\"manipulator\">",
            escape(&*posture.name)
        );
        for (joint, value) in JOINT_NAMES.iter().zip(&posture.joints) {
            let _ = writeln!(text, "    <joint name=\"{joint}\" value=\"{value}\"/>");
        }
        text.push_str("  </group_state>\n");
    }
    for (index, a) in cell.bodies.iter().enumerate() {
        for b in &cell.bodies[index + 1..] {
            let reason = match pair_rule(a, b) {
                PairRule::Measured(_) => continue,
                PairRule::LeftOut(LeftOut::Adjacent) => "Adjacent",
                PairRule::LeftOut(LeftOut::Fixed) => "Never",
                PairRule::LeftOut(LeftOut::Hand) => "Default",
            };
            let _ = writeln!(
                text,
                "  <disable_collisions link1=\"{}\" link2=\"{}\" reason=\"{reason}\"/>",
                escape(link_of(a)),
                escape(link_of(b))
            );
        }
    }
    text.push_str("</robot>\n");
    Ok(text)
}

fn vector(v: &Vector3<f64>) -> String {
    // Minus zero is zero to everybody but a comparison of files.
    format!("{} {} {}", v.x + 0.0, v.y + 0.0, v.z + 0.0)
}

fn origin(pose: &Pose) -> String {
    format!(
        "<origin xyz=\"{}\" rpy=\"{}\"/>",
        vector(&pose.translation.vector),
        vector(&roll_pitch_yaw(&pose.rotation.to_rotation_matrix()))
    )
}

/// Fixed-axis angles: `Rz(yaw) Ry(pitch) Rx(roll)`. Each is taken from what those before it leave, so that they give the
/// rotation back to rounding at every pitch, a right angle too.
fn roll_pitch_yaw(rotation: &Rotation3<f64>) -> Vector3<f64> {
    let yaw = libm::atan2(rotation[(1, 0)], rotation[(0, 0)]);
    let left = Rotation3::from_axis_angle(&Vector3::z_axis(), -yaw) * rotation;
    let pitch = libm::atan2(-left[(2, 0)], left[(0, 0)]);
    let left = Rotation3::from_axis_angle(&Vector3::y_axis(), -pitch) * left;
    let roll = libm::atan2(left[(2, 1)], left[(1, 1)]);
    Vector3::new(roll, pitch, yaw)
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{FRAC_PI_2, PI};

    use nalgebra::UnitQuaternion;

    use super::*;

    #[test]
    fn angles_give_the_rotation_back_at_every_pitch() {
        for roll in [-PI, -1.0, 0.0, 1e-9, 2.5] {
            for pitch in [-FRAC_PI_2, -1.2, 0.0, 1.3, FRAC_PI_2 - 1e-9, FRAC_PI_2] {
                for yaw in [-3.0, 0.0, 0.7, PI] {
                    let wanted = Rotation3::from_euler_angles(roll, pitch, yaw);
                    let angles = roll_pitch_yaw(&wanted);
                    let back = Rotation3::from_euler_angles(angles.x, angles.y, angles.z);
                    // A few units in the last place.
                    assert!((wanted.matrix() - back.matrix()).abs().max() < 1e-15);
                    let back = UnitQuaternion::from_euler_angles(angles.x, angles.y, angles.z);
                    assert!(back.angle_to(&UnitQuaternion::from(wanted)) < 1e-7);
                }
            }
        }
    }

    #[test]
    fn packages_have_names_that_ros_takes() {
        assert_eq!(package_name("table3"), "table3");
        assert_eq!(package_name("My Cell-2"), "my_cell_2");
        assert_eq!(package_name("3d"), "cell_3d");
    }
}
