//! The cell as an MJCF model: for the engine's own process, and for people who open it alone.

use std::fmt::Write as _;

use nalgebra::{UnitQuaternion, Vector3};
use needlebench_cell::{BodyKind, Cell, CollisionBody, Frame};
use needlebench_geometry::{Shape, Solid, TriangleMesh};
use needlebench_kinematics::{JOINT_COUNT, JOINT_LABELS, JOINT_NAMES, Joints, LINK_NAMES, Pose};
use quick_xml::escape::escape;

use super::settings::MujocoSettings;
use crate::contact_groups::{ContactBits, contact_bits};
use crate::error::check_bodies;
use crate::pieces::convex_pieces;
use crate::plant::checked_timestep_s;
use crate::{ArmSpec, EngineError};

/// Name of the site at the flange.
pub(super) const FLANGE_SITE: &str = "tool0";

/// Colours of a model that people look at: red, green, blue, opacity.
fn color(kind: BodyKind) -> &'static str {
    match kind {
        BodyKind::Base | BodyKind::Link => "0.79 0.80 0.81 1",
        BodyKind::Tool => "0.35 0.37 0.40 1",
        BodyKind::GuideTube => "0.84 0.37 0.00 1",
        BodyKind::NeedleCorridor => "0.34 0.71 0.91 0.35",
        BodyKind::Phantom => "0.90 0.75 0.65 0.5",
        BodyKind::Table => "0.62 0.68 0.74 1",
        BodyKind::Gantry => "0.90 0.90 0.88 0.5",
        BodyKind::Mount => "0.55 0.55 0.58 1",
        BodyKind::Obstacle => "0.60 0.55 0.45 1",
        BodyKind::Person => "0.35 0.45 0.65 0.35",
    }
}

/// What a model that is opened alone has besides what the engine steps. Nothing of it changes the motion under
/// given torques, within the joints' limits.
#[derive(Debug, Clone, PartialEq)]
pub struct StandaloneModel {
    /// Name of the model.
    pub name: String,
    /// Comment before it, an XML comment with its marks; empty for none.
    pub comment: String,
    /// Postures, as keyframes.
    pub keyframes: Vec<Keyframe>,
    /// Marked places.
    pub sites: Vec<MarkedPlace>,
}

/// A posture at rest.
#[derive(Debug, Clone, PartialEq)]
pub struct Keyframe {
    /// Its name.
    pub name: String,
    /// Joint positions, rad.
    pub position: Joints,
    /// Torques of the motors, N m.
    pub torque_nm: Joints,
}

/// A place with a name.
#[derive(Debug, Clone, PartialEq)]
pub struct MarkedPlace {
    /// Its name.
    pub name: String,
    /// What it moves with.
    pub frame: Frame,
    /// Its pose in that frame.
    pub frame_from_site: Pose,
}

/// The model of an arm among all that it may touch, to be opened alone: the very one that the engine steps,
/// with a motor for each joint, the joints' limits, keyframes, marked places, colours, and the needle's corridor as a
/// body that touches nothing.
///
/// # Errors
/// As of a plant: bad settings, bodies that cannot be moved, shapes that MuJoCo cannot have.
pub fn standalone_model(
    arm: &ArmSpec<'_>,
    standalone: &StandaloneModel,
) -> Result<String, EngineError> {
    let settings = MujocoSettings::of(arm);
    settings.check()?;
    let timestep_s = checked_timestep_s(arm.timestep_s)?;
    model(arm.cell, timestep_s, &settings, Some(standalone))
}

/// Name of a solid's geom: those of its body and its own, with indices where another has the same.
fn geom_name(cell: &Cell, body: usize, solid: usize) -> String {
    let bodies = &cell.bodies;
    let (whose, name) = (&bodies[body].name, &bodies[body].solids[solid].name);
    let has_name = |each: &&CollisionBody| each.name == *whose;
    let same = bodies.iter().filter(has_name).flat_map(|each| &each.solids);
    let count = same.filter(|each| each.name == *name).count();
    if count == 1 && !whose.contains('/') && !name.contains('/') {
        format!("{whose}/{name}")
    } else {
        format!("{body}/{solid}/{whose}/{name}")
    }
}

