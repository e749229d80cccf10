//! URDF files as trees of links and joints, with the place of everything for error messages.
//!
//! `urdf-rs` reads the values. What it loses is kept by [`markup`]: a missing `<inertial>` or `<limit>`
//! has to be told from a zero one, what it does not know must not pass in silence, and every complaint
//! names a line. `package://` is resolved by [`crate::files`]: the crate's own way needs ROS.

mod markup;
mod tree;
mod vocabulary;

use std::ops::Range;

use nalgebra::{Matrix3, Translation3, UnitQuaternion, UnitVector3, Vector3};
use needlebench_kinematics::{Body, Pose};
use urdf_rs::JointType;

use crate::Finding;
use markup::{JointPlace, LinkPlace, read_markup};

/// Types of joints that a URDF can have.
const JOINT_TYPES: [&str; 6] = [
    "revolute",
    "continuous",
    "fixed",
    "prismatic",
    "floating",
    "planar",
];

/// Largest radius of gyration of a link, m: that of a rod of 5 m, about its middle.
const FARTHEST_GYRATION_M: f64 = 1.5;

/// Geometry element of a link.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Geometry {
    Box { size_m: [f64; 3] },
    Cylinder { radius_m: f64, length_m: f64 },
    Sphere { radius_m: f64 },
    Mesh { filename: String, scale: [f64; 3] },
}

#[derive(Debug, Clone)]
pub(crate) struct Element {
    pub name: Option<String>,
    pub link_from_geometry: Pose,
    pub geometry: Geometry,
    pub color_rgba: Option<[f32; 4]>,
    pub span: Range<usize>,
}

#[derive(Debug, Clone)]
pub(crate) struct UrdfLink {
    pub name: String,
    pub inertial: Option<Body>,
    /// Of its mass, or its own.
    pub mass_span: Range<usize>,
    pub collisions: Vec<Element>,
    pub visuals: Vec<Element>,
    pub span: Range<usize>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum JointKind {
    Revolute,
    Continuous,
    Fixed,
    Other,
}

#[derive(Debug, Clone, Copy)]
pub(crate) struct Limit {
    pub lower: f64,
    pub upper: f64,
    /// Whether the file gives lower and upper: 0 if not.
    pub has_range: [bool; 2],
    pub effort: f64,
    pub velocity: f64,
}

#[derive(Debug, Clone)]
pub(crate) struct UrdfJoint {
    pub name: String,
    pub kind: JointKind,
    pub parent: String,
    pub child: String,
    pub parent_from_joint: Pose,
    pub axis: UnitVector3<f64>,
    pub limit: Option<Limit>,
    pub span: Range<usize>,
    /// Of its `<origin>`, or its own.
    pub origin_span: Range<usize>,
    /// Of its `<limit>`, or its own.
    pub limit_span: Range<usize>,
}

/// needlebench's extension element `<needle_guide .../>` of a tool.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct NeedleGuide {
    pub bore_mm: f64,
    pub guide_length_mm: f64,
    pub needle_gauge: u32,
    pub needle_od_mm: f64,
    pub needle_length_mm: f64,
}

/// A URDF whose links form one tree.
#[derive(Debug, Clone)]
pub(crate) struct Urdf {
    pub file: String,
    pub text: String,
    pub name: String,
    pub links: Vec<UrdfLink>,
    pub joints: Vec<UrdfJoint>,
    pub needle_guide: Option<NeedleGuide>,
    /// What was passed over and may matter; with lines.
    pub notes: Vec<String>,
}

impl Urdf {
    pub(crate) fn parse(file: &str, bytes: &[u8]) -> Result<Self, Finding> {
        let text = std::str::from_utf8(bytes)
            .map_err(|error| Finding::new(file, format!("not UTF-8 text: {error}")))?;
        let markup = read_markup(file, text)?;
        let robot = urdf_rs::read_from_string(&markup.plain)
            .map_err(|error| Finding::new(file, format!("not a URDF: {error}")))?;
        let counts = |links: usize, joints: usize| format!("{links} links and {joints} joints");
        let (read, there) = (
            counts(robot.links.len(), robot.joints.len()),
            counts(markup.links.len(), markup.joints.len()),
        );
        if read != there {
            return Err(Finding::new(file, format!("of {there} {read} can be read")));
        }
        let reader = Reader { file, text };
        let links = robot.links.iter().zip(&markup.links);
        let joints = robot.joints.iter().zip(&markup.joints);
        let urdf = Self {
            file: file.to_owned(),
            text: text.to_owned(),
            name: if robot.name.is_empty() {
                "robot".to_owned()
            } else {
                robot.name.clone()
            },
            links: links
                .map(|(link, place)| reader.link(link, place, &robot.materials))
                .collect::<Result<_, _>>()?,
            joints: joints
                .map(|(joint, place)| reader.joint(joint, place))
                .collect::<Result<_, _>>()?,
            needle_guide: markup.needle_guide,
            notes: markup.notes,
        };
        urdf.check_tree()?;
        Ok(urdf)
    }

