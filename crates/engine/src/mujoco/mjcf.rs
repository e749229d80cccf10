//! The cell as an MJCF model.

use std::fmt::Write as _;

use nalgebra::{UnitQuaternion, Vector3};
use needlebench_cell::{Cell, Frame};
use needlebench_geometry::{Shape, Solid, TriangleMesh};
use needlebench_kinematics::{JOINT_COUNT, Pose};
use quick_xml::escape::escape;

use super::settings::MujocoSettings;
use crate::EngineError;
use crate::contact_groups::{ContactBits, contact_bits};
use crate::error::check_bodies;
use crate::pieces::convex_pieces;

/// Name of the site at the flange.
pub(super) const FLANGE_SITE: &str = "flange";

/// Name of the body of a moving link.
pub(super) fn link_name(link: usize) -> String {
    format!("link_{}", link + 1)
}

/// Name of the joint that moves a link.
pub(super) fn joint_name(joint: usize) -> String {
    format!("joint_{}", joint + 1)
}

/// Name of a solid's geom: indices keep it unique, the solid's name makes it readable.
fn geom_name(cell: &Cell, body: usize, solid: usize) -> String {
    format!("{body}/{solid}/{}", cell.bodies[body].solids[solid].name)
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
    check_bodies(cell)?;
    let mut writer = Writer {
        cell,
        bits: contact_bits(cell)?,
        xml: String::new(),
        depth: 0,
    };
    writer.open("mujoco model=\"needlebench\"");
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
            link_name(i),
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
            "joint name=\"{}\" type=\"hinge\" axis=\"{}\" armature=\"{}\" limited=\"false\"",
            joint_name(i),
            vector(&joint.axis),
            number(dynamics.armature_kgm2[i]),
        ));
        writer.geoms(Frame::Link(i))?;
    }
    writer.leaf(&format!(
        "site name=\"{FLANGE_SITE}\" {}",
        placed(&dynamics.chain.wrist_3_from_flange)
    ));
    for _ in 0..JOINT_COUNT {
        writer.close("body");
    }
    writer.close("worldbody");
    writer.close("mujoco");
    Ok(writer.xml)
}

struct Writer<'a> {
    cell: &'a Cell,
    bits: Vec<ContactBits>,
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

    /// Indices of the solids that take part in contacts: body and solid.
    fn solids(&self) -> Vec<(usize, usize)> {
        (0..self.cell.bodies.len())
            .filter(|&body| self.bits[body] != ContactBits::default())
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
                for (name, _) in geoms_of(self.cell, body, k)? {
                    let name = escape(&*name);
                    self.leaf(&format!(
                        "geom name=\"{name}\" {} {} contype=\"{member}\" conaffinity=\"{mask}\"",
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
    fn names_are_escaped() {
        let mut cell = crate::test_cell::ur3(Vec::new());
        cell.bodies[2].solids[0].name = "a<b>&\"c".into();
        let model = mjcf(&cell, 1e-3, &MujocoSettings::default()).unwrap();
        assert!(model.contains("/a&lt;b&gt;&amp;&quot;c\""));
    }
}
