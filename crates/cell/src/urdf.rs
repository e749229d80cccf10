//! URDF files as trees of links and joints, with the place of everything for error messages.
//!
//! Read from the XML directly: a missing `<inertial>` or `<limit>` has to be told from a zero one,
//! and every complaint names a line.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

use nalgebra::{Matrix3, Translation3, UnitQuaternion, UnitVector3, Vector3};
use needlebench_kinematics::{Body, Pose};
use roxmltree::Node;

use crate::{Finding, nearest_name};

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
}

impl Urdf {
    pub(crate) fn parse(file: &str, bytes: &[u8]) -> Result<Self, Finding> {
        let text = std::str::from_utf8(bytes)
            .map_err(|error| Finding::new(file, format!("not UTF-8 text: {error}")))?;
        let document = roxmltree::Document::parse(text).map_err(|error| {
            let line = error.pos().row as usize;
            let mut finding = Finding::new(file, format!("not well-formed XML: {error}"));
            finding.line = Some(line);
            finding.hint("a URDF is an XML file whose root element is <robot>")
        })?;
        let reader = Reader { file, text };
        let root = document.root_element();
        if root.tag_name().name() != "robot" {
            return Err(reader
                .finding(
                    root,
                    format!("the root element is <{}>", root.tag_name().name()),
                )
                .hint("a URDF's root element is <robot>"));
        }
        if let Some(node) = root.descendants().find(is_xacro) {
            return Err(reader
                .finding(node, "this is a xacro file, not a URDF")
                .hint("expand it first: xacro file.urdf.xacro > file.urdf"));
        }
        let materials = root
            .children()
            .filter(|node| node.has_tag_name("material"))
            .filter_map(|node| {
                Some((
                    node.attribute("name")?.to_owned(),
                    reader.color(node).ok()??,
                ))
            })
            .collect();
        let mut urdf = Self {
            file: file.to_owned(),
            text: text.to_owned(),
            name: root.attribute("name").unwrap_or("robot").to_owned(),
            links: Vec::new(),
            joints: Vec::new(),
            needle_guide: None,
        };
        for node in root.children().filter(Node::is_element) {
            match node.tag_name().name() {
                "link" => urdf.links.push(reader.link(node, &materials)?),
                "joint" => urdf.joints.push(reader.joint(node)?),
                "needle_guide" => urdf.needle_guide = Some(reader.needle_guide(node)?),
                _ => {}
            }
        }
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

    fn check_tree(&self) -> Result<(), Finding> {
        if self.links.is_empty() {
            return Err(Finding::new(&self.file, "it has no <link>"));
        }
        let mut seen = BTreeSet::new();
        for link in &self.links {
            if !seen.insert(link.name.as_str()) {
                return Err(
                    self.finding(&link.span, format!("link '{}' is there twice", link.name))
                );
            }
        }
        let mut parents: BTreeMap<&str, &str> = BTreeMap::new();
        let mut joint_names = BTreeSet::new();
        for joint in &self.joints {
            if !joint_names.insert(joint.name.as_str()) {
                let message = format!("joint '{}' is there twice", joint.name);
                return Err(self
                    .finding(&joint.span, message)
                    .hint("every joint needs a name of its own"));
            }
            for (role, name) in [("parent", &joint.parent), ("child", &joint.child)] {
                if !seen.contains(name.as_str()) {
                    let message = format!(
                        "joint '{}' names the {role} link '{name}', which does not exist",
                        joint.name
                    );
                    let finding = self.finding(&joint.span, message);
                    return Err(match nearest_name(name, seen.iter().copied()) {
                        Some(near) => finding.hint(format!("did you mean '{near}'?")),
                        None => finding,
                    });
                }
            }
            if let Some(other) = parents.insert(&joint.child, &joint.name) {
                return Err(self.finding(
                    &joint.span,
                    format!(
                        "link '{}' is the child of two joints, '{other}' and '{}'",
                        joint.child, joint.name
                    ),
                ));
            }
        }
        // With one parent at most per link, a link that never meets a root is on a cycle.
        for link in &self.links {
            let mut at = link.name.as_str();
            for _ in 0..=self.links.len() {
                match self.joint_above(at) {
                    Some(joint) => at = &joint.parent,
                    None => break,
                }
            }
            if self.joint_above(at).is_some() {
                return Err(self
                    .finding(
                        &link.span,
                        format!("the links form a cycle through link '{}'", link.name),
                    )
                    .key(format!("link '{}'", link.name))
                    .hint("a URDF is a tree: one of the joints has the wrong <parent>"));
            }
        }
        let roots: Vec<&str> = self
            .links
            .iter()
            .filter(|link| self.joint_above(&link.name).is_none())
            .map(|link| link.name.as_str())
            .collect();
        if roots.len() > 1 {
            return Err(Finding::new(
                &self.file,
                format!(
                    "it has {} root links ({}), a URDF has one",
                    roots.len(),
                    roots.join(", ")
                ),
            )
            .hint("join them with a <joint>"));
        }
        Ok(())
    }
}

struct Reader<'a> {
    file: &'a str,
    text: &'a str,
}