/// Names of a solid's geoms, each with the mesh that it is made of, if it is: one geom, but for a mesh
/// one for each of its convex pieces. MuJoCo collides a mesh as its convex hull.
pub(super) fn geoms_of(
    cell: &Cell,
    body: usize,
    solid: usize,
) -> Result<Vec<(String, Option<&TriangleMesh>)>, EngineError> {
    let name = geom_name(cell, body, solid);
    let geometry = &cell.bodies[body].solids[solid];
    Ok(match &geometry.shape {
        Shape::Convex(mesh) => vec![(name, Some(&mesh.0))],
        Shape::Mesh(mesh) => (1..)
            .zip(convex_pieces(geometry, mesh)?)
            .map(|(number, piece)| (format!("{name}/{number}"), Some(&piece.0)))
            .collect(),
        _ => vec![(name, None)],
    })
}

/// Model of the cell, every number with 17 significant digits.
///
/// Only the collision bits decide which geoms touch. MuJoCo's own filters (no contact within a body
/// or between a body and its child) drop nothing beyond them: the cell has no such pairs.
pub(super) fn mjcf(
    cell: &Cell,
    timestep_s: f64,
    settings: &MujocoSettings,
) -> Result<String, EngineError> {
    model(cell, timestep_s, settings, None)
}

fn model(
    cell: &Cell,
    timestep_s: f64,
    settings: &MujocoSettings,
    standalone: Option<&StandaloneModel>,
) -> Result<String, EngineError> {
    check_bodies(cell)?;
    let mut writer = Writer {
        cell,
        bits: contact_bits(cell)?,
        standalone,
        xml: String::new(),
        depth: 0,
    };
    if let Some(standalone) = standalone {
        writer.xml.push_str(&standalone.comment);
    }
    let name = standalone.map_or("needlebench", |each| &each.name);
    writer.open(&format!("mujoco model=\"{}\"", escape(name)));
    // Inertias are given and are final. Visual defaults of MuJoCo do not matter here.
    writer.leaf(
        "compiler angle=\"radian\" inertiafromgeom=\"false\" balanceinertia=\"false\" \
         boundmass=\"0\" boundinertia=\"0\" fusestatic=\"false\"",
    );
    writer.leaf(&format!(
        "option timestep=\"{}\" gravity=\"{}\" integrator=\"{}\" cone=\"elliptic\"",
        number(timestep_s),
        vector(&cell.gravity_m_s2),
        settings.integrator.name(),
    ));
    let (stiffness_per_s2, damping_per_s) = settings.contact_spring(timestep_s);
    writer.open("default");
    writer.leaf(&format!(
        "geom condim=\"{}\" friction=\"{} 0 0\" solref=\"{} {}\" solimp=\"{impedance} {impedance}\"",
        if settings.friction > 0.0 { 3 } else { 1 },
        number(settings.friction),
        number(-stiffness_per_s2),
        number(-damping_per_s),
        impedance = number(settings.contact_impedance),
    ));
    writer.close("default");
    writer.assets()?;
    writer.open("worldbody");
    writer.geoms(Frame::World)?;
    writer.sites(Frame::World);
    let dynamics = cell.dynamics();
    for i in 0..JOINT_COUNT {
        let joint = &dynamics.chain.joints[i];
        let body = &dynamics.bodies[i];
        let parent_from_link = if i == 0 {
            cell.robot.world_from_base_link * joint.parent_from_joint
        } else {
            joint.parent_from_joint
        };
        writer.open(&format!(
            "body name=\"{}\" {}",
            LINK_NAMES[i],
            placed(&parent_from_link)
        ));
        let inertia = &body.inertia_kgm2;
        let [xx, yy, zz, xy, xz, yz] =
            [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)].map(|at| number(inertia[at]));
        writer.leaf(&format!(
            "inertial pos=\"{}\" mass=\"{}\" fullinertia=\"{xx} {yy} {zz} {xy} {xz} {yz}\"",
            vector(&body.com_m),
            number(body.mass_kg),
        ));
        writer.leaf(&format!(
            "joint name=\"{}\" type=\"hinge\" axis=\"{}\" armature=\"{}\" {}",
            JOINT_NAMES[i],
            vector(&joint.axis),
            number(dynamics.armature_kgm2[i]),
            writer.limited(i),
        ));
        writer.geoms(Frame::Link(i))?;
        writer.sites(Frame::Link(i));
    }
    writer.leaf(&format!(
        "site name=\"{FLANGE_SITE}\" {}",
        placed(&dynamics.chain.wrist_3_from_flange)
    ));
    for _ in 0..JOINT_COUNT {
        writer.close("body");
    }
    writer.close("worldbody");
    writer.motors_and_keyframes();
    writer.close("mujoco");
    Ok(writer.xml)
}

struct Writer<'a> {
    cell: &'a Cell,
    bits: Vec<ContactBits>,
    standalone: Option<&'a StandaloneModel>,
    xml: String,
    depth: usize,
}

