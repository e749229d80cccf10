//! What may stand in a URDF: elements, their attributes, and what is read of them.
//!
//! Readers of URDFs pass over what they do not know, so that `<orign>` or `<origin xy="1 2 3">` would be an
//! origin at zero. Everything that is not in here is refused, or said in a note where it may belong to
//! another program.

use std::f64::consts::PI;

/// How an attribute's value is written.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Form {
    /// Any text.
    Text,
    /// A finite number.
    Number,
    /// So many finite numbers.
    Numbers(usize),
    /// So many numbers that a robot can have.
    Plausible(usize, &'static Plausible),
}

/// What numbers of one kind can be in a robot or a tool: limits far outside what any arm has, and far
/// inside what a slip of the unit makes.
#[derive(Debug, PartialEq)]
pub(super) struct Plausible {
    pub least: f64,
    pub most: f64,
    pub unit: &'static str,
    /// The likeliest slip.
    pub hint: &'static str,
}

/// Places of frames. The largest arm reaches 1.75 m; a link above `base_link` may place it in a room.
static PLACE: Plausible = Plausible {
    least: -10.0,
    most: 10.0,
    unit: "m",
    hint: METRES,
};

/// Angles of frames: two turns.
static ANGLE: Plausible = Plausible {
    least: -4.0 * PI,
    most: 4.0 * PI,
    unit: "rad",
    hint: RADIANS,
};

/// Sizes of shapes: from a hundredth of a millimetre to longer than any arm.
static SIZE: Plausible = Plausible {
    least: 1e-5,
    most: 3.0,
    unit: "m",
    hint: METRES,
};

/// Masses of links. A UR20 weighs 64 kg as a whole; a pedestal may belong to the base.
static MASS_KG: Plausible = Plausible {
    least: 0.0,
    most: 1000.0,
    unit: "kg",
    hint: "masses of a URDF are in kilograms: did you give grams?",
};

/// Moments of inertia: those of the heaviest such link, a metre across.
static MOMENT: Plausible = Plausible {
    least: -1000.0,
    most: 1000.0,
    unit: "kg m^2",
    hint: "moments of inertia of a URDF are in kg m^2: did you give kg mm^2 or g mm^2?",
};

/// Limits of joints: UR arms turn once each way, other arms not more than twice.
static LIMIT_RAD: Plausible = Plausible {
    least: -4.0 * PI,
    most: 4.0 * PI,
    unit: "rad",
    hint: RADIANS,
};

/// Scales of meshes: from micrometres to kilometres; below 0 a mesh is mirrored.
static SCALE: Plausible = Plausible {
    least: -1e3,
    most: 1e3,
    unit: "",
    hint: "0.001 is the scale of a mesh in millimetres",
};

/// Lengths of a needle and its guide.
static NEEDLE_MM: Plausible = Plausible {
    least: 0.1,
    most: 1000.0,
    unit: "mm",
    hint: "lengths of <needle_guide> are in millimetres: did you give metres?",
};

/// Diameters of a needle and its bore: a needle of 34 gauge has 0.18 mm.
static DIAMETER_MM: Plausible = Plausible {
    least: 0.1,
    most: 20.0,
    unit: "mm",
    hint: "diameters of <needle_guide> are in millimetres",
};

const METRES: &str = "lengths of a URDF are in metres: did you give millimetres?";
const RADIANS: &str = "angles of a URDF are in radians: did you give degrees?";

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
        child("safety_controller", Count::Optional, &SAFETY),
    ],
    passed_over: &["calibration", "dynamics", "gazebo", "mimic"],
    open: true,
};

static SAFETY: Kind = leaf(&[
    optional("soft_lower_limit", Form::Plausible(1, &LIMIT_RAD)),
    optional("soft_upper_limit", Form::Plausible(1, &LIMIT_RAD)),
    optional("k_position", Form::Number),
    required("k_velocity", Form::Number),
]);

static ORIGIN: Kind = leaf(&[
    optional("xyz", Form::Plausible(3, &PLACE)),
    optional("rpy", Form::Plausible(3, &ANGLE)),
    optional(QUATERNION, Form::Numbers(4)),
]);

static LINK_NAME: Kind = leaf(&[required("link", Form::Text)]);

static AXIS: Kind = leaf(&[required("xyz", Form::Numbers(3))]);

static LIMIT: Kind = leaf(&[
    optional("lower", Form::Plausible(1, &LIMIT_RAD)),
    optional("upper", Form::Plausible(1, &LIMIT_RAD)),
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
        child("mass", Count::Optional, &MASS),
        child("inertia", Count::Optional, &INERTIA),
    ],
    passed_over: &[],
    open: false,
};

static MASS: Kind = leaf(&[required("value", Form::Plausible(1, &MASS_KG))]);

static INERTIA: Kind = leaf(&[
    required("ixx", Form::Plausible(1, &MOMENT)),
    required("ixy", Form::Plausible(1, &MOMENT)),
    required("ixz", Form::Plausible(1, &MOMENT)),
    required("iyy", Form::Plausible(1, &MOMENT)),
    required("iyz", Form::Plausible(1, &MOMENT)),
    required("izz", Form::Plausible(1, &MOMENT)),
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

static BOX: Kind = leaf(&[required("size", Form::Plausible(3, &SIZE))]);

static CYLINDER: Kind = leaf(&[
    required("radius", Form::Plausible(1, &SIZE)),
    required("length", Form::Plausible(1, &SIZE)),
]);

static SPHERE: Kind = leaf(&[required("radius", Form::Plausible(1, &SIZE))]);

static MESH: Kind = leaf(&[
    required("filename", Form::Text),
    optional("scale", Form::Plausible(3, &SCALE)),
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
    required("bore_mm", Form::Plausible(1, &DIAMETER_MM)),
    required("guide_length_mm", Form::Plausible(1, &NEEDLE_MM)),
    required("needle_gauge", Form::Text),
    required("needle_od_mm", Form::Plausible(1, &DIAMETER_MM)),
    required("needle_length_mm", Form::Plausible(1, &NEEDLE_MM)),
]);

/// Attribute of an `<origin>` that counts from version 1.1 of the format on.
pub(super) const QUATERNION: &str = "quat_xyzw";
