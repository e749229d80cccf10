//! `visualization_msgs/msg/MarkerArray`.

use serde::{Serialize, Serializer};

use super::{Header, Message, Pose, QUATERNION, TIME, VECTOR3, with_types};

/// Red, green, blue and opacity, 0 to 1.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Colour(pub [f32; 4]);

/// What a marker shows.
#[derive(Debug, Clone, PartialEq)]
pub enum MarkerShape {
    /// Box with these edges, m.
    Cube([f64; 3]),
    /// Ellipsoid with these diameters, m.
    Sphere([f64; 3]),
    /// Cylinder along z with these diameters and this length, m.
    Cylinder([f64; 3]),
    /// Triangles, three points each, m.
    Triangles(Vec<[f64; 3]>),
    /// Words of this height, m, that face who looks.
    Text(String, f64),
}

impl MarkerShape {
    /// The constant of the message's `type`.
    fn constant(&self) -> i32 {
        match self {
            Self::Cube(_) => 1,
            Self::Sphere(_) => 2,
            Self::Cylinder(_) => 3,
            Self::Text(..) => 9,
            Self::Triangles(_) => 11,
        }
    }

    fn scale(&self) -> [f64; 3] {
        match self {
            Self::Cube(size) | Self::Sphere(size) | Self::Cylinder(size) => *size,
            Self::Triangles(_) => [1.0; 3],
            Self::Text(_, height) => [0.0, 0.0, *height],
        }
    }
}

/// The constant of the message's `action`.
const ADD: i32 = 0;

/// `visualization_msgs/msg/Marker`: added, for ever.
#[derive(Debug, Clone, PartialEq)]
pub struct Marker {
    /// When, and the frame that it is fixed to.
    pub header: Header,
    /// Namespace; with `id` unique.
    pub ns: String,
    /// Number within the namespace.
    pub id: i32,
    /// Its pose in the frame.
    pub pose: Pose,
    /// What it is.
    pub shape: MarkerShape,
    /// Its colour.
    pub colour: Colour,
}

/// `visualization_msgs/msg/MarkerArray`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MarkerArray(pub Vec<Marker>);

const MARKER: &str = "\
int32 ARROW=0
int32 CUBE=1
int32 SPHERE=2
int32 CYLINDER=3
int32 LINE_STRIP=4
int32 LINE_LIST=5
int32 CUBE_LIST=6
int32 SPHERE_LIST=7
int32 POINTS=8
int32 TEXT_VIEW_FACING=9
int32 MESH_RESOURCE=10
int32 TRIANGLE_LIST=11
int32 ADD=0
int32 MODIFY=0
int32 DELETE=2
int32 DELETEALL=3
std_msgs/Header header
string ns
int32 id
int32 type
int32 action
geometry_msgs/Pose pose
geometry_msgs/Vector3 scale
std_msgs/ColorRGBA color
builtin_interfaces/Duration lifetime
bool frame_locked
geometry_msgs/Point[] points
std_msgs/ColorRGBA[] colors
string texture_resource
sensor_msgs/CompressedImage texture
visualization_msgs/UVCoordinate[] uv_coordinates
string text
string mesh_resource
visualization_msgs/MeshFile mesh_file
bool mesh_use_embedded_materials
";

impl Message for MarkerArray {
    const TYPE: &'static str = "visualization_msgs/msg/MarkerArray";

    fn definition() -> String {
        with_types(
            "visualization_msgs/Marker[] markers\n",
            &[
                ("visualization_msgs/Marker", MARKER),
                super::HEADER,
                TIME,
                (
                    "geometry_msgs/Pose",
                    "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n",
                ),
                ("geometry_msgs/Point", "float64 x\nfloat64 y\nfloat64 z\n"),
                QUATERNION,
                VECTOR3,
                (
                    "std_msgs/ColorRGBA",
                    "float32 r\nfloat32 g\nfloat32 b\nfloat32 a\n",
                ),
                ("builtin_interfaces/Duration", "int32 sec\nuint32 nanosec\n"),
                (
                    "sensor_msgs/CompressedImage",
                    "std_msgs/Header header\nstring format\nuint8[] data\n",
                ),
                ("visualization_msgs/UVCoordinate", "float32 u\nfloat32 v\n"),
                (
                    "visualization_msgs/MeshFile",
                    "string filename\nuint8[] data\n",
                ),
            ],
        )
    }
}

impl Serialize for Marker {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let (points, text) = match &self.shape {
            MarkerShape::Triangles(points) => (points.as_slice(), ""),
            MarkerShape::Text(text, _) => (&[][..], text.as_str()),
            _ => (&[][..], ""),
        };
        let nothing: &[u8] = &[];
        (
            (&self.header, &self.ns, self.id),
            (self.shape.constant(), ADD),
            (self.pose, self.shape.scale(), self.colour),
            // For ever, and it moves with its frame.
            ((0_i32, 0_u32), true),
            // One colour for all.
            (points, nothing),
            // No texture.
            ("", (Header::default(), "", nothing), nothing),
            text,
            // No mesh of a file.
            ("", ("", nothing), false),
        )
            .serialize(serializer)
    }
}