    pub(crate) fn link(&self, name: &str) -> Option<&UrdfLink> {
        self.links.iter().find(|link| link.name == name)
    }

    pub(crate) fn joint_above(&self, link: &str) -> Option<&UrdfJoint> {
        self.joints.iter().find(|joint| joint.child == link)
    }

    /// Joints from `ancestor` down to `link`; `None` if it is not an ancestor.
    pub(crate) fn joints_between(&self, ancestor: &str, link: &str) -> Option<Vec<&UrdfJoint>> {
        let mut joints = Vec::new();
        let mut at = link;
        while at != ancestor {
            let joint = self.joint_above(at)?;
            joints.push(joint);
            at = &joint.parent;
        }
        joints.reverse();
        Some(joints)
    }

    pub(crate) fn finding(&self, span: &Range<usize>, message: impl Into<String>) -> Finding {
        Finding::new(&self.file, message).at(&self.text, span.clone())
    }
}

/// From the crate's types to ours.
struct Reader<'a> {
    file: &'a str,
    text: &'a str,
}

impl Reader<'_> {
    fn finding(&self, span: &Range<usize>, message: impl Into<String>) -> Finding {
        Finding::new(self.file, message).at(self.text, span.clone())
    }

    fn link(
        &self,
        link: &urdf_rs::Link,
        place: &LinkPlace,
        materials: &[urdf_rs::Material],
    ) -> Result<UrdfLink, Finding> {
        if [link.collision.len(), link.visual.len()]
            != [place.collisions.len(), place.visuals.len()]
        {
            let message = format!("the geometry of link '{}' cannot be read", link.name);
            return Err(self.finding(&place.span, message));
        }
        let collisions = link.collision.iter().zip(&place.collisions);
        let visuals = link.visual.iter().zip(&place.visuals);
        Ok(UrdfLink {
            name: link.name.clone(),
            inertial: place
                .inertial
                .as_ref()
                .map(|places| self.inertial(&link.inertial, places))
                .transpose()?,
            mass_span: match &place.inertial {
                Some([mass, _]) => mass.clone(),
                None => place.span.clone(),
            },
            collisions: collisions
                .map(|(each, span)| {
                    self.element(each.name.as_ref(), &each.origin, &each.geometry, None, span)
                })
                .collect::<Result<_, _>>()?,
            visuals: visuals
                .map(|(each, span)| {
                    let color = color_of(each.material.as_ref(), materials);
                    self.element(
                        each.name.as_ref(),
                        &each.origin,
                        &each.geometry,
                        color,
                        span,
                    )
                })
                .collect::<Result<_, _>>()?,
            span: place.span.clone(),
        })
    }

    fn inertial(
        &self,
        inertial: &urdf_rs::Inertial,
        [mass, moments]: &[Range<usize>; 2],
    ) -> Result<Body, Finding> {
        let mass_kg = inertial.mass.value;
        if mass_kg < 0.0 {
            return Err(self.finding(mass, format!("the mass is {mass_kg} kg")));
        }
        let urdf_rs::Inertia {
            ixx: xx,
            ixy: xy,
            ixz: xz,
            iyy: yy,
            iyz: yz,
            izz: zz,
        } = inertial.inertia;
        let tensor = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
        let principal = tensor.symmetric_eigenvalues();
        // A rigid body's largest moment is at most the sum of the others; printed digits round.
        if principal.min() < 0.0 || 2.0 * principal.max() > principal.sum() * (1.0 + 1e-6) {
            return Err(self
                .finding(
                    moments,
                    format!(
                        "no rigid body has the principal moments {:.3e}, {:.3e}, {:.3e} kg m^2",
                        principal[0], principal[1], principal[2]
                    ),
                )
                .hint("moments are positive and none exceeds the sum of the other two"));
        }
        let gyration_m = (principal.max() / mass_kg).sqrt();
        if mass_kg > 0.0 && gyration_m > FARTHEST_GYRATION_M {
            return Err(self
                .finding(
                    moments,
                    format!(
                        "{mass_kg} kg with a moment of {:.3e} kg m^2 would lie {gyration_m:.3e} m \
                         from their centre",
                        principal.max()
                    ),
                )
                .hint(
                    "the radius of gyration, sqrt(moment / mass), is less than a link is long: did \
                     you give kg mm^2?",
                ));
        }
        Ok(Body {
            mass_kg,
            com_m: Vector3::zeros(),
            inertia_kgm2: tensor,
        }
        .transformed(&pose_of(&inertial.origin)))
    }

    fn element(
        &self,
        name: Option<&String>,
        origin: &urdf_rs::Pose,
        geometry: &urdf_rs::Geometry,
        color_rgba: Option<[f32; 4]>,
        span: &Range<usize>,
    ) -> Result<Element, Finding> {
        let geometry = match geometry {
            urdf_rs::Geometry::Box { size } => {
                if size.iter().any(|edge| *edge <= 0.0) {
                    return Err(self.finding(span, "the edges of a <box> have to be positive"));
                }
                Geometry::Box { size_m: size.0 }
            }
            urdf_rs::Geometry::Cylinder { radius, length } => Geometry::Cylinder {
                radius_m: *radius,
                length_m: *length,
            },
            urdf_rs::Geometry::Sphere { radius } => Geometry::Sphere { radius_m: *radius },
            urdf_rs::Geometry::Mesh { filename, scale } => Geometry::Mesh {
                filename: filename.clone(),
                scale: scale.map_or([1.0; 3], |scale| scale.0),
            },
            urdf_rs::Geometry::Capsule { .. } => {
                return Err(self
                    .finding(span, "<capsule> is no geometry")
                    .hint("box, cylinder, sphere or mesh"));
            }
        };
        Ok(Element {
            name: name.cloned(),
            link_from_geometry: pose_of(origin),
            geometry,
            color_rgba,
            span: span.clone(),
        })
    }

    fn joint(&self, joint: &urdf_rs::Joint, place: &JointPlace) -> Result<UrdfJoint, Finding> {
        let name = &joint.name;
        let axis = Vector3::from(joint.axis.xyz.0);
        let axis = UnitVector3::try_new(axis, 1e-9).ok_or_else(|| {
            let message = format!("the axis of joint '{name}' has no length");
            self.finding(&place.span, message)
        })?;
        let limit = &joint.limit;
        Ok(UrdfJoint {
            name: name.clone(),
            kind: match joint.joint_type {
                JointType::Revolute => JointKind::Revolute,
                JointType::Continuous => JointKind::Continuous,
                JointType::Fixed => JointKind::Fixed,
                _ => JointKind::Other,
            },
            parent: joint.parent.link.clone(),
            child: joint.child.link.clone(),
            parent_from_joint: pose_of(&joint.origin),
            axis,
            limit: place.limit.is_some().then_some(Limit {
                lower: limit.lower,
                upper: limit.upper,
                has_range: place.has_range,
                effort: limit.effort,
                velocity: limit.velocity,
            }),
            span: place.span.clone(),
            origin_span: place.origin.clone(),
            limit_span: place.limit.clone().unwrap_or_else(|| place.span.clone()),
        })
    }
}

fn pose_of(origin: &urdf_rs::Pose) -> Pose {
    let [x, y, z] = origin.xyz.0;
    let [roll, pitch, yaw] = origin.rpy.0;
    Pose::from_parts(
        Translation3::new(x, y, z),
        UnitQuaternion::from_euler_angles(roll, pitch, yaw),
    )
}

/// The colour of a material, or of the robot's material of that name.
fn color_of(
    material: Option<&urdf_rs::Material>,
    materials: &[urdf_rs::Material],
) -> Option<[f32; 4]> {
    let material = material?;
    let shared = || {
        let named = materials.iter().rev();
        let mut colors = named.filter(|each| each.name == material.name);
        colors.find_map(|each| each.color.as_ref())
    };
    let color = material.color.as_ref().or_else(shared)?;
    #[expect(clippy::cast_possible_truncation, reason = "colours need no more")]
    Some(color.rgba.0.map(|value| value as f32))
}
