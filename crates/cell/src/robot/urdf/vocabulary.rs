//! What may stand in a URDF: elements, their attributes, and what is read of them.
//!
//! `urdf-rs` passes over what it does not know, so that `<orign>` or `<origin xy="1 2 3">` would be an
//! origin at zero. Everything that is not in here is refused, or said in a note where it may belong to
//! another program.

/// How an attribute's value is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Form {
    /// Any text.
    Text,
    /// A finite number.
    Number,
    /// A finite number above 0.
    Positive,
    /// So many finite numbers.
    Numbers(usize),
}

/// An attribute of an element.
#[derive(Debug)]
pub(super) struct Attribute {
    pub name: &'static str,
    pub form: Form,
    pub required: bool,
}

/// How often an element may stand in another.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Count {
    /// Exactly once.
    One,
    /// At most once.
    Optional,
    /// Any number of times.
    Many,
}

/// An element inside another.
#[derive(Debug)]
pub(super) struct Child {
    pub tag: &'static str,
    pub count: Count,
    pub kind: &'static Kind,
}

/// What an element may hold.
#[derive(Debug)]
pub(super) struct Kind {
    pub attributes: &'static [Attribute],
    pub children: &'static [Child],
    /// Elements that other programs read, or that do not matter here.
    pub passed_over: &'static [&'static str],
    /// Whether other programs put elements and attributes of their own here: what is like none that is
    /// known is noted, not refused.
    pub open: bool,
}

const fn required(name: &'static str, form: Form) -> Attribute {
    Attribute {
        name,
        form,
        required: true,
    }
}

const fn optional(name: &'static str, form: Form) -> Attribute {
    Attribute {
        name,
        form,
        required: false,
    }
}

const fn child(tag: &'static str, count: Count, kind: &'static Kind) -> Child {
    Child { tag, count, kind }
}

/// An element with attributes alone.
const fn leaf(attributes: &'static [Attribute]) -> Kind {
    Kind {
        attributes,
        children: &[],
        passed_over: &[],
        open: false,
    }
}

/// `<robot>`.
pub(super) static ROBOT: Kind = Kind {
    attributes: &[
        optional("name", Form::Text),
        optional("version", Form::Text),
    ],
    children: &[
        child("link", Count::Many, &LINK),
        child("joint", Count::Many, &JOINT),
        child("material", Count::Many, &MATERIAL),
        child(NEEDLE_GUIDE_TAG, Count::Optional, &NEEDLE_GUIDE),
    ],
    passed_over: &["gazebo", "ros2_control", "sensor", "transmission"],
    open: true,
};

static LINK: Kind = Kind {
    attributes: &[required("name", Form::Text), optional("type", Form::Text)],
    children: &[
        child("inertial", Count::Optional, &INERTIAL),
        child("collision", Count::Many, &COLLISION),
        child("visual", Count::Many, &VISUAL),
    ],
    passed_over: &["gazebo", "self_collision_checking", "sensor"],
    open: true,
};

static JOINT: Kind = Kind {
    attributes: &[required("name", Form::Text), required("type", Form::Text)],
    children: &[
        child("origin", Count::Optional, &ORIGIN),
        child("parent", Count::One, &LINK_NAME),
        child("child", Count::One, &LINK_NAME),
        child("axis", Count::Optional, &AXIS),
        child("limit", Count::Optional, &LIMIT),
    ],
    passed_over: &[
        "calibration",
        "dynamics",
        "gazebo",
        "mimic",
        "safety_controller",
    ],
    open: true,
};

static ORIGIN: Kind = leaf(&[
    optional("xyz", Form::Numbers(3)),
    optional("rpy", Form::Numbers(3)),
    optional(QUATERNION, Form::Numbers(4)),
]);

static LINK_NAME: Kind = leaf(&[required("link", Form::Text)]);

static AXIS: Kind = leaf(&[required("xyz", Form::Numbers(3))]);

static LIMIT: Kind = leaf(&[
    optional("lower", Form::Number),
    optional("upper", Form::Number),
    required("effort", Form::Number),
    required("velocity", Form::Number),
    optional("acceleration", Form::Number),
    optional("deceleration", Form::Number),
    optional("jerk", Form::Number),
]);

static INERTIAL: Kind = Kind {
    attributes: &[],
    children: &[
        child("origin", Count::Optional, &ORIGIN),
        child("mass", Count::One, &MASS),
        child("inertia", Count::One, &INERTIA),
    ],
    passed_over: &[],
    open: false,
};

static MASS: Kind = leaf(&[required("value", Form::Number)]);

static INERTIA: Kind = leaf(&[
    required("ixx", Form::Number),
    required("ixy", Form::Number),
    required("ixz", Form::Number),
    required("iyy", Form::Number),
    required("iyz", Form::Number),
    required("izz", Form::Number),
]);

static COLLISION: Kind = Kind {
    attributes: &[optional("name", Form::Text)],
    children: &[
        child("origin", Count::Optional, &ORIGIN),
        child("geometry", Count::One, &GEOMETRY),
    ],
    passed_over: &["contact_coefficients", "material", "surface", "verbose"],
    open: true,
};

static VISUAL: Kind = Kind {
    attributes: &[optional("name", Form::Text)],
    children: &[
        child("origin", Count::Optional, &ORIGIN),
        child("geometry", Count::One, &GEOMETRY),
        child("material", Count::Optional, &MATERIAL),
    ],
    passed_over: &["meta", "transparency"],
    open: true,
};

/// `<geometry>`: one shape, which is checked besides.
static GEOMETRY: Kind = Kind {
    attributes: &[],
    children: &[
        child("box", Count::Optional, &BOX),
        child("cylinder", Count::Optional, &CYLINDER),
        child("sphere", Count::Optional, &SPHERE),
        child("mesh", Count::Optional, &MESH),
    ],
    passed_over: &[],
    open: false,
};

static BOX: Kind = leaf(&[required("size", Form::Numbers(3))]);

static CYLINDER: Kind = leaf(&[
    required("radius", Form::Positive),
    required("length", Form::Positive),
]);

static SPHERE: Kind = leaf(&[required("radius", Form::Positive)]);

static MESH: Kind = leaf(&[
    required("filename", Form::Text),
    optional("scale", Form::Numbers(3)),
]);

static MATERIAL: Kind = Kind {
    attributes: &[optional("name", Form::Text)],
    children: &[child("color", Count::Optional, &COLOR)],
    passed_over: &["texture"],
    open: true,
};

static COLOR: Kind = leaf(&[required("rgba", Form::Numbers(4))]);

/// needlebench's extension of a tool's URDF.
pub(super) const NEEDLE_GUIDE_TAG: &str = "needle_guide";

static NEEDLE_GUIDE: Kind = leaf(&[
    required("bore_mm", Form::Positive),
    required("guide_length_mm", Form::Positive),
    required("needle_gauge", Form::Text),
    required("needle_od_mm", Form::Positive),
    required("needle_length_mm", Form::Positive),
]);

/// Attribute of an `<origin>` that counts from version 1.1 of the format on.
pub(super) const QUATERNION: &str = "quat_xyzw";