impl Reader<'_> {
    fn finding(&self, node: Node<'_, '_>, message: impl Into<String>) -> Finding {
        Finding::new(self.file, message).at(self.text, opening_tag(node))
    }

    fn attribute<'n>(&self, node: Node<'n, '_>, name: &str) -> Result<&'n str, Finding> {
        node.attribute(name).ok_or_else(|| {
            self.finding(
                node,
                format!("<{}> has no `{name}`", node.tag_name().name()),
            )
        })
    }

    fn numbers<const N: usize>(
        &self,
        node: Node<'_, '_>,
        name: &str,
        text: &str,
    ) -> Result<[f64; N], Finding> {
        let bad = |why: String| {
            self.finding(
                node,
                format!("`{name}=\"{text}\"` of <{}> {why}", node.tag_name().name()),
            )
        };
        let mut numbers = [0.0_f64; N];
        let mut words = text.split_whitespace();
        for number in &mut numbers {
            let word = words
                .next()
                .ok_or_else(|| bad(format!("needs {N} numbers")))?;
            *number = word
                .parse()
                .map_err(|_| bad(format!("has '{word}', which is no number")))?;
            if !number.is_finite() {
                return Err(bad(format!("has {word}, which is not finite")));
            }
        }
        if words.next().is_some() {
            return Err(bad(format!("has more than {N} numbers")));
        }
        Ok(numbers)
    }

    fn number(&self, node: Node<'_, '_>, name: &str) -> Result<f64, Finding> {
        let text = self.attribute(node, name)?;
        Ok(self.numbers::<1>(node, name, text)?[0])
    }

    fn positive(&self, node: Node<'_, '_>, name: &str) -> Result<f64, Finding> {
        let value = self.number(node, name)?;
        if value > 0.0 {
            return Ok(value);
        }
        Err(self.finding(
            node,
            format!(
                "`{name}` of <{}> is {value}, but has to be positive",
                node.tag_name().name()
            ),
        ))
    }

    fn origin(&self, node: Node<'_, '_>) -> Result<Pose, Finding> {
        let Some(origin) = child(node, "origin") else {
            return Ok(Pose::identity());
        };
        let read = |name| match origin.attribute(name) {
            Some(text) => self.numbers::<3>(origin, name, text),
            None => Ok([0.0; 3]),
        };
        let ([x, y, z], [roll, pitch, yaw]) = (read("xyz")?, read("rpy")?);
        Ok(Pose::from_parts(
            Translation3::new(x, y, z),
            UnitQuaternion::from_euler_angles(roll, pitch, yaw),
        ))
    }

    fn link(
        &self,
        node: Node<'_, '_>,
        materials: &BTreeMap<String, [f32; 4]>,
    ) -> Result<UrdfLink, Finding> {
        let inertial = child(node, "inertial")
            .map(|inertial| self.inertial(inertial))
            .transpose()?;
        let elements = |tag: &str| {
            node.children()
                .filter(|element| element.has_tag_name(tag))
                .map(|element| self.element(element, materials))
                .collect::<Result<Vec<_>, _>>()
        };
        Ok(UrdfLink {
            name: self.attribute(node, "name")?.to_owned(),
            inertial,
            collisions: elements("collision")?,
            visuals: elements("visual")?,
            span: opening_tag(node),
        })
    }

    fn inertial(&self, node: Node<'_, '_>) -> Result<Body, Finding> {
        let link_from_inertial = self.origin(node)?;
        let mass =
            child(node, "mass").ok_or_else(|| self.finding(node, "<inertial> has no <mass>"))?;
        let mass_kg = self.number(mass, "value")?;
        if mass_kg < 0.0 {
            return Err(self.finding(mass, format!("the mass is {mass_kg} kg")));
        }
        let inertia = child(node, "inertia")
            .ok_or_else(|| self.finding(node, "<inertial> has no <inertia>"))?;
        let read = |name| self.number(inertia, name);
        let (xx, yy, zz) = (read("ixx")?, read("iyy")?, read("izz")?);
        let (xy, xz, yz) = (read("ixy")?, read("ixz")?, read("iyz")?);
        let tensor = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
        let principal = tensor.symmetric_eigenvalues();
        // A rigid body's largest moment is at most the sum of the others; printed digits round.
        if principal.min() < 0.0 || 2.0 * principal.max() > principal.sum() * (1.0 + 1e-6) {
            return Err(self
                .finding(
                    inertia,
                    format!(
                        "no rigid body has the principal moments {:.3e}, {:.3e}, {:.3e} kg m^2",
                        principal[0], principal[1], principal[2]
                    ),
                )
                .hint("moments are positive and none exceeds the sum of the other two"));
        }
        Ok(Body {
            mass_kg,
            com_m: Vector3::zeros(),
            inertia_kgm2: tensor,
        }
        .transformed(&link_from_inertial))
    }

    fn element(
        &self,
        node: Node<'_, '_>,
        materials: &BTreeMap<String, [f32; 4]>,
    ) -> Result<Element, Finding> {
        let geometry =
            child(node, "geometry").ok_or_else(|| self.finding(node, "it has no <geometry>"))?;
        let shape = geometry
            .children()
            .find(Node::is_element)
            .ok_or_else(|| self.finding(geometry, "<geometry> is empty"))?;
        let geometry = match shape.tag_name().name() {
            "box" => {
                let size_m = self.numbers(shape, "size", self.attribute(shape, "size")?)?;
                if size_m.iter().any(|edge| *edge <= 0.0) {
                    return Err(self.finding(shape, "the edges of a <box> have to be positive"));
                }
                Geometry::Box { size_m }
            }
            "cylinder" => Geometry::Cylinder {
                radius_m: self.positive(shape, "radius")?,
                length_m: self.positive(shape, "length")?,
            },
            "sphere" => Geometry::Sphere {
                radius_m: self.positive(shape, "radius")?,
            },
            "mesh" => Geometry::Mesh {
                filename: self.attribute(shape, "filename")?.to_owned(),
                scale: match shape.attribute("scale") {
                    Some(text) => self.numbers(shape, "scale", text)?,
                    None => [1.0; 3],
                },
            },
            other => {
                return Err(self
                    .finding(shape, format!("<{other}> is no geometry"))
                    .hint("box, cylinder, sphere or mesh"));
            }
        };
        let color_rgba = match child(node, "material") {
            Some(material) => self.color(material)?.or_else(|| {
                materials
                    .get(material.attribute("name").unwrap_or_default())
                    .copied()
            }),
            None => None,
        };
        Ok(Element {
            name: node.attribute("name").map(str::to_owned),
            link_from_geometry: self.origin(node)?,
            geometry,
            color_rgba,
            span: opening_tag(shape),
        })
    }

    fn color(&self, material: Node<'_, '_>) -> Result<Option<[f32; 4]>, Finding> {
        let Some(color) = child(material, "color") else {
            return Ok(None);
        };
        let rgba = self.numbers::<4>(color, "rgba", self.attribute(color, "rgba")?)?;
        #[expect(clippy::cast_possible_truncation, reason = "colours need no more")]
        Ok(Some(rgba.map(|value| value as f32)))
    }

    fn joint(&self, node: Node<'_, '_>) -> Result<UrdfJoint, Finding> {
        let name = self.attribute(node, "name")?.to_owned();
        let kind = match self.attribute(node, "type")? {
            "revolute" => JointKind::Revolute,
            "continuous" => JointKind::Continuous,
            "fixed" => JointKind::Fixed,
            "prismatic" | "floating" | "planar" => JointKind::Other,
            other => {
                return Err(self.finding(
                    node,
                    format!("joint '{name}' has the unknown type '{other}'"),
                ));
            }
        };
        let end = |tag: &str| -> Result<String, Finding> {
            let element = child(node, tag)
                .ok_or_else(|| self.finding(node, format!("joint '{name}' has no <{tag}>")))?;
            Ok(self.attribute(element, "link")?.to_owned())
        };
        let axis = match child(node, "axis") {
            Some(axis) => self.numbers::<3>(axis, "xyz", self.attribute(axis, "xyz")?)?,
            None => [1.0, 0.0, 0.0], // URDF's default
        };
        let axis = UnitVector3::try_new(Vector3::from(axis), 1e-9).ok_or_else(|| {
            self.finding(node, format!("the axis of joint '{name}' has no length"))
        })?;
        let limit = match child(node, "limit") {
            None => None,
            Some(limit) => {
                let optional = |attribute: &str, default: f64| match limit.attribute(attribute) {
                    Some(_) => self.number(limit, attribute),
                    None => Ok(default),
                };
                Some(Limit {
                    lower: optional("lower", 0.0)?,
                    upper: optional("upper", 0.0)?,
                    effort: self.number(limit, "effort")?,
                    velocity: self.number(limit, "velocity")?,
                })
            }
        };
        Ok(UrdfJoint {
            kind,
            parent: end("parent")?,
            child: end("child")?,
            parent_from_joint: self.origin(node)?,
            axis,
            limit,
            span: opening_tag(node),
            name,
        })
    }

    fn needle_guide(&self, node: Node<'_, '_>) -> Result<NeedleGuide, Finding> {
        let gauge = self.attribute(node, "needle_gauge")?;
        Ok(NeedleGuide {
            bore_mm: self.positive(node, "bore_mm")?,
            guide_length_mm: self.positive(node, "guide_length_mm")?,
            needle_gauge: gauge.parse().map_err(|_| {
                self.finding(
                    node,
                    format!("`needle_gauge=\"{gauge}\"` is no whole number"),
                )
            })?,
            needle_od_mm: self.positive(node, "needle_od_mm")?,
            needle_length_mm: self.positive(node, "needle_length_mm")?,
        })
    }
}

/// An element of xacro's namespace, or one with an unexpanded attribute. A file that xacro wrote
/// declares the namespace too, and comments may hold anything.
fn is_xacro(node: &Node<'_, '_>) -> bool {
    let namespace = node.tag_name().namespace().unwrap_or_default();
    namespace.ends_with("xacro")
        || node
            .attributes()
            .any(|attribute| attribute.value().contains("${"))
}

fn child<'a, 'd>(node: Node<'a, 'd>, tag: &str) -> Option<Node<'a, 'd>> {
    node.children().find(|child| child.has_tag_name(tag))
}

/// Bytes of an element's opening tag: where a caret should stand.
fn opening_tag(node: Node<'_, '_>) -> Range<usize> {
    let range = node.range();
    let text = &node.document().input_text()[range.clone()];
    let length = text.find('>').map_or(text.len(), |end| end + 1);
    range.start..range.start + length
}