impl Writer<'_> {
    fn open(&mut self, tag: &str) {
        self.line(&format!("<{tag}>"));
        self.depth += 1;
    }

    fn leaf(&mut self, tag: &str) {
        self.line(&format!("<{tag}/>"));
    }

    fn close(&mut self, tag: &str) {
        self.depth -= 1;
        self.line(&format!("</{tag}>"));
    }

    fn line(&mut self, text: &str) {
        let indent = 2 * self.depth;
        writeln!(self.xml, "{:indent$}{text}", "").expect("a String takes everything");
    }

    /// Whether and where a joint ends. The engine's own joints have no ends: the servo keeps away from them.
    fn limited(&self, joint: usize) -> String {
        let limits = &self.cell.robot.limits.0[joint];
        let ends = [limits.lower_rad, limits.upper_rad];
        if self.standalone.is_none() || ends.iter().any(|end| !end.is_finite()) {
            return "limited=\"false\"".to_owned();
        }
        let [lower, upper] = ends.map(number);
        format!("limited=\"true\" range=\"{lower} {upper}\"")
    }

    fn sites(&mut self, frame: Frame) {
        let sites = self.standalone.map_or(&[][..], |each| &each.sites);
        for site in sites.iter().filter(|site| site.frame == frame) {
            self.leaf(&format!(
                "site name=\"{}\" {}",
                escape(&*site.name),
                placed(&site.frame_from_site)
            ));
        }
    }

    fn motors_and_keyframes(&mut self) {
        let Some(standalone) = self.standalone else {
            return;
        };
        self.open("actuator");
        let efforts_nm = self.cell.robot.limits.efforts_nm();
        for joint in 0..JOINT_COUNT {
            let most = number(efforts_nm[joint]);
            self.leaf(&format!(
                "motor name=\"{}\" joint=\"{}\" gear=\"1\" ctrllimited=\"true\" ctrlrange=\"-{most} {most}\"",
                JOINT_LABELS[joint], JOINT_NAMES[joint],
            ));
        }
        self.close("actuator");
        self.open("keyframe");
        for keyframe in &standalone.keyframes {
            self.leaf(&format!(
                "key name=\"{}\" qpos=\"{}\" ctrl=\"{}\"",
                escape(&*keyframe.name),
                numbers(&keyframe.position),
                numbers(&keyframe.torque_nm),
            ));
        }
        self.close("keyframe");
    }

    /// Indices of the solids that the model has: body and solid. Those that touch nothing are for people alone.
    fn solids(&self) -> Vec<(usize, usize)> {
        let all = self.standalone.is_some();
        (0..self.cell.bodies.len())
            .filter(|&body| all || self.bits[body] != ContactBits::default())
            .flat_map(|body| (0..self.cell.bodies[body].solids.len()).map(move |k| (body, k)))
            .collect()
    }

    fn assets(&mut self) -> Result<(), EngineError> {
        self.open("asset");
        for (body, k) in self.solids() {
            let solid = &self.cell.bodies[body].solids[k];
            for (name, mesh) in geoms_of(self.cell, body, k)? {
                let Some(mesh) = mesh else { continue };
                if mesh.vertices_m.len() < 4 {
                    return Err(EngineError::BadSolid {
                        solid: solid.name.clone(),
                        reason: "its points have no hull with a volume",
                    });
                }
                let mut vertices = String::new();
                for vertex in &mesh.vertices_m {
                    vertices += &vector(&vertex.coords);
                    vertices.push(' ');
                }
                self.leaf(&format!(
                    "mesh name=\"{}\" inertia=\"convex\" vertex=\"{}\"",
                    escape(&*name),
                    vertices.trim_end()
                ));
            }
        }
        self.close("asset");
        Ok(())
    }

    fn geoms(&mut self, frame: Frame) -> Result<(), EngineError> {
        for (body, k) in self.solids() {
            if self.cell.bodies[body].frame == frame {
                let ContactBits { member, mask } = self.bits[body];
                let solid = &self.cell.bodies[body].solids[k];
                let rgba = match self.standalone {
                    Some(_) => {
                        format!(" rgba=\"{}\"", color(self.cell.bodies[body].kind))
                    }
                    None => String::new(),
                };
                for (name, _) in geoms_of(self.cell, body, k)? {
                    let name = escape(&*name);
                    self.leaf(&format!(
                        "geom name=\"{name}\" {} {} contype=\"{member}\" conaffinity=\"{mask}\"{rgba}",
                        shape(solid, &name),
                        placed(&solid.parent_from_shape),
                    ));
                }
            }
        }
        Ok(())
    }
}

