//! URDF files as trees of links and joints, with the place of everything for error messages.
//!
//! `roxmltree` reads the XML, [`markup`] holds every element and attribute against a vocabulary, [`values`] takes what they
//! say: a missing `<inertial>` or `<limit>` is told from a zero one, what nobody would read does not pass in silence, and
//! every complaint names a line. `package://` is resolved by [`needlebench_input`].

mod markup;
mod nodes;
mod tree;
mod values;
mod vocabulary;

use std::borrow::Cow;
use std::ops::Range;

use nalgebra::{Matrix3, UnitVector3, Vector3};
use needlebench_kinematics::{Body, Pose};

use markup::read_markup;
use needlebench_input::Finding;
use values::{InertialValues, JointValues, LinkValues, MaterialValues, ShapeValues};

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
    /// Lower and upper of its `<safety_controller>`, if it has one that limits positions.
    pub soft: Option<[f64; 2]>,
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

/// Text of an XML file: UTF-8, or ISO-8859-1 where the file declares it.
fn text_of<'a>(file: &str, bytes: &'a [u8]) -> Result<Cow<'a, str>, Finding> {
    /// Where a declaration ends at the latest.
    const LONGEST_DECLARATION: usize = 200;
    let error = match std::str::from_utf8(bytes) {
        Ok(text) => return Ok(text.into()),
        Err(error) => error,
    };
    let head = &bytes[..bytes.len().min(LONGEST_DECLARATION)];
    let head = String::from_utf8_lossy(head).to_ascii_lowercase();
    let declaration = head
        .split_once("?>")
        .map_or("", |(declaration, _)| declaration);
    let latin_1 = ["iso-8859-1", "latin1", "latin-1"];
    if latin_1.iter().any(|name| declaration.contains(name)) {
        // Its bytes are the first code points of Unicode.
        return Ok(bytes.iter().map(|&byte| char::from(byte)).collect());
    }
    let message = format!("not UTF-8 text: {error}");
    Err(Finding::new(file, message).hint(
        "save it as UTF-8, or declare the encoding: <?xml version=\"1.0\" encoding=\"ISO-8859-1\"?>",
    ))
}

impl Urdf {
    pub(crate) fn parse(file: &str, bytes: &[u8]) -> Result<Self, Finding> {
        let text = text_of(file, bytes)?;
        let text = text.as_ref();
        let markup = read_markup(file, text)?;
        let reader = Reader { file, text };
        let urdf = Self {
            file: file.to_owned(),
            text: text.to_owned(),
            name: if markup.name.is_empty() {
                "robot".to_owned()
            } else {
                markup.name
            },
            links: markup
                .links
                .into_iter()
                .map(|link| reader.link(link, &markup.materials))
                .collect::<Result<_, _>>()?,
            joints: markup
                .joints
                .into_iter()
                .map(|joint| reader.joint(joint))
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

/// Checks values that a form alone does not.
struct Reader<'a> {
    file: &'a str,
    text: &'a str,
}

impl Reader<'_> {
    fn finding(&self, span: &Range<usize>, message: impl Into<String>) -> Finding {
        Finding::new(self.file, message).at(self.text, span.clone())
    }

    fn link(&self, link: LinkValues, materials: &[MaterialValues]) -> Result<UrdfLink, Finding> {
        let mass = link.inertial.as_ref();
        Ok(UrdfLink {
            mass_span: mass.map_or_else(|| link.span.clone(), |mass| mass.mass_span.clone()),
            inertial: link
                .inertial
                .as_ref()
                .map(|values| self.inertial(values))
                .transpose()?,
            collisions: link
                .collisions
                .into_iter()
                .map(|each| self.element(each, None))
                .collect::<Result<_, _>>()?,
            visuals: link
                .visuals
                .into_iter()
                .map(|each| {
                    let color = color_of(each.material.as_ref(), materials);
                    self.element(each, color)
                })
                .collect::<Result<_, _>>()?,
            name: link.name,
            span: link.span,
        })
    }

    fn inertial(&self, inertial: &InertialValues) -> Result<Body, Finding> {
        let InertialValues {
            mass_kg,
            moments_kgm2: [xx, xy, xz, yy, yz, zz],
            mass_span: mass,
            moments_span: moments,
            ..
        } = inertial;
        let mass_kg = *mass_kg;
        if mass_kg < 0.0 {
            return Err(self.finding(mass, format!("the mass is {mass_kg} kg")));
        }
        let tensor = Matrix3::new(*xx, *xy, *xz, *xy, *yy, *yz, *xz, *yz, *zz);
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
                        "{mass_kg} kg with a moment of inertia of {:.3e} kg m^2 would lie {gyration_m:.3e} m \
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
        .transformed(&inertial.origin))
    }

    fn element(
        &self,
        shape: ShapeValues,
        color_rgba: Option<[f32; 4]>,
    ) -> Result<Element, Finding> {
        if let Geometry::Box { size_m } = &shape.geometry
            && size_m.iter().any(|edge| *edge <= 0.0)
        {
            return Err(self.finding(&shape.span, "the edges of a <box> must be positive"));
        }
        Ok(Element {
            name: shape.name,
            link_from_geometry: shape.origin,
            geometry: shape.geometry,
            color_rgba,
            span: shape.span,
        })
    }

    fn joint(&self, joint: JointValues) -> Result<UrdfJoint, Finding> {
        let axis = UnitVector3::try_new(Vector3::from(joint.axis), 1e-9);
        // Exporters write `0 0 0` at joints that turn about nothing.
        let axis = match axis {
            None if joint.kind == JointKind::Fixed => Vector3::x_axis(),
            axis => axis.ok_or_else(|| {
                let message = format!("the axis of joint '{}' has no length", joint.name);
                self.finding(&joint.span, message)
            })?,
        };
        Ok(UrdfJoint {
            name: joint.name,
            kind: joint.kind,
            parent: joint.parent,
            child: joint.child,
            parent_from_joint: joint.origin,
            axis,
            limit: joint.limit,
            // Both are 0 where they are left out: it limits speeds alone.
            soft: joint.soft.filter(|range| *range != [0.0, 0.0]),
            limit_span: joint.limit_span.unwrap_or_else(|| joint.span.clone()),
            span: joint.span,
            origin_span: joint.origin_span,
        })
    }
}

/// The colour of a material, or of the robot's material of that name.
fn color_of(material: Option<&MaterialValues>, materials: &[MaterialValues]) -> Option<[f32; 4]> {
    let material = material?;
    let shared = || {
        let named = materials.iter().rev();
        let mut colors = named.filter(|each| each.name == material.name);
        colors.find_map(|each| each.rgba)
    };
    #[expect(clippy::cast_possible_truncation, reason = "colours need no more")]
    let rgba = material.rgba.or_else(shared)?.map(|value| value as f32);
    Some(rgba)
}
