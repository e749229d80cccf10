//! Values of a URDF's elements whose markup has been checked: what has to be there is, and numbers are numbers.

use std::ops::Range;

use nalgebra::{Quaternion, Translation3, UnitQuaternion};
use needlebench_kinematics::Pose;
use roxmltree::Node;

use super::nodes::{child, opening_tag, own_children, tag};
use super::vocabulary::QUATERNION;
use super::{Geometry, JointKind, Limit};

/// A link as it stands in the file. All places are those of opening tags.
#[derive(Debug)]
pub(super) struct LinkValues {
    pub name: String,
    pub span: Range<usize>,
    pub inertial: Option<InertialValues>,
    pub collisions: Vec<ShapeValues>,
    pub visuals: Vec<ShapeValues>,
}

/// An `<inertial>` with a mass.
#[derive(Debug)]
pub(super) struct InertialValues {
    pub origin: Pose,
    pub mass_kg: f64,
    /// xx, xy, xz, yy, yz, zz; zeros where none are given.
    pub moments_kgm2: [f64; 6],
    pub mass_span: Range<usize>,
    /// Of the moments, or of the mass if there are none.
    pub moments_span: Range<usize>,
}

/// A `<collision>` or a `<visual>`.
#[derive(Debug)]
pub(super) struct ShapeValues {
    pub name: Option<String>,
    pub origin: Pose,
    pub geometry: Geometry,
    pub material: Option<MaterialValues>,
    /// Of the shape.
    pub span: Range<usize>,
}

/// A `<material>`.
#[derive(Debug)]
pub(super) struct MaterialValues {
    pub name: String,
    pub rgba: Option<[f64; 4]>,
}

/// A joint as it stands in the file.
#[derive(Debug)]
pub(super) struct JointValues {
    pub name: String,
    pub kind: JointKind,
    pub parent: String,
    pub child: String,
    pub origin: Pose,
    pub axis: [f64; 3],
    pub limit: Option<Limit>,
    /// Lower and upper of its `<safety_controller>`; 0 where they are left out.
    pub soft: Option<[f64; 2]>,
    pub span: Range<usize>,
    /// Of its `<origin>`; the joint's own if it has none.
    pub origin_span: Range<usize>,
    /// Of its `<limit>`, if it has one.
    pub limit_span: Option<Range<usize>>,
}

impl LinkValues {
    pub fn of(node: Node<'_, '_>) -> Self {
        let shapes = |each: &str| {
            let own = own_children(node).filter(|inner| tag(*inner) == each);
            own.filter_map(shape).collect()
        };
        Self {
            name: text(node, "name"),
            span: opening_tag(node),
            inertial: child(node, "inertial").and_then(inertial),
            collisions: shapes("collision"),
            visuals: shapes("visual"),
        }
    }
}

impl JointValues {
    pub fn of(node: Node<'_, '_>) -> Self {
        let link = |tag: &str| child(node, tag).map_or_else(String::new, |it| text(it, "link"));
        let limit = child(node, "limit");
        let safety = child(node, "safety_controller");
        Self {
            name: text(node, "name"),
            kind: match node.attribute("type") {
                Some("revolute") => JointKind::Revolute,
                Some("continuous") => JointKind::Continuous,
                Some("fixed") => JointKind::Fixed,
                _ => JointKind::Other,
            },
            parent: link("parent"),
            child: link("child"),
            origin: origin(node),
            axis: child(node, "axis")
                .and_then(|axis| numbers(axis, "xyz"))
                .unwrap_or([1.0, 0.0, 0.0]),
            limit: limit.map(|limit| Limit {
                lower: number(limit, "lower"),
                upper: number(limit, "upper"),
                has_range: ["lower", "upper"].map(|name| limit.has_attribute(name)),
                effort: number(limit, "effort"),
                velocity: number(limit, "velocity"),
            }),
            soft: safety.map(|safety| {
                ["soft_lower_limit", "soft_upper_limit"].map(|name| number(safety, name))
            }),
            span: opening_tag(node),
            origin_span: opening_tag(child(node, "origin").unwrap_or(node)),
            limit_span: limit.map(opening_tag),
        }
    }
}

impl MaterialValues {
    pub fn of(node: Node<'_, '_>) -> Self {
        Self {
            name: text(node, "name"),
            rgba: child(node, "color").and_then(|color| numbers(color, "rgba")),
        }
    }
}

/// Moments without a mass are ignored.
fn inertial(node: Node<'_, '_>) -> Option<InertialValues> {
    let mass = child(node, "mass")?;
    let moments = child(node, "inertia");
    Some(InertialValues {
        origin: origin(node),
        mass_kg: number(mass, "value"),
        moments_kgm2: ["ixx", "ixy", "ixz", "iyy", "iyz", "izz"]
            .map(|name| moments.map_or(0.0, |moments| number(moments, name))),
        mass_span: opening_tag(mass),
        moments_span: opening_tag(moments.unwrap_or(mass)),
    })
}

fn shape(node: Node<'_, '_>) -> Option<ShapeValues> {
    let shape = own_children(child(node, "geometry")?).next()?;
    let geometry = match tag(shape) {
        "box" => Geometry::Box {
            size_m: numbers(shape, "size")?,
        },
        "cylinder" => Geometry::Cylinder {
            radius_m: number(shape, "radius"),
            length_m: number(shape, "length"),
        },
        "sphere" => Geometry::Sphere {
            radius_m: number(shape, "radius"),
        },
        "mesh" => Geometry::Mesh {
            filename: text(shape, "filename"),
            scale: numbers(shape, "scale").unwrap_or([1.0; 3]),
        },
        _ => return None,
    };
    Some(ShapeValues {
        name: node.attribute("name").map(str::to_owned),
        origin: origin(node),
        geometry,
        material: child(node, "material").map(MaterialValues::of),
        span: opening_tag(shape),
    })
}

/// The pose of an element's `<origin>`: about fixed axes, or by a quaternion from version 1.1 on.
fn origin(node: Node<'_, '_>) -> Pose {
    let Some(origin) = child(node, "origin") else {
        return Pose::identity();
    };
    let [x, y, z] = numbers(origin, "xyz").unwrap_or_default();
    let turn = if let Some([i, j, k, w]) = numbers(origin, QUATERNION) {
        UnitQuaternion::from_quaternion(Quaternion::new(w, i, j, k))
    } else {
        let [roll, pitch, yaw] = numbers(origin, "rpy").unwrap_or_default();
        UnitQuaternion::from_euler_angles(roll, pitch, yaw)
    };
    Pose::from_parts(Translation3::new(x, y, z), turn)
}

fn text(node: Node<'_, '_>, name: &str) -> String {
    node.attribute(name).unwrap_or_default().to_owned()
}

/// 0 where the attribute is left out.
fn number(node: Node<'_, '_>, name: &str) -> f64 {
    numbers::<1>(node, name).map_or(0.0, |[number]| number)
}

fn numbers<const N: usize>(node: Node<'_, '_>, name: &str) -> Option<[f64; N]> {
    let words = node.attribute(name)?.split_whitespace();
    let numbers: Option<Vec<f64>> = words.map(|word| word.parse().ok()).collect();
    numbers?.try_into().ok()
}