fn shape(solid: &Solid, mesh_name: &str) -> String {
    match &solid.shape {
        Shape::Sphere { radius_m } => format!("type=\"sphere\" size=\"{}\"", number(*radius_m)),
        Shape::Cylinder {
            radius_m,
            half_length_m,
        } => {
            format!(
                "type=\"cylinder\" size=\"{} {}\"",
                number(*radius_m),
                number(*half_length_m)
            )
        }
        Shape::Capsule {
            radius_m,
            half_length_m,
        } => {
            format!(
                "type=\"capsule\" size=\"{} {}\"",
                number(*radius_m),
                number(*half_length_m)
            )
        }
        Shape::Cuboid { half_extents_m } => {
            format!("type=\"box\" size=\"{}\"", vector(half_extents_m))
        }
        Shape::Convex(_) | Shape::Mesh(_) => format!("type=\"mesh\" mesh=\"{mesh_name}\""),
    }
}

fn placed(pose: &Pose) -> String {
    format!(
        "pos=\"{}\" quat=\"{}\"",
        vector(&pose.translation.vector),
        quat_wxyz(&pose.rotation)
    )
}

fn vector(v: &Vector3<f64>) -> String {
    format!("{} {} {}", number(v.x), number(v.y), number(v.z))
}

fn quat_wxyz(q: &UnitQuaternion<f64>) -> String {
    format!(
        "{} {} {} {}",
        number(q.w),
        number(q.i),
        number(q.j),
        number(q.k)
    )
}

fn numbers(joints: &Joints) -> String {
    let numbers: Vec<String> = joints.iter().map(|value| number(*value)).collect();
    numbers.join(" ")
}

/// 17 significant digits: every f64 comes back as it was.
fn number(value: f64) -> String {
    format!("{value:.16e}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_come_back_as_they_were() {
        for value in [
            0.1,
            -1.0 / 3.0,
            9.81,
            1.234_567_890_123_456_7e-300,
            0.0,
            -0.24365,
        ] {
            assert_eq!(number(value).parse::<f64>(), Ok(value));
        }
    }

    #[test]
    fn corridor_of_the_needle_is_no_geom() {
        let cell = crate::test_cell::ur3(Vec::new());
        let model = mjcf(&cell, 1e-3, &MujocoSettings::default()).unwrap();
        assert!(model.contains("guide"));
        assert!(!model.contains("corridor"));
    }

    #[test]
    fn a_model_that_is_opened_alone_is_the_engines_own_and_more() {
        let cell = crate::test_cell::ur3(Vec::new());
        let own = mjcf(&cell, 1e-3, &MujocoSettings::default()).unwrap();
        let standalone = StandaloneModel {
            name: "needlebench".to_owned(),
            comment: "<!-- a remark -->\n".to_owned(),
            keyframes: vec![Keyframe {
                name: "start".to_owned(),
                position: Joints::zeros(),
                torque_nm: Joints::zeros(),
            }],
            sites: vec![MarkedPlace {
                name: "guide_exit".to_owned(),
                frame: Frame::Link(5),
                frame_from_site: Pose::identity(),
            }],
        };
        let alone = model(&cell, 1e-3, &MujocoSettings::default(), Some(&standalone)).unwrap();
        // Colours and ends of joints apart, every line of the engine's is there, in the same order.
        let plain = |line: &str| {
            let line = line.split(" rgba=").next().unwrap();
            let line = line.split(" limited=").next().unwrap();
            line.trim_end_matches("/>").to_owned()
        };
        let mut lines = alone.lines().map(plain);
        for line in own.lines().map(plain) {
            assert!(lines.any(|each| each == line), "{line}");
        }
        let further = alone.lines().count() - own.lines().count();
        // A remark, a site, the corridor, six motors and a keyframe with their elements.
        assert_eq!(further, 1 + 1 + 1 + 8 + 3);
        assert!(alone.contains("<key name=\"start\""));
        assert!(alone.contains("site name=\"guide_exit\""));
        assert_eq!(alone.matches("<motor ").count(), JOINT_COUNT);
    }

    #[test]
    fn names_are_escaped() {
        let mut cell = crate::test_cell::ur3(Vec::new());
        cell.bodies[2].solids[0].name = "a<b>&\"c".into();
        let model = mjcf(&cell, 1e-3, &MujocoSettings::default()).unwrap();
        assert!(model.contains("/a&lt;b&gt;&amp;&quot;c\""));
    }
}
